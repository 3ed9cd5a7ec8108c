"""Small records of every kind, made by hand from one slow model, for tests of pages and figures."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from hrg_cli import store
from hrg_cli.records import (
    Calibration,
    Compensated,
    Diagnosis,
    Periods,
    Provenance,
    Recording,
    Resonator,
    Source,
    Wave,
)

RATE_HZ, FREQUENCY_HZ = 5000.0, 431.0


def course(time_s):
    """a_A, a_B, θ, φ of a slowly turning, decaying wave."""
    theta = 0.3 + 0.05 * time_s + 0.01 * np.sin(4 * (0.3 + 0.05 * time_s))
    return np.exp(-0.08 * time_s), 0.02 * np.sin(0.4 * time_s), theta, 0.6 * time_s


def recording(seconds=8.0, run="run-1", truth=True) -> Recording:
    rng = np.random.default_rng(5)
    time = np.arange(int(seconds * RATE_HZ)) / RATE_HZ
    a, b, theta, phi = course(time)
    turn = np.exp(1j * (2 * np.pi * FREQUENCY_HZ * time + phi))
    c = ((a * np.cos(2 * theta) + 1j * b * np.sin(2 * theta)) * turn).real
    s = ((a * np.sin(2 * theta) - 1j * b * np.cos(2 * theta)) * turn).real
    noise = 1e-3 * rng.standard_normal((2, len(time))) + 2e-3 * np.sin(2 * np.pi * 50 * time)
    log = np.linspace(0, seconds, 50)
    known = np.linspace(0, seconds, 200)
    true = dict(
        zip(
            (
                "truth_main_amplitude",
                "truth_quadrature_amplitude",
                "truth_wave_angle_rad",
                "truth_phase_rad",
            ),
            course(known),
        )
    )
    return Recording(
        c=np.round((c + noise[0]) * 20000).astype("i2"),
        s=np.round((s + noise[1]) * 20000).astype("i2"),
        c_scale_factor=1 / 20000,
        s_scale_factor=1 / 20000,
        c_units="V",
        s_units="V",
        sample_rate_hz=RATE_HZ,
        mode="free",
        gyro_id="G-17",
        run_id=run,
        auxiliary_time_s=log,
        temperature_degc=20 + 0.3 * log,
        rate_rad_s=0.02 * np.sin(log),
        **(
            dict(truth_time_s=known, truth_settings="[resonator]\nfrequency_hz = 431.0\n", **true)
            if truth
            else {}
        ),
    )


def _series(count=1500, seconds=8.0):
    time = (np.arange(count) + 0.5) * seconds / count
    return (time, *course(time))


def periods() -> Periods:
    rng = np.random.default_rng(6)
    time, a, b, theta, phi = _series()
    c0 = np.exp(1j * phi) * (a * np.cos(2 * theta) + 1j * b * np.sin(2 * theta))
    s0 = np.exp(1j * phi) * (a * np.sin(2 * theta) - 1j * b * np.cos(2 * theta))
    signals = np.stack([c0.real, -c0.imag, s0.real, -s0.imag], 1)
    frequency = np.linspace(0, RATE_HZ / 2, 600)
    density = 1e-9 * (1 + rng.random((600, 2)))
    density[12] = 1e-5
    flags = np.zeros(len(time), "u1")
    flags[100:103] = 1
    return Periods(
        time_s=time,
        signals=signals,
        signals_std=np.full_like(signals, 1e-4),
        residual_rms=1e-3 * (1 + 0.1 * rng.random((len(time), 2))),
        flags=flags,
        reference_frequency_hz=FREQUENCY_HZ,
        periods_per_window=2.3,
        window_s=8.0 / 1500,
        mode="free",
        units="V",
        gyro_id="G-17",
        run_id="run-1",
        spectrum_frequency_hz=frequency,
        spectrum_density=density,
        spectrum_line_frequency_hz=np.array([50.0]),
        spectrum_line_amplitude=np.array([[2e-3, 2e-3]]),
        spectrum_line_ratio=np.array([1e4]),
    )


def wave(run="run-1", count=1500) -> Wave:
    rng = np.random.default_rng(7)
    time, a, b, theta, phi = _series(count)
    one = np.ones(count)
    noise = 1e-5 * rng.standard_normal((4, count))
    return Wave(
        time_s=time,
        main_amplitude=a + noise[0],
        quadrature_amplitude=b + noise[1],
        wave_angle_rad=theta + noise[2],
        phase_rad=phi + noise[3],
        carrier_phase_rad=0 * one,
        main_amplitude_std=1e-5 * one,
        quadrature_amplitude_std=1e-5 * one,
        wave_angle_rad_std=1e-5 * one,
        phase_rad_std=1e-5 * one,
        carrier_phase_rad_std=0 * one,
        residual_rms=0 * one,
        signal_std=1e-5 * one,
        iterations=np.zeros(count, "i2"),
        flags=np.zeros(count, "u1"),
        temperature_degc=20 + 0.3 * time,
        rate_rad_s=0.02 * np.sin(time),
        frequency_hz=(FREQUENCY_HZ + 0.6 / 2 / np.pi) * one,
        reference_frequency_hz=FREQUENCY_HZ,
        window_s=8.0 / count,
        mode="free",
        units="V",
        gyro_id="G-17",
        run_id=run,
    )


def resonator() -> Resonator:
    names = [
        "frequency_hz",
        "damping_rate_1_s",
        "damping_split_1_s",
        "damping_axis_rad",
        "frequency_split_rad_s",
        "stiffness_axis_rad",
        "scale_factor",
    ]
    values = np.array([431.09, 0.08, 8e-4, 0.35, 3e-3, 0.7, 0.277])
    std = np.array([1e-6, 1e-5, 1e-5, 5e-3, 2e-5, 4e-3, 3e-6])
    correlation = np.eye(7)
    correlation[2, 6] = correlation[6, 2] = -0.72
    correlation[3, 5] = correlation[5, 3] = 0.4
    return Resonator(
        name=np.array(names, object),
        value=values,
        std=std,
        units=np.array(["Hz", "1/s", "1/s", "rad", "rad/s", "rad", "1"], object),
        covariance=correlation * np.outer(std, std),
        gyro_id="G-17",
        chi2_per_dof=1.02,
        condition=240.0,
        flat_directions=json.dumps(["scale factor and table rate cannot be told apart"]),
        details=json.dumps(
            {
                "methods": {
                    "likelihood": {"damping_rate_1_s": 0.08, "chi2_per_dof": 1.02},
                    "propagator": {"damping_rate_1_s": 0.0801, "chi2_per_dof": 1.4},
                }
            }
        ),
        run=np.array(["run-1", "run-2", "run-3"], object),
        run_chi2_per_dof=np.array([0.98, 1.05, 1.31]),
        run_residual_rms=np.array([1e-4, 1e-4, 1.2e-4]),
        run_rows=np.array([1500, 1500, 1490]),
    )


def calibration(nodes=5) -> Calibration:
    temperature = np.linspace(-20, 60, nodes)
    angle = np.linspace(0, np.pi / 2, 73)
    unit = np.pi / 180 / 3600
    drift = np.stack(
        [
            np.stack(
                [
                    3 * unit + 0 * temperature,
                    (5 + 0.05 * temperature) * unit,
                    (-2 + 0.03 * temperature) * unit,
                    0.4 * unit + 0 * temperature,
                    0.1 * unit + 0 * temperature,
                ],
                1,
            )
        ]
    )[0]
    scale = np.stack(
        [
            0.277 * (1 + 1e-6 * temperature),
            3e-5 + 0 * temperature,
            -2e-5 + 0 * temperature,
            2e-6 + 0 * temperature,
            1e-6 + 0 * temperature,
        ],
        1,
    )
    basis = np.stack(
        [
            np.ones_like(angle),
            np.cos(4 * angle),
            np.sin(4 * angle),
            np.cos(8 * angle),
            np.sin(8 * angle),
        ]
    )
    ladder = [
        ("nothing", 6.1, 310.0),
        ("constant drift", 5.2, 310.0),
        ("harmonics", 0.6, 42.0),
        ("harmonics and temperature", 0.21, 11.0),
    ]
    return Calibration(
        temperature_degc=temperature,
        wave_angle_rad=angle,
        drift_rad_s=drift @ basis,
        drift_rad_s_std=np.full((nodes, 73), 0.15 * unit),
        scale_factor=scale @ basis,
        scale_factor_std=np.full((nodes, 73), 2e-6),
        drift_harmonics=drift,
        drift_harmonics_std=np.full((nodes, 5), 0.1 * unit),
        scale_factor_harmonics=scale,
        scale_factor_harmonics_std=np.full((nodes, 5), 1.5e-6),
        covariance=np.eye(10 * nodes) * 1e-14,
        node_min=-20.0,
        node_max=60.0,
        rate_min_rad_s=-0.5,
        rate_max_rad_s=0.5,
        gyro_id="G-17",
        details=json.dumps(
            {
                "drift_rms_rad_s": {
                    "before": 6.1 * unit,
                    "after": 0.21 * unit,
                    "held_out": 0.24 * unit,
                },
                "scale_factor_rms_ppm": {"before": 310.0, "after": 11.0, "held_out": 12.4},
                "ladder": [
                    {"stage": s, "drift_rms_rad_s": d * unit, "scale_factor_rms_ppm": k}
                    for s, d, k in ladder
                ],
            }
        ),
    )


def compensated() -> Compensated:
    rng = np.random.default_rng(8)
    time = np.arange(4000) * 0.5
    before = 3e-5 * np.sin(time / 60) + 1e-5 * rng.standard_normal(4000)
    after = 1e-5 * rng.standard_normal(4000)
    rate = 0.1 * np.sin(time / 300)
    return Compensated(
        time_s=time,
        rate_estimate_rad_s=rate + after,
        angle_estimate_rad=np.cumsum(rate) * 0.5,
        residual_before_rad_s=before,
        residual_after_rad_s=after,
        gyro_id="G-17",
        run_id="run-1",
    )


def forecast() -> dict[str, object]:
    """The last part of a run predicted: an angle that drifts away under the base model."""
    time = np.linspace(42, 60, 40)
    names = ("angle_deg", "amplitude_percent", "quadrature_percent")
    course = {
        "run": "run-1",
        "time_s": time.tolist(),
        "before": {
            name: (size * (time - 42)).tolist() for name, size in zip(names, (0.02, 0.05, -0.01))
        },
        "after": {
            name: (size * np.sin(time)).tolist() for name, size in zip(names, (0.01, 0.05, 0.02))
        },
        "after_std": {
            name: (size * (time - 41)).tolist() for name, size in zip(names, (0.001, 0.004, 0.002))
        },
    }
    rms = [dict(zip(names, v)) for v in ((0.2, 0.5, 0.1), (0.01, 0.05, 0.02))]
    return {
        "held_out": "time",
        "train_fraction": 0.7,
        "before": 4.2e-3,
        "after": 4.7e-4,
        "ratio": 9.0,
        "low": 8.0,
        "high": 10.1,
        "std": 0.5,
        "unit": "V",
        "parts": {"before": rms[0], "after": rms[1]},
        "course": [course],
        "sentence": "last 30 % of the run from the first: 9 times smaller",
    }


def diagnosis() -> Diagnosis:
    rng = np.random.default_rng(9)
    count = 3000
    time = np.linspace(0, 60, count)
    theta = 0.1 * time
    amplitude, sigma = np.exp(-0.02 * time), 1e-4
    after = rng.standard_normal((count, 4))
    before = after + np.stack(
        [4 * np.cos(8 * theta), 2 * np.sin(4 * theta), np.sin(4 * theta), 0 * theta], 1
    )
    measured = amplitude[:, None] * np.stack(
        [np.cos(2 * theta), np.sin(2 * theta), -0.05 * np.sin(2 * theta), 0.05 * np.cos(2 * theta)],
        1,
    )
    report = {
        "verdict": "explained",
        "baseline": {"chi2_per_dof": 6.2, "residual_rms": 2.5},
        "effects": [
            {
                "name": "pickoff_nonlinearity",
                "z": 48.2,
                "p_value": 1e-30,
                "delta_bic": -2200.0,
                "parameters": {"cubic": {"value": 3.1e-3, "std": 6e-5, "units": "1"}},
                "indistinguishable_from": [],
                "next_experiment": "two amplitudes",
            },
            {
                "name": "gain_mismatch",
                "z": -11.3,
                "p_value": 1e-20,
                "delta_bic": -110.0,
                "parameters": {"gain": {"value": -2e-3, "std": 1.8e-4, "units": "1"}},
                "indistinguishable_from": ["damping_split"],
                "next_experiment": "both signs of rotation",
            },
        ],
        "after": {"chi2_per_dof": 1.03, "residual_rms": 1.01},
        "gain": {
            "held_out": "runs",
            "before": 2.4,
            "after": 1.02,
            "ratio": 2.35,
            "std": 0.08,
            "drift_error_deg_h": {
                "before": 41.0,
                "before_std": 6.0,
                "after": 4.2,
                "after_std": 0.7,
            },
            "angle_error_ppm": {
                "before": 310.0,
                "before_std": 40.0,
                "after": 31.0,
                "after_std": 5.0,
            },
            "amplitude_error_ppm": {
                "before": 120.0,
                "before_std": 11.0,
                "after": 90.0,
                "after_std": 9.0,
            },
        },
        "forecast": forecast(),
        "mode_number": 2,
        "correlations": {
            "names": ["pickoff_nonlinearity", "gain_mismatch", "rate_bias"],
            "matrix": [[1.0, 0.2, 0.95], [0.2, 1.0, 0.0], [0.95, 0.0, 1.0]],
        },
        "tested": [
            {"name": n, "z": z, "upper_limit": 1e-4, "units": "1"}
            for n, z in (
                ("mains_tone", 1.2),
                ("saturation", -0.4),
                ("thermal_damping", 2.1),
                ("rate_bias", 0.1),
            )
        ],
        "remainder": None,
        "extended_model": "extended.toml",
    }
    return Diagnosis(
        run=np.zeros(count, "i4"),
        time_s=time,
        wave_angle_rad=theta,
        main_amplitude=amplitude,
        temperature_degc=20 + 0.1 * time,
        measured=measured,
        simulated_before=measured - sigma * before,
        simulated_after=measured - sigma * after,
        residual_before=before,
        residual_after=after,
        series=json.dumps(["C0 real", "S0 real", "C0 imaginary", "S0 imaginary"]),
        gyro_id="G-17",
        verdict="explained",
        report=json.dumps(report),
    )


RECORDS = {
    "recording": recording,
    "periods": periods,
    "wave": wave,
    "resonator": resonator,
    "calibration": calibration,
    "compensated": compensated,
    "diagnosis": diagnosis,
}


def write_all(folder: Path) -> list[Path]:
    """One file of every kind, with a history."""
    paths: list[Path] = []
    for kind, make in RECORDS.items():
        path = folder / f"{kind}.h5"
        sources = tuple(Source(p.name, p.stem, store.compute_sha256(p)) for p in paths[-1:])
        lines = (
            "2026-01-02T03:04:05Z hrg 0.1.0 hrg simulate run.toml -o recording.h5",
            f"2026-01-02T03:05:00Z hrg 0.1.0 hrg make {kind}",
        )
        record = make().replace(
            provenance=Provenance(
                lines, f"[{kind}]\nlevel = 1\n", sources, "2026-01-02T03:05:00Z", "hrg 0.1.0"
            )
        )
        store.write(path, record)
        paths.append(path)
    return paths
