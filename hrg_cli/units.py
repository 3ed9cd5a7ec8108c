"""Units: the spelling kept in files, the spellings accepted from laboratories, and the factors for
a person's screen."""

import math

CANONICAL = {
    "1": ("1", "", "dimensionless", "-"),
    "s": ("s", "sec", "second", "seconds"),
    "Hz": ("Hz", "hertz", "1/s (cycles)"),
    "rad": ("rad", "radian", "radians"),
    "rad s-1": ("rad s-1", "rad/s", "rad s^-1", "rad*s-1", "rad.s-1"),
    "s-1": ("s-1", "1/s", "s^-1"),
    "degC": ("degC", "°C", "celsius", "deg_C", "degrees_celsius"),
}
"""Unit as the files spell it -> the spellings accepted on reading."""

_SPELLING = {spelling: unit for unit, spellings in CANONICAL.items() for spelling in spellings}

DEGREE = math.pi / 180
DEGREE_PER_HOUR = DEGREE / 3600
"""One °/h in rad/s."""
EARTH_RATE_RAD_S = 7.292115e-5
"""Rotation of the Earth against the stars, rad/s (15.041 °/h)."""
ZERO_KELVIN_DEGC = -273.15
"""Below it there is no temperature."""
KELVIN_DEGC = 150.0
"""Temperature that no gyro has in °C and every gyro has in K."""
RATE_UNITS = {"°/s": DEGREE, "°/h": DEGREE_PER_HOUR, "mrad/s": 1e-3, "1/min": 2 * math.pi / 60}
"""Units that a rate log may come in for rad/s -> their size in rad/s."""


def to_file_unit(unit: str) -> str:
    """The spelling of a unit that files use.

    Parameters
    ----------
    unit
        As a laboratory spells it.

    Returns
    -------
    str
        One of `CANONICAL`; an unknown unit as it is.

    Examples
    --------
    >>> from hrg_cli.units import to_file_unit
    >>> to_file_unit("rad/s"), to_file_unit(" furlong ")
    ('rad s-1', 'furlong')
    """
    return _SPELLING.get(unit.strip(), unit.strip())


def round_down(value: float, digits: int = 2) -> float:
    """A number to so many digits, never above it: what is told as the most that will do has to do.

    Parameters
    ----------
    value
        Positive.
    digits
        That are left of it.

    Returns
    -------
    float
        At most `value`.

    Examples
    --------
    >>> from hrg_cli.units import round_down
    >>> round_down(0.0196), round_down(0.02), round_down(1234.0)
    (0.019, 0.02, 1200.0)
    """
    near = float(f"{value:.{digits}g}")
    if near <= value:
        return near
    power = math.floor(math.log10(value)) - digits + 1
    return float(f"{math.floor(value / 10.0**power) * 10.0**power:.{digits}g}")


TRADE = {
    "rad_s_sqrt_s": (DEGREE / 3600 / 60, "°/h/√h"),
    "rad_sqrt_s": (DEGREE / 60, "°/√h"),
    "rad_s": (DEGREE_PER_HOUR, "°/h"),
    "rad": (DEGREE / 3600, "″"),
}
"""Unit at the end of a figure's name -> its size in SI units in the trade's, and that unit's name,
the longest end first."""


def to_trade(name: str, value: float) -> tuple[str, float, str]:
    """A figure in the trade's unit.

    Parameters
    ----------
    name
        Of the figure, which ends in its SI unit.
    value
        In that unit.

    Returns
    -------
    tuple
        The name in words, the value, the trade's unit; the unit is empty where the trade has none
        of its own.

    Examples
    --------
    >>> from hrg_cli.units import to_trade
    >>> name, value, unit = to_trade("angle_random_walk_rad_sqrt_s", 1e-6)
    >>> name, round(value, 6), unit
    ('angle random walk', 0.003438, '°/√h')
    """
    for end, (size, unit) in TRADE.items():
        if name.endswith("_" + end):
            return name.removesuffix("_" + end).replace("_", " "), value / size, unit
    return name.replace("_", " "), value, ""


def to_deg_per_hour(rate_rad_s: float) -> float:
    """A rate in °/h, for people.

    Parameters
    ----------
    rate_rad_s
        [rad/s]

    Returns
    -------
    float
        [°/h]

    Examples
    --------
    >>> from hrg_cli.units import EARTH_RATE_RAD_S, to_deg_per_hour
    >>> round(to_deg_per_hour(EARTH_RATE_RAD_S), 3)
    15.041
    """
    return rate_rad_s / DEGREE_PER_HOUR
