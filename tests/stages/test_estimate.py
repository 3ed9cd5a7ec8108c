"""estimate: recovery within the stated deviations, continuity through blocks, and honesty about
rows that fail."""

import numpy as np
import pytest

from hrg_cli import store
from hrg_cli.errors import HrgError
from hrg_cli.physics import ellipse
from hrg_cli.physics.signals import make_signals
from hrg_cli.records import (
    FLAG_CLIPPED,
    FLAG_GAP,
    FLAG_NOT_FINITE,
    FLAG_SETTLING,
    Periods,
    Wave,
    collect,
)
from hrg_cli.stages import estimate as module
from hrg_cli.stages.estimate import estimate, summarise

SOLVERS = ("closed-form", "gauss-newton", "levenberg-marquardt")
WINDOW = 0.01


def periods(
    a, b, theta, phi, psi=0.0, *, readout="direct", m=2, sigma=1e-4, seed=0, **changes
) -> Periods:
    """Demodulated signals of a known wave (θ physical) with white noise."""
    a, b, theta, phi, psi = np.broadcast_arrays(a, b, theta, phi, psi)
    if readout == "direct":
        u = ellipse.compute_envelopes(a, b, theta, phi, m)
        z = np.stack([u[:, 0].real, -u[:, 0].imag, u[:, 1].real, -u[:, 1].imag], axis=-1)
    else:
        z = make_signals(np.stack([a, b, m * theta, phi, psi], axis=-1))
    n = len(z)
    record = Periods(
        time_s=(np.arange(n) + 0.5) * WINDOW,
        signals=z + sigma * np.random.default_rng(seed).standard_normal(z.shape),
        signals_std=np.full(z.shape, sigma),
        residual_rms=np.full((n, 2), sigma),
        flags=np.zeros(n, np.uint8),
        temperature_degc=np.linspace(20, 30, n),
        reference_frequency_hz=5000.0,
        periods_per_window=50,
        window_s=WINDOW,
        mode="free",
        readout=readout,
        carrier_hz=50e3 if readout == "carrier" else None,
        mode_number=m,
        gyro_id="G1",
        run_id="run 7",
        lot_id="L1",
        units="V",
    )
    return record.replace(**changes)


def turning(n: int = 2000, m: int = 2, **settings):
    """A wave that turns many times, with its truth."""
    t = (np.arange(n) + 0.5) * WINDOW
    truth = (
        np.exp(-t / 60),
        0.05 * np.cos(t),
        0.2 + 20 / m * t,
        -0.3 + 40 * t + 0.5 * t**2,
        0.4 + 3 * t,
    )
    return periods(*truth, m=m, **settings), truth


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("readout", ["direct", "carrier"])
def test_errors_of_random_waves_are_as_large_as_stated(readout, solver):
    """Mean of (error/σ)² over 600 draws, each another wave."""
    generator = np.random.default_rng(3)
    n, m = 600, 2
    a = generator.uniform(0.5, 2, n)
    b = a * generator.uniform(-0.7, 0.7, n)
    theta, phi, psi = generator.uniform(-1.4, 1.4, (3, n))
    theta = theta / m
    wave = collect(
        estimate(
            periods(a, b, theta, phi, psi, readout=readout, sigma=2e-3),
            solver=solver,
            start="closed-form",
        )
    )
    angle, phase = wave.wave_angle_rad, wave.phase_rad
    errors = {
        "main_amplitude": wave.main_amplitude - a,
        "quadrature_amplitude": wave.quadrature_amplitude - b,
        "wave_angle_rad": np.remainder(m * (angle - theta) + np.pi / 2, np.pi) / m - np.pi / 2 / m,
        "phase_rad": np.remainder(phase - phi + np.pi / 2, np.pi) - np.pi / 2,
    }
    if readout == "carrier":
        errors["carrier_phase_rad"] = (
            np.remainder(wave.carrier_phase_rad - psi + np.pi / 2, np.pi) - np.pi / 2
        )
    for name, error in errors.items():
        assert 0.8 < np.mean((error / getattr(wave, f"{name}_std")) ** 2) < 1.25, name
    assert (np.abs(wave.quadrature_amplitude) <= wave.main_amplitude).all()
    assert wave.status == "valid" and (wave.iterations >= 0).all()


@pytest.mark.parametrize("m", [1, 2, 3])
@pytest.mark.parametrize("readout", ["direct", "carrier"])
def test_angles_are_continuous_over_many_turns_and_through_blocks(readout, m, monkeypatch):
    record, (_, _, theta, phi, psi) = turning(m=m, readout=readout)
    whole = collect(estimate(record))
    half_turns = np.round(m * (whole.wave_angle_rad - theta)[0] / np.pi)
    np.testing.assert_allclose(whole.wave_angle_rad - theta, half_turns * np.pi / m, atol=3e-3)
    np.testing.assert_allclose(np.ptp(whole.phase_rad - phi), 0, atol=3e-3)
    if readout == "carrier":
        np.testing.assert_allclose(np.ptp(whole.carrier_phase_rad - psi), 0, atol=3e-3)
    monkeypatch.setattr(module, "BLOCK_ROWS", 137)
    pieces = list(estimate(record))
    assert len(pieces) == -(-len(record) // 137)
    joined = collect(pieces)
    for name, spec in Wave.columns().items():
        if spec.dims == ("row",) and getattr(whole, name) is not None:
            np.testing.assert_allclose(
                getattr(joined, name), getattr(whole, name), rtol=1e-9, atol=1e-9, err_msg=name
            )


def test_the_recovered_parameters_give_back_the_signals():
    """Values and phases belong together: the wave's envelopes are the demodulated ones, whatever
    was unwrapped."""
    record, _ = turning(sigma=0.0)
    wave = collect(estimate(record))
    u = ellipse.compute_envelopes(
        wave.main_amplitude, wave.quadrature_amplitude, wave.wave_angle_rad, wave.phase_rad, 2
    )
    np.testing.assert_allclose(
        np.stack([u[:, 0].real, -u[:, 0].imag, u[:, 1].real, -u[:, 1].imag], -1),
        record.signals,
        atol=1e-11,
    )
    record, _ = turning(sigma=0.0, readout="carrier")
    wave = collect(estimate(record))
    x = np.stack(
        [
            wave.main_amplitude,
            wave.quadrature_amplitude,
            2 * wave.wave_angle_rad,
            wave.phase_rad,
            wave.carrier_phase_rad,
        ],
        axis=-1,
    )
    np.testing.assert_allclose(make_signals(x), record.signals, atol=1e-11)


@pytest.mark.parametrize("start", ["previous", "closed-form", "fixed"])
@pytest.mark.parametrize("solver", SOLVERS[1:])
@pytest.mark.parametrize("readout", ["direct", "carrier"])
def test_solvers_and_starts_agree(readout, solver, start):
    record, _ = turning(300, readout=readout)
    expected, found = (
        collect(estimate(record)),
        collect(estimate(record, solver=solver, start=start)),
    )
    done = found.iterations > 0
    assert done.mean() > (0.5 if start == "fixed" else 0.99)
    for name in (
        "main_amplitude",
        "quadrature_amplitude",
        "wave_angle_rad",
        "phase_rad",
        "carrier_phase_rad",
    ):
        if start != "fixed":
            np.testing.assert_allclose(
                getattr(found, name)[done], getattr(expected, name)[done], atol=1e-7, err_msg=name
            )
    np.testing.assert_allclose(found.main_amplitude[done], expected.main_amplitude[done], atol=1e-8)
    assert (expected.iterations == 0).all()


def test_previous_is_what_a_sequential_run_does():
    """Row by row, each started at the row before, gives the same solutions and the same iteration
    counts."""
    from hrg_cli.fitting.ellipse.closed_form import solve_closed_form
    from hrg_cli.fitting.ellipse.gauss_newton import solve_gauss_newton

    record, _ = turning(100, readout="carrier")
    found = collect(estimate(record, solver="gauss-newton", start="previous"))
    x = solve_closed_form(record.signals[:1])[0]
    for row, count in zip(record.signals, found.iterations, strict=True):
        one = solve_gauss_newton(row[None], x)
        x = one.x
        assert one.evaluations[0] == count


def test_a_known_carrier_phase_is_used():
    record = periods(np.ones(400), 0.1, 0.3, 0.2, 0.9, readout="carrier", sigma=1e-3)
    wave = collect(estimate(record, carrier_phase_rad=0.9))
    assert (wave.carrier_phase_rad == 0.9).all() and (wave.carrier_phase_rad_std == 0).all()
    assert np.mean(((wave.phase_rad - 0.2) / wave.phase_rad_std) ** 2) == pytest.approx(1, abs=0.3)
    with pytest.raises(HrgError, match=r"run 7.*direct"):
        collect(estimate(turning(10)[0], carrier_phase_rad=0.9))


def test_signal_std_is_that_of_an_envelope():
    for readout in ("direct", "carrier"):
        wave = collect(estimate(turning(50, readout=readout, sigma=1e-3)[0]))
        np.testing.assert_allclose(wave.signal_std, wave.main_amplitude_std, rtol=1e-9)


def test_redundant_residual_tells_a_sideband_gain_and_direct_has_none():
    record, _ = turning(500, readout="carrier", sigma=1e-3)
    quiet = collect(estimate(record)).residual_rms
    assert np.sqrt(np.mean(quiet**2)) == pytest.approx(1e-3 * np.sqrt(3 / 8), rel=0.1)
    record.signals[:, 1::2] *= 1.05
    assert np.median(collect(estimate(record)).residual_rms) > 10 * np.median(quiet)
    assert (collect(estimate(turning(50)[0])).residual_rms == 0).all()


@pytest.mark.parametrize("readout", ["direct", "carrier"])
def test_bad_rows_stay_bad_and_leave_the_others_alone(readout):
    record, (_, _, theta, phi, _) = turning(500, readout=readout)
    record.signals[[0, 1, 200], [0, 1, 3]] = [np.nan, np.inf, np.nan]
    record.flags[[5, 200, 499]] = [FLAG_CLIPPED, FLAG_NOT_FINITE | FLAG_CLIPPED, FLAG_SETTLING]
    wave = collect(estimate(record))
    bad = np.isin(np.arange(500), [0, 1, 200])
    for name in ("main_amplitude", "wave_angle_rad", "phase_rad", "wave_angle_rad_std"):
        np.testing.assert_array_equal(np.isnan(getattr(wave, name)), bad, err_msg=name)
    assert (
        wave.flags[[0, 5, 200, 499]]
        == [FLAG_NOT_FINITE, FLAG_CLIPPED, FLAG_NOT_FINITE | FLAG_CLIPPED, FLAG_SETTLING]
    ).all()
    assert not wave.good()[bad].any() and (wave.iterations[bad] < 0).all()
    assert np.ptp((wave.wave_angle_rad - theta)[~bad]) < 3e-3
    assert np.ptp((wave.phase_rad - phi)[~bad]) < 3e-3
    assert wave.status == "valid"


@pytest.mark.parametrize("readout", ["direct", "carrier"])
def test_stray_rows_turn_nothing_that_follows(readout):
    """Garbage in windows at gaps, in every place of the half turn, leaves the clean rows on one
    path."""
    record, (_, _, theta, phi, _) = turning(1000, readout=readout)
    stray = np.arange(5, 1000, 7)
    record.signals[stray] = np.random.default_rng(4).standard_normal(
        (len(stray), record.signals.shape[1])
    )
    record.flags[stray] = FLAG_GAP
    wave = collect(estimate(record))
    clean = wave.flags == 0
    assert np.ptp((wave.wave_angle_rad - theta)[clean]) < 3e-3
    assert np.ptp((wave.phase_rad - phi)[clean]) < 3e-3
    assert (
        np.abs((wave.wave_angle_rad - theta)[stray] - (wave.wave_angle_rad - theta)[0]).max()
        < 1.01 * np.pi / 4
    )


def test_frequency_is_the_slope_of_the_phase():
    record, _ = turning(3000, sigma=1e-3)
    wave = collect(estimate(record))
    np.testing.assert_allclose(
        wave.frequency_hz[:], 5000 + (40 + record.time_s) / (2 * np.pi), atol=0.02
    )
    assert np.std(wave.frequency_hz - 5000 - (40 + record.time_s) / (2 * np.pi)) < 0.005


def test_columns_attributes_and_status_pass_through():
    spectrum = {
        "spectrum_frequency_hz": np.arange(3.0),
        "spectrum_density": np.ones((3, 2)),
        "spectrum_line_frequency_hz": np.array([50.0]),
        "spectrum_line_amplitude": np.ones((1, 2)),
        "spectrum_line_ratio": np.array([9.0]),
    }
    n = 50
    log = {
        "rate_rad_s": np.ones(n),
        "drive_main": np.arange(n) * 1.0,
        "drive_quadrature": np.zeros(n),
    }
    record, _ = turning(
        n,
        m=3,
        mode="forced",
        start_time="2024-01-01T00:00:00Z",
        status="suspect",
        status_reasons=("x",),
        **spectrum,
        **log,
    )
    wave = collect(estimate(record))
    for name in (*spectrum, *log, "temperature_degc", "time_s"):
        np.testing.assert_array_equal(getattr(wave, name), getattr(record, name), err_msg=name)
    for name in (
        "mode",
        "readout",
        "mode_number",
        "gyro_id",
        "run_id",
        "lot_id",
        "start_time",
        "units",
        "window_s",
    ):
        assert getattr(wave, name) == getattr(record, name), name
    assert wave.reference_frequency_hz == 5000.0
    assert wave.status == "suspect" and wave.status_reasons == ("x",)


def test_a_stream_of_a_file_is_a_whole_file(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "BLOCK_ROWS", 100)
    record, _ = turning(950, readout="carrier")
    store.write(tmp_path / "periods.h5", record)
    with store.open_record(tmp_path / "periods.h5", Periods) as lazy:
        store.write(tmp_path / "wave.h5", estimate(lazy, solver="gauss-newton"))
    wave = store.read(tmp_path / "wave.h5", Wave)
    assert len(wave) == 950
    np.testing.assert_allclose(
        wave.wave_angle_rad, collect(estimate(record)).wave_angle_rad, atol=1e-8
    )
    assert summarise(wave)["usable"] == 950


def test_a_circular_wave_has_a_large_finite_angle_deviation():
    wave = collect(estimate(periods(np.ones(300), 1.0, 0.2, 0.1, sigma=1e-4)))
    assert np.isfinite(wave.wave_angle_rad_std).all()
    assert np.median(wave.wave_angle_rad_std) > 0.1
    np.testing.assert_allclose(wave.main_amplitude, 1, atol=1e-3)
    assert wave.main_amplitude_std == pytest.approx(1e-4, rel=0.01)


def test_no_convergence_is_told():
    record, _ = turning(200)
    wave = collect(estimate(record, solver="gauss-newton", max_iterations=1))
    assert wave.status == "refused" and "did not converge" in wave.status_reasons[0]
    record = periods(np.ones(200), 0.1, np.linspace(0, 20, 200), 0.0, readout="carrier")
    wave = collect(estimate(record, solver="gauss-newton", start="fixed", max_iterations=6))
    failed = wave.iterations < 0
    assert 10 < failed.sum() < 100 and (wave.iterations[failed] == -6).all()
    assert wave.status == "suspect" and f"{failed.sum()} of 200" in wave.status_reasons[0]
    assert not wave.good()[failed].any()


@pytest.mark.parametrize(
    ("change", "status"),
    [
        ({"signals": np.full((100, 4), np.nan)}, "refused"),
        ({"signals": np.zeros((100, 4))}, "refused"),
        (
            {
                "signals": np.random.default_rng(0).standard_normal((100, 4)) * 1e-3,
                "signals_std": np.full((100, 4), 1e-3),
            },
            "refused",
        ),
        ({"flags": np.full(100, FLAG_CLIPPED, np.uint8)}, "refused"),
        ({"flags": np.array([FLAG_CLIPPED, 0] * 50, np.uint8)}, "suspect"),
        ({"flags": np.array([FLAG_SETTLING] * 30 + [0] * 70, np.uint8)}, "valid"),
    ],
    ids=["not finite", "all zero", "noise only", "all clipped", "half clipped", "settling"],
)
def test_useless_input_never_looks_like_success(change, status):
    wave = collect(estimate(turning(100)[0].replace(**change)))
    assert wave.status == status
    assert all("run 7" in reason and "100 windows" in reason for reason in wave.status_reasons)
    summarise(wave)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"readout": "carrier"}, "8 a window"),
        ({"readout": "optical"}, "optical"),
        ({"signals": np.zeros((100, 5))}, "4 a window"),
    ],
)
def test_wrong_periods_are_refused_with_a_sentence(change, words):
    with pytest.raises(HrgError, match=rf"run 7.*{words}"):
        collect(estimate(turning(100)[0].replace(**change)))


@pytest.mark.parametrize("n", [1, 2, 3])
def test_very_short_runs(n):
    wave = collect(estimate(turning(n)[0]))
    assert len(wave) == n and np.isfinite(wave.wave_angle_rad).all()
    assert np.isfinite(wave.frequency_hz).all() == (n > 1)
