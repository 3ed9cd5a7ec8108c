"""Noise of demodulated rows from their own scatter: its density where a long average feels it, and
how far neighbours are correlated.

Behind a lock-in's filter the rows are not independent: a mean of g rows has the variance S₀/g, S₀
the noise's density at low frequency (unit² a row), not σ²/g. S₀ stands in the spectrum just above
what the slow motion of the envelope fills, where the spectrum is level; κ = S₀/σ² is the number of
rows that count as one. Of n one-pole filters of time constant τ the delay nτ is 0.5 to 0.6 κ rows.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from .row_motion import find_basis, find_noise_left, find_phase, make_polynomials

Array = np.ndarray

LOW, HIGH = slice(5, 11), slice(11, 21)
"""Bins just above what the polynomial takes and the Hann window spreads, and the octave above
them."""

LEVEL = 1.3
"""Ratio of the two octaves up to which the spectrum is level, besides what chance allows."""

SHORTEST, LONGEST = 64, 1 << 14
"""Rows of the pieces that are tried."""

MORE = 1.15
"""Factor by which a lower octave must show more noise to be believed."""

LINE = 9
"""Bins of a running median: a line under a Hann window fills four."""

FEWEST_PIECES = 3
"""Pieces of one length whose median is taken."""

STILL = 32
"""Rows, at least, of the pieces in which independent rows are looked for: the polynomial takes a
fifth of the freedom there; in longer ones the wave may move more than it."""

LAGS, UNLIKELY = 4, 3.5
"""Rows apart between which independent ones must show no correlation, and the standard deviations
that chance does not reach."""

STRAIGHT, STRAIGHT_CHANCE = 1.3, 12.0
"""Variance of residuals over the differences' up to which a few rows' polynomial has taken all of
their motion, and three times what the differences' median scatters by, over the root of the
rows."""

MEDIAN_OF_ONE, ALONE = 0.4549, 1e-6
"""Median of the square of a normal number of variance 1, and the part of the other's variance below
which a part of a channel holds no noise."""

DELAY = 0.55
"""Delay of a filter of one to four poles over its κ, see above."""


@dataclass(frozen=True)
class RowNoise:
    """Of both channels: `density` (channel, 2) unit² a row, along the wave's phase and across it;
    `variance` (channel, 2) of a row.

    `level`: whether a level part of the spectrum was found; otherwise the lowest octave seen stands
    for it.
    """

    density: Array
    variance: Array
    level: bool

    @property
    def correlated_rows(self) -> float:
        """κ: rows that count as one, at least 1."""
        total = float(self.variance.sum())
        return max(1.0, float(self.density.sum()) / total) if total > 0 else 1.0


def estimate_row_noise(looks: Sequence[Array]) -> RowNoise:
    """Noise of demodulated rows by their own scatter.

    Pieces of growing length look at ever lower frequencies. Of those whose spectrum is level there,
    the shortest stands, unless a longer one shows clearly more; a filter's S ≈ S₀(1 − cf²) is
    continued to f = 0 from both octaves. Rows that are independent have the one variance of all
    their residuals, many times better known, where the spectrum's low end agrees with it.

    Parameters
    ----------
    looks
        Evenly spaced complex rows (channel, n) of the signals' unit, without gaps within a look.

    Returns
    -------
    RowNoise
        Density at low frequency and variance, of each channel along the wave's phase and across it.

    Examples
    --------
    Independent rows of σ = 0.001 in each part about a wave of 1:

    >>> import numpy as np
    >>> from hrg_cli.formats.row_noise import estimate_row_noise
    >>> noise = 1e-3 * np.random.default_rng(1).normal(size=(1, 4096, 2)) @ [1, 1j]
    >>> found = estimate_row_noise([1.0 + noise])
    >>> bool(np.allclose(found.variance, 1e-6, rtol=0.05)), found.correlated_rows
    (True, 1.0)
    """
    longest = max(look.shape[1] for look in looks)
    tried: list[tuple[float, Array, Array, float]] = []
    rows = SHORTEST
    while rows <= min(longest, LONGEST):
        low, high, whole, count = _levels(looks, rows)
        if count >= FEWEST_PIECES or not tried:
            tried.append(
                (
                    float(low.sum() / max(high.sum(), 1e-300)),
                    low,
                    whole,
                    1 / np.sqrt(1.5 * max(1, count) * _noisy_parts(whole)),
                )
            )
        rows *= 2
    tried = [one for one in tried if np.isfinite(one[0])]
    if not tried:
        return _estimate_from_few(looks)
    level = [one for one in tried if one[0] < LEVEL + 2 * one[3]]
    chosen = level[0] if level else min(tried, key=lambda one: one[0])
    for one in level:
        if one[1].sum() > (MORE + 2 * one[3]) * chosen[1].sum():
            chosen = one
    ratio, low, whole, chance = chosen
    white = _white(looks)
    # few bins fall far below their mean more often than they rise above it
    near = np.exp(-3 * chance) / LEVEL, LEVEL + 3 * chance
    if white is not None and near[0] < low.sum() / white.sum() < near[1]:
        return RowNoise(white, white, True)
    return RowNoise(
        low * max(1.0, min(ratio, LEVEL)) ** (1 / 3), np.maximum(whole, 1e-300), bool(level)
    )


def _noisy_parts(variance: Array) -> int:
    """How many of the parts (channel, 2) hold noise at all, of whose sum a level is: one of an
    amplitude alone, four of I and Q of two channels."""
    return max(1, int(np.count_nonzero(variance > 1e-12 * np.max(variance))))


def _estimate_from_few(looks: Sequence[Array]) -> RowNoise:
    """Of rows too few for a spectrum: the variance of all residuals where these show no
    correlation and are no larger than the differences', else that of the differences."""
    steps, white = _estimate_by_differences(looks), _white(looks)
    rows = sum(look.shape[1] for look in looks)
    unsure = STRAIGHT_CHANCE / np.sqrt(rows * _noisy_parts(steps))
    if white is None or not white.sum() < (STRAIGHT + unsure) * steps.sum():
        white = steps
    return RowNoise(white, white, False)


def _estimate_by_differences(looks: Sequence[Array]) -> Array:
    """Variance (channel, 2) of a few rows by their third differences, as if independent: 20 times
    the variance. The median of the square of one normal part is 0.455 of its mean, of the two of
    I and Q together ln 2; they are taken together but where one of them is an amplitude's, which
    has no other."""
    thirds = np.concatenate(
        [
            np.diff(
                _turn_to_phase(
                    look * np.exp(-1j * estimate_mean_turn(look) * np.arange(look.shape[1]))
                ),
                3,
                axis=1,
            )
            for look in looks
        ],
        axis=1,
    )
    thirds = thirds[:, np.isfinite(thirds).all(0)]
    if not thirds.shape[1]:
        return np.full((looks[0].shape[0], 2), 1e-300)
    parts = np.stack([thirds.real, thirds.imag], 1) ** 2 / 20
    apart = np.median(parts, axis=-1) / MEDIAN_OF_ONE
    both = np.median(parts.sum(1), axis=-1) / (2 * np.log(2))
    alone = apart.min(1) < ALONE * apart.max(1)
    return np.maximum(np.where(alone[:, None], apart, both[:, None]), 1e-300)


def _turn_to_phase(u: Array) -> Array:
    """Envelopes (channel, n) in the phase of the stronger channel's mean."""
    mean = np.nanmean(np.where(np.isfinite(u), u, np.nan), axis=1)
    strong = mean[np.argmax(np.abs(mean))]
    return u * (np.conj(strong) / np.abs(strong) if np.abs(strong) > 0 else 1.0)


def _white(looks: Sequence[Array]) -> Array | None:
    """Variance (channel, 2) of rows whose residuals show no correlation between neighbours, along
    and across as one where they do not differ; None where there is one, or a piece of `STILL`
    rows is wanting.

    r = M e, M = I − QQᵀ: E Σ r² = σ² tr M, E Σ r_j r_{j+k} = −σ² Σ_j (QQᵀ)_{j,j+k}.
    """
    pieces, missed, taken_of = [], np.zeros(LAGS), _remember_taken()
    products = np.zeros(LAGS)
    for look in looks:
        rows = look.shape[1] // max(1, look.shape[1] // STILL)
        if rows < STILL:
            continue
        for left, basis in _residuals(look, rows, rows):
            parts, taken = np.stack([left.real, left.imag], 1), taken_of(basis)
            pieces.append(((parts**2).sum(-1), rows - basis.shape[1]))
            scale = np.sqrt(pieces[-1][0] / pieces[-1][1])[..., None]
            parts = parts / np.maximum(scale, 1e-300)
            missed += _noisy_parts(pieces[-1][0]) * taken
            products += [(parts[..., k:] * parts[..., :-k]).sum() for k in range(1, LAGS + 1)]
    if not pieces:
        return None
    freedom = sum(count for _, count in pieces)
    variance = np.asarray(sum(square for square, _ in pieces)) / freedom
    correlated = np.abs(products + missed) / np.sqrt(freedom * _noisy_parts(variance))
    if (correlated > UNLIKELY).any():
        return None
    both = variance.mean(1, keepdims=True)
    apart = np.abs(np.diff(np.log(np.maximum(variance, 1e-300)), axis=1)) * np.sqrt(freedom) / 2
    return np.maximum(np.where(apart > UNLIKELY, variance, both), 1e-300)


def _levels(looks: Sequence[Array], rows: int) -> tuple[Array, Array, Array, int]:
    """Density (channel, 2) in both octaves and variance (channel, 2) of pieces of so many rows;
    their number."""
    power = [
        np.abs(np.fft.rfft(np.stack([left.real, left.imag], 1), axis=-1)) ** 2 / kept
        for left, kept in _pieces(looks, rows)
    ]
    if not power:
        nothing = np.full((looks[0].shape[0], 2), np.nan)
        return nothing, nothing, nothing, 0
    # the median of medians of exponential variables of mean 1, of odd numbers exactly, is ln 2
    middle = _drop_lines(_fill_gaps(_median_of_known(np.asarray(power))) / np.log(2))
    low, high = np.median(middle[..., LOW], -1), np.median(middle[..., HIGH], -1)
    middle[..., : LOW.start] = low[..., None]
    return low, high, middle.mean(-1), len(power)


def estimate_filter_gain(looks: Sequence[Array]) -> float:
    """Gain of a demodulator's filter at the oscillation over that at the reference.

    Noise passes the filter as the signal does: its amplitude at both places tells the ratio.

    Parameters
    ----------
    looks
        As in `estimate_row_noise`.

    Returns
    -------
    float
        1 where it cannot be told.

    Examples
    --------
    Unfiltered noise about an oscillation that turns by 0.3 rad per row:

    >>> import numpy as np
    >>> from hrg_cli.formats.row_noise import estimate_filter_gain
    >>> noise = 1e-3 * np.random.default_rng(1).normal(size=(1, 4096, 2)) @ [1, 1j]
    >>> gain = estimate_filter_gain([np.exp(0.3j * np.arange(4096))[None] + noise])
    >>> 0.8 < gain < 1.25
    True
    """
    rows = min(max(look.shape[1] for look in looks) // FEWEST_PIECES, LONGEST)
    rows = 1 << int(np.log2(max(rows, 1)))
    power = (
        [np.abs(np.fft.fft(left, axis=-1)).sum(0) ** 2 for left, _ in _pieces(looks, rows)]
        if rows >= SHORTEST
        else []
    )
    turn = float(np.median([estimate_mean_turn(look) for look in looks]))
    place = round(-turn / (2 * np.pi) * rows)
    if len(power) < FEWEST_PIECES or abs(place) < 2 * LOW.stop:
        return 1.0
    spectrum = np.median(power, axis=0)
    here = np.median(np.concatenate([spectrum[LOW], spectrum[-LOW.stop : -LOW.start]]))
    there = np.median(
        np.take(spectrum, np.arange(place - LOW.stop, place + LOW.stop + 1), mode="wrap")
    )
    return float(min(1.0, np.sqrt(here / there)))


def _median_of_known(power: Array) -> Array:
    """Median over pieces (pieces, …) of what is known; NaN where nothing is."""
    if np.isfinite(power).all():
        return np.asarray(np.median(power, axis=0))
    known = np.isfinite(power).any(axis=0)
    return np.where(known, np.nanmedian(np.where(known, power, 0.0), axis=0), np.nan)


def _fill_gaps(power: Array) -> Array:
    """Bins (channel, 2, bins) that the motion fills, from those beside them."""
    known = np.isfinite(power).all(axis=(0, 1))
    if known.all() or not known.any():
        return power
    bins = np.arange(power.shape[-1])
    flat = [np.interp(bins, bins[known], one[known]) for one in power.reshape(-1, len(bins))]
    return np.reshape(flat, power.shape)


def _remember_taken() -> Callable[[Array], Array]:
    """Re Σ (QQᴴ)_{j,j+k} at the lags k of an orthonormal basis; that of the plain polynomials,
    which most pieces share, once."""
    known: dict[int, Array] = {}

    def taken(basis: Array) -> Array:
        plain = not np.iscomplexobj(basis)
        if plain and len(basis) in known:
            return known[len(basis)]
        lags = range(1, LAGS + 1)
        sums = np.array([np.sum(basis[k:] * basis[:-k].conj()).real for k in lags])
        return known.setdefault(len(basis), sums) if plain else sums

    return taken


def _pieces(looks: Sequence[Array], rows: int) -> Iterator[tuple[Array, Array | float]]:
    """What a moving envelope leaves of overlapping pieces (channel, rows) under a Hann window of
    power 1, and the part of white noise that it leaves of every bin."""
    window = np.hanning(rows + 2)[1:-1]
    window = window / np.sqrt((window**2).sum())
    for look in looks:
        for left, basis in _residuals(look, rows, max(1, rows // 2)):
            yield left * window, find_noise_left(basis, window)


def _residuals(look: Array, rows: int, every: int) -> Iterator[tuple[Array, Array]]:
    """What its motion leaves of pieces (channel, rows), one in `every` rows, in the wave's own
    phase, and the functions (rows, k) that were taken off."""
    turn, polynomials = estimate_mean_turn(look), make_polynomials(rows)
    for start in range(0, look.shape[1] - rows + 1, every):
        u = look[:, start : start + rows] * np.exp(-1j * turn * np.arange(rows))
        if np.isfinite(u).all():
            basis = find_basis(u, polynomials)
            fit = (u @ basis.conj()) @ basis.T
            yield (u - fit) * np.exp(-1j * find_phase(fit, np.iscomplexobj(basis))), basis


def _drop_lines(power: Array) -> Array:
    """Running median over `LINE` bins, so that a beat or a tone is no noise."""
    padded = np.pad(power, [(0, 0)] * (power.ndim - 1) + [(LINE // 2, LINE // 2)], mode="reflect")
    return np.median(np.lib.stride_tricks.sliding_window_view(padded, LINE, axis=-1), axis=-1)


def estimate_mean_turn(look: Array) -> float:
    """Mean turn of envelopes from row to row.

    Parameters
    ----------
    look
        Envelopes (channel, n), NaN where a row is missing.

    Returns
    -------
    float
        rad per row, the phase of Σ u_{k+1} u_k*; within ±π.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.formats.row_noise import estimate_mean_turn
    >>> round(estimate_mean_turn(np.exp(0.3j * np.arange(9.0))[None]), 9)
    0.3
    """
    pairs = look[:, 1:] * np.conj(look[:, :-1])
    return float(np.angle(pairs[np.isfinite(pairs)].sum()))
