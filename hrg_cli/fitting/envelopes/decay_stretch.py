"""Where in a record a decay is: the strike before it, and the sounds or the silence after it, found
by the decay itself.

A model fitted to the middle of the decay foretells the block next to it; as long as what it misses
there is no worse than within, the block belongs to the decay and the model is fitted anew with it.
Where it does not, the record is something else: a strike, a damper, the end of the sound.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .envelope_runs import EnvelopeRun

Array = np.ndarray
BLOCKS = 60
FEWEST_ROWS = 6
"""Rows of a block at least."""
STRANGE = 25.0
"""Mean square misfit over the stated noise, in units of the decay's own typical one, from which a
block is no part of it."""
GROSS = 0.01
"""The same over the squared amplitude: a decay that a model merely foretells poorly is one
nevertheless."""
LOUD = 6.0
"""Amplitude over its noise up to which a decay is followed from its strongest block at first."""
Predict = Callable[[slice], tuple[Array, Array]]
"""Rows of a fit -> squared misfit over the noise, and over the squared amplitude, measured or
foretold (n,), on every row."""


def find_decay_stretch(run: EnvelopeRun, z: Array, misfit: Predict) -> slice:
    """Rows of the record that are one decay; the whole record where nothing is strange at its ends.

    Parameters
    ----------
    run
        The record, n rows.
    z
        Its signal (n,), whose strongest block is where the decay begins, unless it is near the end.
    misfit
        Of a fit to some rows, on every row (n,): squared misfit over the noise, and over the
        squared amplitude.

    Returns
    -------
    slice
        Of whole blocks, about `BLOCKS` of them in a record, none shorter than `FEWEST_ROWS`.

    Examples
    --------
    A bell that a hand damps after 50 of 60 s: the line through ln|z| of the rows before foretells
    what follows too large.

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.decay_stretch import find_decay_stretch
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> t = np.arange(0.0, 60.0, 0.1)
    >>> z = np.exp(-0.05 * t - np.maximum(0.0, t - 50.0))
    >>> run = EnvelopeRun("", t, np.outer(z, [1, 0]), 0 * t + 1e-3, 0 * t, None, 5e3, 2, 0.1)
    >>> def misfit(rows):
    ...     line = np.exp(np.polyval(np.polyfit(t[rows], np.log(z[rows]), 1), t))
    ...     return ((z - line) / run.std) ** 2, ((z - line) / line) ** 2
    >>> found = find_decay_stretch(run, z, misfit)
    >>> float(t[found.start]), float(t[found.stop])
    (0.0, 50.0)
    """
    count = len(run)
    size = max(FEWEST_ROWS, -(-count // BLOCKS))
    blocks = count // size
    if blocks < 8:
        return slice(0, count)
    edges = np.append(np.arange(blocks) * size, count)
    energy = np.add.reduceat(np.abs(z) ** 2, edges[:-1]) / np.diff(edges)
    peak = int(np.argmax(energy))
    if peak > 0.6 * blocks:
        peak = 0
    # what the noise has swallowed is no place to begin
    loud = energy > LOUD**2 * np.add.reduceat(run.std**2, edges[:-1]) / np.diff(edges)
    end = blocks if loud[peak:].all() else peak + int(np.argmin(loud[peak:]))
    end = max(end, min(peak + 4, blocks))
    low, high = peak + (end - peak) // 4, peak + -(-3 * (end - peak) // 4)
    up = down = True
    while up or down:
        power, relative = (
            np.add.reduceat(values, edges[:-1]) / np.diff(edges)
            for values in misfit(slice(int(edges[low]), int(edges[high])))
        )
        ours = (power < STRANGE * max(1.0, float(np.median(power[low:high])))) | (relative < GROSS)
        up, down = up and high < blocks, down and low > 0
        reach = max(1, (high - low) // 10)
        if up:
            fine = ours[high : min(blocks, high + reach)]
            step = len(fine) if fine.all() else int(np.argmin(fine))
            high, up = high + step, step > 0
        if down:
            fine = ours[max(0, low - reach) : low][::-1]
            step = len(fine) if fine.all() else int(np.argmin(fine))
            low, down = low - step, step > 0
    return slice(int(edges[low]), int(edges[high]))
