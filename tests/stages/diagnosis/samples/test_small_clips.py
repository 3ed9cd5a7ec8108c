"""A clip of some σ of an ideal detector: two or three windows at the very top of one run."""

import zlib

import numpy as np
import pytest

from hrg_cli.effects.saturation import compute_kept, list_levels
from hrg_cli.stages.diagnose import diagnose, summarise
from hrg_cli.studies.hidden import hide


class Runs:
    """A wave that has decayed by half in 500 rows."""

    envelope = 0.5 ** np.linspace(0, 1, 500)[None, :, None] * np.array([1.0, 0.1])
    weight = np.ones((1, 500))


@pytest.mark.parametrize("depth", [2e-3, 6e-3, 2e-2, 6e-2, 0.2])
def test_one_of_the_levels_has_the_shape_of_any(depth):
    amplitude = Runs.envelope[0, :, 0]
    t = np.linspace(-1, 1, len(amplitude))
    basis, _ = np.linalg.qr(np.stack([amplitude, t * amplitude], axis=1))

    def shape(inverse_level):
        change = amplitude * (compute_kept(amplitude, inverse_level) - 1)
        left = change - basis @ (basis.T @ change)
        return left / np.linalg.norm(left)

    true = shape(1 / (1 - depth))
    levels = [start["inverse_level"] for start in list_levels(Runs())]
    assert max((shape(level) @ true) ** 2 for level in levels) > 0.8


@pytest.mark.parametrize("seed", [9173, 77])
def test_a_clip_of_few_windows_is_named_at_its_level(seed):
    random = np.random.default_rng([seed, 0, zlib.crc32(b"saturation")])
    first = int(random.integers(2**31))
    hidden = hide("saturation", random, 3e-4)
    report = summarise(diagnose(hidden.measure(6.5, first)))
    assert [cause["name"] for cause in report["effects"]] == ["saturation"]
    assert report["verdict"] == "explained"
    level = report["effects"][0]["parameters"]["inverse_level"]
    assert abs(level["value"] - hidden.choose_values(6.5)["inverse_level"]) < 4 * level["std"]
