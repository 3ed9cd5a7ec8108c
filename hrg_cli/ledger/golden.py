"""A golden unit: one gyro measured again and again on every station, whose changes are the
stations'."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .charts import Chart, chart
from .entry import Entry
from .series import FigureSeries, series
from .trend import Move, Trend, mean_of, move, repeats_p, trend


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


def golden_unit(entries: Sequence[Entry], names: Sequence[str], by: str) -> list[Golden]:
    """A row a station and figure, of the golden unit's own results of one kind in the order of
    time; a figure that a station's results do not have has no row."""
    rows = []
    for name in names:
        whole = series(entries, name)
        stations = np.array([str(getattr(e, by)) for e in whole.entries], dtype=object)
        for station in sorted(set(stations)):
            here = stations == station
            rows.append(_row(station, whole.select(here), whole.select(~here)))
    return rows


def _row(station: str, own: FigureSeries, others: FigureSeries) -> Golden:
    mean, std = mean_of(own)
    return Golden(
        station=station,
        kind=own.entries[0].kind,
        name=own.name,
        units=own.units,
        measurements=len(own),
        mean=mean,
        mean_std=std,
        from_others=_difference(own, others) if len(others) else None,
        since_first=move(own, old=0),
        trend=trend(own),
        scatter_p=repeats_p(own),
        chart=chart(own.values),
        measured=own,
    )


def _difference(own: FigureSeries, others: FigureSeries) -> Move:
    (mean, std), (other, other_std) = mean_of(own), mean_of(others)
    both = math.hypot(std, other_std)
    return Move(mean - other, (mean - other) / both if both > 0 else None)
