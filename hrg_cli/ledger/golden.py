"""A golden unit: one gyro measured again and again on every station, whose changes are the
stations'."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .charts import Chart, make_chart
from .entry import Entry
from .series import FigureSeries, make_series
from .trend import Move, Trend, compute_mean, compute_repeats_p, find_move, fit_trend


@dataclass(frozen=True)
class Golden:
    """A figure of the golden unit on one station: mean with σ, its distance from the mean of the
    other stations (in σ of both), from its own first measurement, along time, and its chart.

    scatter_p: the probability that repeats scatter so far by their stated σ alone.
    """

    station: str
    kind: str
    name: str
    units: str
    measurements: int
    mean: float
    mean_std: float
    from_others: Move | None
    since_first: Move | None
    trend: Trend | None
    scatter_p: float | None
    chart: Chart | None
    measured: FigureSeries
    """The chart's points in the order of time."""


def describe_golden_unit(entries: Sequence[Entry], names: Sequence[str], by: str) -> list[Golden]:
    """How a golden unit was measured on each station.

    Parameters
    ----------
    entries
        Its own results of one kind, in the order of time.
    names
        Figures.
    by
        What tells stations apart: "station", "operator" …

    Returns
    -------
    list of Golden
        A row a station and figure; a figure that a station's results do not have has none.

    Examples
    --------
    >>> from hrg_cli.ledger.entry import Entry, Figure
    >>> from hrg_cli.ledger.golden import describe_golden_unit
    >>> def tell(station, value, day):
    ...     figures = {"scale_factor": Figure(value, 1e-3, "1")}
    ...     return Entry(
    ...         f"{station}{day}",
    ...         "r.h5",
    ...         "resonator",
    ...         "SN-1",
    ...         f"2026-01-0{day}T00:00:00Z",
    ...         "valid",
    ...         station=station,
    ...         figures=figures,
    ...     )
    >>> entries = [tell("north", 0.55, 1), tell("south", 0.56, 2)]
    >>> rows = describe_golden_unit(entries, ["scale_factor"], "station")
    >>> [(row.station, round(row.from_others.change, 9)) for row in rows]
    [('north', -0.01), ('south', 0.01)]
    """
    rows = []
    for name in names:
        whole = make_series(entries, name)
        stations = np.array([str(getattr(e, by)) for e in whole.entries], dtype=object)
        for station in sorted(set(stations)):
            here = stations == station
            rows.append(_row(station, whole.select(here), whole.select(~here)))
    return rows


def _row(station: str, own: FigureSeries, others: FigureSeries) -> Golden:
    mean, std = compute_mean(own)
    return Golden(
        station=station,
        kind=own.entries[0].kind,
        name=own.name,
        units=own.units,
        measurements=len(own),
        mean=mean,
        mean_std=std,
        from_others=_difference(own, others) if len(others) else None,
        since_first=find_move(own, old=0),
        trend=fit_trend(own),
        scatter_p=compute_repeats_p(own),
        chart=make_chart(own.values),
        measured=own,
    )


def _difference(own: FigureSeries, others: FigureSeries) -> Move:
    (mean, std), (other, other_std) = compute_mean(own), compute_mean(others)
    both = math.hypot(std, other_std)
    return Move(mean - other, (mean - other) / both if both > 0 else None)
