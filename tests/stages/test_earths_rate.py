"""Earth's rate about an axis against the Earth turned: where the axis points in space at two
instants, no formula of latitude and tilt."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from hrg_cli.stages.earth_rate import find_earth_rate

SIDEREAL_DAY_S = 86164.0905


def case_in_space(latitude, longitude, tilt, azimuth, seconds):
    """Attitude in space of a case whose z axis is the sensitive one: level with z up, x north at a
    place on a sphere that turns eastward about the poles, then tilted towards an azimuth."""
    up = Rotation.from_euler(
        "ZY", [longitude, 90 - latitude], degrees=True
    )  # z up, x south, y east
    north = Rotation.from_euler("z", 180, degrees=True)  # x north, y west
    towards = Rotation.from_euler("z", -azimuth, degrees=True)  # clockwise from above: to the east
    tilted = Rotation.from_euler("y", tilt, degrees=True)
    earth = Rotation.from_rotvec([0, 0, 2 * np.pi * seconds / SIDEREAL_DAY_S])
    return earth * up * north * towards * tilted


@pytest.mark.parametrize(
    "place",
    [
        (50, 0, 0),
        (0, 90, 0),
        (0, 90, 180),
        (48, 30, 90),
        (-33, 70, 25),
        (65, -20, 200),
        (90, 40, 10),
    ],
)
def test_earths_rate_is_how_fast_the_case_turns_about_its_axis(place):
    latitude, tilt, azimuth = place
    before, after = (case_in_space(latitude, 30.0, tilt, azimuth, s) for s in (-30.0, 30.0))
    in_case = (before.inv() * after).as_rotvec() / 60.0
    told = find_earth_rate(None, latitude, tilt, azimuth)
    assert told == pytest.approx(in_case[2], abs=1e-6 * 2 * np.pi / SIDEREAL_DAY_S)
    assert np.linalg.norm(in_case) == pytest.approx(2 * np.pi / SIDEREAL_DAY_S, rel=1e-9)
