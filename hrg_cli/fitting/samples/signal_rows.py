"""Rows of signals: the columns of a block of windows, and how a channel's are written into them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Array = np.ndarray
Rows = dict[str, Array]


def make_rows(rows: int, tones: int) -> Rows:
    """A block's columns, to be filled: cos and sin of both channels for each tone.

    Parameters
    ----------
    rows
        Windows of the block.
    tones
        Signals a channel, one or two side bands.

    Returns
    -------
    dict of ndarray
        By the columns' names.

    Examples
    --------
    >>> from hrg_cli.fitting.samples.signal_rows import make_rows
    >>> rows = make_rows(100, 1)
    >>> rows["time_s"].shape, rows["signals"].shape, rows["residual_rms"].shape
    ((100,), (100, 4), (100, 2))
    """
    shapes = {
        "time_s": (rows,),
        "signals": (rows, 4 * tones),
        "signals_std": (rows, 4 * tones),
        "residual_rms": (rows, 2),
    }
    return {name: np.empty(shape) for name, shape in shapes.items()} | {
        "flags": np.zeros(rows, "u1")
    }


@dataclass(frozen=True)
class Variances:
    """What makes the standard deviations of a channel's signals."""

    sample2: Array
    """Of one sample, (windows, 1), unit²."""
    own: Array
    """Of the coefficients cos, sin of each tone in that of one sample, (windows or 1, 2 tones)."""
    unsure: Array | float
    """Of the doubt about the bend, (windows, tones), unit²."""


def write_signals(
    out: Rows, rows: slice, channel: int, u: Array, turn: Array, variances: Variances
) -> None:
    """Write a channel's signals, with their standard deviations, into the columns of a block.

    C = c_cos cos + c_sin sin is Re[(c_cos − j c_sin) e^{jωt}]; turned by β, variances p of cos and
    q of sin become p cos²β + q sin²β and the reverse.

    Parameters
    ----------
    out
        The block's columns.
    rows
        Which of its rows.
    channel
        0 or 1.
    u
        Envelopes (windows, tones) in reference phase.
    turn
        By what they were turned to it, (windows, tones).
    variances
        What makes the standard deviations.

    Examples
    --------
    A quarter of a turn exchanges the variances of cos and sin:

    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.signal_rows import Variances, make_rows, write_signals
    >>> out, one = make_rows(1, 1), Variances(np.ones((1, 1)), np.array([[0.01, 0.04]]), 0.0)
    >>> for turn in (1.0, 1j):
    ...     write_signals(out, slice(0, 1), 0, np.array([[3 - 4j]]), np.array([[turn]]), one)
    ...     print(out["signals"][0, :2].tolist(), out["signals_std"][0, :2].round(9).tolist())
    [3.0, 4.0] [0.1, 0.2]
    [3.0, 4.0] [0.2, 0.1]
    """
    tones, k = u.shape[1], channel
    # turned by β, the variances p of cos and q of sin become p cos²β + q sin²β and the reverse
    p, q = variances.own[:, 0::2], variances.own[:, 1::2]
    part = turn.real**2 * (p - q)
    in_phase = slice(2 * k * tones, (2 * k + 1) * tones)
    quadrature = slice((2 * k + 1) * tones, (2 * k + 2) * tones)
    out["signals"][rows, in_phase] = u.real
    # C = c_cos cos + c_sin sin is Re[(c_cos − j c_sin) e^{jωt}]
    np.negative(u.imag, out=out["signals"][rows, quadrature])
    sample2, unsure = variances.sample2, variances.unsure
    np.sqrt(sample2 * (q + part) + unsure, out=out["signals_std"][rows, in_phase])
    np.sqrt(sample2 * (p - part) + unsure, out=out["signals_std"][rows, quadrature])
