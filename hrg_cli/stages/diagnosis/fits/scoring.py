"""Diagnosis, the score of every cause beside a fit, and of what size a cause is thinkable."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ....effects.effect import Effect
from ....fitting.causes import evidence, scales
from ....fitting.causes.evidence import Score
from ....fitting.causes.extended_fit import ExtendedFit
from ..thresholds import GROSS, MOST_TYPICAL, OWN_SIGMA, SMALL_IN_MOTION, SMALL_IN_READOUT
from .places import place_cause
from .variants import Variant


def is_gross(fit: ExtendedFit) -> bool:
    """Whether the model is far from the data as a whole.

    Parameters
    ----------
    fit
        Of the runs.

    Returns
    -------
    bool
        By χ² per degree of freedom.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_wrong_waves, fit_waves
    >>> from hrg_cli.stages.diagnosis.fits.scoring import is_gross
    >>> is_gross(draw_fit()), is_gross(fit_waves(draw_wrong_waves()))
    (False, True)
    """
    return fit.chi2 > GROSS * fit.dof


def count_places(effect: Effect, fit: ExtendedFit) -> int:
    """At how many places a cause may stand: at every row where it happens at an instant.

    Parameters
    ----------
    effect
        That may stand.
    fit
        Of the runs.

    Returns
    -------
    int
        Rows, or 1.

    Examples
    --------
    >>> from hrg_cli.effects import find
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.fits.scoring import count_places
    >>> [count_places(find(name), draw_fit()) for name in ("gain_mismatch", "momentum_kick")]
    [1, 150]
    """
    return int(np.count_nonzero(fit.series.weight)) if effect.of_one_run else 1


def price_place(effect: Effect, fit: ExtendedFit) -> float:
    """What the choice of its place costs a cause, as ΔBIC: −2 ln of the odds of each.

    Parameters
    ----------
    effect
        That may stand.
    fit
        Of the runs.

    Returns
    -------
    float
        0 of an effect of all runs.

    Examples
    --------
    >>> from hrg_cli.effects import find
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.fits.scoring import price_place
    >>> [
    ...     round(price_place(find(name), draw_fit()), 2)
    ...     for name in ("gain_mismatch", "momentum_kick")
    ... ]
    [0.0, 10.02]
    """
    return 2 * float(np.log(count_places(effect, fit)))


def compute_worth(score: Score, variant: Variant, fit: ExtendedFit, slow: float = 1.0) -> float:
    """ΔBIC that a candidate's score promises beside a fit.

    Parameters
    ----------
    score
        Of the candidate.
    variant
        How it stands.
    fit
        Beside which it was scored.
    slow
        Variance of the noise over the stated one.

    Returns
    -------
    float
        More is better.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case, draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.fits.scoring import compute_worth, score_effects
    >>> fit, candidates = draw_mismatched_fit(), draw_found_case().inquiry.candidates
    >>> ranked = score_effects(fit, candidates)
    >>> worth = [compute_worth(*ranked[0], fit, slow=slow) for slow in (1.0, 4.0)]
    >>> [round(one) for one in worth]
    [845, 207]
    """
    gained = evidence.find_bic_gain(score.gain / slow, score.rank, len(fit.residual))
    return gained - price_place(variant.effect, fit)


def score_effects(fit: ExtendedFit, candidates: Sequence[Variant]) -> list[tuple[Score, Variant]]:
    """Every effect's best variant with its score beside the fit, best criterion first.

    Parameters
    ----------
    fit
        Beside which they are scored.
    candidates
        Ways in which causes may stand.

    Returns
    -------
    list of tuple
        The score and the variant of each cause.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case, draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.fits.scoring import score_effects
    >>> fit, candidates = draw_mismatched_fit(), draw_found_case().inquiry.candidates
    >>> ranked = score_effects(fit, candidates)
    >>> [(score.name, round(float(score.estimate[0]), 3)) for score, _ in ranked]
    [('gain_mismatch', 0.021)]
    """
    active = {effect.name for effect, _ in fit.point.active}
    open_ones = [
        one
        for v in candidates
        if v.effect.name not in active and not (v.anywhere and is_gross(fit))
        for one in (place_cause(v, fit) if v.anywhere else [v])
    ]
    columns = fit.find_sensitivities([variant.wanted for variant in open_ones])
    best: dict[str, tuple[Score, Variant]] = {}
    found = evidence.score_candidates(
        [variant.effect.name for variant in open_ones], fit.residual, columns, fit.basis
    )
    for score, variant in zip(found, open_ones, strict=True):
        if score.visible and not _thinkable(score, variant, fit):
            continue
        if score.name not in best or score.gain > best[score.name][0].gain:
            best[score.name] = (score, variant)

    def order(pair: tuple[Score, Variant]) -> float:
        score, variant = pair
        return -compute_worth(score, variant, fit) if score.visible else np.inf

    return sorted(best.values(), key=order)


def _thinkable(score: Score, variant: Variant, fit: ExtendedFit) -> bool:
    """Whether what stands out of the estimate's noise is of a size such a cause can have: small
    beside the oscillation and the signal."""
    # five σ less: an estimate that noise alone makes large says nothing of the size
    beyond = np.sign(score.estimate) * np.maximum(np.abs(score.estimate) - 5 * score.std, 0.0)
    least = {
        name: float(v) for name, v in zip(variant.steps, beyond, strict=True) if np.isfinite(v)
    }
    values = {name: value + least.get(name, 0.0) for name, value in variant.values.items()}
    return is_small(variant.effect, values, fit)


def is_small(effect: Effect, values: Mapping[str, float], fit: ExtendedFit) -> bool:
    """Whether an effect of these values is of a thinkable size: small beside the oscillation and
    the signal along the fit's runs.

    What is neither in seconds nor in amplitudes (angles, ratios, slopes by temperature) is also
    held against its typical size; the others differ from device to device by more than that would
    allow.

    Parameters
    ----------
    effect
        That is asked.
    values
        Of its parameters.
    fit
        Of the runs.

    Returns
    -------
    bool
        Of a thinkable size.

    Examples
    --------
    A gain that is 2 % beside that of the other channel, and one 20 times as large:

    >>> from hrg_cli.effects import find
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.fits.scoring import is_small
    >>> [is_small(find("gain_mismatch"), {"gain": gain}, draw_fit()) for gain in (0.02, 20.0)]
    [True, False]
    """
    for p in effect.fitted():
        pure = p.amplitude_power == 0 and scales.count_seconds(p.units) == 0
        if pure and not p.sets_in and abs(values[p.name] - p.neutral) > MOST_TYPICAL * p.typical:
            return False
    u = fit.prediction.motion
    motion, seen = scales.measure_strength(effect, values, u, fit.flow.rows.make_state(u))
    return motion <= SMALL_IN_MOTION and seen <= SMALL_IN_READOUT


def is_possible(effect: Effect, fit: ExtendedFit) -> bool:
    """Whether an active effect came out as such a cause can be: of a thinkable size, and on the
    side of neutral that physics allows.

    What lies beyond a parameter's bound by chance is within `OWN_SIGMA` of its standard deviations,
    misfit included: a friction that drives the wave is another cause's shadow.

    Parameters
    ----------
    effect
        Of the fit.
    fit
        With the effect.

    Returns
    -------
    bool
        It may stand.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case
    >>> from hrg_cli.stages.diagnosis.fits.scoring import is_possible
    >>> final = draw_found_case().search.final
    >>> is_possible(final.effect("gain_mismatch"), final)
    True
    """
    values = fit.values(effect.name)
    level = max(fit.chi2 / fit.dof, 1.0) ** 0.5
    for p in effect.fitted():
        reach = OWN_SIGMA * level * fit.parameter_std(effect.name, p.name)
        if values[p.name] < p.minimum - reach:
            return False
    return is_small(effect, values, fit)
