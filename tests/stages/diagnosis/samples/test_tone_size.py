"""Tones that beat a few times in a run: the model of the motion takes a part of them."""

import numpy as np
import pytest
from diagnosis_programme import programme, verdict

PARTS = {"c_cos": 3e-5, "c_sin": -1e-5, "s_cos": 0.5e-5, "s_sin": 1.5e-5}


def diagnose_near_tone(seed, apart_hz, **parts):
    """A tone some tenths of a hertz off in runs of two seconds."""
    table = programme(seed)
    frequency_hz = table["device"]["frequency_hz"] + apart_hz
    table["effects"] = {"mains_tone": parts | {"frequency_hz": frequency_hz}}
    return frequency_hz, verdict(table)[1]


@pytest.mark.parametrize(("apart_hz", "times"), ((-0.9, 1), (0.6, 20), (1.5, 1)))
def test_a_tone_one_to_three_cycles_off_is_named_with_its_size(apart_hz, times):
    """Of a large one the part that the motion's model takes is many σ."""
    parts = {name: times * part for name, part in PARTS.items()}
    frequency_hz, out = diagnose_near_tone(4, apart_hz, **parts)
    assert [one["name"] for one in out["effects"]] == ["mains_tone"]
    assert out["verdict"] == "explained"

    sizes = out["effects"][0]["parameters"]
    off = [(sizes[name]["value"] - true) / sizes[name]["std"] for name, true in parts.items()]
    assert np.max(np.abs(off)) < 4
    assert abs(sizes["frequency_hz"]["value"] - frequency_hz) < 4 * sizes["frequency_hz"]["std"]


def test_a_tone_within_a_cycle_is_not_taken_for_one():
    """What the motion's own model takes nearly all of has no size to be told."""
    _, out = diagnose_near_tone(3, 0.2, c_cos=1e-4, s_sin=5e-5)
    assert "mains_tone" not in [one["name"] for one in out["effects"]]
    assert out["verdict"] != "explained"
