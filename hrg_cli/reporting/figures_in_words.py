"""The figures of a file or a command for people: words, not keys; the unit behind the number;
nothing about what is not there."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping
from numbers import Real
from typing import Any

from ..limit_values import SUFFIXES, find_unit
from .quantities import choose_unit
from .text import clean_text, format_number

Pairs = list[tuple[str, str]]
DIGITS = 6
"""Of a value without a σ: a frequency is known to more than a person reads."""
DIGITS_OF_SPREAD = 3
SPREADS = {
    *("std", "rms", "chi2", "error", "residual", "noise", "walk", "instability"),
    *("condition", "ratio", "share", "count"),
}
"""Words of figures that say how large a scatter, a misfit or a share is: known to a part in a
hundred or worse."""
COUNTED = ("rows", "windows", "usable", "runs")
"""Counts that are told also where they are zero."""
NONE_AT_ZERO = ("residual_rms", "c_add_offset", "s_add_offset")
"""Figures that a file need not have: as many signals as unknowns leave no residual."""
WORDS = {"chi2": "χ²", "std": "σ"}


def list_told(figures: Mapping[str, Any], digits: int = DIGITS) -> Pairs:
    """Figure and value of each that says something, in words.

    Parameters
    ----------
    figures
        Key -> value.
    digits
        Of a value without a σ.

    Returns
    -------
    list of tuple
        Without the computer's time, counts of what did not happen, empty texts and JSON.

    Examples
    --------
    >>> from hrg_cli.reporting.figures_in_words import list_told
    >>> list_told({"frequency_hz": 5000.0, "elapsed_s": 2.0, "gaps": 0, "runs": 0})
    [('frequency', '5000 Hz'), ('runs', '0')]
    """
    return [
        (say_key(key), say_value(key, value, digits))
        for key, value in figures.items()
        if key != "elapsed_s" and not _is_empty(key, value)
    ]


def say_key(key: str) -> str:
    """A figure's key without its unit, in words.

    Parameters
    ----------
    key
        As files have it.

    Returns
    -------
    str
        For a person.

    Examples
    --------
    >>> from hrg_cli.reporting.figures_in_words import say_key
    >>> say_key("drift_rms_rad_s"), say_key("chi2_per_dof")
    ('drift rms', 'χ² per dof')
    """
    unit = next((end for end, _ in SUFFIXES if key.endswith(end)), "")
    parts = re.split(r"[._]", key.removesuffix(unit))
    return clean_text(" ".join(WORDS.get(part, part) for part in parts))


def say_value(key: str, value: Any, digits: int = DIGITS) -> str:
    """A value in the unit that people use for what its key names.

    Parameters
    ----------
    key
        Which tells the unit, and whether it is a scatter, known to a few digits.
    value
        A number, a text, or a list of these.
    digits
        At most.

    Returns
    -------
    str
        A dash where the value is not finite.

    Examples
    --------
    >>> from hrg_cli.reporting.figures_in_words import say_value
    >>> (
    ...     say_value("duration_s", 12.5),
    ...     say_value("residual_rms", 0.123456),
    ...     say_value("rate_hz", float("nan")),
    ... )
    ('12.5 s', '0.123', '–')
    """
    if isinstance(value, list | tuple):
        return ", ".join(say_value(key, one, digits) for one in value)
    if isinstance(value, bool) or not isinstance(value, Real):
        return clean_text(value)
    if not math.isfinite(float(value)) or isinstance(value, int):
        return clean_text(value) if isinstance(value, int) else "–"
    if not SPREADS.isdisjoint(re.split(r"[._]", key)):
        digits = min(digits, DIGITS_OF_SPREAD)
    factor, unit = choose_unit(key, float(value), find_unit(key))
    return f"{format_number(float(value) * factor, digits)} {unit}".strip()


def _is_empty(key: str, value: Any) -> bool:
    if value is None or value == "" or value == [] or value is False:
        return True
    if isinstance(value, str):
        return _is_json(value)
    if key in NONE_AT_ZERO:
        return bool(value == 0)
    return isinstance(value, int) and value == 0 and key not in COUNTED


def _is_json(text: str) -> bool:
    if text[:1] not in ("{", "["):
        return False
    try:
        json.loads(text)
    except ValueError:
        return False
    return True
