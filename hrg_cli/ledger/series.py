"""Measurements of one figure in the order of time, independent of each other: what charts, drifts
and gauge studies are made of."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ..comparing import change_of
from ..origins import overlap
from .entry import Entry
from .times import moment

Array = np.ndarray
DAY_S = 86_400.0
AXIS = ("axis_rad", "axis_rad.value")
"""Ends of an axis's name: axes lie at random from gyro to gyro and repeat, so that nothing is asked
of them over many gyros."""


@dataclass(frozen=True)
class FigureSeries:
    """A figure of n results: values, their σ (NaN where unknown), times in s, and whose they are."""

    name: str
    units: str
    values: Array
    stds: Array
    times: Array
    entries: tuple[Entry, ...]

    def __len__(self) -> int:
        return len(self.values)

    def select(self, chosen: Array) -> FigureSeries:
        """The measurements of a mask (n,), or those at these places in their order."""
        entries = tuple(self.entries[i] for i in np.arange(len(self))[chosen])
        return FigureSeries(
            self.name,
            self.units,
            self.values[chosen],
            self.stds[chosen],
            self.times[chosen],
            entries,
        )

    @property
    def days(self) -> Array:
        """Days since the first."""
        return (self.times - self.times[0]) / DAY_S if len(self) else self.times


def select_independent(entries: Sequence[Entry]) -> list[Entry]:
    """The results that count, in the order of time: those not refused, and of several made from the
    same recorded samples the one made last.

    Time is that of measurement where every result knows it, else that of processing.
    """
    kept: list[Entry] = []
    taken: dict[tuple[str, str], list[str]] = {}
    for entry in sorted(entries, key=lambda e: (e.processed, e.added), reverse=True):
        if entry.status == "refused":
            continue
        used = taken.setdefault((entry.kind, entry.gyro_id), [])
        if not any(_shared(a, b) for a in entry.samples for b in used):
            kept.append(entry)
            used += entry.samples
    times = _times_of(kept)
    return [kept[i] for i in np.argsort(times, kind="stable")]


def _shared(one: str, other: str) -> bool:
    """Whether two fingerprints, FINGERPRINT or FINGERPRINT@from:to, are of common samples."""
    a, _, part_a = one.partition("@")
    b, _, part_b = other.partition("@")
    return a == b and overlap(part_a, part_b)


def _times_of(entries: Sequence[Entry]) -> Array:
    """Seconds since 1970: of measurement where all know it, else of processing."""
    try:
        return np.array([moment(e.measured) for e in entries])
    except (ValueError, OverflowError):
        return np.array([moment(e.processed) for e in entries])


def newest(entries: Iterable[Entry]) -> dict[tuple[str, str], Entry]:
    """(kind, gyro) -> the last of its results, in the order given."""
    return {(e.kind, e.gyro_id): e for e in entries}


def series(entries: Sequence[Entry], name: str) -> FigureSeries:
    """A figure of the results that have it; an axis, which repeats after π/m, without its jumps
    from the first one."""
    having = [e for e in entries if name in e.figures]
    figures = [e.figures[name] for e in having]
    first = figures[0].value if figures else 0.0
    values = [
        first + change_of(name, first, f.value, e.mode_number) for e, f in zip(having, figures)
    ]
    stds = [np.nan if f.std is None else f.std for f in figures]
    units = figures[0].units if figures else ""
    return FigureSeries(
        name, units, np.array(values), np.array(stds), _times_of(having), tuple(having)
    )


def _with_std(entries: Iterable[Entry]) -> list[str]:
    """Names of the figures whose σ is known and above 0 in some result, in their order."""
    return list(dict.fromkeys(n for e in entries for n, figure in e.figures.items() if figure.std))


def list_usual_figures(entries: Iterable[Entry]) -> list[str]:
    """The figures that are told where none are named: those with a σ, without a diagnosis's second
    telling of the resonator and of what it gained."""
    return [
        name
        for name in _with_std(entries)
        if not name.startswith(("details.", "values.", "gain."))
        or name == "gain.drift_error_deg_h.after"
    ]
