"""A run that does not belong to the others is named, before a fault of the gyro is blamed for it."""

import numpy as np
import pytest
from forced_runs import Truth, forced_run, programme

from hrg_cli.stages.calibrate import calibrate, summarise
from hrg_cli.stages.one_gyro import find_two_gyros

PLAN = {"temperatures": (-20, 20, 60), "rates": (0.3, -0.3, 0.15, -0.15), "duration": 30.0}
ODD = 5
"""Number of the run that is wrong: at 20 °C and -0.3 rad/s."""
OTHERS = [k for k in range(12) if k != ODD]


def runs(seed=3):
    return programme(Truth(seed), **PLAN, noise=1e-6, seed=seed)


def calibrated(waves, **more):
    return calibrate(waves, bootstrap=0, **more)


def test_a_run_at_a_frequency_that_no_temperature_makes_gives_no_tables():
    """It was a phase error of the quadrature loop, and the ladder had a drive turned by 3500 σ."""
    waves = runs()
    waves[ODD] = waves[ODD].replace(frequency_hz=2600.0 + 0 * waves[ODD].frequency_hz)
    record = calibrated(waves, ladder=True)
    assert record.status == "refused"
    (said,) = record.status_reasons
    assert f"{waves[ODD].run_id} at 2600 Hz" in said and "(11 in all) at 5" in said
    assert "final_analysis" not in record.details


@pytest.mark.parametrize(
    ("hz", "apart"),
    [
        ((500.0, 500.0 * (1 + 85e-6 * 150)), False),
        ((500.0, 515.0), True),
        ((np.nan, 500.0), False),
        ((np.nan, 500.0, 2600.0), True),
    ],
)
def test_a_gap_among_frequencies_is_one_where_no_temperature_makes_it(hz, apart):
    assert (find_two_gyros([f"r{k}" for k in range(len(hz))], np.array(hz)) is not None) is apart


def wrong_sign(waves):
    return waves[ODD].replace(rate_rad_s=-waves[ODD].rate_rad_s)


def neighbour(_):
    return forced_run(Truth(4), 20, -0.3, 30.0, 77, noise=1e-6, run_id="T20 R-0.3")


@pytest.mark.parametrize(("change", "shown"), [(wrong_sign, -0.3), (neighbour, -0.3)])
def test_a_run_that_the_others_contradict_is_named_alone(change, shown):
    """Of either "a cause is missing" was said, or a drift that moves with the rate."""
    waves = runs()
    waves[ODD] = change(waves)
    record = calibrated(waves)
    assert record.status == "refused"
    (said,) = record.status_reasons
    assert said.startswith(f"run {waves[ODD].run_id} contradicts the other 11,")
    turned, logged = (
        float(said.split(start)[1].split()[0]) for start in ("its wave turns as at ", " rad/s, ")
    )
    # of the drift of another gyro some thousandths of a rad/s are left
    assert turned == pytest.approx(shown, abs=5e-3)
    assert logged == pytest.approx(float(np.mean(waves[ODD].rate_rad_s)), rel=1e-5)
    alone = calibrated([waves[k] for k in OTHERS])
    assert alone.status == "valid"


def test_a_wrong_run_without_a_log_that_the_others_have_is_named():
    """Of a factor that only the others have their answer says nothing of this run."""
    waves = [
        wave.replace(
            drive_main=1e-3 + 1e-5 * np.sin(wave.time_s),
            drive_quadrature=1e-6 * np.cos(wave.time_s),
        )
        for wave in runs()
    ]
    waves[ODD] = wrong_sign(waves).replace(drive_main=None, drive_quadrature=None)
    (said,) = calibrated(waves).status_reasons
    assert said.startswith(f"run {waves[ODD].run_id} contradicts the other 11,")


@pytest.mark.parametrize("rates", [(0.3, -0.3), (0.3, -0.3, 0.02)])
def test_where_any_run_may_be_the_wrong_one_none_is_named(rates):
    """Without a run two are left, which agree whatever they are, or a programme that gives no
    table."""
    waves = programme(Truth(3), (20,), rates, duration=30.0, noise=1e-6)
    waves[0] = waves[0].replace(rate_rad_s=1.2 * waves[0].rate_rad_s)
    assert not any("contradicts" in reason for reason in calibrated(waves).status_reasons)


def test_a_cause_that_every_run_shows_accuses_none():
    """A scale factor that grows with the square of the rate, in all runs."""
    waves = [
        wave.replace(rate_rad_s=wave.rate_rad_s * (1 + 0.02 * wave.rate_rad_s**2))
        for wave in runs()
    ]
    record = calibrated(waves)
    assert record.status == "suspect"
    assert not any("contradicts" in reason for reason in record.status_reasons)


def test_small_offsets_of_every_log_accuse_none():
    """10 µrad/s each: five of six runs agree by chance within the walk that they then show."""
    rates = (-0.5, -0.25, -0.1, 0.1, 0.25, 1.0)
    waves = [
        wave.replace(rate_rad_s=wave.rate_rad_s + 1e-5 * np.random.default_rng([0, k]).normal())
        for k, wave in enumerate(programme(Truth(0), (20,), rates, duration=25.0, noise=1e-6))
    ]
    record = calibrated(waves)
    assert record.status == "suspect"
    assert not any("contradicts" in reason for reason in record.status_reasons)


@pytest.mark.parametrize("seed", range(3))
def test_clean_runs_accuse_none(seed):
    record = calibrated(runs(seed))
    assert record.status == "valid"
    assert not any("contradicts" in reason for reason in record.status_reasons)


THREE = {"temperatures": (-20, 20, 60), "rates": (0.3, -0.3, 0.15), "duration": 30.0}
WRONG = 4
"""Number of the run that is wrong of three at each temperature: at 20 °C and -0.3 rad/s."""


def three_a_dwell(seed=3, **more):
    return programme(Truth(seed), **{**THREE, **more}, noise=1e-6, seed=seed)


def times(factor):
    return lambda wave: wave.replace(rate_rad_s=factor * wave.rate_rad_s)


def silent_s(wave):
    """Only C is measured: the angle is its sign, and the amplitude swings with it."""
    c = np.cos(2 * wave.wave_angle_rad)
    noise = 1e-6 * np.random.default_rng(1).normal(size=len(c))
    return wave.replace(main_amplitude=np.abs(c) + 1e-6, wave_angle_rad=np.pi / 2 * (c < 0) + noise)


def inverted(wave):
    return wave.replace(wave_angle_rad=-wave.wave_angle_rad)


def exchanged(wave):
    return wave.replace(wave_angle_rad=np.pi / 4 - wave.wave_angle_rad)


WRONGS = [
    (times(180 / np.pi), "rate log in °/s"),
    (times(180 / np.pi * 3600), "rate log in °/h"),
    (times(-1.0), "rate log of wrong sign"),
    (times(0.0), "not as they predict"),
    (inverted, "one channel inverted"),
    (exchanged, "channels exchanged"),
    (silent_s, "channel S silent"),
]


@pytest.mark.parametrize(("change", "what"), WRONGS)
def test_a_gross_mistake_of_one_of_three_runs_a_dwell_is_named_with_its_cause(change, what):
    """Any of the three fits without one: a drift that moves with the rate was told, and to add dwells."""
    waves = three_a_dwell()
    waves[WRONG] = change(waves[WRONG])
    record = calibrated(waves)
    assert record.status == "refused"
    (said,) = record.status_reasons
    assert said.startswith(f"run {waves[WRONG].run_id} contradicts the other 8, which agree")
    (told,) = summarise(record)["suspect_runs"]
    assert (told["run_id"], told["what"]) == (waves[WRONG].run_id, what)
    assert "its wave turns as at" in told["evidence"]


def test_two_runs_a_dwell_do_not_hide_a_wrong_one():
    """They fit exactly, whatever they are: a channel inverted in one gave valid tables, 9 °/s off."""
    waves = three_a_dwell(rates=(0.3, -0.3))
    waves[3] = inverted(waves[3])
    record = calibrated(waves)
    assert record.status == "refused"
    (told,) = summarise(record)["suspect_runs"]
    assert (told["run_id"], told["what"]) == (waves[3].run_id, "one channel inverted")


def test_a_wrong_run_among_those_of_one_name_is_told_by_its_number():
    """It was "run x", as all of them were."""
    waves = [wave.replace(run_id="x") for wave in three_a_dwell()]
    waves[WRONG] = inverted(waves[WRONG])
    record = calibrated(waves)
    assert record.status == "refused"
    (told,) = summarise(record)["suspect_runs"]
    assert (told["run_id"], told["what"]) == (f"x ({WRONG + 1})", "one channel inverted")


def test_several_wrong_runs_are_named_each_with_its_own_cause():
    waves = three_a_dwell()
    waves[3], waves[8] = inverted(waves[3]), times(180 / np.pi)(waves[8])
    told = summarise(calibrated(waves))["suspect_runs"]
    assert [(one["run_id"], one["what"]) for one in told] == [
        (waves[3].run_id, "one channel inverted"),
        (waves[8].run_id, "rate log in °/s"),
    ]


def oscillating(waves, hz_per_degc=0.45):
    """The runs with the frequency of their temperature."""
    return [
        wave.replace(frequency_hz=5000.0 + hz_per_degc * (wave.temperature_degc - 20))
        for wave in waves
    ]


def test_a_dwell_logged_at_another_one_is_told_by_its_frequency():
    """Three runs at 40 °C that are logged at 20 °C showed "a phase error of the quadrature loop"."""
    waves = oscillating(three_a_dwell(temperatures=(-20, 20, 40, 60)))
    wrong = [6, 7, 8]
    for k in wrong:
        waves[k] = waves[k].replace(temperature_degc=0 * waves[k].temperature_degc + 20)
    record = calibrated(waves)
    assert record.status == "refused"
    told = summarise(record)["suspect_runs"]
    assert [one["run_id"] for one in told] == [waves[k].run_id for k in wrong]
    assert {one["what"] for one in told} == {"thermometer wrong"}
    assert all("at 5009 Hz, theirs at 40 °C" in one["evidence"] for one in told)


def test_a_neighbour_of_another_frequency_is_told_as_another_gyro():
    waves = oscillating(three_a_dwell())
    other = oscillating([forced_run(Truth(4), 20, -0.3, 30.0, 77, noise=1e-6)])[0]
    waves[WRONG] = other.replace(frequency_hz=other.frequency_hz + 5, run_id="b")
    (told,) = summarise(calibrated(waves))["suspect_runs"]
    assert told["run_id"] == "b"
    assert told["what"].startswith("another gyro's run")


def test_a_wave_locked_at_a_low_rate_is_no_wrong_turn():
    """It stands while a rate is logged, as the drift of the others says it must."""
    truth = Truth(3, drift=1e-2)
    waves = programme(truth, (-20, 20, 60), (0.3, -0.3, 0.02, 0.15), duration=30.0, noise=1e-6)
    assert "suspect_runs" not in summarise(calibrated(waves))


@pytest.mark.parametrize("factor", [1.001, 1.1, 0.9])
@pytest.mark.parametrize("odd", [3, 4, 5])
def test_a_small_mistake_of_one_of_three_runs_is_told_by_the_scale_factor_of_other_dwells(
    factor, odd
):
    """Any of the three fits without one, but K is the same at all temperatures; loops were blamed."""
    waves = three_a_dwell()
    waves[odd] = times(factor)(waves[odd])
    record = calibrated(waves)
    assert record.status == "refused"
    assert [one["run_id"] for one in summarise(record)["suspect_runs"]] == [waves[odd].run_id]


def test_a_log_of_zeros_at_a_single_temperature_is_told_by_what_a_scale_factor_may_be():
    """Without another of the three K is twice that of any resonator."""
    waves = three_a_dwell(temperatures=(20,))
    waves[1] = times(0.0)(waves[1])
    record = calibrated(waves)
    assert record.status == "refused"
    assert [one["run_id"] for one in summarise(record)["suspect_runs"]] == [waves[1].run_id]


@pytest.mark.parametrize(
    ("factor", "said"),
    [
        (180 / np.pi, "with the rate log in °/s it is 0.55"),
        (180 / np.pi * 3600, "with the rate log in °/h it is 0.55"),
        (30 / np.pi, "with the rate log in 1/min it is 0.55"),
        (np.pi / 180, "with the rate log in rad/s, read as °/s it is 0.55"),
        (-1.0, "check the sign and the unit"),
    ],
)
def test_logs_that_all_have_another_unit_or_sign_give_no_scale_factor_of_a_resonator(factor, said):
    """They agree among themselves: K = 0.0096 was "valid"."""
    record = calibrated([times(factor)(wave) for wave in three_a_dwell()])
    assert record.status == "suspect"
    assert any(said in reason for reason in record.status_reasons)


@pytest.mark.parametrize(
    ("temperatures", "factor"),
    [((-20, 20, 60), 1.1), ((20, 60), 1.03), (range(-40, 81, 30), 1.005)],
)
def test_a_dwell_of_two_runs_whose_scale_factor_is_another_is_doubted(temperatures, factor):
    """Two runs fit exactly, whatever they are; K at their temperature was 4.8 % off, "valid"."""
    waves = three_a_dwell(temperatures=temperatures, rates=(0.3, -0.3))
    waves[1] = times(factor)(waves[1])
    record = calibrated(waves)
    assert record.status == "suspect"
    assert any(
        f"at {temperatures[0]:.4g} °C" in reason and "the course of the others (0.55" in reason
        for reason in record.status_reasons
    )
