"""The noise of the envelopes carried through any regression to its answer, so that what differences
of neighbouring rows share cancels.

A regression's answer moves by Σ Gᵢ δeᵢ, G its influence and e its equations' misfits, each a
function of a few neighbouring rows of the envelopes. Rows further apart than such a reach are moved
at once, so a handful of evaluations gives every ∂eᵢ/∂(envelope), exactly.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator

import numpy as np

from ..envelopes.envelope_runs import EnvelopeRun

Array = np.ndarray
STEP = 0.1
"""Size of the trial moves, in standard deviations."""


def move_rows(
    run: EnvelopeRun, misfit: Callable[[EnvelopeRun], Array], first: Array, reach: int
) -> Iterator[tuple[Array, Array]]:
    """What one standard deviation of a component of the envelope does to the misfits.

    Rows further apart than the reach of an equation are moved at once: a comb of them costs one
    evaluation.

    Parameters
    ----------
    run
        Its envelopes (n, 2) and their standard deviations.
    misfit
        The equations' misfits (N,), the i-th a function of the rows first[i] … first[i] + reach −
        1.
    first
        (N,): the first row that each sees.
    reach
        Rows that each sees.

    Returns
    -------
    iterator of tuple
        For every comb and component the changes (N,), and the row (N,) that made each.

    Examples
    --------
    A difference of neighbours is moved by −σ by its first row and by σ by its second:

    >>> from dataclasses import dataclass
    >>> import numpy as np
    >>> from hrg_cli.fitting.noise.noise_propagation import move_rows
    >>> @dataclass
    ... class Run:
    ...     envelope: np.ndarray
    ...     std: float
    ...     def __len__(self):
    ...         return len(self.envelope)
    >>> run = Run(np.zeros((4, 2), complex), 0.1)
    >>> differences = lambda run: np.diff(run.envelope[:, 0].real)
    >>> (change, row), *_ = move_rows(run, differences, np.arange(3), 2)
    >>> change.round(9).tolist(), row.tolist()
    ([-0.1, 0.1, -0.1], [0, 2, 2])
    """
    before = misfit(run)
    rows = np.arange(len(run))
    for comb in range(reach):
        moved = np.where(rows % reach == comb, STEP * run.std, 0.0)
        row = first + (comb - first) % reach
        inside = (row >= 0) & (row < len(run))
        for channel in (0, 1):
            for unit in (1.0, 1j):
                envelope = run.envelope.copy()
                envelope[:, channel] += unit * moved
                change = (misfit(dataclasses.replace(run, envelope=envelope)) - before) / STEP
                yield np.where(inside, change, 0.0), np.where(inside, row, 0)


def propagate_noise(
    run: EnvelopeRun,
    misfit: Callable[[EnvelopeRun], Array],
    first: Array,
    reach: int,
    influence: Array,
) -> tuple[Array, Array]:
    """The envelopes' noise carried through a regression to its answer.

    What neighbouring equations share of a row's noise cancels in a sum of their differences, which
    independent errors of the equations would not let it do.

    Parameters
    ----------
    run
        Its envelopes (n, 2) and their standard deviations.
    misfit
        The equations' misfits (N,), the i-th a function of the rows first[i] … first[i] + reach −
        1.
    first
        (N,): the first row that each sees.
    reach
        Rows that each sees.
    influence
        (k, N): by how much each misfit moves the answer.

    Returns
    -------
    tuple of ndarray
        Covariance (k, k) of the answer, and the variance (N,) of each misfit.

    Examples
    --------
    The sum of three differences is the last row less the first: 2σ², not the 6σ² of independent
    ones.

    >>> from dataclasses import dataclass
    >>> import numpy as np
    >>> from hrg_cli.fitting.noise.noise_propagation import propagate_noise
    >>> @dataclass
    ... class Run:
    ...     envelope: np.ndarray
    ...     std: float
    ...     def __len__(self):
    ...         return len(self.envelope)
    >>> run = Run(np.zeros((4, 2), complex), 0.1)
    >>> differences = lambda run: np.diff(run.envelope[:, 0].real)
    >>> covariance, variance = propagate_noise(run, differences, np.arange(3), 2, np.ones((1, 3)))
    >>> covariance.round(9).tolist(), variance.round(9).tolist()
    ([[0.02]], [0.02, 0.02, 0.02])
    """
    total, variance = np.zeros((len(influence),) * 2), np.zeros(len(first))
    for change, row in move_rows(run, misfit, first, reach):
        parts = np.stack([np.bincount(row, g * change, len(run)) for g in influence])
        total += parts @ parts.T
        variance += change**2
    return total, variance
