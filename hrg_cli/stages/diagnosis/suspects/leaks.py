"""Loss of vacuum between runs: dampings that differ from run to run, and nothing else."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....fitting.causes.extended_fit import ExtendedFit
from ....records import Array, Wave
from ...suspicion import Suspicion
from ..thresholds import LEAK_PARTS, MISTAKES_REMOVE, SURE_LEAK
from .cases import Fitted, SuspectFound, fit_or_none
from .readings import DAMPING, fit_own_damping
from .transformations import undo_damping

LEAK_ROUNDS = 3
"""Dampings of the runs and the rest of the model, in turn."""


def find_leaks(waves: Sequence[Wave], fitted: Fitted, base: ExtendedFit) -> SuspectFound | None:
    """Dampings that differ from run to run and nothing else: gas.

    The runs above the gap that one leak leaves are named; of dampings that differ by and by all
    that stand off the least.

    Parameters
    ----------
    waves
        As given, one a run.
    fitted
        The base model's fit to waves.
    base
        That of these waves.

    Returns
    -------
    SuspectFound or None
        None of fewer than three runs, of driven ones, and where dampings leave a misfit.

    Examples
    --------
    Gas adds 0.05 1/s to the first run's 0.5:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves, fit_waves
    >>> from hrg_cli.stages.diagnosis.suspects.leaks import find_leaks
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import undo_damping
    >>> waves = undo_damping(draw_waves()[0], -0.05), *draw_waves()[1:]
    >>> leak = find_leaks(waves, fit_waves, fit_waves(waves))
    >>> [one.what for one in leak.suspicions], leak.suspicions[0].evidence[:27]
    (['loss of pressure'], 'its damping is 0.54659 1/s,')
    """
    if len(waves) < 3 or any(wave.mode != "free" for wave in waves):
        return None
    fit, undone = base, list(waves)
    less, std = np.zeros(len(waves)), np.zeros(len(waves))
    for _ in range(LEAK_ROUNDS):
        dampings = [one for wave in undone if (one := fit_own_damping(wave, fit)) is not None]
        if len(dampings) < len(waves):
            return None
        own, std = np.array(dampings).T
        less += own - fit.coordinate(DAMPING)
        undone = [undo_damping(wave, d) for wave, d in zip(waves, less, strict=True)]
        again = fit_or_none(undone, fitted)
        if again is None or again.chi2 > fit.chi2:
            return None
        fit = again
    before, after = base.chi2 / base.dof, fit.chi2 / fit.dof
    if after - 1 > (1 - MISTAKES_REMOVE) * (before - 1):
        return None
    high = _find_leaking(less, std * np.sqrt(max(after, 1.0)))
    common = fit.coordinate(DAMPING) + float(less.min())
    told = tuple(
        Suspicion(
            waves[k].run_id,
            "loss of pressure",
            f"its damping is {fit.coordinate(DAMPING) + less[k]:.5g} 1/s, the least of the runs"
            f" {common:.5g}: with a damping of its own in every run χ² per degree of freedom falls"
            f" from {before:.3g} to {after:.3g}",
            "check the vacuum between the runs: gas damping; calibrate these runs apart",
        )
        for k in sorted(high)
    )
    return SuspectFound(told, len(waves) - 1, base, fit, after) if told else None


def _find_leaking(less: Array, std: Array) -> Array:
    """Runs of more damping, from the runs' dampings (R,) and their σ."""
    order = np.argsort(less)
    gaps = np.diff(less[order])
    if gaps.max() >= LEAK_PARTS * np.ptp(less):
        return np.asarray(order[int(np.argmax(gaps)) + 1 :])
    least = order[0]
    return np.flatnonzero(less - less[least] > SURE_LEAK * np.hypot(std, std[least]))
