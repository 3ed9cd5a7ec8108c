"""Loss of vacuum between runs: dampings that differ from run to run, and nothing else."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....fitting.causes.extended_fit import ExtendedFit
from ....records import Wave
from .cases import REMOVED, Fitted, SuspectFound, fit_or_none
from .readings import DAMPING, fit_own_damping
from .suspicion import Suspicion
from .transformations import undo_damping

LEAK_ROUNDS = 3
"""Dampings of the runs and the rest of the model, in turn."""


def find_leaks(waves: Sequence[Wave], fitted: Fitted, base: ExtendedFit) -> SuspectFound | None:
    """Dampings that differ from run to run and nothing else: gas. The runs with more damping than
    those of the least are named."""
    if len(waves) < 3 or any(wave.mode != "free" for wave in waves):
        return None
    fit, undone, less = base, list(waves), np.zeros(len(waves))
    for _ in range(LEAK_ROUNDS):
        dampings = [fit_own_damping(wave, fit) for wave in undone]
        if any(one is None for one in dampings):
            return None
        less += np.array([one[0] - fit.coordinate(DAMPING) for one in dampings if one is not None])
        undone = [undo_damping(wave, d) for wave, d in zip(waves, less, strict=True)]
        again = fit_or_none(undone, fitted)
        if again is None or again.chi2 > fit.chi2:
            return None
        fit = again
    before, after = base.chi2 / base.dof, fit.chi2 / fit.dof
    order = np.argsort(less)
    gaps = np.diff(less[order])
    high = order[int(np.argmax(gaps)) + 1 :]
    if after - 1 > (1 - REMOVED) * (before - 1) or gaps.max() < 0.5 * np.ptp(less):
        return None
    common = fit.coordinate(DAMPING) + float(less[order[0]])
    told = tuple(
        Suspicion(
            waves[k].run_id,
            "loss of pressure",
            f"its damping is {fit.coordinate(DAMPING) + less[k]:.5g} 1/s, the least of the runs"
            f" {common:.5g}: with a damping of its own in every run χ² a degree of freedom falls"
            f" from {before:.3g} to {after:.3g}",
            "check the vacuum between the runs: gas damping; calibrate these runs apart",
        )
        for k in sorted(high)
    )
    return SuspectFound(told, len(waves) - 1, base, fit, after)
