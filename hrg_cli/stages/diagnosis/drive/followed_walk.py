"""Diagnosis, what a cause earns by following the likely walk of driven runs.

The residual r (whitened, C = 1 + DDᵀ) makes the likely walk w = DᵀC⁻¹r, which is laid on the motion
(`scatter.follow_walk`), and what follows the motion follows r in part. A cause whose columns beside
the basis are s⊥(w) is expected to earn, of noise alone, not 0 but

    b = E[s⊥(w(r))ᵀ r]

which for a gain that follows the amplitude is the number of directions in which the walk is known,
over |s⊥|. It is lost in what most causes do, and is all of one that nothing but the walk tells from
the model: a₀/a beside start and damping where loops hold the amplitude.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ....fitting.causes import evidence
from ....fitting.causes.evidence import Score
from ....fitting.causes.extended_fit import ExtendedFit

Array = np.ndarray
DRAWS = 8
"""Draws of the noise whose mean is taken: b to 0.3 σ where it is 6."""


def correct_for_walk(
    fit: ExtendedFit, score: Score, make_columns: Callable[[ExtendedFit], Array]
) -> Score:
    """The score without what noise alone is expected to earn along the walk that it makes.

    The expectation is a mean over draws of white noise, either sign of which is followed, so that
    what does not follow the walk drops out of each draw.

    Parameters
    ----------
    fit
        Of the runs, along their likely walk.
    score
        Of a cause beside it.
    make_columns
        The cause's sensitivities (N, m) beside a fit.

    Returns
    -------
    Score
        The same where nothing walks.

    Examples
    --------
    Free runs have no log that a walk could stand beside:

    >>> from hrg_cli.effects import find
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.drive.followed_walk import correct_for_walk
    >>> from hrg_cli.stages.diagnosis.fits.scoring import score_effects
    >>> from hrg_cli.stages.diagnosis.fits.variants import list_variants
    >>> fit = draw_mismatched_fit()
    >>> ((score, variant),) = score_effects(fit, list_variants([find("gain_mismatch")], fit))
    >>> make = lambda fit: fit.find_sensitivities([variant.wanted])[0]
    >>> correct_for_walk(fit, score, make) is score
    True
    """
    if not score.visible or not is_along_walk(fit):
        return score
    earned = score.space.T @ fit.residual - _expect_earned(fit, score, make_columns)
    gain = float(earned @ earned)
    z, p = evidence.find_significance(gain, score.rank)
    return replace(score, gain=gain, z=z, p_value=p)


def is_along_walk(fit: ExtendedFit) -> bool:
    """Whether the motion of the runs holds a walk that their own residual made likely.

    Parameters
    ----------
    fit
        Of the runs.

    Returns
    -------
    bool
        Of driven runs alone.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.drive.followed_walk import is_along_walk
    >>> is_along_walk(draw_fit())
    False
    """
    walk = fit.series.walk
    return walk is not None and fit.series.scatter is not None and bool(np.any(walk.jumps))


def _expect_earned(
    fit: ExtendedFit, score: Score, make_columns: Callable[[ExtendedFit], Array]
) -> Array:
    """b along the directions of the score (rank,)."""
    walk, scatter = fit.series.walk, fit.series.scatter
    assert walk is not None and scatter is not None
    random, earned = np.random.default_rng(0), np.zeros(score.rank)
    for _ in range(DRAWS):
        noise = random.standard_normal(len(fit.residual))
        jumps = walk.estimate_jumps(noise, scatter)
        for side in (1, -1):
            series = replace(fit.series, walk=replace(walk, jumps=walk.jumps + side * jumps))
            beside = fit.stand_along(series)
            columns = make_columns(beside) @ score.directions
            earned += side * (beside.basis.project_out(columns).T @ noise) / 2
    return earned / DRAWS
