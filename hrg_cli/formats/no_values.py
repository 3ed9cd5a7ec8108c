"""Numbers that instruments write where there is no value (−9999, 1e30): known where a temperature
or a rate cannot be what they say."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ..records import Status
from ..units import ZERO_KELVIN_DEGC

Array = np.ndarray
NINES = tuple(10.0**digits - 1 for digits in range(3, 8))
"""999, 9999 … of either sign."""
BEYOND_ALL = 1e20
"""From here on a number is a mark in any unit."""
HOTTEST_DEGC, FASTEST_RAD_S = 2000.0, 100.0
"""Silica is liquid, and no turntable turns: here a mark is not a value by chance."""
PLACES = 5


def find_no_values(role: str, raw: Array, converted: Array) -> Array:
    """Which numbers of a slow column are none.

    Parameters
    ----------
    role
        "temperature", "rate" or another, of which nothing is known.
    raw
        Numbers (n,) as the log has them.
    converted
        The same in °C or rad/s.

    Returns
    -------
    ndarray
        bool (n,): below absolute zero, or a usual mark where no value can be.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.formats.no_values import find_no_values
    >>> raw = np.array([20.0, -9999.0, 9999.0, -300.0])
    >>> find_no_values("temperature", raw, raw).tolist()
    [False, True, True, True]
    >>> find_no_values("rate", raw, np.radians(raw) / 3600).tolist()
    [False, False, False, False]
    """
    if role not in ("temperature", "rate"):
        return np.zeros(len(raw), bool)
    size = np.abs(np.asarray(raw, float))
    marked = np.isin(size, NINES) | ((size >= BEYOND_ALL) & np.isfinite(size))
    if role == "rate":
        return marked & (np.abs(converted) > FASTEST_RAD_S)
    return (converted < ZERO_KELVIN_DEGC) | (marked & (converted > HOTTEST_DEGC))


@dataclass
class NoValues:
    """Counts the numbers of one slow column that are none, block by block."""

    role: str
    where: Callable[[int], str]
    rows: int = 0
    count: int = 0
    places: list[str] = field(default_factory=list)
    low: float = np.inf
    high: float = -np.inf

    def take(self, raw: Array, converted: Array, rows: Array) -> Array:
        """Values (n,) with NaN for those that are none; `rows` are their rows of the log."""
        bad = find_no_values(self.role, raw, converted)
        self.rows += len(raw)
        if not bad.any():
            return converted
        marks = np.asarray(raw, float)[bad]
        self.low, self.high = min(self.low, marks.min()), max(self.high, marks.max())
        self.count += len(marks)
        open_places = max(0, PLACES - len(self.places))
        self.places += [self.where(int(row)) for row in rows[bad][:open_places]]
        return np.where(bad, np.nan, converted)

    def judge(self) -> list[tuple[Status, str]]:
        """After the last block: how many and where. One mark in fewer than half of the rows is an
        instrument's way; otherwise the column's unit may be wrong."""
        if not self.count:
            return []
        usual = self.low == self.high and 2 * self.count < self.rows
        marks = f"{self.low:g}" + ("" if self.low == self.high else f" to {self.high:g}")
        more = ", …" if self.count > len(self.places) else ""
        told = (
            f"{self.count} of {self.rows} values of its {self.role} column are none"
            f" ({marks}; {', '.join(self.places)}{more}) and are left out"
        )
        doubt = "" if usual else f": if they are measured, give {self.role}_units"
        return [("valid" if usual else "suspect", told + doubt)]
