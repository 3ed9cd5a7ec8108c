"""Seed A's variants and ladder against the exact slow model, repeats and thermal memory against
known causes."""

import json

import numpy as np
import pytest
from elliptic_runs import DEVICE, elliptic_run
from forced_runs import Truth, forced_run, programme

from hrg_cli.fitting.tables.increments import build_path
from hrg_cli.records import Resonator, collect
from hrg_cli.reporting.calibration import show_bought
from hrg_cli.stages.calibrate import calibrate, summarise
from hrg_cli.stages.calibration.interpolation import compute_measured_drift
from hrg_cli.stages.compensate import compensate
from hrg_cli.stages.compensate import summarise as compensated_figures


@pytest.fixture(scope="module")
def free_runs():
    plan = [
        (0.4, 0.1, 0.01),
        (-0.4, 0.9, -0.01),
        (0.4, 0.7, -0.01),
        (-0.4, 0.3, 0.01),
        (0.0, 0.2, 0.02),
        (0.0, 1.1, -0.02),
    ]
    return [
        elliptic_run(DEVICE, 20.0, rate, start, ratio, f"f{i}", seed=i, mode="free")
        for i, (rate, start, ratio) in enumerate(plan)
    ]


def test_quadrature_variant_finds_both_anisotropies(free_runs):
    """(11) to first order in r: νδμ sin 2m(θ − θ_μ) from the table, −2rδω cos 2m(θ − θ_ω) from the
    observed a_B."""
    record = calibrate(free_runs, model="quadrature", scale_factor_harmonics=0, bootstrap=0)
    drift = record.drift_harmonics[0]
    assert np.hypot(drift[1], drift[2]) == pytest.approx(8e-4, rel=0.005)
    assert np.arctan2(-drift[1], drift[2]) / 4 == pytest.approx(0.4, abs=2e-3)
    measured = json.loads(record.details)["measured"]["coefficients"][0]
    assert np.hypot(*measured) == pytest.approx(2 * 4e-3, rel=0.01)
    assert np.arctan2(-measured[1], -measured[0]) / 4 == pytest.approx(0.15, abs=3e-3)
    assert record.scale_factor_harmonics[0, 0] == pytest.approx(0.55, rel=1e-4)


def test_phase_variant_needs_no_stiffness_axes_but_the_mean_frequency(free_runs):
    record = calibrate(free_runs, model="phase", scale_factor_harmonics=0, bootstrap=0)
    assert np.hypot(*record.drift_harmonics[0, 1:3]) == pytest.approx(8e-4, rel=0.01)
    assert json.loads(record.details)["measured"]["mean_frequency_hz"][0] == pytest.approx(
        5000.0, abs=2e-5
    )


def test_a_phase_variant_of_an_old_file_is_the_exact_one_to_first_order(free_runs):
    record = calibrate(free_runs, model="phase", scale_factor_harmonics=0, bootstrap=0)
    details = json.loads(record.details)
    details["measured"]["exact"] = False
    old = record.replace(details=json.dumps(details))
    for run in free_runs:
        path = build_path(run, harmonics=1)
        exact, first = compute_measured_drift(record, path), compute_measured_drift(old, path)
        ratio = np.abs(path.ratio).max()
        assert np.abs(exact).max() > 0 and ratio < 0.5
        assert np.abs(first - exact).max() < ratio * np.abs(exact).max()


def test_all_variants_in_one_table(free_runs):
    names = (
        "damping_split_1_s",
        "damping_axis_rad",
        "frequency_split_rad_s",
        "stiffness_axis_rad",
        "scale_factor",
    )
    resonator = Resonator(
        name=np.array(names), value=np.array([8e-4, 0.4, 4e-3, 0.15, 0.55]), std=np.full(5, 1e-7),
        units=np.array(["s-1", "rad", "rad s-1", "rad", "1"]),
        covariance=np.eye(5) * 1e-14,
    )  # fmt: skip
    record = calibrate(free_runs, resonator, model="all", bootstrap=0)
    rows = {row["model"]: row for row in summarise(record)["variants"]}
    assert set(rows) == {"table", "parametric", "quadrature", "phase", "combined", "physical"}
    for name in ("quadrature", "phase", "physical"):
        assert rows[name]["drift_rms_rad_s"] < 0.2 * rows["parametric"]["drift_rms_rad_s"]
    assert rows["physical"]["coefficients"] == 0
    # (12) in numbers: δD = 4πr·δf
    phase = next(v for v in json.loads(record.details)["variants"] if v["stage"] == "phase")
    assert phase["mean_frequency_needed_hz"] * 4 * np.pi * phase[
        "quadrature_ratio_rms"
    ] == pytest.approx(rows["table"]["drift_rms_rad_s"])
    physical = calibrate(free_runs, resonator, model="physical", bootstrap=0)
    assert physical.drift_harmonics[0, 1:3] == pytest.approx(
        [-8e-4 * np.sin(1.6), 8e-4 * np.cos(1.6)]
    )
    assert physical.drift_harmonics_std[0, 2] == pytest.approx(
        1e-7 * np.hypot(np.cos(1.6), 4 * 8e-4 * np.sin(1.6)), rel=1e-6
    )


def test_measured_part_is_applied_in_operation(free_runs):
    unseen = elliptic_run(DEVICE, 20.0, 0.4, 0.5, 0.03, "later", seed=9, mode="free")
    after = {}
    for model in ("parametric", "quadrature", "phase"):
        record = calibrate(free_runs, model=model, scale_factor_harmonics=0, bootstrap=0)
        after[model] = compensated_figures(collect(compensate(unseen, record)))[
            "angle_cell_rms_rad_s"
        ]["after"]
    assert (
        after["quadrature"] < 0.15 * after["parametric"]
        and after["phase"] < 0.15 * after["parametric"]
    )


def driven(seed=0, drive_error=3e-4):
    """Forced runs whose drive adds its own harmonic, and free runs without it."""
    resonator = Truth(31, drift=1e-4, scale_ripple=0, curved=False)
    drive = Truth(31, drift=1e-4, scale_ripple=0, curved=False)
    drive.d = resonator.d.copy()
    drive.d[0, 1] += drive_error
    runs = []
    for i, (T, rate) in enumerate([(T, R) for T in (0, 40) for R in (-0.5, 0.5)]):
        runs.append(forced_run(drive, T, rate, 30, seed + i, run_id=f"forced {i}"))
        runs.append(
            forced_run(resonator, T, rate, 30, seed + 50 + i, run_id=f"free {i}").replace(
                mode="free"
            )
        )
    return runs


def test_the_ladder_separates_the_drive_by_free_runs():
    record = calibrate(driven(), ladder=True, harmonics=2, scale_factor_harmonics=0, bootstrap=50)
    rows = summarise(record)["ladder"]
    assert [row["stage"][0] for row in rows] == list("1234567")
    assert all(
        np.isfinite([row["drift_rms_rad_s"], row["scale_factor_rms_ppm"]]).all() for row in rows
    )
    assert "note" in rows[3] and "note" in rows[4] and "note" not in rows[5]
    factors = {f["name"]: f for f in json.loads(record.details)["final_analysis"]["factors"]}
    drive = factors["drive matrix, forced runs against free ones"]
    assert drive["values"][1] == pytest.approx(3e-4, abs=5 * drive["std"][1])
    assert (
        abs(drive["values"][2]) < 5 * drive["std"][2]
        and drive["z"] > 10
        and drive["independence"] > 0.5
    )
    assert (
        "drive matrix, forced runs against free ones"
        in json.loads(record.details)["final_analysis"]["significant"]
    )


def test_every_factor_says_what_it_needs():
    record = calibrate(driven(), ladder=True, harmonics=2, scale_factor_harmonics=0, bootstrap=0)
    report = summarise(record)
    needs = {row["name"]: row["needs"] for row in report["factors"]}
    assert needs["drive matrix, forced runs against free ones"].startswith("free run-downs")
    assert "thermometer" in needs["drift over temperature"]
    head, rows = show_bought(report)
    assert len(rows) == len(needs) and all(len(row) == len(head) for row in rows)


def test_an_hour_more_brings_what_longer_recordings_do():
    """Every run twice against what the programme foretells of as much time again."""
    runs = [
        [wave.replace(run_id=f"{wave.run_id} {seed}") for wave in again]
        for seed in (1, 2)
        for again in [programme(Truth(2), (0, 30), (-0.5, 0.5), seed=seed, duration=20)]
    ]
    short, long = (
        summarise(calibrate(waves, harmonics=2, scale_factor_harmonics=2, bootstrap=0))["hour"]
        for waves in (runs[0], [*runs[0], *runs[1]])
    )
    assert long["recorded_s"] == pytest.approx(2 * short["recorded_s"], rel=0.01)
    for key in ("drift_std_rad_s", "scale_factor_std_ppm"):
        assert long[key] == pytest.approx(short[key] / np.sqrt(2), rel=0.15)
    part = np.sqrt(short["recorded_s"] / (short["recorded_s"] + 3600))
    assert short["drift_std_with_it_rad_s"] == pytest.approx(part * short["drift_std_rad_s"])


def test_ladder_names_what_it_cannot_reach():
    rows = summarise(
        calibrate(programme(Truth(2), (0, 30), (-0.5, 0.5), duration=15), ladder=True, bootstrap=0)
    )["ladder"]
    assert (
        len(rows) == 7
        and "no free run" in rows[5]["note"]
        and "no drive is logged" in rows[4]["note"]
    )


def test_harmonics_that_do_not_repeat_are_named_and_dropped():
    truth, waves = Truth(6, curved=False), []
    draw = np.random.default_rng(0)
    truth.d[:, 3:] = 0
    for day in range(5):
        today = Truth(6, curved=False)
        today.d = truth.d.copy()
        today.d[0, 3:] = draw.normal(size=2) * 2e-4
        waves += [
            forced_run(
                today,
                T,
                R,
                20,
                100 * day + i,
                run_id=f"{day} {i}",
                start_time=f"2026-03-0{day + 1}T08:00:00Z",
            )
            for i, (T, R) in enumerate([(0, -0.5), (0, 0.5), (40, -0.5), (40, 0.5)])
        ]
    record = calibrate(waves, harmonics=2, scale_factor_harmonics=1, stable_only=True, bootstrap=0)
    details = json.loads(record.details)
    found = {(row["kind"], row["harmonic"]): row for row in details["stability"]["harmonics"]}
    assert details["stability"]["told_by"] == "day" and len(details["stability"]["programmes"]) == 5
    assert (
        not found["drift", 2]["repeats"]
        and found["drift", 1]["repeats"]
        and found["scale", 1]["repeats"]
    )
    assert found["drift", 2]["scatter"] == pytest.approx(2e-4 * np.sqrt(2), rel=0.6)
    assert details["dropped"] == ["drift 8θ"]
    assert (
        np.abs(record.drift_harmonics[:, 3:]).max() == 0
        and np.abs(record.drift_harmonics[:, 1]).min() > 0
    )


def sweeps(lag=0.0, hysteresis=0.0, speeds=(1.0, -1.0), seed=0):
    """Up and down sweeps; the resonator stands at T + lag·dT/dt + hysteresis·sign(dT/dt) of the
    thermometer."""
    truth, waves = Truth(8, curved=False), []
    truth.d[1] = truth.d[0] * 0.8
    for i, (speed, rate) in enumerate([(s, r) for s in speeds for r in (-0.5, 0.5)]):
        length = 60 / abs(speed)
        first = -10.0 if speed > 0 else 50.0
        true = forced_run(
            truth,
            lambda t, s=speed, f=first: f + s * t + lag * s + hysteresis * np.sign(s),
            rate,
            length,
            seed + i,
            dt=0.04,
            noise=1e-6,
            run_id=str(i),
        )
        waves.append(true.replace(temperature_degc=first + speed * true.time_s))
    return waves


def test_one_sweep_speed_cannot_tell_lag_from_hysteresis():
    found = json.loads(
        calibrate(sweeps(lag=2.0), harmonics=2, scale_factor_harmonics=2, bootstrap=0).details
    )["thermal_memory"]
    assert not found["separable"] and "another speed" in found["sentence"]
    assert found["lag"]["value"] == pytest.approx(2.0, abs=5 * found["lag"]["std"])


@pytest.mark.parametrize("interpolation", ["smooth", "linear"])
@pytest.mark.parametrize("seed", [0, 10, 20])
def test_what_the_tables_take_whole_is_told_no_size(interpolation, seed):
    """A smooth table left 1e-7 of a lag's column in a single ramp: 23 779 ± 0.01 s, of rounding."""
    record = calibrate(
        sweeps(speeds=(1.0,), seed=seed), harmonics=2, scale_factor_harmonics=2, bootstrap=0,
        interpolation=interpolation,
    )  # fmt: skip
    memory = json.loads(record.details)["thermal_memory"]
    for name in ("lag", "hysteresis"):
        value, std = memory[name]["value"], memory[name]["std"]
        assert (value is None) == (not memory["independence"][name] > 1e-3)
        assert value is None or abs(value) < 5 * std
    assert not any(reason.startswith("the thermometer ") for reason in record.status_reasons)


@pytest.mark.parametrize("one_way", [(1.0,), (-1.0, -0.7)])
def test_sweeps_one_way_say_what_a_lag_would_be_worth(one_way):
    """A resonator 2 s behind its thermometer in a single ramp is tables shifted by 2 °C: nothing shows
    it, so it is said (PHYSICS §2 iv)."""
    record = calibrate(sweeps(speeds=one_way), harmonics=2, scale_factor_harmonics=2, bootstrap=0)
    said = [reason for reason in record.status_reasons if "no lag of the thermometer" in reason]
    assert len(said) == 1 and "°/h" in said[0]
    assert ("all runs warm" if one_way[0] > 0 else "all runs cool") in said[0]
    assert not any("lags by" in reason for reason in record.status_reasons)


@pytest.mark.parametrize(("lag", "hysteresis"), [(0.3, 0.0), (0.0, 0.3), (0.0, 0.0)])
def test_a_memory_of_the_thermometer_that_shows_is_doubted(lag, hysteresis):
    record = calibrate(
        sweeps(lag, hysteresis, speeds=(1.5, -1.5, 0.5, -0.5)), harmonics=2, scale_factor_harmonics=2,
        bootstrap=0,
    )  # fmt: skip
    told = [reason for reason in record.status_reasons if reason.startswith("the thermometer ")]
    assert len(told) == (lag + hysteresis > 0)
    assert all(("lags by 0.3" if lag else "hysteresis of 0.3") in reason for reason in told)
    assert not told or record.status == "suspect"
    assert not any("no lag of the thermometer" in reason for reason in record.status_reasons)


@pytest.mark.parametrize(("lag", "hysteresis"), [(2.0, 0.0), (0.0, 1.5)])
def test_two_sweep_speeds_tell_lag_from_hysteresis(lag, hysteresis):
    waves = sweeps(lag, hysteresis, speeds=(1.5, -1.5, 0.5, -0.5))
    found = json.loads(
        calibrate(waves, harmonics=2, scale_factor_harmonics=2, bootstrap=0).details
    )["thermal_memory"]
    assert found["separable"]
    for name, truth in (("lag", lag), ("hysteresis", hysteresis)):
        assert found[name]["value"] == pytest.approx(
            truth, abs=5 * found[name]["std"] + 0.03 * (lag + hysteresis)
        )
        assert found[name]["std"] < 0.2


def test_a_drift_that_moves_with_the_quadrature_is_said(free_runs):
    """−2rδω cos ζ stays in the residual of a table; the quadrature variant takes it and is
    silent."""
    words = "moves with the measured quadrature"
    assert any(
        words in reason
        for reason in calibrate(
            free_runs, model="table", harmonics=1, scale_factor_harmonics=0, bootstrap=0
        ).status_reasons
    )
    model = calibrate(free_runs, model="quadrature", scale_factor_harmonics=0, bootstrap=0)
    assert not any(words in reason for reason in model.status_reasons)
    plain = calibrate(programme(Truth(2), (0, 30), (-0.5, 0.5), duration=15), bootstrap=0)
    assert plain.status == "valid", plain.status_reasons


def test_a_drift_that_moves_with_the_rate_alone_is_said():
    """An asymmetric scale factor, K₊ ≠ K₋, is an even function of the rate: no table over
    temperature and angle holds it."""
    truth, waves = Truth(4, curved=False), []
    for i, rate in enumerate((-0.5, -0.2, 0.02, 0.2, 0.5)):
        wave = forced_run(truth, 20.0, rate * (1 + 2e-4 * (rate > 0)), 20, 30 + i, run_id=f"r{i}")
        waves.append(wave.replace(rate_rad_s=np.full(len(wave), rate)))
    record = calibrate(waves, harmonics=2, scale_factor_harmonics=2, bootstrap=0)
    assert any("moves with the rate itself" in reason for reason in record.status_reasons), (
        record.status_reasons
    )
    clean = [
        forced_run(truth, 20.0, rate, 20, 40 + i, run_id=f"r{i}")
        for i, rate in enumerate((-0.5, -0.2, 0.02, 0.2, 0.5))
    ]
    silent = calibrate(clean, harmonics=2, scale_factor_harmonics=2, bootstrap=0)
    assert not any("rate itself" in reason for reason in silent.status_reasons)
