"""Multiples of the oscillation that the sampling and the windows' own rate fold beside it: none of
them is a tone from outside, and a tone that stands at such a place is one."""

import numpy as np
import pytest
from diagnosis_programme import programme, waves

from hrg_cli.stages.diagnose import diagnose, summarise

OFF_HZ = -86.0
"""Distance from the oscillation at which the sampling folds its third harmonic: more than half the
windows' rate of 120 to 130 Hz, which folds it again to some 40 Hz above."""


def folded(runs, off_hz=OFF_HZ):
    """A programme whose third harmonic the sampling folds so far beside it; its windows' rate."""
    table = programme(1, runs=runs)
    frequency_hz = table["device"]["frequency_hz"]
    sampling_hz = float(round(4 * frequency_hz + off_hz))
    table["recording"]["sample_rate_hz"] = sampling_hz
    return table, sampling_hz / round(40 * sampling_hz / frequency_hz)


def test_a_harmonic_folded_by_the_windows_is_the_pick_off_s():
    """Too weak to be a line of the samples' spectrum, it was a `mains_tone` of 11 σ beside the cubic,
    and all checks passed."""
    cubic = 3.4e-4
    table, _ = folded(runs=6)
    table["effects"] = {"pickoff_nonlinearity": {"cubic": cubic}}
    out = summarise(diagnose(waves(table)))
    assert [e["name"] for e in out["effects"]] == ["pickoff_nonlinearity"]
    assert out["verdict"] == "explained", out["checks"]
    found = out["effects"][0]["parameters"]["cubic"]
    assert abs(found["value"] - cubic) < 4 * found["std"]
    third = next(line for line in out["lines"] if "windows' rate" in line["meaning"])
    place_hz = table["device"]["frequency_hz"] + OFF_HZ
    assert third["multiple"] == 3 and abs(third["frequency_hz"] - place_hz) < 2.0


@pytest.mark.parametrize("off_hz, once_more", [(OFF_HZ, 1), (30.0, 0), (5.0, 0)])
def test_a_tone_where_a_harmonic_would_be_seen_is_a_tone(off_hz, once_more):
    """Fourteen σ: the runs' phases and sizes tell it apart. Where the sampling alone folds the third
    harmonic it was taken for a pick-off's cubic, "explained"."""
    table, rate_hz = folded(runs=4, off_hz=off_hz)
    tone_hz = table["device"]["frequency_hz"] + off_hz + once_more * rate_hz
    size = 14 * 3e-4 * np.sqrt(2 / (2.0 * 2e4) / 4)
    table["effects"] = {
        "mains_tone": {"frequency_hz": tone_hz, "c_cos": 0.8 * size, "s_sin": 0.6 * size}
    }
    out = summarise(diagnose(waves(table)))
    assert [e["name"] for e in out["effects"]] == ["mains_tone"]
    assert out["verdict"] == "explained", out["checks"]
    assert abs(out["effects"][0]["parameters"]["frequency_hz"]["value"] - tone_hz) < 0.6
