"""What `hrg ledger history` tells of one gyro: every result, and how each figure moved against the
measurement before, the first one, its limits and time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..reporting.figure_names import name_of_figure
from .charts import Chart, chart
from .entry import KINDS, Entry
from .judging import Bounds, Held, bounds_of, hold_limits, share_of_limit, tables_of
from .overview import gauge_of, list_gyros, no_such
from .series import AXIS, list_usual_figures, select_independent, series
from .trend import Move, Trend, days_to_limit, move, trend


@dataclass(frozen=True)
class FigureHistory:
    """A figure of one gyro: its measurements in the order of time, the last one's move against that
    before and the first, in σ and as a share of the limit, its line over time with the days left to
    a limit, and its chart."""

    kind: str
    name: str
    units: str
    times: tuple[float, ...]
    values: tuple[float, ...]
    stds: tuple[float, ...]
    bounds: Bounds
    since_before: Move | None
    since_first: Move | None
    share_before: float | None
    share_first: float | None
    trend: Trend | None
    days_to_limit: float | None
    chart: Chart | None


MOST_MOVED_SIGMA = 5.0
"""A move from one result to the next beyond which one of them is in doubt: that of `check`."""


@dataclass(frozen=True)
class History:
    """Everything `history` tells: the results in the order of processing, which of them count (not
    refused, not processed again later), the figures, and the newest ones' rows against limits."""

    gyro_id: str
    entries: tuple[Entry, ...]
    counting: tuple[Entry, ...]
    figures: tuple[FigureHistory, ...]
    held: tuple[Held, ...]
    guard_sigma: float

    @property
    def missed(self) -> list[str]:
        """Sentences: which limits the newest results miss."""
        return [row.describe(self.guard_sigma) for row in self.held if not row.passed]

    @property
    def doubts(self) -> list[str]:
        """Sentences: newest results that are refused, figures out of control, and those that moved
        since the last by more than both their σ allow."""
        last = {e.kind: e for e in self.entries}
        said = [
            f"the newest {e.kind} is refused"
            for e in last.values()
            if e.status == "refused" and not self.held
        ]
        return (
            said
            + [
                f"{name_of_figure(figure.name)} is out of control"
                for figure in self.figures
                if figure.chart is not None and figure.chart.out_of_control
            ]
            + [
                f"{name_of_figure(figure.name)} moved by {figure.since_before.sigma:+.3g} σ since the"
                f" last, {MOST_MOVED_SIGMA:g} σ at most were expected; measure again"
                for figure in self.figures
                if figure.since_before is not None
                and abs(figure.since_before.sigma or 0.0) > MOST_MOVED_SIGMA
            ]
        )


def history(
    entries: Sequence[Entry],
    gyro_id: str,
    *,
    limits: Mapping[str, Any] | None = None,
    names: Sequence[str] = (),
    guard_sigma: float = 0.0,
    by: str = "station",
) -> History:
    """Tell of one gyro; a guard band's σ is that of the whole ledger's gauge study.

    names: the figures that are told (default: those with limits or a σ). UsageError: a gyro or
    figure that is not there. HrgError: limits that are for no kind here.
    """
    own = sorted((e for e in entries if e.gyro_id == gyro_id), key=lambda e: (e.processed, e.added))
    if not own:
        raise no_such(gyro_id, "gyro", {e.gyro_id for e in entries})
    for name in names:
        if not any(name in e.figures for e in own):
            raise no_such(name, "figure", {n for e in own for n in e.figures})
    counting = select_independent(own)
    kinds = [kind for kind in KINDS if any(e.kind == kind for e in own)]
    tables = tables_of(limits, kinds) if limits else {}
    figures: list[FigureHistory] = []
    against: list[Held] = []
    for kind in kinds:
        of_kind = [e for e in counting if e.kind == kind]
        table = tables.get(kind, {})
        every = [e for e in own if e.kind == kind]
        bounds = bounds_of(every, table) if table else {}
        told = names or list(dict.fromkeys([*bounds, *list_usual_figures(of_kind)]))
        figures += [
            _figure(of_kind, kind, name, bounds.get(name, (None, None)))
            for name in told
            if any(name in e.figures for e in of_kind)
        ]
        whole = select_independent([e for e in entries if e.kind == kind])
        gauges = {
            name: gauge_of(list_gyros(whole, kind, name, limit, None, by, guard_sigma))
            for name, limit in bounds.items()
            if not name.endswith(AXIS)
        }
        against += hold_limits(every[-1], table, guard_sigma, gauges) if table else []
    return History(
        gyro_id, tuple(own), tuple(counting), tuple(figures), tuple(against), guard_sigma
    )


def _figure(entries: Sequence[Entry], kind: str, name: str, bounds: Bounds) -> FigureHistory:
    found = series(entries, name)
    line, before, first = trend(found), move(found), move(found, old=0)
    last = float(found.values[-1])
    return FigureHistory(
        kind=kind,
        name=name,
        units=found.units,
        times=tuple(map(float, found.times)),
        values=tuple(map(float, found.values)),
        stds=tuple(map(float, found.stds)),
        bounds=bounds,
        since_before=before,
        since_first=first,
        share_before=None if before is None else share_of_limit(before.change, bounds),
        share_first=None if first is None else share_of_limit(first.change, bounds),
        trend=line,
        days_to_limit=None if line is None else days_to_limit(last, line, *bounds),
        chart=chart(found.values),
    )
