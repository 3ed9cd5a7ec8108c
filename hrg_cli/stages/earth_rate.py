"""Earth's rate about a gyro's sensitive axis, from what a laboratory knows: the rate itself, or its
latitude and how the axis stands."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from ..errors import HrgError
from ..physics.environment import EARTH_RATE_RAD_S

EarthRate = Annotated[
    float | None,
    Field(description="Earth's rate about the axis, °/h, which the logged rates leave out"),
]
Latitude = Annotated[
    float | None, Field(description="latitude from which the Earth's rate is taken instead")
]
AxisTilt = Annotated[float, Field(description="tilt of the sensitive axis from the vertical")]
AxisAzimuth = Annotated[float, Field(description="direction of that tilt from north")]
"""Options of the stages that take the Earth's rate into account."""
OPTIONS = ("earth_rate_deg_h", "latitude_deg", "axis_tilt_deg", "axis_azimuth_deg")
"""Their names."""


def find_earth_rate(
    earth_rate_deg_h: float | None = None,
    latitude_deg: float | None = None,
    axis_tilt_deg: float = 0.0,
    axis_azimuth_deg: float = 0.0,
) -> float:
    """Component of the Earth's rotation along the axis, rad/s; 0 where nothing is given.

    Ω_E (sin φ cos τ + cos φ sin τ cos α): latitude φ (north positive), the axis tilted by τ from
    the vertical (up positive) towards the azimuth α from north. HrgError: both the rate and the
    latitude, a tilt without a latitude, an impossible latitude.
    """
    if earth_rate_deg_h is not None and latitude_deg is not None:
        raise HrgError(
            "earth_rate_deg_h and latitude_deg are both given, one was expected: the first is the"
            " rate about the axis itself"
        )
    if latitude_deg is None:
        if axis_tilt_deg or axis_azimuth_deg:
            raise HrgError(
                "axis_tilt_deg and axis_azimuth_deg turn the Earth's rate at a latitude, and none"
                " is given; add latitude_deg"
            )
        return 0.0 if earth_rate_deg_h is None else float(np.radians(earth_rate_deg_h)) / 3600
    if not -90 <= latitude_deg <= 90:
        raise HrgError(
            f"latitude_deg = {latitude_deg:g}, −90 to 90 was expected; south is negative"
        )
    latitude, tilt, azimuth = np.radians([latitude_deg, axis_tilt_deg, axis_azimuth_deg])
    return float(
        EARTH_RATE_RAD_S
        * (np.sin(latitude) * np.cos(tilt) + np.cos(latitude) * np.sin(tilt) * np.cos(azimuth))
    )


def read_earth_rate(settings: Mapping[str, Any]) -> float:
    """The same from a stage's settings, rad/s."""
    given = {name: settings[name] for name in OPTIONS if settings.get(name) is not None}
    return find_earth_rate(**given)
