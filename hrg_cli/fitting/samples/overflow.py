"""Codes that overflowed: an oscillation larger than the integers' range goes on at its other end,
−128 behind 127.

Three samples of an oscillation obey e = y₊ − 2 cos(ωΔ) y + y₋ = const. Where codes y are R less or
more than they should be, R the range, e is off by R (k₊ − 2 cos(ωΔ) k + k₋), k = −1, 0, 1, and by
nothing else. Clipped samples, spikes and noise make other sizes.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np

from .looks import Look

Array = np.ndarray

NEAR = 1 / 32
"""Part of the range within which a size is the one that is asked for."""

FAR = 1 / 8
"""Part of the range below which a size is nothing that noise does not reach."""

FEWEST = 8
"""Samples that must be off, in all looks together."""

EXPLAINED = 0.9
"""Part of these that whole ranges must explain: by chance a quarter are."""


def tell_overflow(
    looks: Sequence[Look], turns_rad: Sequence[float], least_count_raw: tuple[float, float]
) -> tuple[str, ...]:
    """A sentence for each channel whose codes run over the end of their range.

    Parameters
    ----------
    looks
        Along an evenly sampled recording.
    turns_rad
        ωΔ, by which the oscillation turns from sample to sample in each.
    least_count_raw
        Step of each channel's raw values; 0: none, and no codes.

    Returns
    -------
    tuple of str
        Mostly empty.

    Examples
    --------
    Amplitudes of 100 and 140 codes in eight bits:

    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.looks import Look
    >>> from hrg_cli.fitting.samples.overflow import tell_overflow
    >>> wave = np.cos(0.7 * np.arange(2000))
    >>> c, s = (np.round(size * wave).astype("i4").astype("i1") for size in (100, 140))
    >>> look = Look(np.arange(2000.0), np.stack([c, s]).astype(float), (c, s))
    >>> print(*tell_overflow([look], [0.7], (1.0, 1.0)))
    channel S overflows: past the end of their range of 256 codes its samples go on at ...
    """
    said = []
    for k, step in enumerate(least_count_raw):
        codes = [np.asarray(look.raw[k], float) / step for look in looks] if step else []
        codes = [one for one in codes if np.isfinite(one).all()]
        if not codes or len(codes) < len(looks):
            continue
        low, high = min(one.min() for one in codes), max(one.max() for one in codes)
        size = 2.0 ** np.ceil(np.log2(max(high - low + 1, 2.0)))
        found = [
            _find_overflown(one, size, turn) for one, turn in zip(codes, turns_rad, strict=True)
        ]
        off, explained = (sum(int(np.count_nonzero(one[j])) for one in found) for j in (0, 1))
        if explained < max(FEWEST, EXPLAINED * off):
            continue
        last = max(
            float(look.time_s[np.flatnonzero(one[1])[-1]])
            for look, one in zip(looks, found, strict=True)
            if one[1].any()
        )
        said.append(
            f"channel {'CS'[k]} overflows: past the end of their range of {size:.0f} codes its"
            f" samples go on at its other end, seen up to {last:.4g} s; record it with less gain or"
            " more bits, or take what is behind that (--from-s)"
        )
    return tuple(said)


def _find_overflown(codes: Array, size: float, turn_rad: float) -> tuple[Array, Array]:
    """Which samples (n,) do not follow from those beside them, and which of these do by whole
    ranges; samples at the very ends of the codes, where a converter may have clipped, do not
    count."""
    twice = 2 * np.cos(turn_rad)
    error = codes[2:] - twice * codes[1:-1] + codes[:-2]
    error = error - np.median(error)
    within = (codes > codes.min()) & (codes < codes.max())
    off = np.zeros(len(codes), bool)
    off[1:-1] = (np.abs(error) > NEAR * size) & within[2:] & within[1:-1] & within[:-2]
    explained = np.zeros(len(codes), bool)
    for after, here, before in product((-1, 0, 1), repeat=3):
        whole = size * (after - twice * here + before)
        if abs(whole) > FAR * size:
            explained[1:-1] |= np.abs(error - whole) < NEAR * size
    return off, off & explained
