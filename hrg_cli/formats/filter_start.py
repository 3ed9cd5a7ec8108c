"""How many rows at a log's start a demodulator's filter still settles.

A filter that starts empty, or with what another wave left in it, answers with exponentials that are
over within some of its own correlations. There the envelope, turned back by the oscillation's own
turn, stands farther off the parabola through the rows ahead than it ever does just behind. Of a
filter of one pole the first row alone tells of it, as all others follow from it but for noise: the
parabola has to be longer than the noise's correlation, so that it adds little.
"""

from __future__ import annotations

import numpy as np
from scipy.special import chdtri

Array = np.ndarray

LONGEST = 12.0
"""Correlations within which any filter of one to four poles has settled to a millionth."""

BEHIND = 24.0
"""Correlations behind them in which the envelope shows how far off it is by itself, and length of
the parabolas."""

AHEAD = 2.0
"""Correlations from a row to the first that its parabola is fitted to."""

FEWEST = 16
"""Distances, at least, that this is judged by."""

CHANCE, ROOM = 1e-6, 1.5
"""Chance with which noise alone is as far off, and times that which counts as far: no motion loses
so much of its bend within `LONGEST`."""

QUIET = 0.01
"""Part of the noise's power to which what is left shall have fallen: a tenth of σ."""


def count_settling_rows(start: Array, correlated_rows: float, turn: float, variance: float) -> int:
    """Rows of an envelope's start before the filter that made it has settled.

    An exponential that dies away stands far off the parabolas. Where it is no longer seen it goes
    on to fall as it did, until it is below the noise.

    Parameters
    ----------
    start
        The first rows (channel, n), complex, signals' unit.
    correlated_rows
        κ, rows that count as one.
    turn
        The oscillation's turn per row, rad.
    variance
        Of a row's noise, all parts together, unit².

    Returns
    -------
    int
        0 where nothing shows that it had to settle, or where there are too few rows to tell.

    Examples
    --------
    An envelope that rises to 1 within a few rows, and one that was there from the start:

    >>> import numpy as np
    >>> from hrg_cli.formats.filter_start import count_settling_rows
    >>> noise = 1e-4 * np.random.default_rng(1).normal(size=(1, 400, 2)) @ [1, 1j]
    >>> rising = 1 - np.exp(-np.arange(400.0) / 2)[None] + noise
    >>> 10 < count_settling_rows(rising, 4.0, 0.0, 2e-8) < 30
    True
    >>> count_settling_rows(1 + noise, 4.0, 0.0, 2e-8)
    0
    """
    lag = max(1, round(correlated_rows))
    longest = int(np.ceil(LONGEST * correlated_rows))
    kernel = _make_parabola(round(AHEAD * lag), round(BEHIND * lag))
    rows = start[:, : longest + max(FEWEST, int(BEHIND * correlated_rows)) + len(kernel)]
    if rows.shape[1] < longest + FEWEST + len(kernel):
        return 0
    back = rows * np.exp(-1j * turn * np.arange(rows.shape[1]))
    off = np.stack([np.correlate(channel, kernel, "valid") for channel in back])
    power = (np.abs(off) ** 2).sum(0)
    seen = _find_far(len(rows)) * np.nanmedian(power[longest:])
    far = power > seen
    if not far[0] or far[longest - lag : longest].any():
        return 0
    last = int(np.flatnonzero(far[:longest])[-1]) + 1
    fall = np.log(power[:last].max() / seen) / last
    unseen = np.log(seen / min(seen, QUIET * variance)) / fall
    return last + lag + int(np.ceil(unseen))


def _make_parabola(ahead: int, length: int) -> Array:
    """Weights (n,) of a row and those ahead of it that give its distance from the parabola of least
    squares through `length` of these."""
    lags = ahead + np.arange(length)
    along = np.vander(lags / lags[-1], 3)
    kernel = np.zeros(ahead + length)
    kernel[ahead:] = -np.linalg.pinv(along)[2]
    kernel[0] += 1
    return kernel


def _find_far(channels: int) -> float:
    """Square of a distance over its median behind from which it is far: χ² of the channels' two
    parts."""
    return ROOM * float(chdtri(2 * channels, CHANCE) / chdtri(2 * channels, 0.5))
