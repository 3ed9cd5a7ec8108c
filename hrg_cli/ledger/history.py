"""What `hrg ledger history` tells of one gyro: every result, and how each figure moved against the
measurement before, the first one, its limits and time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..reporting.figure_names import name_figure
from .charts import Chart, make_chart
from .entry import KINDS, Entry
from .judging import Bounds, Held, compute_share_of_limit, find_bounds, find_tables, hold_limits
from .overview import explain_unknown, find_gauge, list_gyros
from .own_history import HistoryDistance, find_departure
from .series import AXIS, list_usual_figures, make_series, select_independent
from .trend import Move, Trend, compute_days_to_limit, find_move, fit_trend


@dataclass(frozen=True)
class FigureHistory:
    """A figure of one gyro: its measurements in the order of time, the last one's move against that
    before and the first, in σ and as a share of the limit, how far it is from its own history, its
    line over time with the days left to a limit, and its chart."""

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
    from_history: HistoryDistance | None
    trend: Trend | None
    days_to_limit: float | None
    chart: Chart | None


@dataclass(frozen=True)
class History:
    """Everything `tell_history` tells: the results in the order of processing, which of them count
    (not refused, not processed again later), the figures, and the newest ones' rows against
    limits."""

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
        """Sentences: newest results that are refused, figures out of control, and those that have
        left their own history by more than both their σ allow."""
        last = {e.kind: e for e in self.entries}
        said = [
            f"the newest {e.kind} is refused"
            for e in last.values()
            if e.status == "refused" and not self.held
        ]
        return (
            said
            + [
                f"{name_figure(figure.name)} is out of control"
                for figure in self.figures
                if figure.chart is not None and figure.chart.out_of_control
            ]
            + [
                figure.from_history.describe(figure.name)
                for figure in self.figures
                if figure.from_history is not None and figure.from_history.since is not None
            ]
        )


def tell_history(
    entries: Sequence[Entry],
    gyro_id: str,
    *,
    limits: Mapping[str, Any] | None = None,
    names: Sequence[str] = (),
    guard_sigma: float = 0.0,
    by: str = "station",
) -> History:
    """Everything that the ledger tells of one gyro.

    Parameters
    ----------
    entries
        Of the whole ledger: a guard band's σ is that of its gauge study.
    gyro_id
        The gyro.
    limits
        Of a figure; None: there are none.
    names
        Figures that are told; empty: those with limits or a σ.
    guard_sigma
        Width of the guard bands.
    by
        What tells stations apart.

    Returns
    -------
    History
        Results in the order of processing, and how each figure moved.

    Raises
    ------
    HrgError
        Limits that are for no kind here; UsageError for a gyro or a figure that is not there.

    Examples
    --------
    >>> from hrg_cli.ledger.entry import Entry, Figure
    >>> from hrg_cli.ledger.history import tell_history
    >>> def tell(value, day):
    ...     figures = {"scale_factor": Figure(value, 1e-3, "1")}
    ...     return Entry(
    ...         str(day), "r.h5", "resonator", "SN-1", f"2026-01-0{day}T00:00:00Z", "valid",
    ...         figures=figures,
    ...     )
    >>> (figure,) = tell_history([tell(0.55, 1), tell(0.56, 2)], "SN-1").figures
    >>> round(figure.since_before.change, 9), round(figure.since_before.sigma, 2)
    (0.01, 7.07)
    """
    own = sorted((e for e in entries if e.gyro_id == gyro_id), key=lambda e: (e.processed, e.added))
    if not own:
        raise explain_unknown(gyro_id, "gyro", {e.gyro_id for e in entries})
    for name in names:
        if not any(name in e.figures for e in own):
            raise explain_unknown(name, "figure", {n for e in own for n in e.figures})
    counting = select_independent(own)
    kinds = [kind for kind in KINDS if any(e.kind == kind for e in own)]
    tables = find_tables(limits, kinds) if limits else {}
    figures: list[FigureHistory] = []
    against: list[Held] = []
    for kind in kinds:
        of_kind = [e for e in counting if e.kind == kind]
        table = tables.get(kind, {})
        every = [e for e in own if e.kind == kind]
        bounds = find_bounds(every, table) if table else {}
        told = names or list(dict.fromkeys([*bounds, *list_usual_figures(of_kind)]))
        figures += [
            _figure(of_kind, kind, name, bounds.get(name, (None, None)))
            for name in told
            if any(name in e.figures for e in of_kind)
        ]
        whole = select_independent([e for e in entries if e.kind == kind])
        gauges = {
            name: find_gauge(list_gyros(whole, kind, name, limit, None, by, guard_sigma))
            for name, limit in bounds.items()
            if not name.endswith(AXIS)
        }
        against += hold_limits(every[-1], table, guard_sigma, gauges) if table else []
    return History(
        gyro_id, tuple(own), tuple(counting), tuple(figures), tuple(against), guard_sigma
    )


def _figure(entries: Sequence[Entry], kind: str, name: str, bounds: Bounds) -> FigureHistory:
    found = make_series(entries, name)
    line, before, first = fit_trend(found), find_move(found), find_move(found, old=0)
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
        share_before=None if before is None else compute_share_of_limit(before.change, bounds),
        share_first=None if first is None else compute_share_of_limit(first.change, bounds),
        from_history=find_departure(found),
        trend=line,
        days_to_limit=None if line is None else compute_days_to_limit(last, line, *bounds),
        chart=make_chart(found.values),
    )
