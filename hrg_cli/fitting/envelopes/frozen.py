"""What of a measured wave stands still: stretches of rows that repeat one value, which noise never
does.

Two neighbouring values of white noise σ on a lattice of step q are equal with probability
p = q/(2√π σ) (the density of their difference at nought, times q) or less, where the wave moves
beside the noise. n such pairs in a row among N have the chance N·pⁿ. Values that are coarse, or
held for a few rows by a logger, repeat everywhere: there p is how often a new value is repeated.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from ...least_count import find_least_count
from ...records import Wave
from ..samples.stretches import Stretches
from .envelope_runs import compute_envelopes

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
SAMPLED = (*COLUMNS, *(f"{name}_std" for name in COLUMNS), "signal_std")
READ = (*SAMPLED, "time_s", "flags", "iterations")
"""The columns that are looked at, so that nothing else of a long file is."""
BLOCK, SAMPLE = 1 << 16, 1 << 16
"""Rows that are read at a time; rows of a run that are sampled for what is usual in it."""
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


def find_frozen(waves: Sequence[Wave]) -> list[list[Frozen]]:
    """What stands still in each wave, read block by block: whole channels, else single columns.

    Parameters
    ----------
    waves
        Of one gyro.

    Returns
    -------
    list of list of Frozen
        Of every wave; empty where nothing repeats a value for longer than noise ever would. A
        channel that is nought in every run was not recorded, and nothing is said of its ellipse.

    Examples
    --------
    A wave angle that stops for fifty of 400 windows, while the rest goes on:

    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli import Wave
    >>> from hrg_cli.fitting.envelopes.frozen import find_frozen
    >>> t, noise = np.arange(400.0), 1e-4 * np.random.default_rng(0).standard_normal((4, 400))
    >>> noise[2, 100:150] = noise[2, 100]
    >>> wave = Wave(**{f.name: 0 * t + 1e-4 for f in fields(Wave) if f.default is MISSING} | dict(
    ...     time_s=t, flags=np.zeros(400, "u1"), iterations=np.zeros(400, "i2"), mode="free",
    ...     main_amplitude=1 + noise[0], quadrature_amplitude=noise[1], phase_rad=noise[3],
    ...     wave_angle_rad=0.3 + noise[2], reference_frequency_hz=5e3, window_s=1.0,
    ... ))
    >>> [(one.what, one.rows, one.first_s, one.last_s) for one in find_frozen([wave])[0]]
    [('wave angle', 50, 100.0, 149.0)]
    """
    seen = [_Seen.from_wave(wave) for wave in waves]
    if any(all(one.silent[k] for one in seen) for k in range(len(CHANNELS))):
        return [[] for _ in waves]
    return [list(_channels(one)) or list(_columns(one)) for one in seen]


@dataclass
class _Seen:
    """What a wave's good rows show: their number, the stretches in which each column and channel
    repeats a value, whether a channel is nought throughout, the rounding of the envelopes, and a
    sample of the columns."""

    wave: Wave
    rows: int = 0
    stretches: dict[str, Stretches] = field(default_factory=lambda: defaultdict(Stretches))
    silent: list[bool] = field(default_factory=lambda: [True] * len(CHANNELS))
    rounding: float = 0.0
    sample: dict[str, Array] = field(default_factory=dict)
    envelope: Array = field(default_factory=lambda: np.zeros((0, 2), complex))

    @classmethod
    def from_wave(cls, wave: Wave) -> _Seen:
        seen, every = cls(wave), max(1, -(-len(wave) // SAMPLE))
        sampled: dict[str, list[Array]] = {name: [] for name in SAMPLED}
        envelopes: list[Array] = [seen.envelope]
        last: dict[str, Array] = {}
        for part, rows in _good_parts(wave):
            for name, values in sampled.items():
                values.append(np.asarray(getattr(part, name), float)[rows[::every]])
            here = {name: np.asarray(getattr(part, name), float)[rows] for name in COLUMNS}
            here["envelope"] = compute_envelopes(part, rows)
            envelopes.append(here["envelope"][::every].copy())  # a view would hold the block
            seen._add(
                {name: np.concatenate([last.get(name, v[:0]), v]) for name, v in here.items()}
            )
            last = {name: values[-1:] for name, values in here.items()}
            seen.rows += len(rows)
        seen.sample = {
            name: np.concatenate(values or [np.zeros(0)]) for name, values in sampled.items()
        }
        seen.envelope = np.concatenate(envelopes)
        return seen

    def _add(self, columns: dict[str, Array]) -> None:
        """More rows, the last one of those before them first."""
        u = columns.pop("envelope")
        turned = 1 + np.abs(columns["phase_rad"]).max()
        # the cosine of an angle φ is known to ε·|φ|, for φ itself is rounded to that
        rounding = ROUNDINGS * np.finfo(float).eps * turned * float(np.abs(u).max())
        self.rounding = max(self.rounding, rounding)
        for k, name in enumerate(CHANNELS):
            self.silent[k] &= not u[:, k].any()
            self.stretches[name].add(np.abs(np.diff(u[:, k])) <= rounding)
        for name, values in columns.items():
            self.stretches[name].add(np.diff(values) == 0)

    def std(self, name: str) -> float:
        """The usual σ that is stated of a column."""
        return float(np.median(self.sample[name]))

    def describe(self, what: str, name: str, std: float, stretch: tuple[int, int]) -> Frozen:
        """The finding of rows from the first to the last of a stretch; name: a column, or a
        channel."""
        first, last = (self._row(place) for place in stretch)
        if name in CHANNELS:
            value = np.abs(compute_envelopes(first)[0, CHANNELS.index(name)])
        else:
            value = getattr(first, name)[0]
        times = float(first.time_s[0]), float(last.time_s[0])
        return Frozen(what, float(value), std, *times, stretch[1] - stretch[0] + 1, self.rows)

    def _row(self, place: int) -> Wave:
        """The good row of that number."""
        return next(self._from(place, place))

    def _from(self, first: int, last: int) -> Iterator[Wave]:
        """The good rows from the first to the last, part by part."""
        passed = 0
        for part, rows in _good_parts(self.wave):
            own = rows[max(first - passed, 0) : max(last + 1 - passed, 0)]
            passed += len(rows)
            if len(own):
                yield part.picked(own)

    def is_noisy(self, stretch: tuple[int, int]) -> bool:
        """Whether the envelopes of a stretch, or of as much of it as is read at a time, show the
        noise that they state, by third differences."""
        part = next(self._from(*stretch))
        rough = np.sum(np.abs(np.diff(compute_envelopes(part), n=3, axis=0)) ** 2, axis=1)
        # third differences of white noise have 1² + 3² + 3² + 1² = 20 times its variance; two
        # complex envelopes are four components
        level = np.sqrt(np.median(rough) / (20 * 4)) if len(rough) else 0.0
        return bool(level > QUIET * np.median(part.signal_std))


def _good_parts(wave: Wave) -> Iterator[tuple[Wave, Array]]:
    """A wave piece by piece, with the numbers of the good rows in each; pieces without are left
    out."""
    for part in wave.only(READ).blocks(BLOCK):
        rows = np.flatnonzero(part.good() & np.isfinite(part.phase_rad))
        if len(rows):
            yield part, rows


def _channels(seen: _Seen) -> Iterator[Frozen]:
    """Channels whose envelope stands still, or is nought, to the rounding of what it is put
    together from, or to the lattice on which I and Q were written."""
    if seen.rows < FEWEST:
        return
    std = seen.std("signal_std")
    for k, name in enumerate(CHANNELS):
        step = max(seen.rounding, _find_lattice(seen.envelope[:, k], seen.rounding))
        stretch = _improbable(seen.stretches[name], step / std if std > 0 else np.inf)
        if stretch is not None:
            yield seen.describe(name, name, std, stretch)


def _columns(seen: _Seen) -> Iterator[Frozen]:
    """Columns of the wave that repeat a value exactly while the wave shows noise elsewhere."""
    if seen.rows < FEWEST:
        return
    for name, words in COLUMNS.items():
        std, step = seen.std(f"{name}_std"), _step(seen.sample[name])
        stretch = _improbable(seen.stretches[name], step / std if std > 0 else np.inf)
        if stretch is not None and seen.is_noisy(stretch):
            yield seen.describe(words, name, std, stretch)


def _find_lattice(envelope: Array, rounding: float) -> float:
    """The step to which I and Q of a channel (n,) were written, 0 where their values are a
    continuum; what is calculated from amplitudes and angles is one value up to its rounding."""
    values = np.sort(np.concatenate([envelope.real, envelope.imag]))
    apart = np.concatenate([[True], np.diff(values) > 2 * rounding])[: len(values)]
    return find_least_count([values[apart]])


def _step(values: Array) -> float:
    """The lattice on which all values lie, else their rounding; steps of an even motion are as
    equal as a lattice's and are told from one by what is left beside whole steps."""
    rounding, step = float(np.spacing(np.abs(values).max())), find_least_count([values])
    if step <= rounding:
        return rounding
    steps = np.diff(values) / step
    return step if np.abs(steps - np.round(steps)).max() < EXACTLY else rounding


def _improbable(found: Stretches, step: float) -> tuple[int, int] | None:
    """First and last row of the longest stretch of one value, where noise would not leave one so
    long; None where it would.

    found: of the pairs of neighbouring rows that are equal; step: of the values, in σ.
    """
    pairs, unequal = found.longest[1] - found.longest[0], found.count - found.true
    begun = found.begun - (found.longest[0] > 0)
    chance = max(step / (2 * np.sqrt(np.pi)), begun / unequal if unequal else 0.0)
    if pairs + 1 < FEWEST or chance >= 1 or found.count * chance**pairs > CHANCE:
        return None
    return found.longest
