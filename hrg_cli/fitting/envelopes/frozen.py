"""What of a measured wave stands still: stretches of rows that repeat one value, which noise never
does.

Two neighbouring values of white noise σ on a lattice of step q are equal with probability
p = q/(2√π σ) (the density of their difference at nought, times q) or less, where the wave moves
beside the noise. n such pairs in a row among N have the chance N·pⁿ. Values that are coarse, or
held for a few rows by a logger, repeat everywhere: there p is how often a new value is repeated.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ...records import Wave
from ..samples.least_count import least_count
from .envelope_runs import envelopes_of

Array = np.ndarray
CHANCE = 1e-9
"""Chance that noise repeats a value in so many rows of a run."""
FEWEST = 4
"""Rows of one value from which they are looked at."""
QUIET = 0.1
"""Part of the stated σ below which a run shows no noise at all: a simulation without any."""
EXACTLY = 1e-2
"""Part of a lattice's step to which values lie on it."""
ROUNDINGS = 16.0
"""Roundings to which envelopes put together from amplitudes and angles are one value."""
COLUMNS = {
    "main_amplitude": "main amplitude",
    "quadrature_amplitude": "quadrature amplitude",
    "wave_angle_rad": "wave angle",
    "phase_rad": "phase",
}
CHANNELS = ("channel C", "channel S")
CORRECTION = (
    "look at the channel or the column that this came from; record the run again, or leave these"
    " rows out (--from-s, --to-s)"
)
"""What to do about it."""


@dataclass(frozen=True)
class Frozen:
    """What repeats one value (column or channel) in `rows` of `of_rows` rows, from `first_s` to
    `last_s`, beside a stated σ."""

    what: str
    value: float
    std: float
    first_s: float
    last_s: float
    rows: int
    of_rows: int

    @property
    def evidence(self) -> str:
        """The figures that show it."""
        return (
            f"{self.rows} of {self.of_rows} windows, from {self.first_s:.6g} to"
            f" {self.last_s:.6g} s, repeat {self.value:.9g} exactly, where a σ of {self.std:.3g}"
            " is stated: noise does not"
        )


def frozen(waves: Sequence[Wave]) -> list[list[Frozen]]:
    """What stands still in each wave: whole channels, else single columns.

    A channel that is nought in every run was not recorded, and nothing is said of its ellipse.
    """
    seen = [_Rows.of(wave) for wave in waves]
    absent = [all(not one.envelope[:, k].any() for one in seen) for k in range(len(CHANNELS))]
    if any(absent):
        return [[] for _ in waves]
    return [list(_channels(one)) or list(_columns(one)) for one in seen]


@dataclass(frozen=True)
class _Rows:
    """The good rows of a wave and its envelopes (n, 2) there."""

    wave: Wave
    rows: Array
    envelope: Array

    @classmethod
    def of(cls, wave: Wave) -> _Rows:
        rows = np.flatnonzero(wave.good() & np.isfinite(wave.phase_rad))
        return cls(wave, rows, envelopes_of(wave, rows))

    def column(self, name: str) -> Array:
        """A column (n,) of the wave."""
        return np.asarray(getattr(self.wave, name), float)[self.rows]

    def told(self, what: str, value: float, std: float, stretch: tuple[int, int]) -> Frozen:
        """The finding of rows from the first to the last of a stretch."""
        time = self.column("time_s")
        first, last = stretch
        return Frozen(what, value, std, time[first], time[last], last - first + 1, len(self.rows))

    def noisy(self, stretch: tuple[int, int]) -> bool:
        """Whether the envelopes of a stretch show the noise that they state, by third
        differences."""
        own = slice(stretch[0], stretch[1] + 1)
        rough = np.sum(np.abs(np.diff(self.envelope[own], n=3, axis=0)) ** 2, axis=1)
        level = np.sqrt(np.median(rough) / (20 * 4)) if len(rough) else 0.0
        return bool(level > QUIET * np.median(self.column("signal_std")[own]))


def _channels(seen: _Rows) -> Iterator[Frozen]:
    """Channels whose envelope stands still, or is nought, to the rounding of what it is put
    together from."""
    if len(seen.rows) < FEWEST:
        return
    turned = 1 + np.abs(seen.column("phase_rad")).max()
    size = np.abs(seen.envelope).max()
    rounding = ROUNDINGS * np.finfo(float).eps * turned * size
    std = float(np.median(seen.column("signal_std")))
    for k, name in enumerate(CHANNELS):
        same = np.abs(np.diff(seen.envelope[:, k])) <= rounding
        stretch = _stretch(same, rounding / std if std > 0 else np.inf)
        if stretch is not None:
            yield seen.told(name, float(np.abs(seen.envelope[stretch[0], k])), std, stretch)


def _columns(seen: _Rows) -> Iterator[Frozen]:
    """Columns of the wave that repeat a value exactly while the wave shows noise elsewhere."""
    if len(seen.rows) < FEWEST:
        return
    for name, words in COLUMNS.items():
        values, std = seen.column(name), float(np.median(seen.column(f"{name}_std")))
        stretch = _stretch(np.diff(values) == 0, _step(values) / std if std > 0 else np.inf)
        if stretch is not None and seen.noisy(stretch):
            yield seen.told(words, float(values[stretch[0]]), std, stretch)


def _step(values: Array) -> float:
    """The lattice on which all values lie, else their rounding; steps of an even motion are as
    equal as a lattice's and are told from one by what is left beside whole steps."""
    rounding, step = float(np.spacing(np.abs(values).max())), least_count([values])
    if step <= rounding:
        return rounding
    steps = np.diff(values) / step
    return step if np.abs(steps - np.round(steps)).max() < EXACTLY else rounding


def _stretch(same: Array, step: float) -> tuple[int, int] | None:
    """First and last row of the longest stretch of one value, where noise would not leave one so
    long; None where it would.

    same (n − 1,): pairs that are equal; step: of the values, in σ.
    """
    edges = np.flatnonzero(np.diff(np.concatenate([[0], same.astype(np.int8), [0]])))
    starts, stops = edges[::2], edges[1::2]
    if not len(starts):
        return None
    longest = int(np.argmax(stops - starts))
    pairs = int(stops[longest] - starts[longest])
    unequal = len(same) - np.count_nonzero(same)
    begun = np.count_nonzero(np.delete(starts, longest))
    chance = max(step / (2 * np.sqrt(np.pi)), begun / unequal if unequal else 0.0)
    if pairs + 1 < FEWEST or chance >= 1 or len(same) * chance**pairs > CHANCE:
        return None
    return int(starts[longest]), int(stops[longest])
