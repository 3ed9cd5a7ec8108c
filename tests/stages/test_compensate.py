"""Rate and angle of another run with the tables, and what is refused."""

import json

import numpy as np
import pytest
from forced_runs import Truth, forced_run, programme

from hrg_cli.errors import HrgError
from hrg_cli.records import Provenance, collect
from hrg_cli.stages.calibrate import calibrate
from hrg_cli.stages.compensate import compensate, summarise
from hrg_cli.stages.compensation import logged_run


@pytest.fixture(scope="module")
def truth():
    return Truth(21)


@pytest.fixture(scope="module")
def tables(truth):
    return calibrate(
        programme(truth, (-10, 15, 40), (-0.5, 0.05, 0.5), duration=40),
        harmonics=2,
        scale_factor_harmonics=2,
        bootstrap=0,
    )


@pytest.fixture(scope="module")
def run(truth):
    return forced_run(
        truth,
        lambda t: -5 + t,
        lambda t: 0.3 * np.sin(0.4 * t),
        40,
        99,
        run_id="flight",
        noise=1e-6,
    )


def test_angle_and_rate_of_an_unseen_run(tables, run):
    done = collect(compensate(run, tables))
    true_angle = 0.3 / 0.4 * (1 - np.cos(0.4 * done.time_s))
    constant = np.cumsum(np.append(0, -2 * np.diff(run.wave_angle_rad))) / 0.55
    assert np.abs(done.angle_estimate_rad - true_angle).max() < 2e-5
    assert (
        np.abs(np.interp(done.time_s, run.time_s, constant) - true_angle).max()
        > 20 * np.abs(done.angle_estimate_rad - true_angle).max()
    )
    figures = summarise(done)["angle_cell_rms_rad_s"]
    assert figures["after"] < 0.1 * figures["before"]
    assert done.status == "valid"


@pytest.mark.parametrize("windows", [1, 10, 25])
def test_increments_of_many_windows_follow_a_wave_that_turns(tables, truth, windows):
    """At 0.4 rad/s the drift turns on within increments of half a second; taken at their means'
    angle it left the compensated angle 10 σ off (25 windows)."""
    run = forced_run(truth, lambda t: 15 + 0 * t, lambda t: 0.4 + 0 * t, 40, 7, noise=1e-6)
    done = collect(compensate(run, tables, windows_per_increment=windows))
    rate = (done.rate_estimate_rad_s - 0.4) / done.rate_estimate_rad_s_std
    off = done.angle_estimate_rad - 0.4 * (done.time_s - run.time_s[:windows].mean())
    assert np.abs(rate).max() < 5
    assert np.abs(off / done.angle_estimate_rad_std).max() < 5


@pytest.mark.parametrize("windows", [1, 5])
def test_the_angle_of_a_swing_is_that_of_its_time(tables, truth, windows):
    """The mean of an increment's ends is Ω̇Δt²/8 too far: 12 σ here, and 850 σ in five windows."""
    run = forced_run(
        truth, lambda t: 15 + 0 * t, lambda t: 0.4 * np.sin(1.5 * t), 40, 7, noise=1e-6
    )
    done = collect(compensate(run, tables, windows_per_increment=windows))
    true = -0.4 / 1.5 * np.cos(1.5 * done.time_s)
    off = done.angle_estimate_rad - true - 0.4 / 1.5 * np.cos(1.5 * run.time_s[:windows].mean())
    assert np.abs(off / done.angle_estimate_rad_std).max() < 5


def test_a_stream_of_pieces_equals_the_whole(tables, run, monkeypatch):
    bad = np.zeros(len(run), "u1")
    bad[190:215] = 2
    run = run.replace(flags=bad)
    whole = collect(compensate(run, tables, windows_per_increment=3))
    monkeypatch.setattr(logged_run, "ROWS_AT_ONCE", 200)
    pieces = list(compensate(run, tables, windows_per_increment=3))
    assert len(pieces) > 5
    joined = collect(pieces)
    assert joined.rate_estimate_rad_s.sum() == pytest.approx(
        whole.rate_estimate_rad_s.sum(), rel=1e-9
    )
    assert joined.angle_estimate_rad == pytest.approx(whole.angle_estimate_rad, abs=1e-9)


def test_without_a_rate_log_there_are_no_residuals(tables, run):
    done = collect(compensate(run.replace(rate_rad_s=None), tables))
    assert done.residual_after_rad_s is None and done.status == "valid"
    assert done.rate_estimate_rad_s == pytest.approx(
        collect(compensate(run, tables)).rate_estimate_rad_s
    )


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"gyro_id": "g2"}, "is of gyro g2, the tables are of gyro g1"),
        ({"mode_number": 3}, "mode_number 3"),
        (
            {"provenance": Provenance(history=("2026 hrg 0.1 compensate wave.h5",))},
            "compensated already",
        ),
        ({"temperature_degc": np.full(2000, 80.0)}, "80 to 80 °C, the tables hold from -10 to 40"),
        ({"temperature_degc": None}, "temperature is missing"),
        ({"flags": np.ones(2000, "u1")}, "no good windows"),
    ],
)
def test_guards(tables, run, change, words):
    with pytest.raises(HrgError, match=words):
        collect(compensate(run.replace(**change), tables))


def test_sign_and_order_are_guarded(tables, run, truth):
    turning = forced_run(truth, 10.0, 0.4, 10, 1)
    with pytest.raises(HrgError, match="sign"):
        collect(compensate(turning.replace(rate_rad_s=-turning.rate_rad_s), tables))
    with pytest.raises(HrgError, match="correction"):
        compensate(run, tables.replace(correction="divide first"))
    with pytest.raises(HrgError, match="refused"):
        compensate(run, tables.replace(status="refused", status_reasons=("one rate only",)))


def test_with_the_earths_rate_told_the_answer_is_against_the_ground(tables, run):
    """The log holds what the table turns, the gyro the Earth's rate too: 2π in a sidereal day,
    times the sine of the latitude about the vertical."""
    earth = 2 * np.pi / 86164.0905 * np.sin(np.radians(50))
    logged = run.replace(rate_rad_s=run.rate_rad_s - earth)
    against_stars = collect(compensate(run, tables))
    for told in ({"latitude_deg": 50.0}, {"earth_rate_deg_h": np.degrees(earth) * 3600}):
        done = collect(compensate(logged, tables, **told))
        less = against_stars.rate_estimate_rad_s - done.rate_estimate_rad_s
        assert less == pytest.approx(earth, rel=1e-6)
        assert done.residual_after_rad_s == pytest.approx(
            against_stars.residual_after_rad_s, abs=1e-10
        )
        behind = against_stars.angle_estimate_rad - done.angle_estimate_rad
        assert behind == pytest.approx(earth * (done.time_s - run.time_s[0]), abs=1e-9)


def test_rates_outside_are_doubted(tables, truth):
    fast = forced_run(truth, 10.0, 1.5, 8, 1)
    done = collect(compensate(fast, tables))
    assert done.status == "suspect" and "beyond those calibrated" in done.status_reasons[-1]
    assert collect(compensate(fast.replace(rate_rad_s=None), tables)).status == "suspect"
    json.dumps(summarise(done), allow_nan=False)


def test_a_scale_factor_of_another_gyro_is_doubted(tables, truth):
    """The run's own K, seen against its rate log, differs by a tenth from the tables': it is told as
    that; by a fiftieth the angle is off its log all the same."""
    for factor in (1.1, 1.02):
        other = Truth(21)
        other.k = truth.k * factor
        run = forced_run(
            other, 10.0, lambda t: 0.4 * np.sin(0.4 * t), 40, 7, run_id="other", noise=1e-6
        )
        done = collect(compensate(run, tables))
        assert done.status == "suspect"
        assert any("own scale factor" in reason for reason in done.status_reasons) == (
            factor > 1.05
        )
        assert any("off the run's rate log" in reason for reason in done.status_reasons)


def test_tables_that_have_aged_are_contradicted_by_the_runs_own_log(tables, truth, run):
    """A drift of three tenths more than the tables' is all but lost in the noise of every rate and adds up in
    the angle; the tables' own gyro stays within what is stated of it."""
    aged = Truth(21)
    aged.d = truth.d * 1.3
    later = forced_run(
        aged, 10.0, lambda t: 0.3 * np.sin(0.4 * t), 40, 98, run_id="later", noise=1e-6
    )
    done = collect(compensate(later, tables))
    assert done.status == "suspect" and "tables that have aged" in done.status_reasons[-1]
    assert summarise(done)["error_over_std_rms"] < 1.3  # hardly anything is seen in single rates
    figures = summarise(done)["angle_against_log"]
    # it was 7: at 10 °C σ holds what three nodes leave open between them
    assert figures["largest_over_std"] > 6
    at = np.argmin(np.abs(done.time_s - figures["time_s"]))
    stated = figures["largest_over_std"] * done.angle_estimate_rad_std[at]
    # what the rates scatter beyond their deviations is the log's own and widens it
    assert stated <= abs(figures["error_rad"]) < 1.3 * stated
    without = collect(compensate(later.replace(rate_rad_s=None), tables))
    assert without.status == "valid" and "angle_against_log" not in summarise(without)
    assert summarise(collect(compensate(run, tables)))["angle_against_log"]["largest_over_std"] < 5


def test_a_free_run_under_tables_of_driven_ones_is_doubted(tables, run):
    done = collect(compensate(run.replace(mode="free"), tables))
    assert done.status == "suspect" and "the tables are of driven runs" in done.status_reasons[-1]


def test_increments_too_long_for_a_swing_are_told(tables, truth):
    """A second and a half at 1.5 rad/s: between the blocks the angle is anybody's."""
    run = forced_run(
        truth, lambda t: 15 + 0 * t, lambda t: 0.4 * np.sin(1.5 * t), 40, 7, noise=1e-6
    )
    done = collect(compensate(run, tables, windows_per_increment=75))
    assert done.status == "suspect"
    assert any("fewer windows_per_increment" in why for why in done.status_reasons)


def test_a_step_of_the_rate_within_a_window_is_told(tables, run):
    """One row of the log off, as a table's step looks: nothing was said of 97 σ."""
    rate = run.rate_rad_s.copy()
    rate[800:803] += 0.01
    done = collect(compensate(run.replace(rate_rad_s=rate), tables))
    assert done.status == "suspect" and any("at 16." in why for why in done.status_reasons)
    assert any("changes within a window" in why for why in done.status_reasons)
