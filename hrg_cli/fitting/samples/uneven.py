"""Rows from uneven sampling: windows of a fixed duration, least squares at the true times by
batched normal equations."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...errors import HrgError
from ...records import FLAG_CLIPPED, FLAG_GAP, FLAG_NOT_FINITE, Recording
from .basis import Pull, build_columns, build_pairs, build_window_basis, compute_pull
from .demodulator import Demodulator
from .envelope_motion import NEIGHBOURS
from .gaps import Gaps
from .signal_rows import Rows
from .stillness import count_least, find_still, mark_stretches
from .windows import Fits, count_pooled_rows

Array = np.ndarray


def make_uneven_rows(run: Demodulator, block_samples: int) -> Iterator[Rows]:
    """Blocks of rows from uneven sampling, in the order of time.

    Parameters
    ----------
    run
        The recording on its way through; its window and its gaps are set here.
    block_samples
        Samples that are read at once.

    Returns
    -------
    Iterator of dict
        Columns by name, as `make_rows` makes them.

    Raises
    ------
    HrgError
        Times that do not increase or jump; a recording too short for one window.

    Examples
    --------
    Half a second without a sample:

    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.fitting.samples.demodulator import Demodulator
    >>> from hrg_cli.fitting.samples.survey import survey
    >>> from hrg_cli.fitting.samples.uneven import make_uneven_rows
    >>> t = np.arange(60_000) / 20e3
    >>> t = t[(t < 1) | (t > 1.5)]
    >>> noise = 1e-3 * np.random.default_rng(0).standard_normal((2, len(t)))
    >>> c, s = np.array([[1.0], [0.5]]) * np.cos(2 * np.pi * 1000 * t) + noise
    >>> one = Recording(c=c, s=s, time_s=t, mode="free")
    >>> run = Demodulator(one, survey(one, "run"), "run", 5.0, None)
    >>> flags = np.concatenate([block["flags"] for block in make_uneven_rows(run, 1 << 16)])
    >>> run.gaps.count, round(run.gaps.total_s, 3), int(np.count_nonzero(flags & 2))
    (1, 0.5, 102)
    """
    recording, n, step = run.recording, len(run.recording.c), run.survey.step_s
    begin, end = (float(recording.times(a, a + 1)[0]) for a in (0, n - 1))
    span = end - begin + step
    if run.periods_asked / run.reference_hz > span:
        raise run.tell_too_short()
    width = _choose_width(run, step)
    run.window_s = width
    total = int(span / width + 1e-9)
    if total < 1:
        raise run.tell_too_short()
    pool = count_pooled_rows(width / step - run.count_columns())
    chunk = run.count_windows(width / step, pool)
    _learn(run, width, step)
    run.gaps = Gaps(begin, width, step, run.reference_hz)
    reader = _Reader(recording, begin, width, block_samples, run.name)
    for first in range(0, total, chunk):
        last = min(first + chunk, total)
        # windows beside the chunk's own: a window's motion is told by those about it, and no
        # result may hang on where chunks end
        low, high = max(0, first - NEIGHBOURS), min(last + NEIGHBOURS, total)
        time, raw, window = reader.read_windows(low, high)
        centre = begin + (np.arange(low, high) + 0.5) * width
        local = run.find_hz(begin + (first + chunk / 2) * width)
        y = np.stack([raw[0] * run.find_scale(0), raw[1] * run.find_scale(1)])
        fits = fit_uneven(
            time, y, window - low, centre, width, run.list_bands(local), run.nuisance, run.moving
        )
        flags = np.zeros(high - low, "u1")
        flags[run.gaps.find_touched(time, low, high)] |= FLAG_GAP
        stretches = find_still(raw[0], raw[1], count_least(1 / (step * run.reference_hz)))
        still = mark_stretches(window[stretches] - low, high - low)
        fits.envelope[:, still], fits.residual2[:, still] = np.nan, np.nan
        flags[still] |= FLAG_GAP
        flags[window[~np.isfinite(y).all(0)] - low] |= FLAG_NOT_FINITE
        flags[~np.isfinite(fits.residual2).all(0) & (flags & FLAG_NOT_FINITE == 0)] |= FLAG_GAP
        for k in range(2):
            lowest, highest = run.survey.rails[k]
            flags[window[(raw[k] >= highest) | (raw[k] <= lowest)] - low] |= FLAG_CLIPPED
        keep = slice(first - low, last - low)
        block = run.make_block(last - first)
        block["flags"][:] = flags[keep]
        run.note_still(centre[keep], still[keep])
        run.fill(fits, centre, local, keep, block, slice(None))
        yield block


def _sum_normal_equations(basis: Array, right: Array, starts: Array) -> tuple[Array, Array]:
    """AᵀA (windows, k, k) and AᵀB (windows, k, ·) of windows that begin at the samples `starts`;
    column by column: the products of all pairs at once would be n·k² numbers."""
    k = basis.shape[1]
    gram = np.zeros((len(starts), k, k))
    cross = np.zeros((len(starts), k, right.shape[1]))
    for a in range(k):
        gram[:, a, a:] = np.add.reduceat(basis[:, a : a + 1] * basis[:, a:], starts, axis=0)
        gram[:, a:, a] = gram[:, a, a:]
        cross[:, a] = np.add.reduceat(basis[:, a : a + 1] * right, starts, axis=0)
    return gram, cross


def _sum_squares(columns: Array, starts: Array) -> Array:
    """BᵀB (windows, k, k) of columns (n, k)."""
    return np.asarray(np.add.reduceat(columns[:, :, None] * columns[:, None, :], starts, axis=0))


@dataclass(frozen=True)
class _Sums:
    """Sums over the samples of each window, by which its least squares are solved."""

    gram: Array  # AᵀA (windows, k, k)
    cross: Array  # AᵀB (windows, k, ·)
    square: Array  # Σy² (windows, channels)
    samples: Array  # (windows,)
    present: Array  # windows that hold samples
    starts: Array  # their first samples

    @classmethod
    def from_samples(cls, basis: Array, right: Array, y: Array, window: Array, rows: int) -> _Sums:
        """Of samples (n,) whose windows do not decrease; a window without samples has zeros."""
        k = basis.shape[1]
        present, starts, count = np.unique(window, return_index=True, return_counts=True)
        samples = np.zeros(rows, int)
        samples[present] = count
        gram, cross = np.zeros((rows, k, k)), np.zeros((rows, k, right.shape[1]))
        square = np.zeros((rows, len(y)))
        if len(present):
            gram[present], cross[present] = _sum_normal_equations(basis, right, starts)
            square[present] = np.add.reduceat(y.T**2, starts, axis=0)
        return cls(gram, cross, square, samples, present, starts)


def _find_pull(motion: Array, sums: _Sums, fit: Array, cross: Array, good: Array) -> Pull:
    """What a motion (n, tones) that the windows' fit does not hold makes of its coefficients and of
    its residual; fit, cross: (windows, k, tones) of that motion."""
    tones = motion.shape[1]
    square2 = np.zeros((len(good), tones, tones))
    if len(sums.present):
        square2[sums.present] = _sum_squares(motion, sums.starts)
    # what the fit leaves of the motion's own squares: that part raises the residual
    left = square2 - fit.transpose(0, 2, 1) @ cross
    return compute_pull(
        np.where(good[:, None, None], fit[:, :tones], 0.0),
        np.where(good[:, None, None], left, 0.0),
    )


def fit_uneven(
    time_s: Array,
    y: Array,
    window: Array,
    centre_s: Array,
    width_s: float,
    frequency_hz: tuple[float, ...],
    nuisance_hz: tuple[float, ...],
    moving: bool,
) -> Fits:
    """Windows fitted at the true times of their samples.

    A window with fewer samples than unknowns + 1, or whose samples do not separate the unknowns,
    holds NaN.

    Parameters
    ----------
    time_s
        Of the samples (n,), s.
    y
        Samples (channels, n).
    window
        Row in `centre_s` of each sample (n,), not decreasing.
    centre_s
        Middles of the windows (rows,), s.
    width_s
        Of a window, s.
    frequency_hz
        Of the wanted signals, F of them.
    nuisance_hz
        Of what is fitted beside them.
    moving
        Whether t·cos and t·sin of the wanted signals are fitted too.

    Returns
    -------
    Fits
        Of all windows.

    Examples
    --------
    The second of three windows has no samples:

    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.uneven import fit_uneven
    >>> t = np.sort(np.random.default_rng(0).uniform(0, 0.3, 300))
    >>> t = t[(t < 0.1) | (t > 0.2)]
    >>> y = np.cos(2 * np.pi * 50 * t)[None]
    >>> centre = np.array([0.05, 0.15, 0.25])
    >>> fits = fit_uneven(t, y, (t / 0.1).astype(int), centre, 0.1, (50.0,), (), False)
    >>> (fits.envelope[0, :, 0] * np.exp(-2j * np.pi * 50 * centre)).real.round(9).tolist()
    [1.0, nan, 1.0]
    """
    channels, tones = len(y), 2 * len(frequency_hz)
    tau = time_s - centre_s[window]
    basis = build_columns(tau, frequency_hz, nuisance_hz, moving, width_s / 2)
    k = basis.shape[1]
    wanted = build_pairs(tau, frequency_hz)
    right = np.concatenate([y.T, tau[:, None] * wanted, tau[:, None] ** 2 / 2 * wanted], 1)
    sums = _Sums.from_samples(basis, right, y, window, len(centre_s))
    # beyond a condition of 1e6 the samples of a window do not separate its unknowns
    values = np.linalg.eigvalsh(sums.gram)
    good = (sums.samples > k) & (values[:, 0] > 1e-6 * values[:, -1])
    inverse = np.linalg.inv(np.where(good[:, None, None], sums.gram, np.eye(k)))
    fit = inverse @ sums.cross
    own, cross = fit[:, :, :channels], sums.cross[:, :, :channels]
    residual2 = np.maximum(sums.square - np.einsum("rkc,rkc->rc", own, cross), 0.0)
    envelope = np.moveaxis(own[:, 0:tones:2] - 1j * own[:, 1:tones:2], -1, 0).copy()
    envelope[:, ~good] = np.nan
    residual2[~good] = np.nan
    slope, bend = (
        _find_pull(right[:, part], sums, fit[:, :, part], sums.cross[:, :, part], good)
        for part in (slice(channels, channels + tones), slice(channels + tones, None))
    )
    variance = np.einsum("rkk->rk", inverse)[:, :tones]
    freedom = np.maximum(sums.samples - k, 1)
    return Fits(envelope, residual2.T, freedom, sums.samples, variance, slope, bend)


def _choose_width(run: Demodulator, step: float) -> float:
    """Duration of a window: as asked, or as long as its unknowns need at the usual step, with two
    samples to spare."""
    width = run.periods_asked / run.reference_hz
    if run.moving and run.moving_asked is None and width < 3 * run.count_columns() * step:
        run.moving = False
    least = (run.count_columns() + 2) * step
    if run.periods_asked >= 0.9:
        while least < 64 / run.reference_hz and not _is_regular(run, max(width, least), step):
            least = 1.1 * max(width, least)
    if width < least:
        run.notes.append(
            f"windows of {least * run.reference_hz:.3g} periods are used: {run.periods_asked:g}"
            " hold too few samples for the fit"
        )
        return least
    return width


def _is_regular(run: Demodulator, width: float, step: float) -> bool:
    """Whether windows of that duration, were their samples even, tell their unknowns well apart."""
    basis = build_window_basis(
        int(width / step), 1 / step, tuple(run.reference), run.nuisance, run.moving
    )
    return basis is not None and basis.condition < 10


def _learn(run: Demodulator, width: float, step: float) -> None:
    """What windows of this length leave at each look: the calm level that a settling start stands
    out of, and the noise's colour."""
    found = list(zip(run.survey.looks, run.survey.look_noise2, strict=True))
    seen = []
    for look, noise2 in found[1:] or found:
        start, stop = look.time_s[0], look.time_s[-1]
        count = int((stop - start) / width)
        if count == 0:
            continue
        inside = look.time_s < start + count * width
        window = ((look.time_s[inside] - start) / width).astype(int)
        centre = start + (np.arange(count) + 0.5) * width
        local = run.find_hz(float(look.time_s.mean()))
        fits = fit_uneven(
            look.time_s[inside],
            look.y[:, inside],
            window,
            centre,
            width,
            run.list_bands(local),
            run.nuisance,
            run.moving,
        )
        seen.append((fits, centre, local, noise2))
    run.learn_calm(seen)
    basis = build_window_basis(
        int(width / step),
        1 / step,
        run.list_bands(run.reference_hz),
        run.nuisance,
        run.moving,
    )
    if basis is not None:
        run.learn_colour(basis, 1 / step)


class _Reader:
    """Samples of an unevenly sampled recording by windows, read forward in blocks; checks that
    times increase."""

    def __init__(
        self, recording: Recording, begin: float, width: float, block: int, name: str
    ) -> None:
        self.recording, self.begin, self.width, self.block, self.name = (
            recording,
            begin,
            width,
            block,
            name,
        )
        self.read = 0
        self.time = np.zeros(0)
        self.raw = [np.zeros(0), np.zeros(0)]

    def read_windows(self, low: int, high: int) -> tuple[Array, list[Array], Array]:
        """Times, both channels and window numbers of the samples in windows low … high − 1; low
        goes back by a few windows at the most."""
        start, stop = self.begin + low * self.width, self.begin + high * self.width
        while self.read < len(self.recording.c) and not (len(self.time) and self.time[-1] >= stop):
            self._read_more()
        a, b = np.searchsorted(self.time, [start, stop])
        window = np.clip(((self.time[a:b] - self.begin) / self.width).astype(int), low, high - 1)
        out = self.time[a:b], [channel[a:b] for channel in self.raw], window
        kept = max(0, int(np.searchsorted(self.time, stop - 2 * (NEIGHBOURS + 1) * self.width)) - 1)
        self.time, self.raw = self.time[kept:], [channel[kept:] for channel in self.raw]
        return out

    def _read_more(self) -> None:
        """Read the next block behind what is held."""
        more = slice(self.read, min(self.read + self.block, len(self.recording.c)))
        time = self.recording.times(more.start, more.stop).astype(float)
        joined = np.concatenate([self.time[-1:], time])
        wrong = np.flatnonzero(~(np.diff(joined) > 0))
        if len(wrong):
            at = int(wrong[0]) + self.read + (0 if len(self.time) else 1)
            raise HrgError(
                f"{self.name}: time_s[{at}] = {joined[wrong[0] + 1]:.9g} s follows"
                f" {joined[wrong[0]]:.9g} s; strictly increasing times were expected: sort the"
                " samples or drop the repeated ones"
            )
        self.time = np.concatenate([self.time, time])
        channels = (self.recording.c, self.recording.s)
        self.raw = [
            np.concatenate([held, np.asarray(channel[more], float)])
            for held, channel in zip(self.raw, channels, strict=True)
        ]
        self.read = more.stop
