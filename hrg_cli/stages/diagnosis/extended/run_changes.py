"""Diagnosis, the written model: which starts and frequencies of its runs would bring a simulation
nearest to the fit.

A file knows one start and one frequency a run. Where a run was cut, since samples were lost, the
fit has those of every piece: what a change of the run's start does to a later piece is carried
there by the flow, and a change of its frequency has turned that piece's start as well.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....fitting import least_squares
from ....fitting.causes.design_columns import FREQUENCY, OWN
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.causes.sensitivities import find_base_sensitivities
from ....fitting.causes.slow_equation import build_generators
from ....fitting.causes.wave_frame import make_real_matrix, to_complex, to_reals
from ....fitting.causes.whitened_rows import flatten_own
from ....physics.resonator import exponentiate

Array = np.ndarray


def find_change(
    fit: ExtendedFit, difference: Array, compared: Array, origin: Sequence[int]
) -> Array:
    """What of the runs' starts and frequency offsets makes up most of a difference, judged as the
    fit judges.

    Parameters
    ----------
    fit
        The model's.
    difference
        Over σ, (R, n, 4).
    compared
        Rows that were compared, (R, n).
    origin
        The run of which each of the fit's runs is a piece; a run's change stands at its first.

    Returns
    -------
    ndarray
        (R, 5): start state and frequency offset [rad/s].

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.extended.run_changes import find_change
    >>> rows = draw_fit().series.weight > 0
    >>> find_change(draw_fit(), np.zeros((*rows.shape, 4)), rows, [0, 1, 2]).any()
    np.False_
    """
    own = find_base_sensitivities(fit.flow)[1] * compared[..., None, None]
    columns, wanted = flatten_own(fit.series, own), flatten_own(fit.series, difference)
    rows = [block for block, _, _ in fit.design.own]
    change = np.zeros((len(origin), OWN))
    for run in dict.fromkeys(origin):
        pieces = [k for k, of in enumerate(origin) if of == run and compared[k].any()]
        if not pieces:
            continue
        first = origin.index(run)
        carried = _carried(fit, first, pieces)
        parts = [columns[rows[k]] @ carried[k] for k in pieces]
        right = [wanted[rows[k]] for k in pieces]
        change[first] = least_squares.solve(np.concatenate(parts), np.concatenate(right))[0]
    return change


def _carried(fit: ExtendedFit, first: int, pieces: Sequence[int]) -> dict[int, Array]:
    """For each piece the change (5, 5) of its own start and frequency by that of the run's."""
    series, motion = fit.series, fit.prediction.motion
    L = build_generators(series, fit.point)
    start = np.eye(4)
    out = {}
    for k in range(first, max(pieces) + 1):
        if k > first:
            last = int(np.flatnonzero(series.weight[k - 1] > 0)[-1])
            gap_s = float(series.time_s[k, 0] - series.time_s[k - 1, last])
            flow = make_real_matrix(exponentiate(L[k - 1, last], gap_s))
            for step in fit.flow.step[k - 1, :last][::-1]:
                flow = flow @ step
            start = _turned_onto(flow @ start, motion[first, 0], motion[k, 0])
        matrix = np.eye(OWN)
        matrix[:FREQUENCY, :FREQUENCY] = start
        since_s = float(series.time_s[k, 0] - series.time_s[first, 0])
        matrix[:FREQUENCY, FREQUENCY] = since_s * to_reals(1j * motion[k, 0])
        out[k] = matrix
    return out


def _turned_onto(carried: Array, before: Array, after: Array) -> Array:
    """The carried changes (4, 4) turned by the phase that brings the carried motion onto the
    piece's: the clock of the recording stood still where samples were lost."""
    arrived = to_complex(carried @ to_reals(before))
    turn = np.vdot(arrived, after)
    phase = turn / abs(turn) if abs(turn) > 0 else 1.0
    return np.asarray(make_real_matrix(phase * np.eye(2)) @ carried)
