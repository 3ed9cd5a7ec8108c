"""How many rows at a log's start a demodulator's filter still settles.

A filter that starts empty, or with what another wave left in it, answers with exponentials that are
over within some of its own correlations. There the envelope bends as it never does just behind: its
second difference over a correlation, turned back by the oscillation's own turn, stands far out.
"""

from __future__ import annotations

import numpy as np

Array = np.ndarray

LONGEST = 12.0
"""Correlations within which any filter of one to four poles has settled to a millionth."""

BEHIND = 24.0
"""Correlations behind them in which the envelope shows how much it bends by itself."""

FEWEST = 16
"""Second differences, at least, that this is judged by."""

FAR = 30.0
"""Square of a second difference over the median behind: noise of one channel gets there with a
chance of 1e-6, and no motion loses so much of its bend within `LONGEST`."""

QUIET = 0.01
"""Part of the noise's power to which what is left shall have fallen: a tenth of σ."""


def count_settling_rows(start: Array, correlated_rows: float, turn: float, variance: float) -> int:
    """Rows of an envelope's start before the filter that made it has settled.

    An exponential that dies away stands far out of what the second difference over a correlation
    shows behind it. Where the bend is no longer seen it goes on to fall as it did, until it is
    below the noise.

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
    rows = start[:, : longest + max(FEWEST, int(BEHIND * correlated_rows)) + 2 * lag]
    if rows.shape[1] < longest + FEWEST + 2 * lag:
        return 0
    back = rows * np.exp(-1j * turn * np.arange(rows.shape[1]))
    bend = back[:, 2 * lag :] - 2 * back[:, lag:-lag] + back[:, : -2 * lag]
    power = (np.abs(bend) ** 2).sum(0)
    seen = FAR * np.nanmedian(power[longest:])
    far = power > seen
    if not far[0] or far[longest - lag : longest].any():
        return 0
    last = int(np.flatnonzero(far[:longest])[-1]) + 1
    fall = np.log(power[:last].max() / seen) / last
    unseen = np.log(seen / min(seen, QUIET * 6 * variance)) / fall
    return last + lag + int(np.ceil(unseen))
