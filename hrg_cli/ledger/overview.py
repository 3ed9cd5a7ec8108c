"""What `hrg ledger show` tells: every gyro's standing, and of every figure the population, its
chart, its capability and its gauge."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..errors import UsageError
from ..limit_values import suggest
from ..reporting.figure_names import name_figure
from .capability import Capability, compute_capability
from .charts import BEYOND, FALSE_ALARMS, Chart, make_chart
from .entry import KINDS, Entry
from .gauge import GaugeStudy, study_gauge
from .golden import Golden, describe_golden_unit
from .guard_bands import Risks, compute_risks
from .judging import Bounds, GaugeOf, Held, find_bounds, find_tables, hold_limits
from .own_history import HistoryDistance, find_departure
from .series import (
    AXIS,
    FigureSeries,
    find_newest,
    list_usual_figures,
    make_series,
    select_independent,
)
from .trend import find_move

Array = np.ndarray
SHOWN = 5
"""Gyros that one sentence names."""


@dataclass(frozen=True)
class Standing:
    """A gyro by its newest result of a kind: how often it was measured, the figure that moved most
    since the measurement before (in σ), that which is farthest from the gyro's own history, and its
    rows against the limits."""

    entry: Entry
    results: int
    measurements: int
    moved_figure: str
    moved_sigma: float | None
    changed_figure: str
    changed: HistoryDistance | None
    held: tuple[Held, ...]

    @property
    def farthest_sigma(self) -> float:
        """The larger of both, without a sign."""
        return max(abs(self.moved_sigma or 0.0), abs(self.changed.sigma if self.changed else 0.0))


@dataclass(frozen=True)
class FigureReport:
    """A figure over the gyros, one value a gyro (its newest): chart in the order of time,
    capability against its limits, gauge study of all measurements, risks of its limits."""

    kind: str
    name: str
    units: str
    gyros: int
    mean: float
    mean_std: float | None
    """By the gyros' spread or by their own σ, whichever is larger; None where neither is known."""
    std: float | None
    bounds: Bounds
    chart: Chart | None
    measured: FigureSeries
    """The chart's points in the order of time."""
    capability: Capability | None
    gauge: GaugeStudy | None
    risks: Risks | None

    @property
    def points(self) -> tuple[str, ...]:
        """Serial numbers of the chart's points."""
        return tuple(entry.gyro_id for entry in self.measured.entries)


@dataclass(frozen=True)
class Overview:
    """Everything `show` tells of so many entries: results that were refused or processed again do
    not count in the statistics."""

    entries: int
    refused: int
    reprocessed: int
    standings: tuple[Standing, ...]
    figures: tuple[FigureReport, ...]
    golden: tuple[Golden, ...]
    guard_sigma: float
    by: str

    @property
    def missed(self) -> list[str]:
        """Sentences: which gyro misses which limit."""
        return [
            f"{s.entry.gyro_id}, {s.entry.kind}: {row.describe(self.guard_sigma)}"
            for s in self.standings
            for row in s.held
            if not row.passed
        ]

    @property
    def doubts(self) -> list[str]:
        """Sentences: charts out of control, newest results that are refused, and gyros that have
        left their own history."""
        said = [
            f"{s.entry.gyro_id}: its newest {s.entry.kind} is refused"
            for s in self.standings
            if s.entry.status == "refused" and not s.held
        ]
        said += self._list_changed()
        for figure in self.figures:
            if figure.chart is not None and figure.chart.out_of_control:
                beyond = [v.point for v in figure.chart.violations if v.rule == BEYOND]
                said.append(
                    f"{name_figure(figure.name)} over the gyros is out of control at"
                    f" {', '.join(figure.points[i] for i in beyond[:SHOWN])}"
                    f"{f' and {len(beyond) - SHOWN} more' if len(beyond) > SHOWN else ''}"
                )
        said += [
            f"{name_figure(row.name)} of the golden unit is out of control"
            f"{f' on {self.by} {row.station}' if row.station else ''}"
            for row in self.golden
            if row.chart is not None and row.chart.out_of_control
        ]
        return said

    def _list_changed(self) -> list[str]:
        """A sentence a gyro and kind, for the figure that is farthest from its history."""
        said = [
            f"{s.entry.gyro_id}: {s.changed.describe(s.changed_figure)}"
            for s in self.standings
            if s.changed is not None and s.changed.since is not None
        ]
        more = len(said) - SHOWN
        return said[:SHOWN] + ([f"{more} more gyros have left their history"] if more > 0 else [])

    @property
    def false_alarms_expected(self) -> float:
        """Points that would lie beyond 3 σ by chance were everything in control."""
        charted = sum(f.gyros for f in self.figures if f.chart is not None)
        charted += sum(g.measurements for g in self.golden if g.chart is not None)
        return FALSE_ALARMS * charted


def make_overview(
    entries: Sequence[Entry],
    *,
    limits: Mapping[str, Any] | None = None,
    golden: str | None = None,
    names: Sequence[str] = (),
    guard_sigma: float = 0.0,
    by: str = "station",
) -> Overview:
    """Everything that the ledger tells of results over all gyros.

    Parameters
    ----------
    entries
        The results.
    limits
        Of figures; None: there are none.
    golden
        Serial number of the golden unit; None: there is none.
    names
        Figures that are told; empty: those with limits, without limits those with a σ.
    guard_sigma
        Width of the guard bands.
    by
        What tells stations apart.

    Returns
    -------
    Overview
        Every gyro's standing, and of every figure its population.

    Raises
    ------
    HrgError
        Limits that are for none of the kinds; UsageError for a figure or golden unit that is not
        there.

    Examples
    --------
    >>> from hrg_cli.ledger.entry import Entry, Figure
    >>> from hrg_cli.ledger.overview import make_overview
    >>> def tell(gyro, value):
    ...     figures = {"scale_factor": Figure(value, 1e-3, "1")}
    ...     return Entry(
    ...         gyro, "r.h5", "resonator", gyro, "2026-01-01T00:00:00Z", "valid", figures=figures
    ...     )
    >>> found = make_overview([tell("SN-1", 0.55), tell("SN-2", 0.57)])
    >>> (figure,) = found.figures
    >>> figure.name, figure.gyros, round(figure.mean, 9)
    ('scale_factor', 2, 0.56)
    """
    counting = select_independent(entries)
    kinds = [kind for kind in KINDS if any(e.kind == kind for e in entries)]
    tables = find_tables(limits, kinds) if limits else {}
    if golden is not None and not any(e.gyro_id == golden for e in entries):
        raise explain_unknown(golden, "gyro", {e.gyro_id for e in entries})
    for name in names:
        if not any(name in e.figures for e in entries):
            raise explain_unknown(name, "figure", {n for e in entries for n in e.figures})
    reports: list[FigureReport] = []
    standings: list[Standing] = []
    rows: list[Golden] = []
    for kind in kinds:
        every = [e for e in entries if e.kind == kind]
        of_kind = [e for e in counting if e.kind == kind]
        table = tables.get(kind, {})
        bounds = find_bounds(every, table) if table else {}
        told = [n for n in names if any(n in e.figures for e in of_kind)]
        told = told or ([] if names else list(bounds) if limits else list_usual_figures(of_kind))
        found = [
            list_gyros(of_kind, kind, name, bounds.get(name, (None, None)), golden, by, guard_sigma)
            for name in told
            if not name.endswith(AXIS)
        ]
        reports += found
        gauges = {f.name: find_gauge(f) for f in found}
        standings += _standings(every, of_kind, table, guard_sigma, gauges)
        if golden is not None:
            own = [e for e in of_kind if e.gyro_id == golden]
            rows += describe_golden_unit(own, told, by)
    refused = sum(e.status == "refused" for e in entries)
    return Overview(
        entries=len(entries),
        refused=refused,
        reprocessed=len(entries) - refused - len(counting),
        standings=tuple(standings),
        figures=tuple(reports),
        golden=tuple(rows),
        guard_sigma=guard_sigma,
        by=by,
    )


def explain_unknown(word: str, what: str, known: Iterable[str]) -> UsageError:
    """The error for a name that the ledger does not hold.

    Parameters
    ----------
    word
        As it was written.
    what
        It was to name: "gyro", "figure".
    known
        Names that are there.

    Returns
    -------
    UsageError
        With the name that was likely meant.

    Examples
    --------
    >>> from hrg_cli.ledger.overview import explain_unknown
    >>> print(explain_unknown("SN-11", "gyro", ["SN-1", "SN-12"]))
    the ledger holds no gyro 'SN-11'; ...
    """
    hint = suggest(word, known) or "`hrg ledger show` lists what is there"
    return UsageError(f"the ledger holds no {what} {word!r}; {hint}")


def list_gyros(
    entries: Sequence[Entry],
    kind: str,
    name: str,
    bounds: Bounds,
    golden: str | None,
    by: str,
    guard_sigma: float,
) -> FigureReport:
    """A figure over the gyros, one value a gyro, its newest.

    Parameters
    ----------
    entries
        Results of one kind that count.
    kind
        Of them.
    name
        Figure.
    bounds
        Its minimum and maximum.
    golden
        Serial number of the golden unit, which counts in the gauge study alone; None: there is
        none.
    by
        What tells stations apart.
    guard_sigma
        Width of the guard bands.

    Returns
    -------
    FigureReport
        Chart, capability, gauge study and risks, where there are results enough.

    Examples
    --------
    >>> from hrg_cli.ledger.entry import Entry, Figure
    >>> from hrg_cli.ledger.overview import list_gyros
    >>> def tell(gyro, value):
    ...     figures = {"scale_factor": Figure(value, 1e-3, "1")}
    ...     return Entry(
    ...         gyro, "r.h5", "resonator", gyro, "2026-01-01T00:00:00Z", "valid", figures=figures
    ...     )
    >>> entries = [tell("SN-1", 0.55), tell("SN-2", 0.57), tell("golden", 0.9)]
    >>> bounds = (None, None)
    >>> found = list_gyros(entries, "resonator", "scale_factor", bounds, "golden", "station", 0.0)
    >>> found.gyros, round(found.mean, 9), found.chart
    (2, 0.56, None)
    """
    made = find_newest(e for e in entries if name in e.figures)
    population = make_series([e for e in made.values() if e.gyro_id != golden], name)
    population = population.select(np.argsort(population.times, kind="stable"))
    values = population.values
    every = make_series(entries, name)
    own = np.where(np.isnan(every.stds), 0.0, every.stds)
    where = [str(getattr(e, by)) for e in every.entries]
    gauge = study_gauge(every.values, own, [e.gyro_id for e in every.entries], where)
    wrong = (
        compute_risks((gauge.mean, gauge.gyro_std), gauge.gauge_std, *bounds, guard_sigma)
        if gauge is not None and gauge.gauge_std > 0 and bounds != (None, None)
        else None
    )
    return FigureReport(
        kind=kind,
        name=name,
        units=every.units,
        gyros=len(values),
        mean=float(values.mean()) if len(values) else math.nan,
        mean_std=_std_of_mean(values, population.stds),
        std=float(values.std(ddof=1)) if len(values) > 1 else None,
        bounds=bounds,
        chart=make_chart(values),
        measured=population,
        capability=compute_capability(values, *bounds),
        gauge=gauge,
        risks=wrong,
    )


def _std_of_mean(values: Array, stds: Array) -> float | None:
    """σ of the mean of (n,) values by their spread, or by their own σ (NaN where unknown)."""
    count = len(values)
    spread = values.std(ddof=1) / math.sqrt(count) if count > 1 else 0.0
    own = math.sqrt(float(np.nansum(stds**2))) / max(count, 1)
    return max(float(spread), own) or None


def find_gauge(figure: FigureReport) -> GaugeOf:
    """What a figure's gauge study tells of one measurement.

    Parameters
    ----------
    figure
        Over the gyros.

    Returns
    -------
    GaugeOf
        Without a study, nothing beyond a result's own σ.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.ledger.overview import find_gauge
    >>> find_gauge(Told(gauge=None))
    GaugeOf(beyond_own=0.0, population=None)
    """
    if figure.gauge is None:
        return GaugeOf()
    beyond = math.sqrt(max(0.0, figure.gauge.gauge_std**2 - figure.gauge.own_std**2))
    return GaugeOf(beyond, (figure.gauge.mean, figure.gauge.gyro_std))


def _standings(
    every: Sequence[Entry],
    counting: Sequence[Entry],
    table: Mapping[str, Any],
    guard_sigma: float,
    gauges: Mapping[str, GaugeOf],
) -> list[Standing]:
    """A row a gyro, those that miss a limit first, then by how far they moved."""
    results = Counter(e.gyro_id for e in every)
    last = find_newest(sorted(every, key=lambda e: (e.processed, e.added)))
    rows = []
    for entry in last.values():
        own = [e for e in counting if e.gyro_id == entry.gyro_id]
        against = tuple(hold_limits(entry, table, guard_sigma, gauges)) if table else ()
        moved, changed = _most_moved(own), _most_changed(own)
        rows.append(Standing(entry, results[entry.gyro_id], len(own), *moved, *changed, against))
    return sorted(
        rows,
        key=lambda r: (
            all(h.passed for h in r.held),
            r.entry.status != "refused",
            -r.farthest_sigma,
            r.entry.gyro_id,
        ),
    )


def _most_moved(entries: Sequence[Entry]) -> tuple[str, float | None]:
    """The figure that moved most since the measurement before, in σ."""
    moves = [
        (name, find_move(make_series(entries[-2:], name)))
        for name in list_usual_figures(entries[-2:])
    ]
    known = [(name, m.sigma) for name, m in moves if m is not None and m.sigma is not None]
    return max(known, key=lambda pair: abs(pair[1]), default=("", None))


def _most_changed(entries: Sequence[Entry]) -> tuple[str, HistoryDistance | None]:
    """The figure of the newest result that is farthest from the gyro's own history."""
    found = [
        (name, find_departure(make_series(entries, name)))
        for name in list_usual_figures(entries[-1:])
    ]
    known = [(name, away) for name, away in found if away is not None]
    return max(known, key=lambda pair: abs(pair[1].sigma), default=("", None))
