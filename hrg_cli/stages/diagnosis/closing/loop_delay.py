"""Diagnosis, what loops that act late may add to the scale factor unseen.

The force of loops that act τ late stands behind the wave and turns it by ντ of its own turn: driven
runs show K/(1 + ντ), which is what `drive_frame` leaves to K. Beside that scale factor a lateness
is seen only in what follows the damping along the wave, ντδμ in 4θ, fifty times less. So the fit is
made again where a lateness may move K too: by how much each number moves then, and by how much less
it is known, is what a delay that nobody logged may have done to it.
"""

from __future__ import annotations

import numpy as np

from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.envelopes.coordinates import COUNT
from ..base.joint_fit import fit_beside_delay

Array = np.ndarray
NAME = "loop_delay"


def estimate_moves_of_delay(fit: ExtendedFit) -> dict[str, Array]:
    """By how much the base model's coordinates may be moved by loops that act late.

    Parameters
    ----------
    fit
        The final one.

    Returns
    -------
    dict
        Columns (7, k), whose squares add up to the mean square; empty where free runs tell, or
        where no frame of loops was allowed for.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.closing.loop_delay import estimate_moves_of_delay
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> estimate_moves_of_delay(draw_fit())
    {}
    """
    beside = fit_beside_delay(fit)
    if beside is None:
        return {}
    more = beside.coordinate_covariance() - fit.coordinate_covariance()
    # less than nothing is rounding: where a lateness may move K too nothing is known better
    power, turn = np.linalg.eigh(more)
    unknown = turn * np.sqrt(np.maximum(power, 0.0))
    moved = (beside.point.p - fit.point.p).reshape(COUNT, 1)
    return {NAME: np.concatenate([unknown, moved], axis=1)}
