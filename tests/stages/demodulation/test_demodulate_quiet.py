"""Samples without noise need no search for lines, ends and colour: the same envelopes without it."""

import time

import numpy as np
import pytest

from hrg_cli.fitting.samples.demodulator import MOVING_PERIODS
from hrg_cli.records import collect
from hrg_cli.stages.demodulate import demodulate, demodulate_quiet
from hrg_cli.stages.simulate import simulate

EFFECTS = {
    "steady": {},
    "cubic": {"cubic_stiffness": {"pull_rad_s": 20.0}},
    "third harmonic": {"pickoff_nonlinearity": {"cubic": 0.02}},
}


def samples(effects, duration_s=1.5):
    config = {
        "device": {
            "frequency_hz": 2000.0, "damping_rate_1_s": 0.4, "frequency_split_rad_s": 3.0,
            "stiffness_axis_rad": 0.4,
        },
        "effects": effects,
        "readout": {"noise": 0.0},
        "recording": {"sample_rate_hz": 20_000.0, "duration_s": duration_s},
        "run": [{"run_id": "a", "environment": {"rate_rad_s": 1.0}}],
    }  # fmt: skip
    return collect(simulate(config))


@pytest.mark.parametrize("kind", EFFECTS)
def test_the_envelopes_are_those_of_the_whole_demodulation(kind):
    """Also where the frequency moves by 20 rad/s while the wave decays."""
    recording = samples(EFFECTS[kind])
    whole, quiet = (
        collect(how(recording, periods_per_window=MOVING_PERIODS))
        for how in (demodulate, demodulate_quiet)
    )
    np.testing.assert_array_equal(quiet.time_s, whole.time_s)
    t = np.asarray(whole.time_s)

    def envelopes(periods):
        turn = np.exp(2j * np.pi * (periods.reference_frequency_hz - 2000.0) * t)[:, None]
        return (periods.signals[:, ::2] - 1j * periods.signals[:, 1::2]) * turn

    worst = np.abs(envelopes(quiet) - envelopes(whole)).max()
    assert worst < 1e-6 * np.abs(envelopes(whole)).max()


def test_it_takes_less_than_half_the_time():
    recording, spent = samples({}, 8.0), []
    for how in (demodulate, demodulate_quiet):
        started = time.process_time()
        collect(how(recording, periods_per_window=MOVING_PERIODS))
        spent.append(time.process_time() - started)
    assert spent[1] < 0.5 * spent[0]
