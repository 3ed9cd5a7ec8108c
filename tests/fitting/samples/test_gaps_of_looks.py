"""Windows beside a gap: their frequency and their motion are told by what stands together."""

import numpy as np
import pytest

from hrg_cli.records import collect
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.estimate import estimate
from hrg_cli.stages.simulate import simulate

LONG_S, SHORT_S = ((0.5, 3.0), (17.2, 19.9)), ((9.3, 9.9), (15.0, 19.0))
SEEN = ("main_amplitude", "quadrature_amplitude", "wave_angle_rad")


def demodulate_run(rate_rad_s, gaps_s):
    """A run-down of 20 s, without the samples of its gaps."""
    table = {
        "device": {
            "frequency_hz": 503.7,
            "damping_rate_1_s": 0.05,
            "damping_split_1_s": 0.001,
            "damping_axis_rad": 0.21,
            "frequency_split_hz": 0.005,
            "stiffness_axis_rad": 0.576,
            "scale_factor": 0.554,
        },
        "recording": {"sample_rate_hz": 5000.0, "duration_s": 20.0},
        "readout": {"noise": 1e-4},
        "start": {"wave_angle_rad": 1.25, "phase_rad": 3.0},
        "environment": {"rate_rad_s": rate_rad_s},
    }
    record = collect(simulate(table, seed=4))
    time_s = np.arange(len(record.c)) / record.sample_rate_hz
    kept = np.ones(len(time_s), bool)
    for begin, end in gaps_s:
        kept &= (time_s < begin) | (time_s > end)
    record = record.replace(c=record.c[kept], s=record.s[kept], time_s=time_s[kept])
    return collect(estimate(collect(demodulate(record, periods_per_window=50.0))))


@pytest.mark.parametrize(("rate_rad_s", "gaps_s"), ((-0.3, LONG_S), (0.0, SHORT_S)))
def test_whole_windows_beside_gaps_are_those_of_a_run_without(rate_rad_s, gaps_s):
    """The same samples in both: what the gaps change is a small part of the noise. The parts of a
    look on either side of the short one are in step 1.4 Hz beside the oscillation."""
    whole, gapped = (demodulate_run(rate_rad_s, gaps) for gaps in ((), gaps_s))
    full = np.isfinite(gapped.main_amplitude) & (gapped.flags == 0)
    assert full.sum() > 110
    for name in SEEN:
        beside = np.interp(gapped.time_s, whole.time_s, getattr(whole, name))
        off = (getattr(gapped, name) - beside) / getattr(gapped, f"{name}_std")
        assert np.abs(off[full]).max() < 1, name
