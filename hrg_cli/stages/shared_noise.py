"""One recording under two names, told by its noise: two runs may move alike, and never share noise.

Of every run the rows' main amplitude and wave angle, less a polynomial along them, are noise; the
cross-correlation of two runs' has a single peak where one is the other, exported again, rounded,
cut or multiplied by a factor, and both columns share it. Runs that a simulator gave the same noise
move otherwise, and lines that all recordings have make no single peak.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from ..errors import EACH_RUN_ONCE, HrgError
from ..records import Wave

Array = np.ndarray
MOST_ROWS, FEWEST_ROWS = 8192, 64
"""Rows of a run that are compared, from its first; with fewer nothing is said."""
SMOOTHED, DEGREE = 15, 4
"""Rows along which, and degree with which, the motion is taken off."""
NOISE_RANGE = (0.2, 2.0)
"""Of what is left over the stated noise: beyond it the motion is still in it, or the noise is not
white."""
STEPS = 0.02
"""Relative difference of the rows' distance in time up to which two runs have the same windows."""
SHARED = 0.25
"""Correlation from which noise is shared: windows of a cut copy that lie across the first's share
half of it at least, and the polynomial takes some."""
SURE = 9.0
"""Peak over the rms of all other shifts: 1e-18, with all pairs and shifts of a lot below 1e-10."""
ALONE, BESIDE = 0.5, 3
"""Any other peak over the highest, and shifts on either side that belong to that."""
MOVES_ALIKE = 10.0
"""Standard deviations within which copies move alike, beside what they move from row to row."""


@dataclass(frozen=True)
class SharedNoise:
    """Two runs by their places, the part of the noise that they share, and the second's start less
    the first's in the first's time."""

    first: int
    second: int
    correlation: float
    shift_s: float


@dataclass(frozen=True)
class _Rows:
    """Rows of a run from its first: noise (n,) complex in its own σ, amplitude and angle (n,) with
    their σ."""

    step_s: float
    noise: Array
    transform: Array
    amplitude: Array
    angle: Array
    std: tuple[float, float]
    period_rad: float


def need_own_noise(waves: Sequence[Wave]) -> None:
    """Refuse runs of which two are one recording, exported again, rounded or cut: its rows would
    count twice.

    Parameters
    ----------
    waves
        The runs.

    Raises
    ------
    HrgError
        Two of them share their noise, and move alike.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.shared_noise import need_own_noise
    >>> need_own_noise(draw_waves())
    """
    found = find_shared_noise(waves)
    if found is None:
        return
    one, other = (
        waves[place].run_id or f"number {place + 1}" for place in (found.first, found.second)
    )
    cut = f", {abs(found.shift_s):.3g} s cut off" if found.shift_s else ""
    raise HrgError(
        f"runs {one} and {other} share {found.correlation:.0%} of their noise and move alike: one"
        f" recording under two names{cut}; {EACH_RUN_ONCE}"
    )


def find_shared_noise(waves: Sequence[Wave]) -> SharedNoise | None:
    """The first two runs that are one recording.

    Parameters
    ----------
    waves
        The runs.

    Returns
    -------
    SharedNoise or None
        None where all have noise of their own.

    Examples
    --------
    A copy of which the first five rows are cut off:

    >>> from hrg_cli.records import collect
    >>> from hrg_cli.stages.demodulate import demodulate
    >>> from hrg_cli.stages.estimate import estimate
    >>> from hrg_cli.stages.shared_noise import find_shared_noise
    >>> from hrg_cli.stages.simulate import simulate
    >>> def measure(seed):
    ...     config = {
    ...         "device": {"frequency_hz": 1000.0, "quality_factor": 1e4},
    ...         "recording": {"sample_rate_hz": 8000.0, "duration_s": 2.0},
    ...         "readout": {"noise": 1e-3},
    ...     }
    ...     samples = collect(simulate(config, seed=seed))
    ...     return collect(estimate(collect(demodulate(samples, periods_per_window=10))))
    >>> one, other = measure(1), measure(2)
    >>> find_shared_noise([one, other]) is None
    True
    >>> found = find_shared_noise([one, other, other.rows(5, len(other))])
    >>> found.first, found.second, bool(found.correlation > 0.9)
    (1, 2, True)
    """
    # twice the longest run's rows: no shift of two runs comes round to another
    length = 2 * min(MOST_ROWS, max((len(wave) for wave in waves), default=1))
    rows = [_rows_of(wave, length) for wave in waves]
    for (i, one), (k, other) in combinations(enumerate(rows), 2):
        if one is None or other is None or not _windowed_alike(one, other):
            continue
        found = _compare(one, other)
        if found is not None:
            correlation, shift = found
            return SharedNoise(i, k, correlation, shift * one.step_s)
    return None


def _windowed_alike(one: _Rows, other: _Rows) -> bool:
    return one.period_rad == other.period_rad and abs(other.step_s / one.step_s - 1) < STEPS


def _rows_of(wave: Wave, length: int) -> _Rows | None:
    """A run's rows, their transform at least `length` long; None where there are too few rows, they
    state no noise, or what is left is not noise."""
    from scipy.fft import next_fast_len

    n = min(len(wave), MOST_ROWS)
    good = wave.good()[:n]
    if np.count_nonzero(good) < max(FEWEST_ROWS, n // 2):
        return None
    t = np.asarray(wave.time_s[:n], float)
    columns, own = (
        np.stack([np.interp(t, t[good], np.asarray(one[:n], float)[good]) for one in both])
        for both in (
            (wave.main_amplitude, wave.wave_angle_rad),
            (wave.main_amplitude_std, wave.wave_angle_rad_std),
        )
    )
    if not own.min() > 0:
        return None
    noise = np.where(good, columns - _smooth(columns), 0.0) / own
    least, most = NOISE_RANGE
    level = np.sqrt(np.mean(noise[:, good] ** 2, axis=1))
    if not (np.all(level > least) and np.all(level < most)):
        return None
    stds = tuple(np.median(own, axis=1).tolist())
    both = noise[0] + 1j * noise[1]
    transform = np.fft.fft(both, next_fast_len(length))
    step, period = float(np.median(np.diff(t))), np.pi / wave.mode_number
    return _Rows(
        step, both, transform, columns[0], columns[1], (float(stds[0]), float(stds[1])), period
    )


def _smooth(columns: Array) -> Array:
    """What a polynomial along the rows about each makes of columns (c, n), at the ends that of the
    first and the last (Savitzky and Golay 1964).

    In a matrix of its own: scipy's is 25 MB of modules for every process that asks.
    """
    half = SMOOTHED // 2
    Q, _ = np.linalg.qr(np.vander(np.linspace(-1, 1, SMOOTHED), DEGREE + 1))
    fitted = Q @ Q.T
    inner = np.lib.stride_tricks.sliding_window_view(columns, SMOOTHED, axis=1) @ fitted[half]
    first, last = columns[:, :SMOOTHED] @ fitted[:, :half], columns[:, -SMOOTHED:] @ fitted
    return np.concatenate([first, inner, last[:, half + 1 :]], axis=1)


def _compare(one: _Rows, other: _Rows) -> tuple[float, int] | None:
    """(correlation, rows by which the other begins later) of one recording; None: they are two."""
    # Re Σ conj(z₁[k]) z₂[k − shift]: both columns at once
    course = np.fft.ifft(np.conj(other.transform) * one.transform).real
    place = int(np.argmax(course))
    peak, size = float(course[place]), len(course)
    away = np.abs((np.arange(size) - place + size // 2) % size - size // 2) > BESIDE
    rest = course[away]
    # shifts without any row in common have nothing, and lower no rms
    overlapping = max(1, len(one.noise) + len(other.noise) - 1 - (2 * BESIDE + 1))
    if (
        peak < SURE * float(np.sqrt(np.sum(rest**2) / overlapping))
        or float(rest.max()) > ALONE * peak
    ):
        return None
    shift = place if place < size // 2 else place - size
    a, b = max(shift, 0), max(-shift, 0)
    n = min(len(one.noise) - a, len(other.noise) - b)
    if n < FEWEST_ROWS:
        return None
    mine, its = slice(a, a + n), slice(b, b + n)
    correlation = _correlate(one.noise[mine], other.noise[its])
    if correlation < SHARED or not _move_alike(one, other, mine, its):
        return None
    # what the polynomial leaves of one motion is in the angle alone
    least = min(SHARED, max(SHARED / 2, 4 / np.sqrt(n)))
    for part in (np.real, np.imag):
        if _correlate(part(one.noise[mine]), part(other.noise[its])) < least:
            return None
    return correlation, shift


def _correlate(one: Array, other: Array) -> float:
    """Of two columns (n,), real or complex."""
    power = np.sum(np.abs(one) ** 2) * np.sum(np.abs(other) ** 2)
    return float(np.sum(one * np.conj(other)).real / np.sqrt(power)) if power > 0 else 0.0


def _move_alike(one: _Rows, other: _Rows, mine: slice, its: slice) -> bool:
    """Whether both go through the same amplitudes and angles, but for noise, a part of a row, and a
    factor that their noise has too."""
    a, b = one.amplitude[mine], other.amplitude[its]
    turned = one.angle[mine] - other.angle[its]
    turned = turned - one.period_rad * np.round(turned / one.period_rad)
    if not _differ_by_noise(one.angle[mine], turned, one.std[1]):
        return False
    if _differ_by_noise(a, a - b, one.std[0]):
        return True
    factor = float(np.median(a) / np.median(b)) if np.median(b) > 0 else 0.0
    # a simulator's seed gives runs of several amplitudes one noise of one size
    if factor <= 0 or abs(np.log(one.std[0] / other.std[0] / factor)) > abs(np.log(factor)) / 2:
        return False
    return _differ_by_noise(a, a - factor * b, one.std[0])


def _differ_by_noise(values: Array, difference: Array, std: float) -> bool:
    moved = float(np.median(np.abs(np.diff(values))))
    return float(np.median(np.abs(difference))) <= MOVES_ALIKE * std + moved
