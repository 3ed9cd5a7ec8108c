"""A limit as a person writes it ("5 deg/h", "200 ppm", 0.6) in the unit of the figure it limits."""

from __future__ import annotations

import difflib
import math
import re
from collections.abc import Iterable, Mapping
from typing import Any

from .errors import UsageError
from .units import DEGREE, DEGREE_PER_HOUR, to_file_unit

TURN = 2 * math.pi
RATES = {
    "rad/s": 1.0, "mrad/s": 1e-3, "urad/s": 1e-6, "µrad/s": 1e-6, "deg/s": DEGREE, "°/s": DEGREE,
    "deg/h": DEGREE_PER_HOUR, "deg/hr": DEGREE_PER_HOUR, "°/h": DEGREE_PER_HOUR, "rpm": TURN / 60,
}  # fmt: skip
FREQUENCIES = {"Hz": 1.0, "mHz": 1e-3, "uHz": 1e-6, "µHz": 1e-6, "kHz": 1e3}


def _scale_units(units: dict[str, float], factor: float) -> dict[str, float]:
    return {spelling: factor * value for spelling, value in units.items()}


QUANTITIES: dict[str, dict[str, float]] = {
    "a rate": RATES | _scale_units(FREQUENCIES, TURN),
    "half the difference of two frequencies": RATES | _scale_units(FREQUENCIES, TURN / 2),
    "an angle": {
        "rad": 1.0, "mrad": 1e-3, "urad": 1e-6, "µrad": 1e-6, "deg": DEGREE, "°": DEGREE,
        "arcsec": DEGREE / 3600,
    },
    "a frequency": FREQUENCIES | _scale_units(RATES, 1 / TURN),
    "a time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "min": 60.0, "h": 3600.0},
    "a decay rate": {"1/s": 1.0, "1/min": 1 / 60, "1/h": 1 / 3600} | RATES,
    "an angle random walk": {
        "rad/√s": 1.0, "rad/sqrt(s)": 1.0, "°/√h": DEGREE / 60, "deg/√h": DEGREE / 60,
        "deg/sqrt(h)": DEGREE / 60, "deg/sqrt(hr)": DEGREE / 60, "deg/rt-h": DEGREE / 60,
    },
    "a rate random walk": {
        "rad/s/√s": 1.0, "rad/s/sqrt(s)": 1.0, "°/h/√h": DEGREE_PER_HOUR / 60,
        "deg/h/√h": DEGREE_PER_HOUR / 60, "deg/h/sqrt(h)": DEGREE_PER_HOUR / 60,
    },
    "a temperature": {"degC": 1.0, "°C": 1.0},
    "a ratio": {"": 1.0, "1": 1.0, "%": 1e-2, "ppm": 1e-6, "ppb": 1e-9},
}  # fmt: skip
SUFFIXES = (
    ("_rad_s_sqrt_s", "a rate random walk"),
    ("_rad_sqrt_s", "an angle random walk"),
    ("_frequency_split_rad_s", "half the difference of two frequencies"),
    ("_frequency_split_cos_rad_s", "half the difference of two frequencies"),
    ("_frequency_split_sin_rad_s", "half the difference of two frequencies"),
    ("_rad_s", "a rate"),
    ("_1_s", "a decay rate"),
    ("_deg_h", "a rate in °/h"),
    ("_ppm", "a ratio in ppm"),
    ("_ppm_per_node_unit", "a ratio in ppm"),
    ("_percent", "a ratio in %"),
    ("_deg", "an angle in °"),
    ("_rad", "an angle"),
    ("_hz", "a frequency"),
    ("_degc", "a temperature"),
    ("_s", "a time"),
)
"""End of a figure's name -> what it is; the first that fits. A frequency split δω = (ω_p − ω_q)/2
is told, and limited, as Δf = δω/π where it is in Hz."""
SCALED = {
    "a rate in °/h": ("a rate", DEGREE_PER_HOUR),
    "a ratio in ppm": ("a ratio", 1e-6),
    "a ratio in %": ("a ratio", 1e-2),
    "an angle in °": ("an angle", DEGREE),
}
"""A figure that its name says is not in SI -> what it is, and its unit in SI."""
RELATIVE = frozenset(
    [
        "gain",
        "relative",
        "coupling",
        "coefficient",
        "ratio",
        "part",
        "share",
        "fraction",
        "split",
        "mismatch",
        "correlation",
    ]
)
"""Words in the name of a figure without a unit that is a part of something; of any other (a scale
factor, a count) "300 ppm" says no size."""
_NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S.*?)?\s*")
_OF_FILES = {"rad s-1": "rad/s", "s-1": "1/s"}
UNITS = {
    "a rate": "rad s-1",
    "half the difference of two frequencies": "rad s-1",
    "an angle random walk": "rad s-1/2",
    "a rate random walk": "rad s-3/2",
    "an angle": "rad",
    "a frequency": "Hz",
    "a time": "s",
    "a decay rate": "s-1",
    "a temperature": "degC",
    "a ratio": "",
    "a rate in °/h": "deg/h",
    "a ratio in ppm": "ppm",
    "a ratio in %": "%",
    "an angle in °": "deg",
}
"""What a figure is -> its unit as files spell it."""


def find_quantity(name: str) -> str:
    """What a figure is, by its name.

    A part of the name before the last point may carry the unit ("drift_rms_rad_s.held_out").

    Parameters
    ----------
    name
        The figure's, with dots.

    Returns
    -------
    str
        A key of `UNITS`; a name without a unit is a ratio.

    Examples
    --------
    >>> from hrg_cli.limit_values import find_quantity
    >>> find_quantity("drift_rms_rad_s.held_out"), find_quantity("chi2_per_dof")
    ('a rate', 'a ratio')
    """
    for part in reversed(name.split(".")):
        stem = part.removesuffix("_std")
        for suffix, quantity in SUFFIXES:
            if f"_{stem}".endswith(suffix):
                return quantity
    return "a ratio"


def is_relative(name: str) -> bool:
    """Whether a figure without a unit in its name is a part of something.

    Parameters
    ----------
    name
        The figure's, with dots.

    Returns
    -------
    bool
        A limit in ppm or % means something.

    Examples
    --------
    >>> from hrg_cli.limit_values import is_relative
    >>> is_relative("effects.gain_mismatch"), is_relative("scale_factor")
    (True, False)
    """
    parts = name.split(".")
    return parts[0] == "effects" or any(not RELATIVE.isdisjoint(p.split("_")) for p in parts)


def find_unit(name: str) -> str:
    """The unit of a figure, by its name.

    Parameters
    ----------
    name
        The figure's, with dots.

    Returns
    -------
    str
        As files spell it; empty for a ratio.

    Examples
    --------
    >>> from hrg_cli.limit_values import find_unit
    >>> find_unit("damping_rate_1_s"), find_unit("drift_deg_h")
    ('s-1', 'deg/h')
    """
    return UNITS[find_quantity(name)]


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
        number, unit = float(match[1]), to_file_unit(match[2]) if match[2] else ""
    if not math.isfinite(number):
        raise UsageError(f"limit {name} = {value!r}: a finite number was expected")
    return number * _factor(name, unit) if unit else number


def _factor(name: str, unit: str) -> float:
    quantity = find_quantity(name)
    within, size = SCALED.get(quantity, (quantity, 1.0))
    known, unit = QUANTITIES[within], _OF_FILES.get(unit, unit)
    if quantity == "a ratio" and unit in known and known[unit] != 1.0 and not is_relative(name):
        raise UsageError(
            f"limit {name}: {unit} is a part of something, {name} is a number by itself; write"
            " that number, or limit a figure whose name ends in _ppm"
        )
    if unit in known:
        return known[unit] / size
    every = {spelling for table in QUANTITIES.values() for spelling in table if spelling}
    what = f"{unit} is no unit of {within}" if unit in every else f"{unit} is no unit"
    raise UsageError(
        f"limit {name}: {what};"
        f" {suggest(unit, known) or 'one of ' + ', '.join(k for k in known if k) + ' was expected'}"
    )


def spell_whole_names(table: Mapping[str, Any], begin: str = "") -> dict[str, Any]:
    """Limits by the whole names of their figures.

    Of a name with dots that stands in no quotes TOML makes a table in a table.

    Parameters
    ----------
    table
        Limits of a kind of file, as TOML was read.
    begin
        What stands before its names.

    Returns
    -------
    dict
        Name -> limit.

    Examples
    --------
    >>> from hrg_cli.limit_values import spell_whole_names
    >>> spell_whole_names({"drift_rms_rad_s": {"held_out": {"maximum": "5 deg/h"}}})
    {'drift_rms_rad_s.held_out': {'maximum': '5 deg/h'}}
    """
    found: dict[str, Any] = {}
    for name, limit in table.items():
        inner = isinstance(limit, Mapping) and limit
        if inner and not any(suggest(key, ("minimum", "maximum")) for key in limit):
            found |= spell_whole_names(limit, f"{begin}{name}.")
        else:
            found[f"{begin}{name}"] = limit
    return found


def suggest(word: str, known: Iterable[str]) -> str:
    """The question whether another word was meant.

    Parameters
    ----------
    word
        As it was typed.
    known
        Words that there are.

    Returns
    -------
    str
        "did you mean …?" where a known word is close, else empty.

    Examples
    --------
    >>> from hrg_cli.limit_values import suggest
    >>> suggest("maximun", ("minimum", "maximum"))
    'did you mean maximum?'
    """
    names = [k for k in known if k]
    close = difflib.get_close_matches(word, names, 1, 0.72) or difflib.get_close_matches(
        word.split(".")[-1], names, 1, 0.85
    )
    return f"did you mean {close[0]}?" if close else ""
