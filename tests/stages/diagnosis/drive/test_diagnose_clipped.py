"""Driven runs whose tops are clipped just under the drive's amplitude."""

import pytest
from diagnosis_programme import programme
from wrong_runs import estimated, recordings

from hrg_cli.stages.diagnose import diagnose, summarise

LEVEL = 0.9985


@pytest.mark.parametrize("seed", (3, 6))
def test_a_clip_just_under_the_driven_amplitude_is_named_alone(seed):
    """A noise of a third of the clip's depth: harmonics of 1e-5 of the wave, where it passes an
    axis. Before, "unexplained" (3), and "explained" by a knock and a gain's step (6)."""
    table = programme(
        seed, {"saturation": {"inverse_level": 1 / LEVEL}}, forced=True, runs=3, noise=5e-4
    )
    table["recording"]["sample_rate_hz"] = 40_009.0
    out = summarise(diagnose(estimated(recordings(table, seed))))
    assert out["verdict"] == "explained"
    (cause,) = out["effects"]
    assert cause["name"] == "saturation"
    found = cause["parameters"]["inverse_level"]
    assert abs(found["value"] - 1 / LEVEL) < 4 * found["std"] < 4 * 3e-4
