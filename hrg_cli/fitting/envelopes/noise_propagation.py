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

from .envelope_runs import EnvelopeRun

Array = np.ndarray
STEP = 0.1
"""Size of the trial moves, in standard deviations."""


def moves(
    run: EnvelopeRun, misfit: Callable[[EnvelopeRun], Array], first: Array, reach: int
) -> Iterator[tuple[Array, Array]]:
    """(δe (N,) by one standard deviation of a component of a row, that row (N,)) for every comb of
    rows and component.

    misfit: equations (N,), the i-th a function of rows first[i] … first[i] + reach − 1.
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
    """(covariance (k, k) of an answer that moves by influence (k, N) times the misfits, predicted
    variance of each misfit (N,))."""
    total, variance = np.zeros((len(influence),) * 2), np.zeros(len(first))
    for change, row in moves(run, misfit, first, reach):
        parts = np.stack([np.bincount(row, g * change, len(run)) for g in influence])
        total += parts @ parts.T
        variance += change**2
    return total, variance
