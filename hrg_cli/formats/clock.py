"""Times of day and calendar times of text logs as seconds."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from datetime import UTC, datetime

import numpy as np

from ..errors import HrgError

DAY = 86_400.0
_CLOCK = re.compile(r"^\d{1,2}:\d{2}(:\d{2}([.,]\d+)?)?(\s?[AP]M)?$", re.IGNORECASE)
_HALF_DAY = re.compile(r"^(\d{1,2})(:[^\sAPap]*)\s?([AP])M$", re.IGNORECASE)
_DATE_TIME = re.compile(
    r"^\d{4}[-/.]\d{1,2}[-/.]\d{1,2}[T ]\d{1,2}:\d{2}(:\d{2}([.,]\d+)?)?\s*(Z|[+-]\d{2}:?\d{2})?$"
)

_NUMBER = re.compile(r"^[+-]?(\d*)\.?(\d*)(?:[eE]([+-]?\d{1,3}))?$")


def find_clock_kind(text: str) -> str:
    """The way in which a text tells a time.

    Parameters
    ----------
    text
        A cell of a log.

    Returns
    -------
    str
        "clock" for HH:MM:SS.mmm, with AM or PM too, "date" for an ISO date-time, "" for anything
        else, plain seconds too.

    Examples
    --------
    >>> from hrg_cli.formats.clock import find_clock_kind
    >>> (
    ...     find_clock_kind("14:03:22,125"),
    ...     find_clock_kind("2026-05-04T14:03:22Z"),
    ...     find_clock_kind("0.125"),
    ... )
    ('clock', 'date', '')
    """
    if _CLOCK.match(text):
        return "clock"
    return "date" if _DATE_TIME.match(text) else ""


def find_quantum(text: str) -> float:
    """The rounding step of a printed number or time: the weight of its last digit.

    Parameters
    ----------
    text
        A cell, with a decimal point or comma.

    Returns
    -------
    float
        In the number's own unit, of a time in s; 0 where none can be seen.

    Examples
    --------
    >>> from hrg_cli.formats.clock import find_quantum
    >>> (
    ...     find_quantum("1.250"),
    ...     find_quantum("1.5e3"),
    ...     find_quantum("14:03:22,125"),
    ...     find_quantum("14:03"),
    ... )
    (0.001, 100.0, 0.001, 60.0)
    """
    text = text.strip().replace(",", ".")
    if find_clock_kind(text):
        fraction = re.search(r"\.(\d+)", text)
        return 10.0 ** -len(fraction[1]) if fraction else (1.0 if text.count(":") >= 2 else 60.0)
    found = _NUMBER.match(text)
    return float(10.0 ** (int(found[3] or 0) - len(found[2]))) if found else 0.0


def find_floating_quantum(texts: Iterable[str]) -> float:
    """The rounding step of the largest of numbers that are printed with so many significant digits,
    and an exponent where it is shorter (`%.10g`, a language's own way).

    Zeros at the end may be left out, so that the longest number tells the digits; a bare 0 has none
    to tell.

    Parameters
    ----------
    texts
        Cells of one column.

    Returns
    -------
    float
        In the column's unit; 0 where none can be seen.

    Examples
    --------
    Six digits, of which the largest number has three before the point:

    >>> from hrg_cli.formats.clock import find_floating_quantum
    >>> find_floating_quantum(["0.125375", "102.4", "0"])
    0.001
    """
    digits, leading = 0, -math.inf
    for text in texts:
        found = _NUMBER.match(text.strip().replace(",", "."))
        significant = (found[1] + found[2]).lstrip("0") if found else ""
        if found and significant:
            digits = max(digits, len(significant))
            leading = max(leading, int(found[3] or 0) - len(found[2]) + len(significant) - 1)
    return float(10.0 ** (leading - digits + 1)) if digits else 0.0


class Clock:
    """Turns blocks of time text into seconds since the first one; a time of day that jumps back by
    half a day passed midnight."""

    def __init__(self, kind: str, first: str, where: str) -> None:
        self.kind, self.where = kind, where
        self.days, self.last = 0.0, -np.inf
        self.origin = self._nanoseconds([first])[0]

    def format_start_time(self) -> str:
        """ISO 8601 text of the first time; empty where the log has no date."""
        if self.kind != "date":
            return ""
        whole, rest = divmod(int(self.origin), 10**9)
        stamp = datetime.fromtimestamp(whole, tz=UTC).strftime("%Y-%m-%dT%H:%M:%S")
        return f"{stamp}.{rest:09d}".rstrip("0").rstrip(".") + "Z"

    def parse_seconds(self, texts: np.ndarray) -> np.ndarray:
        """Seconds of a block; NaN where a cell is no time."""
        raw = self._nanoseconds(texts)
        seconds = (raw - self.origin) / 1e9
        seconds = np.where(raw == _NOT_A_TIME, np.nan, seconds)
        if self.kind == "clock" and len(seconds):
            previous = np.concatenate([[self.last], seconds[:-1]])
            wraps = np.cumsum(seconds - previous < -DAY / 2)
            self.last = seconds[-1]
            seconds = seconds + DAY * (self.days + wraps)
            self.days += float(wraps[-1])
        return seconds

    def _nanoseconds(self, texts: np.ndarray | list[str]) -> np.ndarray:
        import pandas as pd

        series = pd.Series(
            [
                (
                    _count_from_midnight(str(text).strip().replace(",", "."))
                    if find_clock_kind(str(text).strip()) == self.kind
                    else ""
                )
                for text in texts
            ]
        )
        try:
            if self.kind == "clock":
                two = series.str.count(":") == 1
                times = pd.to_timedelta(series.where(~two, series + ":00"), errors="coerce")
                return times.to_numpy("timedelta64[ns]").astype("i8")
            series = series.str.replace(
                r"^(\d{4})[/.](\d{1,2})[/.](\d{1,2})", r"\1-\2-\3", regex=True
            )
            dates = pd.to_datetime(series, format="ISO8601", utc=True, errors="coerce")
            return dates.dt.tz_localize(None).to_numpy("datetime64[ns]").astype("i8")
        except (ValueError, OverflowError) as error:
            raise HrgError(
                f"{self.where}: its times cannot be read ({str(error)[:80]}); write them as"
                " HH:MM:SS.mmm or as ISO date-times"
            ) from error


def _count_from_midnight(text: str) -> str:
    """A time of day on 24 hours: 12:30 AM is 00:30."""
    found = _HALF_DAY.match(text)
    if found is None:
        return text
    hour = int(found[1]) % 12 + 12 * (found[3] in "Pp")
    return f"{hour:02d}{found[2]}"


_NOT_A_TIME = np.iinfo("i8").min
