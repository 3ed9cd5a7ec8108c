"""Runs whose wave turns by nothing like the rate that is logged: a rate in another unit or of wrong
sign, a channel inverted or silent. No tables are asked for it, so that several runs may be wrong.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...fitting.tables.increments import AnglePath

TURNING = 0.05
"""Part of the runs' median rate from which a run turns."""
FAR = 0.2
"""Part of the turn, seen or expected, by which one is far from the other."""
BESIDE_DRIFT = 20.0
"""Times the other runs' median departure, which their drifts make."""


def find_wrong_turns(paths: Sequence[AnglePath]) -> list[int]:
    """Runs whose mean turn is far from −KΩ with the scale factor of most runs.

    Parameters
    ----------
    paths
        The runs, as logged.

    Returns
    -------
    list of int
        Their places; empty where they are not a minority of the runs that turn.

    Examples
    --------
    One of four logs is in °/s:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.stages.calibration.turn_against_log import find_wrong_turns
    >>> def turn(rate, logged):
    ...     return draw_path(rate, rate_integral_rad=logged * np.arange(600.0))
    >>> find_wrong_turns([turn(0.1, 0.1), turn(-0.1, -0.1), turn(0.2, 11.46), turn(-0.2, -0.2)])
    [2]
    """
    seconds = np.array([path.time_s[-1] - path.time_s[0] for path in paths])
    turn = np.array([path.turn.sum() for path in paths]) / seconds
    rate = np.array([path.rotation.sum() for path in paths]) / seconds
    least = TURNING * float(np.median(np.abs(rate)))
    turning = np.abs(rate) > least
    if np.count_nonzero(turning) < 3:
        return []
    scale = float(np.median(-turn[turning] / rate[turning]))
    # a wave that turns beside a log of zeros does not tell K, but does turn
    turning |= np.abs(turn) > abs(scale) * least
    expected = -scale * rate
    off = np.abs(turn - expected)
    usual = float(np.median(off[turning]))
    far = off > FAR * np.maximum(np.abs(turn), np.abs(expected))
    found = np.flatnonzero(turning & far & (off > BESIDE_DRIFT * usual))
    return [int(run) for run in found] if 2 * len(found) < np.count_nonzero(turning) else []
