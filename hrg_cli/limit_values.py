"""A limit as a person writes it ("5 deg/h", "200 ppm", 0.6) in the unit of the figure it limits."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable
from typing import Any

from .errors import UsageError
from .units import DEGREE, DEGREE_PER_HOUR

QUANTITIES: dict[str, dict[str, float]] = {
    "a rate": {
        "rad/s": 1.0, "mrad/s": 1e-3, "deg/s": DEGREE, "°/s": DEGREE, "deg/h": DEGREE_PER_HOUR, "deg/hr": DEGREE_PER_HOUR,
        "°/h": DEGREE_PER_HOUR, "rpm": 2 * math.pi / 60,
    },
    "an angle": {"rad": 1.0, "mrad": 1e-3, "urad": 1e-6, "µrad": 1e-6, "deg": DEGREE, "°": DEGREE, "arcsec": DEGREE / 3600},
    "a frequency": {"Hz": 1.0, "mHz": 1e-3, "uHz": 1e-6, "µHz": 1e-6, "kHz": 1e3},
    "a time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "min": 60.0, "h": 3600.0},
    "a decay rate": {"1/s": 1.0, "1/h": 1 / 3600, "rad/s": 1.0, "deg/s": DEGREE, "deg/h": DEGREE_PER_HOUR, "°/h": DEGREE_PER_HOUR},
    "a temperature": {"degC": 1.0, "°C": 1.0},
    "a ratio": {"": 1.0, "1": 1.0, "%": 1e-2, "ppm": 1e-6, "ppb": 1e-9},
}  # fmt: skip
SUFFIXES = (
    ("_rad_s", "a rate"),
    ("_1_s", "a decay rate"),
    ("_deg_h", "a rate in °/h"),
    ("_ppm", "a ratio in ppm"),
    ("_rad", "an angle"),
    ("_hz", "a frequency"),
    ("_degc", "a temperature"),
    ("_s", "a time"),
)
"""End of a figure's name -> what it is; the first that fits."""
_NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S*)\s*")
UNITS = {
    "a rate": "rad s-1",
    "an angle": "rad",
    "a frequency": "Hz",
    "a time": "s",
    "a decay rate": "s-1",
    "a temperature": "degC",
    "a ratio": "",
    "a rate in °/h": "deg/h",
    "a ratio in ppm": "ppm",
}
"""What a figure is -> its unit as files spell it."""


def quantity_of(name: str) -> str:
    """What a figure of this name is; a part of the name before the last point may carry the unit
    ("drift_rms_rad_s.held_out")."""
    for part in reversed(name.split(".")):
        stem = part.removesuffix("_std")
        for suffix, quantity in SUFFIXES:
            if stem.endswith(suffix):
                return quantity
    return "a ratio"


def unit_of(name: str) -> str:
    """The unit of a figure of this name."""
    return UNITS[quantity_of(name)]


def limit_value(name: str, value: Any) -> float:
    """A limit in its figure's own unit.

    Parameters
    ----------
    name
        The figure, whose end tells what it is.
    value
        A number in that unit, or a text with a unit.

    Returns
    -------
    float
        The limit, SI but for names that end in another unit.

    Raises
    ------
    UsageError
        No number, not finite, a unit of something else.

    Examples
    --------
    >>> from hrg_cli.limit_values import limit_value
    >>> round(limit_value("damping_split_1_s", "360 1/h"), 9)
    0.1
    """
    if isinstance(value, int | float) and not isinstance(value, bool):
        number, unit = float(value), ""
    else:
        match = _NUMBER.fullmatch(value) if isinstance(value, str) else None
        if match is None:
            raise UsageError(
                f'limit {name} = {value!r}: a finite number, or one with a unit such as "5 deg/h",'
                " was expected"
            )
        number, unit = float(match[1]), match[2]
    if not math.isfinite(number):
        raise UsageError(f"limit {name} = {value!r}: a finite number was expected")
    return number * _factor(name, unit) if unit else number


def _factor(name: str, unit: str) -> float:
    quantity = quantity_of(name)
    within, scale = quantity, 1.0
    if quantity == "a rate in °/h":
        within, scale = "a rate", 1 / DEGREE_PER_HOUR
    elif quantity == "a ratio in ppm":
        within, scale = "a ratio", 1e6
    known = QUANTITIES[within]
    if unit in known:
        return known[unit] * scale
    every = {spelling for table in QUANTITIES.values() for spelling in table if spelling}
    what = f"{unit} is no unit of {within}" if unit in every else f"{unit} is no unit"
    raise UsageError(
        f"limit {name}: {what};"
        f" {meant(unit, known) or 'one of ' + ', '.join(k for k in known if k) + ' was expected'}"
    )


def meant(word: str, known: Iterable[str]) -> str:
    """The question "did you mean …?" where a known word is close, else nothing."""
    names = [k for k in known if k]
    close = difflib.get_close_matches(word, names, 1, 0.72) or difflib.get_close_matches(
        word.split(".")[-1], names, 1, 0.85
    )
    return f"did you mean {close[0]}?" if close else ""
