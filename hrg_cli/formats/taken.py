"""What an import took of a log: columns and units, times and gaps, what was left out and where; and
the cut by --from-s and --to-s."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..errors import HrgError
from ..records import Status
from .left_columns import list_left_columns
from .left_out import LeftOut
from .log import Array, Channel, Log
from .unit_spellings import OF_ROLE, are_same_unit

FEW_ROWS, FEW_SHARE = 3, 0.01
"""Rows left out that are told only: an instrument's first ones. More make the recording suspect."""

REFUSED_SHARE = 0.2
"""Part of a log's rows from which a loss refuses the recording."""

MANY_NOT_FINITE = 1e-3
"""Fraction of samples that are not finite from which the recording is suspect."""

GAP_STEPS = 2.5
"""A step longer than so many usual ones is a gap."""

TAKEN_IN = {"time": "s", "auxiliary_time": "s", "rate": "rad/s", "temperature": "degC"}
"""Units to which a role's values are brought; any other role keeps the log's."""

GAPS_NAMED = 5
"""Gaps and places told one by one; the rest are counted."""


def check_range(from_s: float | None, to_s: float | None) -> None:
    """Refuse a range of times that holds nothing.

    Parameters
    ----------
    from_s, to_s
        Where it begins and ends [s]; None: with the log.

    Raises
    ------
    HrgError
        It does not begin before it ends.

    Examples
    --------
    >>> from hrg_cli.formats.taken import check_range
    >>> check_range(None, 5.0)
    >>> check_range(5.0, 5.0)
    Traceback (most recent call last):
    ...
    hrg_cli.errors.HrgError: from_s = 5 is not before to_s = 5; a part of the log was expected
    """
    if from_s is not None and to_s is not None and not from_s < to_s:
        raise HrgError(
            f"from_s = {from_s:g} is not before to_s = {to_s:g}; a part of the log was expected"
        )


@dataclass
class Taken:
    """Filled block by block; `columns` is role -> index of the log's channel."""

    log: Log
    columns: dict[str, int]
    units: dict[str, str]
    sample_rate_hz: float | None
    from_s: float | None = None
    to_s: float | None = None
    rows: int = 0
    first_s: float | None = None
    """Time of the first row taken, in seconds of the log."""
    last_s: float = float("nan")
    outside: int = 0
    not_finite: int = 0
    places: list[str] = field(default_factory=list)
    gaps: int = 0
    longest_gap_s: float = 0.0
    gaps_named: list[dict[str, Any]] = field(default_factory=list)
    usual_step_s: float = 0.0
    seen: int = 0
    _last_read_s: float | None = None

    def take_block(self, times_s: Array) -> slice:
        """The part of a block of the log (times from its first row on) that lies in the range asked
        for; looks for gaps."""
        low = 0 if self.from_s is None else int(np.searchsorted(times_s, self.from_s))
        high = len(times_s) if self.to_s is None else int(np.searchsorted(times_s, self.to_s))
        self.outside += len(times_s) - max(0, high - low)
        part = times_s[low:high]
        if len(part):
            if self.first_s is None:
                self.first_s = float(part[0])
            if self.sample_rate_hz is None:
                self._find_gaps(part, self.seen + low)
            self.last_s = float(part[-1])
        self.rows += len(part)
        self.seen += len(times_s)
        self._last_read_s = float(times_s[-1])
        return slice(low, max(low, high))

    def _find_gaps(self, times_s: Array, row: int) -> None:
        before = [self.last_s] if np.isfinite(self.last_s) else []
        steps = np.diff(np.concatenate([before, times_s]))
        if not self.usual_step_s and len(steps):
            self.usual_step_s = float(np.median(steps))
        for k in np.flatnonzero(steps > GAP_STEPS * self.usual_step_s):
            self.gaps += 1
            self.longest_gap_s = max(self.longest_gap_s, float(steps[k]))
            if self.gaps <= GAPS_NAMED:
                place = int(k) + row + (0 if before else 1)
                self.gaps_named.append(
                    {"before": self.log.where(place), "length_s": float(steps[k])}
                )

    def count_not_finite(self, bad: Array, row: int) -> None:
        """Samples (n,) of which one is not finite; `row` is the log's row of the first."""
        where = np.flatnonzero(bad)
        self.not_finite += len(where)
        self.places += [
            self.log.where(row + int(k)) for k in where[: max(0, GAPS_NAMED - len(self.places))]
        ]

    def check_range(self, path: str) -> None:
        """After the last block. HrgError: nothing of the log lies in the range asked for."""
        if self.rows == 0 and self.seen and (self.from_s is not None or self.to_s is not None):
            raise HrgError(
                f"{path}: none of its rows lies between from_s = {self.from_s or 0:g} and to_s ="
                f" {'its end' if self.to_s is None else format(self.to_s, 'g')}; it is"
                f" {self._last_read_s or 0.0:.6g} s long"
            )

    def judge(self) -> list[tuple[Status, str]]:
        """Reasons, each with how bad it is."""
        found = [*self._judge_lost_rows(), *self._tell_closing(), *self._judge_not_finite()]
        found += self._tell_other_units()
        if self.gaps:
            found.append(
                (
                    "valid",
                    self._tell_gaps(),
                )
            )
        end = self._last_read_s
        # the end asked for may lie within the step after the last row
        if self.to_s is not None and end is not None and self.to_s > end + 1.5 * self._step():
            found.append(
                ("valid", f"to_s = {self.to_s:g} lies behind the end of the log at {end:.6g} s")
            )
        return found

    def _judge_lost_rows(self) -> list[tuple[Status, str]]:
        parts = [part for part in self.log.left_out if part.samples]
        lost = sum(part.rows for part in parts)
        if not lost:
            return []
        told = "; ".join(part.describe() for part in parts[:GAPS_NAMED])
        share = lost / (lost + self.seen)
        few = lost <= FEW_ROWS and share < FEW_SHARE
        status: Status = "valid" if few else "refused" if share > REFUSED_SHARE else "suspect"
        return [
            (
                status,
                f"{lost} of {lost + self.seen} rows of the log could not be read and"
                f" {'was' if lost == 1 else 'were'} left out: {told}",
            )
        ]

    def _tell_closing(self) -> list[tuple[Status, str]]:
        return [
            ("valid", f"not taken: {part.describe()}")
            for part in self.log.left_out
            if not part.samples
        ]

    def _tell_other_units(self) -> list[tuple[Status, str]]:
        """Units that were told of columns whose titles name others."""
        told = {role: self.units[role] for role in OF_ROLE if role in self.units}
        return [
            (
                "valid",
                f"its column {index + 1} ({self.log.channels[index].name}), taken as the {role},"
                f" is in {own!r} by its own title and was read in {told[role]!r} as"
                f" {role}_units says",
            )
            for role, index in self.columns.items()
            if role in told
            and (own := self.log.channels[index].units)
            and not are_same_unit(OF_ROLE[role][0], own, told[role])
        ]

    def _judge_not_finite(self) -> list[tuple[Status, str]]:
        if not self.not_finite:
            return []
        one, many = self.not_finite == 1, self.not_finite > MANY_NOT_FINITE * self.rows
        more = ", …" if self.not_finite > len(self.places) else ""
        return [
            (
                "suspect" if many else "valid",
                f"{self.not_finite} of {self.rows} samples {'is' if one else 'are'} not finite"
                f" ({', '.join(self.places)}{more}); {'it is' if one else 'they are'} kept and"
                " will be flagged",
            )
        ]

    def _tell_gaps(self) -> str:
        where = f"of {self.longest_gap_s:.4g} s before {self._longest_place()}"
        if self.gaps == 1:
            return f"the times have a gap {where}"
        return f"the times have {self.gaps} gaps, the longest {where}"

    def _longest_place(self) -> str:
        named = [gap["before"] for gap in self.gaps_named if gap["length_s"] == self.longest_gap_s]
        return named[0] if named else "a later row"

    def _step(self) -> float:
        return 1 / self.sample_rate_hz if self.sample_rate_hz else self.usual_step_s

    def list_facts(self) -> dict[str, Any]:
        """Everything for JSON."""
        channels = self.log.channels
        facts: dict[str, Any] = {
            "format": self.log.format,
            "columns": {
                role: {
                    "column": index + 1,
                    "name": channels[index].name,
                    "units": self.units.get(role, channels[index].units),
                }
                | self._converted(role, channels[index])
                for role, index in self.columns.items()
            },
            "columns_left": list_left_columns(self.log, self.columns),
            "samples": self.rows,
            "sample_rate_hz": self.sample_rate_hz,
            "duration_s": self.last_s - self.first_s if self.first_s is not None else 0.0,
            "gaps": {"count": self.gaps, "longest_s": self.longest_gap_s, "first": self.gaps_named},
            "not_finite": {"count": self.not_finite, "first": self.places},
            "left_out": [_plain(part) for part in self.log.left_out],
        }
        if self.from_s is not None or self.to_s is not None:
            facts["cut"] = {
                "from_s": self.from_s,
                "to_s": self.to_s,
                "first_s": self.first_s,
                "last_s": self.last_s,
                "rows": self.outside,
            }
        return facts

    def _converted(self, role: str, channel: Channel) -> dict[str, str]:
        """The unit a column's values became, where it is not the one that it names."""
        taken_in = TAKEN_IN.get(role)
        units = self.units.get(role, channel.units)
        return {} if taken_in is None or taken_in == units else {"taken_in": taken_in}

    def dump_facts(self) -> str:
        """What `list_facts` gives, as JSON text."""
        return json.dumps(self.list_facts(), ensure_ascii=False)


def _plain(part: LeftOut) -> dict[str, Any]:
    return {
        "first_line": part.first_line,
        "last_line": part.last_line,
        "rows": part.rows,
        "why": part.why,
        "example": part.example,
    }
