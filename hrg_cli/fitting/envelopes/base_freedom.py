"""What of the linear gyro is fitted, what is held because it is known, and how widely a direction
may move of which the runs say nothing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .coordinates import COORDINATES, COUNT, DAMPING
from .likelihood import Freedom, free_coordinates
from .weak_priors import IDENTIFIED, find_natural_sizes

Array = np.ndarray


def choose_scale_factor(mode_number: int) -> float:
    """K where it is neither known nor measurable: 1 for a Foucault pendulum (m = 1), 0.55 for a
    shell.

    Parameters
    ----------
    mode_number
        m.

    Returns
    -------
    float
        K, without a unit.

    Examples
    --------
    >>> from hrg_cli.fitting.envelopes.base_freedom import choose_scale_factor
    >>> choose_scale_factor(1), choose_scale_factor(2)
    (1.0, 0.55)
    """
    return 1.0 if mode_number == 1 else 0.55


def choose_scale_factor_spread(mode_number: int) -> float:
    """Standard deviation to which the nominal K is known: shells and rings have 0.25 to 0.85, a
    pendulum 1 but for its pivot.

    Parameters
    ----------
    mode_number
        m.

    Returns
    -------
    float
        Of K.

    Examples
    --------
    >>> from hrg_cli.fitting.envelopes.base_freedom import choose_scale_factor_spread
    >>> choose_scale_factor_spread(1), choose_scale_factor_spread(2)
    (0.05, 0.2)
    """
    return 0.05 if mode_number == 1 else 0.2


@dataclass(frozen=True)
class Known:
    """What is held instead of fitted: K, and the axes (physical angles) of damping and stiffness;
    None: fitted."""

    scale_factor: float | None = None
    damping_axis_rad: float | None = None
    stiffness_axis_rad: float | None = None


def make_freedom(known: Known, p: Array, mode_number: int, span_s: float) -> Freedom:
    """What is fitted, with weak priors sized by a first estimate.

    Parameters
    ----------
    known
        What is held; a known axis leaves its split's size alone.
    p
        The first estimate, (7,), in the order of `COORDINATES`.
    mode_number
        m.
    span_s
        Length of the longest run: what no run can show is taken for no smaller than 1 over it.

    Returns
    -------
    Freedom
        Names, origin, directions and priors of the free coordinates.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.base_freedom import Known, make_freedom
    >>> p = np.array([0.2, 0.0, 0.0, 0.1, 0.0, 0.55, 1.0])
    >>> "scale_factor" in make_freedom(Known(scale_factor=0.55), p, 2, 10.0).names
    False
    """
    base = free_coordinates(COORDINATES, np.zeros(COUNT))
    directions, origin = base.directions.copy(), np.zeros(COUNT)
    mean = np.array([p[DAMPING], 0, 0, 0, 0, choose_scale_factor(mode_number), 0.5])
    std = IDENTIFIED.scale_by(*find_natural_sizes(p, span_s))
    keep = np.ones(COUNT, bool)
    for first, axis in ((1, known.damping_axis_rad), (3, known.stiffness_axis_rad)):
        if axis is not None:
            alpha = 2 * mode_number * axis
            directions[first : first + 2, first] = np.cos(alpha), np.sin(alpha)
            keep[first + 1] = False
    if known.scale_factor is not None:
        origin[5], keep[5] = known.scale_factor, False
    return Freedom(
        tuple(np.array(COORDINATES)[keep]), origin, directions[:, keep], mean[keep], std[keep]
    )


def hold_second_order(space: Freedom, value: float = 1.0) -> Freedom:
    """The same freedom with the second-order correction held.

    Parameters
    ----------
    space
        With the correction as its last coordinate.
    value
        Where it is held: 1 as a real resonator has it, 0 for plain averaging.

    Returns
    -------
    Freedom
        With one coordinate less.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.base_freedom import Known, make_freedom, hold_second_order
    >>> space = make_freedom(Known(), np.array([0.2, 0.0, 0.0, 0.1, 0.0, 0.55, 1.0]), 2, 10.0)
    >>> len(space.names), len(hold_second_order(space).names)
    (7, 6)
    """
    origin = space.origin.copy()
    origin[6] = value
    return Freedom(
        space.names[:-1],
        origin,
        space.directions[:, :-1],
        space.prior_mean[:-1],
        space.prior_std[:-1],
    )
