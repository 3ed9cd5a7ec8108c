"""Results held against limits, with guard bands: the limits of each kind of file, and a gyro's
rows."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..errors import HrgError
from ..limits import Judged, Row, find_table, list_rows
from ..reporting.answer import describe_requirement
from .entry import Entry
from .guard_bands import compute_guard_limits, compute_probability_outside

NO_FIGURE = ("status", "verdict")
Bounds = tuple[float | None, float | None]


@dataclass(frozen=True)
class GaugeOf:
    """What is known of a figure's measurement: the part of its σ that a result does not state of
    itself (stations, repeats), and the gyros' (μ, σ_g), None where no gauge study could be done."""

    beyond_own: float = 0.0
    population: tuple[float, float] | None = None

    def measurement_std(self, own: float | None) -> float | None:
        """σ of a measurement whose own is stated; None where it is not."""
        return None if own is None else math.hypot(own, self.beyond_own)


@dataclass(frozen=True)
class Held:
    """A limit and a gyro's figure: the row of `hrg check`, the σ of its measurement, whether it is
    within the limit but in its guard band, and the probability that the true figure is outside."""

    row: Row
    measurement_std: float | None
    in_guard_band: bool
    probability_outside: float | None

    @property
    def passed(self) -> bool:
        """Within the limit, and clear of its guard band."""
        return self.row.passed and not self.in_guard_band

    def describe(self, k: float) -> str:
        """Why it does not pass, in people's names and units."""
        shown = describe_requirement(self.row)
        if self.row.words is not None:
            return self.row.describe()
        if self.row.value is None:
            return f"{shown.label} is not in the file"
        if self.row.passed and self.in_guard_band:
            return f"{shown.label} is {shown.value}, less than {k:g} σ from its limit {shown.limit}"
        return f"{shown.label} is {shown.value}, the limit is {shown.limit}"


def find_tables(limits: Mapping[str, Any], kinds: Sequence[str]) -> dict[str, Mapping[str, Any]]:
    """The limits of each kind of file.

    Parameters
    ----------
    limits
        Kind -> its table, or one table alone.
    kinds
        That are there.

    Returns
    -------
    dict
        Kind -> its limits, of those that have some.

    Raises
    ------
    HrgError
        Limits for no kind at all, or without a table while there are several kinds; UsageError for
        a table that looks mistyped.

    Examples
    --------
    >>> from hrg_cli.ledger.judging import find_tables
    >>> limits = {"scale_factor": {"minimum": 0.5}}
    >>> find_tables(limits, ["resonator"])
    {'resonator': {'scale_factor': {'minimum': 0.5}}}
    >>> find_tables(limits, ["resonator", "calibration"])
    Traceback (most recent call last):
    ...
    hrg_cli.errors.HrgError: the limits have no table for resonator or calibration files; ...
    """
    found = {
        kind: find_table(kind, limits) for kind in kinds if isinstance(limits.get(kind), Mapping)
    }
    if not found and kinds:
        if len(kinds) > 1:
            raise HrgError(
                f"the limits have no table for {' or '.join(kinds)} files; write one, or name one"
                " kind with --kind"
            )
        found = {kinds[0]: find_table(kinds[0], limits)}
    return found


def find_bounds(entries: Sequence[Entry], table: Mapping[str, Any]) -> dict[str, Bounds]:
    """Minimum and maximum of the figures that results have.

    Parameters
    ----------
    entries
        Of one kind.
    table
        Its limits.

    Returns
    -------
    dict
        Figure -> (minimum, maximum), None where there is none.

    Examples
    --------
    >>> from hrg_cli.ledger.entry import Entry, Figure
    >>> from hrg_cli.ledger.judging import find_bounds
    >>> figures = {"scale_factor": Figure(0.55, 1e-3, "1")}
    >>> entry = Entry("", "r.h5", "resonator", "SN-1", "", "valid", figures=figures)
    >>> find_bounds([entry], {"scale_factor": {"minimum": 0.5}})
    {'scale_factor': (0.5, None)}
    """
    found: dict[str, Bounds] = {}
    for entry in entries:
        for row in list_rows(_judge_entry(entry), table):
            if row.name not in NO_FIGURE and row.value is not None:
                found[_own_name(row.name)] = (row.minimum, row.maximum)
    return found


def hold_limits(
    entry: Entry, table: Mapping[str, Any], k: float, gauges: Mapping[str, GaugeOf]
) -> list[Held]:
    """A result's figures against the limits of its kind.

    Parameters
    ----------
    entry
        The result.
    table
        Of its kind.
    k
        Width of the guard bands in σ of measurement.
    gauges
        Figure -> what is known of its measurement.

    Returns
    -------
    list of Held
        A row a limit, that of the status first.

    Examples
    --------
    Within its limit, but less than two σ from it:

    >>> from hrg_cli.ledger.entry import Entry, Figure
    >>> from hrg_cli.ledger.judging import hold_limits
    >>> figures = {"scale_factor": Figure(0.501, 1e-3, "1")}
    >>> entry = Entry("", "r.h5", "resonator", "SN-1", "", "valid", figures=figures)
    >>> _, row = hold_limits(entry, {"scale_factor": {"minimum": 0.5}}, 2.0, {})
    >>> row.row.passed, row.in_guard_band, row.passed
    (True, True, False)
    """
    found = []
    for row in list_rows(_judge_entry(entry), table):
        if row.name in NO_FIGURE or row.value is None:
            found.append(Held(row, None, False, None))
            continue
        gauge = gauges.get(_own_name(row.name), GaugeOf())
        std = gauge.measurement_std(row.std)
        if std is None:
            found.append(Held(row, None, False, None))
            continue
        low, high = compute_guard_limits(row.minimum, row.maximum, std, k)
        clear = (low is None or row.value >= low) and (high is None or row.value <= high)
        risk = compute_probability_outside(
            row.value, std, row.minimum, row.maximum, gauge.population
        )
        found.append(Held(row, std, row.passed and not clear, risk))
    return found


def compute_share_of_limit(change: float, bounds: Bounds) -> float | None:
    """A change over the width of the tolerance.

    Parameters
    ----------
    change
        In the unit of the limits.
    bounds
        Minimum and maximum; None: there is no such limit.

    Returns
    -------
    float or None
        Over the limit's own size where there is one alone; None where that is 0.

    Examples
    --------
    >>> from hrg_cli.ledger.judging import compute_share_of_limit
    >>> compute_share_of_limit(0.5, (-1.0, 1.0)), compute_share_of_limit(0.5, (None, 2.0))
    (0.25, 0.25)
    >>> compute_share_of_limit(0.5, (None, None)) is None
    True
    """
    low, high = bounds
    if low is not None and high is not None:
        width = high - low
    else:
        width = abs(high if high is not None else low if low is not None else 0.0)
    return change / width if width > 0 else None


def _own_name(name: str) -> str:
    """A resonator's parameter may be named as `hrg info` prints it: parameters.NAME.value."""
    parts = name.split(".")
    return parts[1] if len(parts) == 3 and (parts[0], parts[2]) == ("parameters", "value") else name


def _judge_entry(entry: Entry) -> Judged:
    figures: dict[str, float] = {}
    for name, figure in entry.figures.items():
        figures[name] = figure.value
        if figure.std is not None:
            figures[f"{name}_std"] = figure.std
        if entry.kind == "resonator" and "." not in name:
            figures[f"parameters.{name}.value"] = figure.value
            if figure.std is not None:
                figures[f"parameters.{name}.std"] = figure.std
    return Judged(entry.kind, entry.status, figures, entry.verdict)
