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
    """Component of the Earth's rotation along a gyro's sensitive axis.

    Ω_E (sin φ cos τ + cos φ sin τ cos α): latitude φ, the axis tilted by τ from the vertical
    towards the azimuth α from north.

    Parameters
    ----------
    earth_rate_deg_h
        The component itself, °/h; None: it follows from the latitude.
    latitude_deg
        φ, north positive.
    axis_tilt_deg
        τ, of an axis that points up at 0.
    axis_azimuth_deg
        α, from north through east.

    Returns
    -------
    float
        rad/s; 0 where neither is given.

    Raises
    ------
    HrgError
        Both the component and the latitude, a tilt without a latitude, an impossible latitude.

    Examples
    --------
    An upright axis at 30° north feels half of 15.04 °/h, one that lies north–south cos 30° of it:

    >>> import math
    >>> from hrg_cli.stages.earth_rate import find_earth_rate
    >>> upright, lying = find_earth_rate(None, 30.0), find_earth_rate(None, 30.0, 90.0)
    >>> round(math.degrees(upright) * 3600, 2), round(lying / upright, 4)
    (7.52, 1.7321)
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
    """Component of the Earth's rotation that a stage was told of.

    Parameters
    ----------
    settings
        The stage's, by name; those of `find_earth_rate` are taken, others ignored.

    Returns
    -------
    float
        rad/s; 0 where none of them is given.

    Raises
    ------
    HrgError
        As `find_earth_rate`.

    Examples
    --------
    >>> import math
    >>> from hrg_cli.stages.earth_rate import read_earth_rate
    >>> told = read_earth_rate({"nodes": 5, "earth_rate_deg_h": 7.5, "latitude_deg": None})
    >>> round(math.degrees(told) * 3600, 6)
    7.5
    """
    given = {name: settings[name] for name in OPTIONS if settings.get(name) is not None}
    return find_earth_rate(**given)
