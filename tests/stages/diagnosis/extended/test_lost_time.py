"""Losses where whole periods are whole numbers of samples, from raw samples: the phase leaves the
count open, the motion through what was lost tells it."""

import functools

import numpy as np
import pytest
from diagnosis_programme import programme
from wrong_runs import estimated, recordings

from hrg_cli.stages.diagnose import diagnose, summarise
from hrg_cli.stages.diagnosis.samples.lost_samples import PhaseStep, count_lost

A_PERIOD = 7.3
"""Samples of a period, so that 73 are ten."""
LOSER, AT = 2, 14_000


@functools.cache
def sampled():
    """Recordings of a programme sampled at that, of which one run is to lose samples."""
    table = programme(9, runs=4)
    table["recording"]["sample_rate_hz"] = A_PERIOD * table["device"]["frequency_hz"]
    return recordings(table, 9)


def without(record, count):
    """The recording less `count` samples, or with as many twice where it is negative."""

    def cut(samples):
        x = np.asarray(samples)
        return np.concatenate([x[:AT], x[AT + count :]])

    return record.replace(c=cut(record.c), s=cut(record.s))


@pytest.mark.parametrize("count", (3, 37, 80, -3, -40, 150))
def test_as_many_samples_are_named_as_the_wave_turned_through(count):
    records = list(sampled())
    records[LOSER] = without(records[LOSER], count)
    out = summarise(diagnose(estimated(records)))
    (found,) = out["effects"]
    lost, step_s = found["parameters"]["lost_s"], 1 / records[LOSER].sample_rate_hz
    assert found["name"] == "dropped_samples" and found["runs"] == ["run2"]
    assert found["samples"] == count and "or_samples" not in found
    assert found["what"] == ("lost" if count > 0 else "repeated")
    assert abs(lost["value"] - count * step_s) < 5 * lost["std"] < 1e-2 * step_s
    if count > 0:
        assert out["verdict"] == "explained", out["checks"]


def test_what_the_motion_does_not_tell_is_said_and_held_by_the_error():
    """A step whose slow motion is known to some ten periods alone."""
    records = sampled()
    wave = estimated([records[LOSER]])[0]
    step_s = 1 / records[LOSER].sample_rate_hz
    frequency = 1 / (A_PERIOD * step_s)
    turn = float(np.angle(np.exp(2j * np.pi * 40 / A_PERIOD)))

    def counted(shift, std):
        step = PhaseStep(0, 24, 25, 0.5, turn, 1e-5, frequency, shift * step_s, std * step_s)
        return count_lost([step], [wave], frequency)

    told, open_ = counted(-33, 3.0), counted(10, 20.0)
    assert told["samples"] == -33 and "or_samples" not in told
    assert (open_["samples"], open_["or_samples"]) == (40, [-33])
    lost = open_["parameters"]["lost_s"]
    assert lost["std"] == pytest.approx(73 * step_s)
