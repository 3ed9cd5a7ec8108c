"""Windows whose rate nobody logged, and waves that were refused, take no part and are named."""

import json

import numpy as np
import pytest
from forced_runs import Truth, forced_run
from synthetic_waves import errors, run_down

from hrg_cli.errors import HrgError
from hrg_cli.fitting.samples.rate_log import BRIDGED, find_covered
from hrg_cli.physics.resonator import Mechanics
from hrg_cli.records import Wave, collect
from hrg_cli.stages.calibrate import calibrate
from hrg_cli.stages.compensate import compensate
from hrg_cli.stages.diagnose import diagnose
from hrg_cli.stages.identify import identify
from hrg_cli.stages.rate import rate

LOGGED_S = 2.0
"""The log's end; the table turns another way from here on, which nobody knows."""
CASES = ((0.0, 0.0), (0.4, 1.5), (0.1, 2.0), (0.5, -2.0))


def ended(wave: Wave, end_s: float = LOGGED_S, begin_s: float = -np.inf) -> Wave:
    """The wave with its rate logged from begin_s to end_s."""
    inside = (wave.time_s >= begin_s) & (wave.time_s <= end_s)
    return wave.replace(rate_rad_s=np.where(inside, wave.rate_rad_s, np.nan))


def turning_back(rate: float):
    """A rate that changes its sign at the log's end."""
    return lambda t: np.where(np.asarray(t) < LOGGED_S, rate, -rate)


@pytest.fixture(scope="module")
def runs():
    return [
        run_down(theta, turning_back(rate), seed=i, window=8e-3)
        for i, (theta, rate) in enumerate(CASES)
    ]


def test_the_longest_stretch_between_known_rates_is_covered():
    wave = run_down(0.3, 1.0, seconds=2.0, window=1e-2)
    assert find_covered(wave).all()
    assert find_covered(wave.replace(rate_rad_s=None)).all()
    rate = wave.rate_rad_s.copy()
    rate[:7] = rate[60 : 60 + BRIDGED] = rate[140:160] = np.nan
    inside = find_covered(wave.replace(rate_rad_s=rate))
    assert np.flatnonzero(inside).tolist() == list(range(7, 140))
    rate[60 + BRIDGED] = np.nan
    inside = find_covered(wave.replace(rate_rad_s=rate))
    assert np.flatnonzero(inside).tolist() == list(range(66, 140))


def test_identify_leaves_out_what_the_log_does_not_cover(runs):
    found = identify([ended(wave) for wave in runs])
    # 28 values at 4.5 σ: fails by chance once in 5000
    assert max(abs(z) for z in errors(found).values()) < 4.5
    assert found.status == "valid", found.status_reasons
    said = [reason for reason in found.status_reasons if "rate log" in reason]
    assert said == [
        f"250 of 500 windows of run run {i} lie outside its rate log and are left out"
        for i in range(len(runs))
    ]


def test_a_run_that_the_log_misses_is_left_out_and_all_of_them_are_refused(runs):
    missed = [ended(wave, -1.0) for wave in runs]
    found = identify([*missed[:1], *(ended(wave) for wave in runs[1:])])
    assert found.status == "suspect"
    assert "500 of 500 windows of run run 0" in " ".join(found.status_reasons)
    assert found.run.tolist() == [wave.run_id for wave in runs[1:]]
    for stage in (identify, diagnose, calibrate):
        with pytest.raises(HrgError, match="500 of 500 windows of run run 0 lie outside"):
            stage(missed)


def holed(wave: Wave, begin_s: float, end_s: float) -> Wave:
    """The wave without its rates logged between two times."""
    inside = (wave.time_s >= begin_s) & (wave.time_s < end_s)
    return wave.replace(rate_rad_s=np.where(inside, np.nan, wave.rate_rad_s))


def turning_there(rate: float):
    """A rate that doubles while nobody logs it, from 1.2 to 2 s."""
    return lambda t: rate * (1 + ((np.asarray(t) > 1.22) & (np.asarray(t) < 1.9)))


@pytest.fixture(scope="module")
def interrupted():
    return [
        holed(run_down(theta, turning_there(rate), seed=40 + i, window=8e-3), 1.2, 2.0)
        for i, (theta, rate) in enumerate(CASES)
    ]


def test_identify_keeps_both_sides_of_a_hole_in_the_log(interrupted):
    found = identify(interrupted)
    assert max(abs(z) for z in errors(found).values()) < 4.5
    assert found.status == "valid", found.status_reasons
    assert found.run.tolist() == [f"run {40 + i}" for i in range(4) for _ in range(2)]
    told = "100 of 500 windows of run run 40 lie outside its rate log and are left out; its 2 stretches"
    assert told in " ".join(found.status_reasons)
    one = identify([ended(wave, 1.19) for wave in interrupted])
    for name in ("damping_rate_1_s", "frequency_split_rad_s", "scale_factor"):
        assert found.parameters()[name][1] < 0.9 * one.parameters()[name][1], name


def test_a_rate_is_compared_on_both_sides_of_a_hole_in_the_log(interrupted):
    found = rate(interrupted[1], identify(interrupted))
    hole = (found.time_s > 1.21) & (found.time_s < 1.99)
    assert hole.any() and (np.isnan(found.residual_after_rad_s) == hole).all()


def test_a_stretch_too_short_for_a_run_is_told(interrupted):
    wave = holed(interrupted[1], 2.1, 9.0)
    found = identify([*interrupted[:1], wave])
    said = next(r for r in found.status_reasons if "run run 41" in r)
    assert "350 of 500 windows" in said
    assert "12 of them in stretches of it that are too short for runs" in said


def test_diagnose_keeps_both_sides_of_a_hole_in_the_log(interrupted):
    found = diagnose([w.replace(signal_std=np.full(len(w), 1e-4)) for w in interrupted])
    assert found.verdict == "adequate", found.status_reasons
    names = json.loads(found.run_ids)
    assert sorted(names) == sorted(f"run {40 + i}{more}" for i in range(4) for more in ("", " (2)"))


def test_a_rate_that_is_given_needs_no_log():
    waves = [
        ended(run_down(theta, 0.0, seed=i, window=8e-3), -1.0)
        for i, theta in enumerate((0.0, 0.3, 0.6))
    ]
    found = identify(waves, rate_rad_s=0.0)
    assert not any("rate log" in reason for reason in found.status_reasons)


@pytest.fixture(scope="module")
def turned():
    truth = Truth(4, curved=False)
    waves = [
        forced_run(
            truth,
            20.0,
            lambda t, rate=rate: rate * np.where(np.asarray(t) < 30, 1.0, 0.7),
            40,
            seed,
            run_id=f"r{seed}",
        )
        for seed, rate in enumerate((-0.6, -0.3, 0.3, 0.6))
    ]
    return truth, waves


def test_calibrate_and_compensate_use_no_rate_beyond_the_log(turned):
    truth, waves = turned
    logged = [ended(wave, 29.5) for wave in waves]
    tables = calibrate(logged, harmonics=2, scale_factor_harmonics=1, model="table", bootstrap=0)
    assert sum("windows of run r" in reason for reason in tables.status_reasons) == len(waves)
    angle = np.asarray(tables.wave_angle_rad)
    missed = tables.drift_rad_s[0] - truth.drift(20.0, angle)
    # the last rate held to the run's end makes it some 1e-2 rad/s
    assert np.sqrt(np.mean(missed**2)) < 5e-5
    done = collect(compensate(logged[0], tables))
    known = done.time_s < 29.4
    assert np.isnan(logged[0].rate_rad_s[-1])  # what was logged is left as it was
    assert np.isfinite(done.residual_after_rad_s[known]).all()
    assert np.isnan(done.residual_after_rad_s[done.time_s > 29.6]).all()
    assert np.isfinite(done.rate_estimate_rad_s).all()
    later = done.rate_estimate_rad_s[done.time_s > 30.1].mean()
    assert abs(later + 0.42) < 1e-3
    assert any("of its figures" in reason for reason in done.status_reasons)


def test_calibrate_and_compensate_keep_both_sides_of_a_hole_in_the_log():
    """The table turned by twice as much while nobody logged it; the driven wave's angle is known all
    the time, so its compensated rate is, and the tables are of both sides."""
    truth = Truth(4, curved=False)
    waves = [
        forced_run(
            truth,
            20.0,
            lambda t, rate=rate: rate * (1 + ((np.asarray(t) > 12.1) & (np.asarray(t) < 19.9))),
            40,
            seed,
            run_id=f"r{seed}",
        )
        for seed, rate in enumerate((-0.6, -0.3, 0.3, 0.6))
    ]
    logged = [holed(wave, 12, 20) for wave in waves]
    tables, one = (
        calibrate(w, harmonics=2, scale_factor_harmonics=1, model="table", bootstrap=0)
        for w in (logged, [ended(wave, 50.0, 20.0) for wave in waves])
    )
    missed = tables.drift_rad_s[0] - truth.drift(20.0, np.asarray(tables.wave_angle_rad))
    assert np.sqrt(np.mean(missed**2)) < 5e-5
    own, side = (float(np.mean(t.drift_rad_s_std)) for t in (tables, one))
    assert own < 0.9 * side
    assert sum("its 2 stretches of log" in r for r in tables.status_reasons) == 4
    lost = (logged[3].time_s > 12) & (logged[3].time_s < 20)
    flight = logged[3].replace(flags=np.where(lost, 2, 0).astype("u1"))
    for wave in (logged[3], flight):
        done = collect(compensate(wave, tables))
        error = done.residual_after_rad_s
        known = np.isfinite(error)
        assert known[(done.time_s < 11.9) | (done.time_s > 20.1)].all()
        assert not known[(done.time_s > 12.1) & (done.time_s < 19.9)].any()
        assert np.abs(error[known] / done.rate_estimate_rad_s_std[known]).max() < 5


def noise_alone(seed: int) -> Wave:
    """A wave of which nothing but noise is seen, as estimate refuses it."""
    wave = run_down(0.2, 1.0, seed=seed, amplitude=1e-9, seconds=2.0, window=8e-3)
    return wave.judged([f"run {seed}: 0 of 250 windows are usable"], "refused")


def test_refused_waves_are_left_out_or_refuse_the_result(runs):
    good = [ended(wave) for wave in runs]
    found = identify([*good, noise_alone(9)])
    assert found.status == "suspect"
    assert "the wave of run run 9 is refused and is left out" in found.status_reasons
    assert found.run.tolist() == [wave.run_id for wave in runs]
    refused = [wave.judged(["its wave cannot be trusted"], "refused") for wave in good]
    assert identify(refused).status == "refused"


def test_noise_is_not_called_a_dead_channel():
    found = diagnose([noise_alone(seed) for seed in range(3)])
    assert (found.status, found.verdict) == ("refused", "unexplained")
    assert [reason.split(" (")[0] for reason in found.status_reasons] == [
        f"run {seed}: its wave is refused" for seed in range(3)
    ]


def test_one_dead_channel_is_named_still():
    even = Mechanics(4987.3, 0.31, 0.0, 0.0, 0.0, 0.0, 0.55)
    with pytest.raises(HrgError, match="one channel alone"):
        diagnose([run_down(0.0, mechanics=even, ratio=0.0, seed=1, window=8e-3)])


SAID = "logs no rate, unlike the others, and is taken to be at rest"


def unlogged(runs):
    return [runs[0].replace(rate_rad_s=None, run_id="dumb"), *runs[1:]]


def tell_unlogged(found):
    return [reason for reason in found.status_reasons if "no rate, unlike" in reason]


def test_a_run_that_logs_no_rate_among_others_is_named(turned):
    """It was taken to be at rest without a word, right or wrong."""
    runs = [run_down(0.3 + k, r, seed=k, seconds=2.0) for k, r in enumerate((0.0, 1.0, -1.0))]
    for stage in (identify, diagnose):
        (said,) = tell_unlogged(stage(unlogged(runs)))
        assert f"run dumb {SAID}" in said
    assert not tell_unlogged(identify(runs)) and not tell_unlogged(
        identify([wave.replace(rate_rad_s=None) for wave in runs])
    )
    driven = unlogged(turned[1])
    asked = {"harmonics": 1, "scale_factor_harmonics": 1, "bootstrap": 0}
    with pytest.raises(HrgError, match="no rate log"):  # never at rest for sure
        calibrate(driven, **asked)
    for given in ({"rates_rad_s": {"dumb": -0.6}}, {"rate_rad_s": -0.6}):
        assert not tell_unlogged(calibrate(driven, **asked, **given))


def test_a_run_without_a_log_is_not_told_to_correct_it():
    rates = (0.0, 1.0, -1.4, 0.6)
    runs = [run_down(0.3 + k, r, seed=k, seconds=2.0) for k, r in enumerate(rates)]
    runs[3] = runs[3].replace(rate_rad_s=None, run_id="dumb")
    (said,) = [r for r in identify(runs).status_reasons if "contradict each other" in r]
    assert "leave out dumb" in said and said.endswith("or log its rate (dumb logs none)")
