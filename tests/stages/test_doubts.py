"""A result is no surer than what it was made of, called from Python too."""

import numpy as np
import pytest
from elliptic_runs import resonator_of, tempered
from forced_runs import wave_of
from synthetic_waves import programme, run_down

from hrg_cli import calibrate, diagnose, identify
from hrg_cli.records import list_doubts
from hrg_cli.stages.rate import rate

WHY = "the screws were loose"
RUNS = ((0.0, 0.0), (0.3, 2.0), (0.6, -2.0))


def doubted(waves):
    return [waves[0], waves[1].judged([WHY]), *waves[2:]]


def forced():
    t = np.arange(0.0, 60.0, 0.05)
    return [
        wave_of(
            t,
            0.1 - 0.55 * r * t / 2 + 1e-5 * np.random.default_rng(k).standard_normal(len(t)),
            np.full(len(t), 20.0),
            np.full(len(t), r),
            1e-5,
            f"run {k}",
        )
        for k, r in enumerate((-0.6, -0.3, 0.3, 0.6))
    ]


@pytest.mark.parametrize(
    ("stage", "made"),
    [
        (identify, lambda: programme(runs=RUNS, seconds=2.0)),
        (lambda waves: diagnose(waves, most_effects=0), lambda: programme(runs=RUNS, seconds=1.0)),
        (lambda waves: calibrate(waves, harmonics=1, model="table"), forced),
    ],
    ids=["identify", "diagnose", "calibrate"],
)
def test_a_suspect_run_makes_the_result_suspect_and_changes_no_number(stage, made):
    waves = made()
    clean, result = stage(waves), stage(doubted(waves))
    said = f"the wave of run {waves[1].run_id} is suspect: {WHY}"
    assert result.status == "suspect" and said in result.status_reasons
    assert said not in clean.status_reasons
    assert [r for r in result.status_reasons if r != said] == list(clean.status_reasons)


def test_a_rate_is_no_surer_than_its_run_and_its_resonator():
    runs = programme(runs=RUNS, seconds=2.0)
    resonator = identify(runs)
    wave = run_down(0.2, 1.0, seed=50, seconds=2.0)
    clean = rate(wave, resonator, nodes=5)
    assert clean.status == "valid", clean.status_reasons
    by_wave = rate(wave.judged([WHY]), resonator, nodes=5)
    by_resonator = rate(wave, resonator.judged([WHY]), nodes=5)
    assert by_wave.status == by_resonator.status == "suspect"
    assert by_wave.status_reasons == (f"the wave of run run 50 is suspect: {WHY}",)
    assert by_resonator.status_reasons == (f"the resonator is suspect: {WHY}",)
    assert np.array_equal(clean.rate_estimate_rad_s, by_resonator.rate_estimate_rad_s)


def test_physical_tables_are_no_surer_than_their_resonator():
    from elliptic_runs import elliptic_run

    device = tempered(20.0)
    waves = [
        elliptic_run(device, 20.0, r, start, 0.01, f"r{k}", seed=k)
        for k, (r, start) in enumerate(((0.3, 0.1), (-0.3, 0.4), (0.5, 0.8), (-0.5, 1.2)))
    ]
    found = resonator_of(device, 20.0, 2e-3)
    clean = calibrate(waves, found, model="physical", bootstrap=0)
    result = calibrate(waves, found.judged([WHY]), model="physical", bootstrap=0)
    said = f"the resonator is suspect: {WHY}"
    assert said in result.status_reasons and result.status == "suspect"
    assert said not in clean.status_reasons
    table = calibrate(waves, found.judged([WHY]), model="table", bootstrap=0)
    assert said not in table.status_reasons, "nothing of the resonator is in it"


def test_many_doubts_are_counted():
    runs = [(f"{k}.h5", run_down(0.1, seconds=0.1, seed=k).judged([WHY])) for k in range(9)]
    told = list_doubts(runs)
    assert len(told) == 7 and told[-1] == "3 more inputs are suspect or refused"
