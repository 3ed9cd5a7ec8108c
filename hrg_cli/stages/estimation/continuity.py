"""Angles and phases made continuous through a stream of blocks: (mθ, φ) and (mθ + π, φ + π) are one
wave, and the copy nearest to the path of trusted rows is taken.
"""

from __future__ import annotations

import functools

import numpy as np

from ...fitting.ellipse.continuity import CONTEXT_ROWS, continue_angles, find_nearest_copy
from ...records import FLAG_GAP, FLAG_NOT_FINITE, Array, Periods
from .solution import find_finite

DETECTED = 5.0
"""An amplitude below this many standard deviations is no wave; noise alone exceeds it in 5e-5 of
the windows (χ² of four)."""


def make_continuous(x: Array, block: Periods, context: Array | None) -> Array | None:
    """Make (mθ, φ, ψ) continuous, in place.

    The path runs through trusted rows only, for one stray value near half a period away would turn
    all that follows; the others take the copy nearest to the path. Where fewer than half of the
    rows can be trusted, all have a say.

    Parameters
    ----------
    x
        (n, 5): a_A, a_B, mθ, φ, ψ; changed.
    block
        The windows' times, deviations and flags.
    context
        The last trusted rows before, (k, 4): time, mθ, φ, ψ; None: there are none.

    Returns
    -------
    ndarray or None
        Those after this block, the next one's context.

    Examples
    --------
    >>> from types import SimpleNamespace as Block
    >>> import numpy as np
    >>> from hrg_cli.stages.estimation.continuity import make_continuous
    >>> angle = np.linspace(0.0, 6.0, 9)
    >>> folded = np.remainder(angle + np.pi / 2, np.pi) - np.pi / 2
    >>> x = np.stack([angle * 0 + 1, angle * 0, folded, folded - angle, 0 * angle], axis=1)
    >>> block = Block(
    ...     time_s=np.arange(9.0),
    ...     signals_std=np.full((9, 4), 1e-3),
    ...     flags=np.zeros(9, int),
    ...     window_s=1.0,
    ... )
    >>> context = make_continuous(x, block, None)
    >>> bool(np.allclose(np.diff(x[:, 2]), 0.75))
    True
    """
    time_s, std = np.asarray(block.time_s, float), np.asarray(block.signals_std, float)
    finite = find_finite(x) & np.isfinite(time_s)
    stray = (np.asarray(block.flags) & (FLAG_GAP | FLAG_NOT_FINITE) != 0) | _find_faint(
        x[:, 0], std
    )
    trusted = finite & ~stray
    if 2 * np.count_nonzero(trusted) < np.count_nonzero(finite):
        trusted = finite
    rows = np.stack([time_s, *x[:, 2:].T])
    every = bool(trusted.all())
    if not every:
        rows = rows[:, trusted]
    if rows.shape[1] == 0:
        return context
    known = 0 if context is None else len(context)
    if context is not None:
        rows = np.concatenate([context.T, rows], axis=1)
    at, angle, phase, carrier = rows
    path = np.stack(continue_angles(at, angle, phase, carrier, block.window_s))
    if context is not None:
        # All that follows moves by the half turns that the context had been given before.
        path -= np.pi * np.round((path[:, known - 1] - context[-1, 1:]) / np.pi)[:, None]
    x[slice(None) if every else trusted, 2:] = path[:, known:].T
    others = finite & ~trusted
    if others.any():
        expected = np.stack(
            [np.interp(time_s[others], rows[0], column) for column in path], axis=-1
        )
        x[others, 2:] = find_nearest_copy(x[others, 2:], expected)
    return np.column_stack([rows[0, -CONTEXT_ROWS - 1 :], path[:, -CONTEXT_ROWS - 1 :].T])


def _find_faint(amplitude: Array, std: Array) -> Array:
    """Rows (n,) whose amplitude is no wave beside the largest of their signals' deviations (n,
    k)."""
    # where the block's largest is far below every amplitude, which is the rule, one fast pass shows
    # it
    if (amplitude >= DETECTED * std.max()).all():
        return np.zeros(len(amplitude), bool)
    return np.asarray(amplitude < DETECTED * functools.reduce(np.maximum, std.T))
