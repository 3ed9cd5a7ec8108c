"""Measurements of one figure in the order of time, independent of each other: what charts, drifts
and gauge studies are made of."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ..comparing import compute_change
from ..origins import overlap
from ..records.time_origin import parse_time
from .entry import Entry

Array = np.ndarray
DAY_S = 86_400.0
AXIS = ("axis_rad", "axis_rad.value")
"""Ends of an axis's name: axes lie at random from gyro to gyro and repeat, so that nothing is asked
of them over many gyros."""


@dataclass(frozen=True)
class FigureSeries:
    """A figure of n results: values, their σ (NaN where unknown), times in s, and whose they
    are."""

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
    """The results that count, in the order of time.

    Those not refused, and of several made from the same recorded samples the one made last. Time is
    that of measurement where every result knows it, else that of processing.

    Parameters
    ----------
    entries
        The results.

    Returns
    -------
    list of Entry
        One measurement each.

    Examples
    --------
    The same samples processed twice are one measurement:

    >>> from hrg_cli.ledger.entry import Entry
    >>> from hrg_cli.ledger.series import select_independent
    >>> def tell(day, samples):
    ...     processed = f"2026-01-0{day}T00:00:00Z"
    ...     return Entry(str(day), "", "resonator", "SN-1", processed, "valid", samples=(samples,))
    >>> [entry.sha256 for entry in select_independent([tell(1, "a"), tell(2, "a"), tell(3, "b")])]
    ['2', '3']
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
        return np.array([parse_time(e.measured) for e in entries])
    except (ValueError, OverflowError):
        return np.array([parse_time(e.processed) for e in entries])


def find_newest(entries: Iterable[Entry]) -> dict[tuple[str, str], Entry]:
    """The last result of every gyro and kind.

    Parameters
    ----------
    entries
        In the order of time.

    Returns
    -------
    dict
        (kind, gyro) -> its last result.

    Examples
    --------
    >>> from hrg_cli.ledger.entry import Entry
    >>> from hrg_cli.ledger.series import find_newest
    >>> entries = [Entry(sha, "", "resonator", "SN-1", "", "valid") for sha in ("old", "new")]
    >>> find_newest(entries)["resonator", "SN-1"].sha256
    'new'
    """
    return {(e.kind, e.gyro_id): e for e in entries}


def make_series(entries: Sequence[Entry], name: str) -> FigureSeries:
    """A figure of the results that have it, in their order.

    Parameters
    ----------
    entries
        The results.
    name
        Figure.

    Returns
    -------
    FigureSeries
        An axis, which repeats after π/m, without its jumps from the first one.

    Examples
    --------
    >>> from hrg_cli.ledger.entry import Entry, Figure
    >>> from hrg_cli.ledger.series import make_series
    >>> def tell(value, day):
    ...     processed, figures = (
    ...         f"2026-01-0{day}T00:00:00Z",
    ...         {"scale_factor": Figure(value, None, "1")},
    ...     )
    ...     return Entry(str(day), "", "resonator", "SN-1", processed, "valid", figures=figures)
    >>> found = make_series([tell(0.55, 1), tell(0.56, 4)], "scale_factor")
    >>> found.values.tolist(), found.days.tolist(), found.stds.tolist()
    ([0.55, 0.56], [0.0, 3.0], [nan, nan])
    """
    having = [e for e in entries if name in e.figures]
    figures = [e.figures[name] for e in having]
    first = figures[0].value if figures else 0.0
    values = [
        first + compute_change(name, first, f.value, e.mode_number) for e, f in zip(having, figures)
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
    """The figures that are told where none are named: those with a standard deviation.

    Parameters
    ----------
    entries
        The results.

    Returns
    -------
    list of str
        Without a diagnosis's second telling of the resonator and of what it gained.

    Examples
    --------
    >>> from hrg_cli.ledger.entry import Entry, Figure
    >>> from hrg_cli.ledger.series import list_usual_figures
    >>> figures = {"scale_factor": Figure(0.55, 1e-3, "1"), "runs": Figure(4.0, None, "1")}
    >>> list_usual_figures([Entry("", "", "resonator", "SN-1", "", "valid", figures=figures)])
    ['scale_factor']
    """
    return [
        name
        for name in _with_std(entries)
        if not name.startswith(("details.", "values.", "gain."))
        or name == "gain.drift_error_deg_h.after"
    ]
