"""Averaged spectrum of what the demodulation leaves, and the lines that stand out of it (harmonics,
mains, aliases, leakage)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..medians import find_median
from .basis import WindowBasis, build_columns, build_pairs, build_rotations

Array = np.ndarray

MOTIONS = ((3, 1), (8, 1), (16, 1), (32, 1), (32, 4), (32, 16))
"""Degree in time by which the envelope may move, in so many pieces of a look, so that its own decay
and turning are not seen as noise."""

MOTION_GAIN = 6
"""A freer motion is taken where it lowers the residual by more than so many times what its columns
take from white noise."""

MOTION_PEAK = 25
"""Power of a bin beside the oscillation over the median's at which it may be motion; noise passes
it once in 10⁷ bins."""

LEAST_RESIDUAL = 1e-7
"""A residual of this part of the signal is rounding."""


def compute_look_residual(
    time_s: Array, y: Array, frequency_hz: tuple[float, ...], nuisance_hz: tuple[float, ...] = ()
) -> tuple[Array, float]:
    """A look's samples less its oscillation, whose envelope moves as freely as it must (`MOTIONS`),
    and how far from the oscillation that reaches.

    A wave that turns by many radians within a look, or two modes that beat, would else fill the
    spectrum beside the oscillation.

    Parameters
    ----------
    time_s
        Of the samples (n,), s.
    y
        Samples (channels, n).
    frequency_hz
        Of the oscillation, or of its side bands.
    nuisance_hz
        Of what is taken out beside it with a constant envelope.

    Returns
    -------
    residual : ndarray
        (channels, n).
    reach_hz : float
        Distance from the oscillation within which the residual says nothing.

    Examples
    --------
    A wave that rings down to a third within the look, and noise of 1e-3:

    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.spectrum import compute_look_residual
    >>> t = np.arange(8000) / 8000
    >>> y = np.exp(-1.1 * t) * np.cos(2 * np.pi * 1000 * t)
    >>> y = y + 1e-3 * np.random.default_rng(0).standard_normal((2, 8000))
    >>> residual, reach_hz = compute_look_residual(t, y, (1000.0,))
    >>> residual.std(axis=1).round(5).tolist(), round(reach_hz, 2)
    ([0.00101, 0.001], 3.0)
    """
    n, span = len(time_s), max(float(time_s[-1] - time_s[0]), 1e-300)
    pairs_of = 2 * len(frequency_hz)
    order = min(MOTIONS[0][0], max(0, (n - 6) // (2 * pairs_of)))
    residual, reach = (
        _subtract_oscillation(time_s, y, frequency_hz, nuisance_hz, order),
        order / span,
    )
    taken = pairs_of * (order + 1)
    # a motion is tried only with at least eight samples for each of its columns
    for order, pieces in MOTIONS[1:]:
        takes = pairs_of * (order + 1) * pieces
        if 8 * takes > n or not _does_stand_out(residual, frequency_hz[0] * span, y):
            break
        parts = zip(np.array_split(time_s, pieces), np.array_split(y, pieces, axis=-1), strict=True)
        freer = np.concatenate(
            [_subtract_oscillation(t, part, frequency_hz, nuisance_hz, order) for t, part in parts],
            -1,
        )
        if (
            (residual**2).sum(-1) > (1 + MOTION_GAIN * (takes - taken) / n) * (freer**2).sum(-1)
        ).any():
            residual, taken, reach = freer, takes, order * pieces / span
    return residual, reach


def _does_stand_out(residual: Array, turns: float, y: Array) -> bool:
    """Whether the residual holds more beside an oscillation of so many turns than elsewhere, and
    more than rounding."""
    if (residual.std(-1) < LEAST_RESIDUAL * y.std(-1)).all():
        return False
    power = np.abs(np.fft.rfft(residual * np.hanning(residual.shape[-1]))) ** 2
    reach = min(MOTIONS[-1][0] * MOTIONS[-1][1], power.shape[-1] // 8)
    # bin k of the transform is k turns within the look
    near = power[:, max(0, int(turns) - reach) : int(turns) + reach]
    return bool(near.size and (near.max(-1) > MOTION_PEAK * find_median(power, axis=-1)).any())


def _subtract_oscillation(
    time_s: Array,
    y: Array,
    frequency_hz: tuple[float, ...],
    nuisance_hz: tuple[float, ...],
    order: int,
) -> Array:
    """y (channels, n) less pairs at the frequencies, their envelopes polynomials of time, and a
    constant."""
    tau = time_s - (time_s[0] + time_s[-1]) / 2
    # τ brought to [−1, 1], where Legendre polynomials are nearly orthogonal over even samples: the
    # Gram matrix stays well conditioned
    moving = np.polynomial.legendre.legvander(tau / max(float(np.abs(tau).max()), 1e-300), order)[
        :, 1:
    ]
    wanted = (moving[:, :, None] * build_pairs(tau, frequency_hz)[:, None, :]).reshape(len(tau), -1)
    basis = np.concatenate([build_columns(tau, frequency_hz, nuisance_hz), wanted], -1)
    gram = basis.T @ basis
    # the ridge keeps two frequencies that the look cannot tell apart solvable; the second solution
    # takes off what the ridge left of the first
    gram += 1e-12 * np.trace(gram) * np.eye(len(gram))
    residual = y - (np.linalg.solve(gram, basis.T @ y.T)).T @ basis.T
    return residual - (np.linalg.solve(gram, basis.T @ residual.T)).T @ basis.T


@dataclass
class AveragedSpectrum:
    """Welch's average on one frequency grid: `density` (frequencies, channels) one-sided, unit²/Hz,
    of `segments` Hann segments; `parts`: their transforms (channels, frequencies), whose squares
    are densities."""

    frequency_hz: Array
    density: Array = field(init=False)
    parts: list[Array] = field(default_factory=list)
    segments: int = 0

    def __post_init__(self) -> None:
        self.density = np.zeros((len(self.frequency_hz), 2))

    def add(self, time_s: Array, residual: Array, even: bool) -> None:
        """Add one segment; at uneven times the transform is summed directly.

        Parameters
        ----------
        time_s
            Of the samples (n,), s.
        residual
            Samples (2, n).
        even
            Whether their times are even.
        """
        # Hann's window without its two zeros: every sample of the segment counts
        window = np.hanning(residual.shape[-1] + 2)[1:-1]
        # Welch: one-sided density 2Δt·|Σ w y e^{−jωt}|² / Σ w², unit²/Hz
        if even:
            step = (time_s[-1] - time_s[0]) / (len(time_s) - 1)
            spectrum = np.fft.rfft(residual * window)
            norm = 2 * step / (window**2).sum()
        else:
            step = float(find_median(np.diff(time_s)))
            spectrum = (residual * window) @ build_rotations(
                time_s - time_s[0], self.frequency_hz
            ).T
            norm = 2 * step / (window**2).sum()
        self.density += (np.abs(spectrum) ** 2 * norm).T
        self.parts.append(spectrum * np.sqrt(norm))
        self.segments += 1

    def mean(self) -> Array:
        """The averaged density.

        Returns
        -------
        ndarray
            (frequencies, 2), one-sided, unit²/Hz.
        """
        return self.density / max(1, self.segments)


BLIND = 1e-9
"""Density, over the median one, up to which a bin holds no noise but rounding."""


def find_floor(density: Array, bins: int = 65) -> Array:
    """Running median over frequency, of blocks of bins, joined linearly.

    Where the oscillation was taken out nothing is left but rounding: such bins tell of no noise,
    however many of a block they are.

    Parameters
    ----------
    density
        Powers (frequencies, channels).
    bins
        Of a block.

    Returns
    -------
    ndarray
        As the density.

    Examples
    --------
    A single line is not in the floor, nor is the gap that an oscillation left:

    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.spectrum import find_floor
    >>> density = np.ones((500, 2))
    >>> density[200] = 1e6
    >>> density[90:150] = 0.0
    >>> float(find_floor(density).max()), float(find_floor(density).min())
    (1.0, 1.0)
    """
    n = len(density)
    starts = np.arange(0, max(1, n - bins // 2), bins)
    centres = np.array([(a + min(a + bins, n) - 1) / 2 for a in starts.tolist()])
    # a table (block, bin in it, channel), of which the bins that tell stand first when it is sorted
    table = np.full((len(starts) * bins, density.shape[1]), np.inf)
    told = (density > BLIND * find_median(density, axis=0))[: len(table)]
    table[: len(told)][told] = density[: len(table)][told]
    table = np.sort(table.reshape(len(starts), bins, -1), axis=1)
    out = np.zeros(density.shape)
    for k in range(density.shape[1]):
        count = np.isfinite(table[:, :, k]).sum(axis=1)
        # a block that is blind but for a corner lies between its neighbours
        (seen,) = np.nonzero(4 * count >= min(bins, n))
        if len(seen):
            low, high = table[seen, (count[seen] - 1) // 2, k], table[seen, count[seen] // 2, k]
            out[:, k] = np.interp(np.arange(n), centres[seen], (low + high) / 2)
    return out


COMMON_LINE = 8.0
"""Power over the floor from which a bin is a line's, whose phases say nothing of the noise."""

UNCORRELATED = 0.1
"""Correlation up to which noise counts as each channel's own: it moves a σ by a twentieth."""


def estimate_correlation(
    averaged: AveragedSpectrum,
    about_hz: tuple[float, ...],
    reach_hz: float,
    blind_hz: tuple[tuple[float, float], ...],
) -> float | None:
    """Correlation of the channels' noise about some frequencies.

    It is the co-spectrum over both densities' roots, each bin over its floor, the median over the
    segments. Channels of unequal noise that were turned into one another afterwards share noise,
    and so do channels behind one reference. A segment in which the oscillation jumps shares that.
    The product of two independent normal numbers over N bins scatters by 1/√(2N), its median by
    √(π/2) more.

    Parameters
    ----------
    averaged
        Spectrum of both channels, with its segments.
    about_hz
        Frequencies about which it is asked.
    reach_hz
        On either side of them.
    blind_hz
        Bands that do not count.

    Returns
    -------
    float or None
        0 where chance or next to nothing makes it, None without a spectrum.

    Examples
    --------
    Half of both channels' power is one noise:

    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.spectrum import AveragedSpectrum, estimate_correlation
    >>> t, rng = np.arange(1024) / 1024, np.random.default_rng(0)
    >>> averaged = AveragedSpectrum(np.fft.rfftfreq(1024, 1 / 1024))
    >>> for _ in range(16):
    ...     own, common = rng.standard_normal((2, 1024)), rng.standard_normal(1024)
    ...     averaged.add(t, own + common, even=True)
    >>> round(estimate_correlation(averaged, (250.0,), 100.0, ()), 1)
    0.5
    """
    hz, density = averaged.frequency_hz, averaged.mean()
    level = find_floor(density) if len(hz) else density
    near = np.abs(hz[:, None] - np.array(about_hz)).min(axis=-1) < reach_hz
    seen = near & (level > 0).all(axis=-1)
    for low, high in blind_hz:
        seen &= (hz < low) | (hz > high)
    quiet = seen & (density < COMMON_LINE * level).all(axis=-1)
    count = int(quiet.sum()) * averaged.segments
    if not count:
        return None
    each = np.stack(averaged.parts)[..., quiet] / np.sqrt(level[quiet].T)
    power = (np.abs(each) ** 2).sum(axis=-1)
    common = (each[:, 0] * each[:, 1].conj()).real.sum(axis=-1)
    found = float(find_median(common / np.maximum(np.sqrt(power.prod(axis=-1)), 1e-300)))
    return found if abs(found) > max(UNCORRELATED, 4 / np.sqrt(count)) else 0.0


def compute_chi_square_excess(freedom: float, sigmas: float) -> float:
    """χ²/freedom that is exceeded as seldom as a normal number exceeds so many σ (Wilson and
    Hilferty 1931).

    With c = 2/(9·freedom) it is (1 − c + sigmas·√c)³.

    Parameters
    ----------
    freedom
        Degrees of freedom.
    sigmas
        Of the normal number.

    Returns
    -------
    float
        Nears 1 as the freedom grows.

    Examples
    --------
    χ² of 10 degrees exceeds 23.2 once in a hundred, as a normal number 2.326 σ:

    >>> from hrg_cli.fitting.samples.spectrum import compute_chi_square_excess
    >>> round(10 * compute_chi_square_excess(10, 2.326), 1)
    23.2
    """
    c = 2 / (9 * freedom)
    return float((1 - c + sigmas * np.sqrt(c)) ** 3)


def find_lines(
    frequency_hz: Array,
    density: Array,
    segments: int,
    skip_hz: tuple[tuple[float, float], ...] = (),
    most: int = 32,
    least: float = 0.0,
) -> tuple[Array, Array, Array]:
    """Lines that stand out of a spectrum's floor by six σ, strongest first.

    A line is a local maximum of the larger of both channels' ratios; its amplitude is √(2 × power
    above the floor within two bins).

    Parameters
    ----------
    frequency_hz
        Even grid (n,).
    density
        Averaged, one-sided (n, 2), unit²/Hz.
    segments
        Averaged in it.
    skip_hz
        Bands whose lines are left out.
    most
        Lines at most.
    least
        Amplitude below which a line is left out as rounding.

    Returns
    -------
    frequency_hz : ndarray
        (lines,).
    amplitude : ndarray
        (lines, 2), unit of the samples.
    ratio : ndarray
        (lines,), power over the floor.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.spectrum import AveragedSpectrum, find_lines
    >>> t = np.arange(4096) / 4096
    >>> noise = 1e-3 * np.random.default_rng(0).standard_normal((2, 4096))
    >>> averaged = AveragedSpectrum(np.fft.rfftfreq(4096, 1 / 4096))
    >>> averaged.add(t, noise + np.array([[0.02], [0.01]]) * np.cos(2 * np.pi * 500 * t), even=True)
    >>> hz, amplitude, _ = find_lines(averaged.frequency_hz, averaged.mean(), averaged.segments)
    >>> hz.round(1).tolist(), amplitude.round(3).tolist()
    ([500.0], [[0.02, 0.01]])
    """
    below = np.maximum(find_floor(density), 1e-300)
    ratio = (density / below).max(1)
    step = frequency_hz[1] - frequency_hz[0]
    # a segment's power in a bin is χ² of two degrees; the floor is a median, which lies up to 1/ln
    # 2 = 1.44 times below the mean (one segment): 1.5 covers that
    limit = 1.5 * compute_chi_square_excess(2 * max(1, segments), 6.0)
    inner = np.arange(2, len(ratio) - 2)
    top = inner[
        (ratio[inner] > limit)
        & (ratio[inner] >= ratio[inner - 1])
        & (ratio[inner] > ratio[inner + 1])
    ]
    for low, high in skip_hz:
        top = top[(frequency_hz[top] < low) | (frequency_hz[top] > high)]
    top = top[np.argsort(-ratio[top])]
    chosen: list[int] = []
    for k in top:
        # the main lobe of Hann's window is four bins wide: a nearer maximum is the same line
        if len(chosen) < most and all(abs(k - other) > 3 for other in chosen):
            chosen.append(int(k))
    if not chosen:
        return np.zeros(0), np.zeros((0, 2)), np.zeros(0)
    around = np.clip(np.array(chosen)[:, None] + np.arange(-2, 3), 0, len(ratio) - 1)
    weight = np.maximum(density[around] - below[around], 0.0)
    # a sine of amplitude A has the mean square A²/2
    amplitude = np.sqrt(2 * weight.sum(1) * step)
    total = weight.sum(-1)
    where = (total * frequency_hz[around]).sum(1) / np.maximum(total.sum(1), 1e-300)
    real = amplitude.max(1) > least
    return where[real], amplitude[real], ratio[chosen][real]


BESIDE = 33
"""Bins on either side from which the spectrum is filled where the oscillation was taken out."""


@dataclass(frozen=True)
class Colour:
    """Variance of the coefficients (channels, 2F) over what white noise would promise: `whole` of
    the residual's mean level; `steady` of the spectrum without its lines, whose samples have a
    `variance` of their own (channels,)."""

    whole: Array
    steady: Array
    variance: Array

    @property
    def is_white(self) -> bool:
        """Whether no channel departs from white noise."""
        return bool((self.whole == 1).all())

    def take_windows(self, channel: int, sample2: Array) -> Array:
        """The variance factors of windows whose samples leave variances of their own.

        Lines that not all windows hold, as of a wave that is clipped at its top, make up none of
        what the others leave: these have at least the steady spectrum's part of their own residual.

        Parameters
        ----------
        channel
            0 or 1.
        sample2
            Variance a sample of each window (n, 1).

        Returns
        -------
        ndarray
            (n, 2F).
        """
        whole = np.broadcast_to(self.whole[channel], (len(sample2), self.whole.shape[1]))
        if not (self.whole[channel] < 1).any():
            return whole
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.fmin(1.0, self.variance[channel] / sample2)
        return np.fmax(whole, self.steady[channel] * share)


def estimate_colour(
    frequency_hz: Array,
    density: Array,
    segments: int,
    basis: WindowBasis,
    sample_rate_hz: float,
    blind_hz: tuple[tuple[float, float], ...],
    apart: bool = False,
) -> Colour:
    """Variance of a window's coefficients over what the residual would promise if it were white.

    A tone of density S adds S|H(f)|² to a coefficient, H its row's transfer function, and S(n −
    Σ|Q_j(f)|²) to the residual of the basis Q; so κ = ∫S|H|² / (variance · ∫S(n −
    Σ|Q_j|²)/freedom). Bins where the oscillation itself was taken out are filled from beside. κ
    within four of its own standard deviations of 1, or within a tenth, is 1; lines are no chance
    and add no doubt.

    Parameters
    ----------
    frequency_hz
        Even grid (k,), from 0 to half the sampling rate.
    density
        Of the residual, averaged, one-sided (k, 2), unit²/Hz.
    segments
        Averaged in it.
    basis
        Of a window.
    sample_rate_hz
        Of the samples.
    blind_hz
        Bands where the oscillation itself was taken out.
    apart
        Whether the residual is without the envelope's first motion that the basis lacks.

    Returns
    -------
    Colour
        Of both channels; ones where the noise is white.

    Examples
    --------
    White noise, and noise that has ten times the power in a band about the oscillation that the
    window passes:

    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.basis import build_window_basis
    >>> from hrg_cli.fitting.samples.spectrum import estimate_colour
    >>> basis = build_window_basis(100, 1000.0, (50.0,))
    >>> hz, density = np.linspace(0, 500, 501), np.ones((501, 2))
    >>> density[(hz > 20) & (hz < 80), 1] = 10
    >>> estimate_colour(hz, density, 100, basis, 1000.0, ()).whole.round(1).tolist()
    [[1.0, 1.0], [5.1, 5.1]]
    """
    n = len(basis.orthonormal)
    filled, below = _fill_blind_bins(frequency_hz, density, blind_hz)
    # zero padding to eight windows: transfer functions change over 1/(window), and are sampled
    # eight times finer than that
    size = 1 << int(np.ceil(np.log2(max(8 * n, 2 * len(frequency_hz)))))
    at = np.fft.rfftfreq(size, 1 / sample_rate_hz)
    s = np.stack([np.interp(at, frequency_hz, filled[:, k]) for k in range(2)])
    taken = basis.orthonormal
    if apart:
        taken = np.concatenate([taken, basis.sloping], axis=1)
    modes = np.abs(np.fft.rfft(taken, size, axis=0)) ** 2
    rows = np.abs(np.fft.rfft(basis.orthonormal @ basis.triangle, size, axis=0)) ** 2
    held = (n - modes.sum(1)) / (n - taken.shape[1])
    left = np.maximum(s @ held, 1e-300)

    # what the density does to a coefficient, over what the residual's level alone would say
    kappa = (s @ rows) / (basis.variance * left[:, None])

    # scatter of κ by chance: so many independent bins, weighed as the rows weigh them
    weights = s[:, :, None] * rows
    scale = np.maximum(weights.sum(1, keepdims=True), 1e-300)
    floor_at = np.stack(
        [np.interp(at, frequency_hz, np.minimum(filled, 3 * below)[:, k]) for k in range(2)]
    )
    chance = floor_at[:, :, None] * rows / scale
    spread = (chance**2).sum(1) * len(at) / max(1, len(frequency_hz))
    doubt = 4 * np.sqrt(spread * 2 / max(1, segments))
    # a channel of zeros beside a live one: its residual is rounding, of any colour
    silent = density.max(0) < 1e-28 * density.max()
    coloured = (np.abs(kappa - 1) > np.maximum(0.1, doubt)) & ~silent[:, None]
    floor_left = np.maximum(floor_at @ held, 1e-300)
    return Colour(
        whole=np.where(coloured, kappa, 1.0),
        steady=(floor_at @ rows) / (basis.variance * floor_left[:, None]),
        # ∫ S df over the transform's bins
        variance=floor_left * sample_rate_hz / size,
    )


def _fill_blind_bins(
    frequency_hz: Array, density: Array, blind_hz: tuple[tuple[float, float], ...]
) -> tuple[Array, Array]:
    """The density (n, channels) and its floor, where the oscillation itself was taken out filled
    with the level beside."""
    filled, below = density.copy(), find_floor(density)
    for low, high in blind_hz:
        first, last = (
            np.searchsorted(frequency_hz, low),
            np.searchsorted(frequency_hz, high, side="right"),
        )
        beside = [density[max(0, first - BESIDE) : first], density[last : last + BESIDE]]
        levels = [find_median(part, axis=0) for part in beside if len(part)]
        if levels:
            filled[first:last] = below[first:last] = np.mean(levels, axis=0)
    return filled, below
