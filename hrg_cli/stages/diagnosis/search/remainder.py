"""Diagnosis, the rest: an open search over terms of the envelope equation and the read-out times
functions of t, θ, a, T and Ω.

What is left over is described by the best such terms (`open_terms`), blamed on nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ....fitting.causes import evidence, extended_fit, fit_point
from ....fitting.causes.designs import Basis
from ....fitting.causes.evidence import Score
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.causes.measured_runs import MeasuredRuns
from ....fitting.causes.sensitivities import Propagation, batch_columns, multiply_out
from ....fitting.causes.slow_equation import RungeKuttaStage
from ....fitting.causes.wave_frame import find_directions, to_reals
from ....fitting.causes.whitened_rows import flatten_rows
from ..drive.followed_walk import correct_for_walk
from ..fits.open_terms import (
    PLACES,
    Covariate,
    OpenShape,
    Place,
    goes_by_run,
    list_covariates,
    make_open_effect,
)
from ..fits.refits import compute_bic, leave_out
from ..fits.scoring import is_gross
from ..thresholds import (
    INADEQUATE,
    NEARLY_ALL,
    NEVER_LESS,
    READOUT_BETTER,
    SIGNIFICANT,
    WORTH,
)
from .inquiry import STATED, NoiseLevel

Array = np.ndarray
CELLS, PEAKS = 48, 8
"""Half cycles in the longest run up to which tones are looked for, and the peaks of the residual's
spectrum at which they are."""
SLOW = (0.5, 1.0)
"""Cycles too few for a peak, looked for always."""
SHAPED, NEAR = 4, 0.6
"""Terms whose shape is refined before the best is chosen, and the part of the best one's gain from
which they are."""
SMOOTH = 6
"""Slow cosines of each of the wave's components in which a misfit of the model is looked for; what
is quicker is asked of the open terms."""
OPEN_TERMS = 3
"""Open terms that describe a rest; a rest that needs more is not described."""


@dataclass(frozen=True)
class Term:
    """One term of the open search with its score beside the fit."""

    place: Place
    covariate: Covariate
    score: Score

    @property
    def size(self) -> float:
        """Greatest size of the change: of a vector whose parts follow a cosine and a sine, the
        greater half-axis of its ellipse."""
        parts = np.nan_to_num(self.score.estimate).reshape(self.covariate.parts, -1)
        return float(np.linalg.norm(parts, 2))

    def find_run_apart(self) -> int | None:
        """Number of the run that stands farthest from the mean of all; None of what does not go by
        runs."""
        contrasts = self.covariate.contrasts
        if contrasts is None:
            return None
        estimate = np.nan_to_num(self.score.estimate).reshape(self.covariate.parts, -1)
        return int(np.argmax(np.linalg.norm(contrasts.T @ estimate, axis=1)))

    def compute_bic_gain(self, rows: int, noise: NoiseLevel = STATED) -> float:
        """ΔBIC."""
        return evidence.find_bic_gain(self.score.gain / noise.slow, self.score.rank, rows)


def score_terms(fit: ExtendedFit, by_run: bool) -> list[Term]:
    """Every term with its score beside the fit, best first; what coincides with the model is left
    out, what is equal but for rounding stays in the order of the places.

    Parameters
    ----------
    fit
        Of the runs.
    by_run
        Terms with a number of every run's own are looked through too.

    Returns
    -------
    list of Term
        Best first.

    Examples
    --------
    What turns with Ω as a gain mismatch does:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.search.remainder import score_terms
    >>> best = score_terms(draw_mismatched_fit(), by_run=False)[0]
    >>> best.place.name, round(best.score.gain)
    ('gain split', 852)
    """
    rows = len(fit.residual)
    # those without are looked through first, and with the others again
    out = [
        term
        for own in ((False, True) if by_run else (False,))
        for term in fit.recall(("terms", own), partial(_judge_all, fit, own))
    ]
    return sorted(out, key=lambda t: -round(t.compute_bic_gain(rows), 3))


def _judge_all(fit: ExtendedFit, own: bool) -> list[Term]:
    """The terms that can be seen, with a number of every run's `own` or without."""
    judged = judge_terms(fit, list(_pairs(fit, own)), fit.residual, fit.basis)
    return [term for term in judged if term.score.visible]


def _pairs(fit: ExtendedFit, own: bool) -> Iterator[tuple[Place, Covariate]]:
    """All terms with a number of every run's own, or without."""
    covariates = fit.recall(
        "covariates",
        lambda: list(list_covariates(fit.series, fit.flow.prediction.motion, find_peaks(fit))),
    )
    for covariate in covariates:
        if (covariate.contrasts is not None) != own:
            continue
        for place in PLACES:
            # a constant at a place of the motion is a coordinate of the base model itself
            if (
                (covariate.formula != "1" or place.readout)
                and (not covariate.places or place.name in covariate.places)
                and place.acts_in(fit.series)
            ):
                yield place, covariate


def find_peaks(fit: ExtendedFit) -> list[float]:
    """Cycles of the tones looked for: the highest peaks of the spectrum of all runs' and the wave's
    components' residuals together.

    Parameters
    ----------
    fit
        Of the runs.

    Returns
    -------
    list of float
        Over the longest run.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.search.remainder import find_peaks
    >>> find_peaks(draw_fit())[:2]
    [0.5, 1.0]
    """
    series = fit.series
    values = extended_fit.resolve_along_wave(fit, fit.residual)
    good = series.weight > 0
    span = float(series.time_s[good].max())
    cycles = np.arange(1.5, CELLS / 2 + 1, 0.25)
    power = np.zeros(len(cycles))
    for t, kept, one in zip(series.time_s / span, good, values, strict=True):
        # Hann: without it a step between the ends of a run fills all cells
        taper = np.sin(np.pi * np.clip((t - t[0]) / max(np.ptp(t[kept]), 1e-12), 0, 1)) ** 2 * kept
        wave = np.exp(-2j * np.pi * np.outer(cycles, t)) * taper
        power += np.sum(np.abs(wave @ one) ** 2, axis=1) / max(float(taper @ taper), 1e-12)
    inner = np.flatnonzero((power[1:-1] >= power[:-2]) & (power[1:-1] > power[2:])) + 1
    return [*SLOW, *(float(cycles[k]) for k in sorted(inner, key=lambda k: -power[k])[:PEAKS])]


def judge_terms(
    fit: ExtendedFit, pairs: Sequence[tuple[Place, Covariate]], residual: Array, Q: Basis
) -> list[Term]:
    """Terms with their scores beside a model.

    Parameters
    ----------
    fit
        Of the runs.
    pairs
        Place and covariate of each term.
    residual
        That they are judged by (N,).
    Q
        Of the model, orthonormal.

    Returns
    -------
    list of Term
        In the order of the pairs.

    Examples
    --------
    A gain is the base model's own, a gain split is not:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.fits.open_terms import PLACES, list_covariates
    >>> from hrg_cli.stages.diagnosis.search.remainder import judge_terms
    >>> fit = draw_mismatched_fit()
    >>> constant, *_ = list_covariates(fit.series, fit.prediction.motion)
    >>> pairs = [(place, constant) for place in PLACES if place.name in ("gain", "gain split")]
    >>> terms = judge_terms(fit, pairs, fit.residual, fit.basis)
    >>> [(term.place.name, round(term.score.gain)) for term in terms]
    [('gain', 0), ('gain split', 852)]
    """
    ledger, order = evidence.Ledger(residual, Q), list[int]()
    for numbers, columns, widths in compute_term_columns(fit.flow, pairs):
        ledger.enter(columns, widths)
        order += numbers
    names = [f"{pairs[k][0].name} × {pairs[k][1].formula}" for k in order]
    # of the flow, not of the fit, which remembers its terms: a ring of both would be freed late
    made = [partial(_build_term, fit.flow, pairs[k]) for k in order]
    found = dict(zip(order, ledger.compute_scores(names, made), strict=True))
    return [Term(place, covariate, found[k]) for k, (place, covariate) in enumerate(pairs)]


def _build_term(flow: Propagation, pair: tuple[Place, Covariate]) -> Array:
    """The columns of one term."""
    ((_, columns, _),) = compute_term_columns(flow, [pair])
    return columns


def _build_beside(fit: ExtendedFit, pair: tuple[Place, Covariate]) -> Array:
    """The same beside a fit."""
    return _build_term(fit.flow, pair)


def compute_term_columns(
    flow: Propagation, pairs: Sequence[tuple[Place, Covariate]]
) -> Iterator[tuple[list[int], Array, list[int]]]:
    """Numbers, sensitivities over σ side by side (N, Σ widths) and widths of some terms at a time;
    those of a place share its vectors.

    Parameters
    ----------
    flow
        Along a prediction of the runs.
    pairs
        Place and covariate of each term.

    Returns
    -------
    iterator of tuple
        Some terms at a time.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.fits.open_terms import PLACES, list_covariates
    >>> from hrg_cli.stages.diagnosis.search.remainder import compute_term_columns
    >>> fit = draw_mismatched_fit()
    >>> constant, *_ = list_covariates(fit.series, fit.prediction.motion)
    >>> pairs = [(place, constant) for place in PLACES if place.name in ("gain", "gain split")]
    >>> [(columns.shape, widths) for _, columns, widths in compute_term_columns(fit.flow, pairs)]
    [((600, 1), [1]), ((600, 1), [1])]
    """
    series = flow.prediction.series
    motion, seen = flow.prediction.motion, flow.prediction.seen
    by_place: dict[str, list[int]] = {}
    for k, (place, _) in enumerate(pairs):
        by_place.setdefault(place.name, []).append(k)
    known: dict[tuple[int, int], Array] = {}

    def values(numbers: list[int], u: Array, where: MeasuredRuns) -> list[Array]:
        for k in numbers:
            if (k_key := (id(pairs[k][1]), id(u))) not in known:
                known[k_key] = np.moveaxis(pairs[k][1].function(u, where), 0, -1)
        return [known[id(pairs[k][1]), id(u)] for k in numbers]

    for numbers in by_place.values():
        place = pairs[numbers[0]][0]
        at_rows = seen if place.readout else motion
        vectors = _vectors(place, _find_acted_on(place, flow.rows, at_rows))
        widths = [pairs[k][1].parts * vectors.shape[-1] for k in numbers]
        for places in batch_columns(widths, 4 * series.weight.size):
            some = [numbers[place] for place in places]
            parts = values(some, at_rows, series)
            g = np.concatenate(parts, axis=-1)
            if place.readout:
                wide = flow.prediction.whiten_judged(multiply_out(vectors, g))
            else:
                g_middle = np.concatenate(values(some, flow.middle, flow.centre), axis=-1)
                between = _vectors(place, _find_acted_on(place, flow.halves, flow.middle))
                wide = flow.whiten_read_out(flow.propagate_products(vectors, between, g, g_middle))
            yield some, flatten_rows(series, wide), [widths[place] for place in places]


def _find_acted_on(place: Place, stage: RungeKuttaStage, u: Array) -> Array:
    """What a place's M acts on: the envelopes, or the force that drives them."""
    return stage.make_state(u).drive if place.of_drive else u


def _vectors(place: Place, u: Array) -> Array:
    """M u of a place as reals, (…, 4, columns)."""
    return np.stack([to_reals(m) for m in place.columns(u)], -1)


def refine_term(fit: ExtendedFit, term: Term) -> Term:
    """The term with what is free in its covariate's form (an instant, a decay, a frequency) to a
    fiftieth of the first grid.

    Parameters
    ----------
    fit
        Of the runs.
    term
        Beside it.

    Returns
    -------
    Term
        The same where its form has nothing free.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.search.remainder import (
    ...     find_best_term,
    ...     refine_term,
    ...     score_terms,
    ... )
    >>> fit = draw_mismatched_fit()
    >>> best = find_best_term(fit, score_terms(fit, by_run=False))
    >>> refine_term(fit, best) is best
    True
    """
    if term.covariate.shape is None:
        return term
    # the open search looks at one fit twice, with and without terms of every run's own
    key = "refined", term.place.name, term.covariate.formula, term.score.gain
    refined: Term = fit.recall(key, lambda: _refine_shape(fit, term))
    return refined


def _refine_shape(fit: ExtendedFit, term: Term) -> Term:
    """The term at the best of the finer values of what is free in its covariate's form."""
    shape = _shape(term)
    width = shape.width
    for _ in range(2):
        middle = _shape(term).value
        trials = [
            (term.place, shape.make(fit.series, v)) for v in middle + width * np.linspace(-1, 1, 11)
        ]
        best = max(judge_terms(fit, trials, fit.residual, fit.basis), key=lambda t: t.score.gain)
        if best.score.gain > term.score.gain:
            term = best
        width /= 5
    return term


def _shape(term: Term) -> OpenShape:
    assert term.covariate.shape is not None
    return term.covariate.shape


def find_best_term(fit: ExtendedFit, ranked: Sequence[Term]) -> Term:
    """The term worth most once the shapes of the nearest are refined; one of the motion where it
    serves as well as one of the read-out.

    A fast error of the motion looks like one of the read-out.

    Parameters
    ----------
    fit
        Of the runs.
    ranked
        Terms beside it, best first.

    Returns
    -------
    Term
        The best, its shape refined.

    Examples
    --------
    A gain mismatch looks like a damping split that follows the rate:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.search.remainder import find_best_term, score_terms
    >>> fit = draw_mismatched_fit()
    >>> best = find_best_term(fit, score_terms(fit, by_run=False))
    >>> best.place.name, best.covariate.formula
    ('damping split', 'Ω/Ω₀')
    """
    rows = len(fit.residual)
    near = [t for t in ranked if t.score.gain >= NEAR * ranked[0].score.gain]
    shaped = [t for t in near if t.covariate.shape is not None]
    first: dict[tuple[str, object], Term] = {}
    for term in shaped:
        first.setdefault((term.place.name, _shape(term).make), term)
    better = [refine_term(fit, t) for t in list(first.values())[:SHAPED]]
    near = sorted([*better, *near], key=lambda t: -round(t.compute_bic_gain(rows), 3))
    best = near[0]
    if best.place.readout:
        margin = max(WORTH, READOUT_BETTER * best.score.gain)
        alike = (t for t in near if not t.place.readout and t.covariate.name == best.covariate.name)
        moving = next(alike, None)
        if (
            moving is not None
            and moving.compute_bic_gain(rows) > best.compute_bic_gain(rows) - margin
        ):
            best = refine_term(fit, moving)
    return best


@dataclass(frozen=True)
class Remainder:
    """What the open search says: accepted terms in order, the fit with them, their number of
    coefficients."""

    terms: tuple[Term, ...]
    fit: ExtendedFit
    tried: int
    rank: int

    @property
    def chi2(self) -> float:
        """χ² with the terms."""
        return self.fit.chi2


def search_rest(fit: ExtendedFit, noise: NoiseLevel) -> Remainder | None:
    """The open search where the fit is not adequate; None where it is.

    Not adequate: the residual's smooth part is too large, or one open term of all those tried finds
    what is too quick for that part.

    Parameters
    ----------
    fit
        Of the runs.
    noise
        That gains are judged by.

    Returns
    -------
    Remainder or None
        The terms and the fit with them.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.search.inquiry import STATED
    >>> from hrg_cli.stages.diagnosis.search.remainder import search_rest
    >>> search_rest(draw_fit(), STATED) is None
    True
    >>> rest = search_rest(draw_mismatched_fit(), STATED)
    >>> [term.place.name for term in rest.terms], bool(rest.chi2 / rest.fit.dof < 1.5)
    (['damping split'], True)
    """
    level, p = judge_adequacy(fit)
    if level < NEVER_LESS * noise.slow and noise.slow > 1:
        return None
    if p > INADEQUATE:
        found = describe(fit, noise, OPEN_TERMS, INADEQUATE)
        return found if found.terms else None
    return describe(fit, noise, OPEN_TERMS, SIGNIFICANT)


def describe(fit: ExtendedFit, noise: NoiseLevel, most: int, significant: float) -> Remainder:
    """The open terms that describe what a fit leaves.

    Those with a number of every run's own are held against the others as a whole: so many numbers
    take more of a large misfit than the one that, with the next, would leave nothing. Where one of
    the others leaves nothing, they are not asked.

    Parameters
    ----------
    fit
        Of the runs.
    noise
        That gains are judged by.
    most
        Terms at most.
    significant
        Chance from which a term is none.

    Returns
    -------
    Remainder
        Without terms where none stands out.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.search.inquiry import STATED
    >>> from hrg_cli.stages.diagnosis.search.remainder import describe
    >>> rest = describe(draw_mismatched_fit(), STATED, most=1, significant=1e-3)
    >>> [(term.place.name, term.covariate.formula) for term in rest.terms]
    [('damping split', 'Ω/Ω₀')]
    """
    few = select_terms(fit, noise, most, significant, by_run=False)
    level, p = judge_adequacy(few.fit)
    described = len(few.terms) == 1 and (p > INADEQUATE or level < NEVER_LESS * noise.slow)
    if described or not goes_by_run(fit.series):
        return few
    many = select_terms(fit, noise, most, significant, by_run=True)
    return min(few, many, key=lambda one: compute_bic(one.fit))


def is_told_by_one_term(fit: ExtendedFit, noise: NoiseLevel) -> bool:
    """Whether one open term, with no number of a run's own, takes nearly all of a gross misfit:
    what is one thing is no two causes at once.

    Parameters
    ----------
    fit
        Of the runs.
    noise
        That gains are judged by.

    Returns
    -------
    bool
        Whether χ² falls to 1/`NEARLY_ALL` of itself, and below what is gross.

    Examples
    --------
    Noise leaves no misfit, and one that is not gross may be of two causes:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.search.inquiry import STATED
    >>> from hrg_cli.stages.diagnosis.search.remainder import is_told_by_one_term
    >>> [is_told_by_one_term(fit, STATED) for fit in (draw_fit(), draw_mismatched_fit())]
    [False, False]
    """

    def told() -> bool:
        one = select_terms(fit, noise, 1, SIGNIFICANT, by_run=False).fit
        return one.chi2 * NEARLY_ALL < fit.chi2 and not is_gross(one)

    found: bool = fit.recall(("told by one term", noise), told)
    return found


def select_terms(
    fit: ExtendedFit, noise: NoiseLevel, most: int, significant: float, by_run: bool
) -> Remainder:
    """Forward selection of open terms with refit, stopped by corrected p and BIC; then each against
    all others beside the rest.

    Parameters
    ----------
    fit
        Of the runs.
    noise
        That gains are judged by.
    most
        Terms at most.
    significant
        Chance from which a term is none.
    by_run
        Terms with a number of every run's own are looked through too.

    Returns
    -------
    Remainder
        Without terms where none stands out.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.search.inquiry import STATED
    >>> from hrg_cli.stages.diagnosis.search.remainder import select_terms
    >>> fits = draw_fit(), draw_mismatched_fit()
    >>> [len(select_terms(fit, STATED, 2, 1e-3, by_run=False).terms) for fit in fits]
    [0, 1]
    """
    chosen: list[tuple[str, Term]] = []
    start, tried = fit.basis.shape[1], 0
    while len(chosen) < most:
        ranked = score_terms(fit, by_run)
        if not ranked:
            break
        # the spectrum's other cells were looked at too
        tried = len(ranked) + (CELLS - PEAKS) * len(PLACES)
        best = _find_standing_term(fit, ranked, noise, significant, tried)
        if best is None:
            break
        again = add_term(fit, best, name := f"open term {len(chosen)}")
        if again is None or not again.chi2 < fit.chi2 - WORTH * noise.slow:
            break
        fit = again
        chosen.append((name, best))
    fit, chosen = exchange_terms(fit, chosen, noise, by_run)
    return Remainder(
        tuple(fit_of_term(fit, name, term) for name, term in chosen),
        fit,
        tried,
        fit.basis.shape[1] - start,
    )


def _find_standing_term(
    fit: ExtendedFit, ranked: Sequence[Term], noise: NoiseLevel, significant: float, tried: int
) -> Term | None:
    """The best term that is more than chance, and worth its price, without what it earns by
    following the runs' likely walk; None where there is none."""

    def stands(term: Term) -> bool:
        _, p = evidence.find_significance(term.score.gain / noise.slow, term.score.rank)
        chance = evidence.correct_for_tries(p, tried)
        return chance <= significant and term.compute_bic_gain(len(fit.residual), noise) >= WORTH

    left = list(ranked)
    while left and stands(best := find_best_term(fit, left)):
        make = partial(_build_beside, pair=(best.place, best.covariate))
        if stands(replace(best, score=correct_for_walk(fit, best.score, make))):
            return best
        left = [one for one in left if not _is_same_term(one, best)]
    return None


def _is_same_term(one: Term, other: Term) -> bool:
    """Whether two terms are at one place and follow one thing, whatever their shape."""
    return (one.place.name, one.covariate.name) == (other.place.name, other.covariate.name)


def add_term(fit: ExtendedFit, term: Term, name: str) -> ExtendedFit | None:
    """The fit with the term, in the place of one of that name; None where the model finds no fit:
    its linear gain is none.

    Parameters
    ----------
    fit
        Of the runs.
    term
        With the estimate that the fit begins with.
    name
        That the fit gives it.

    Returns
    -------
    ExtendedFit or None
        With the term.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.search.remainder import add_term, find_best_term, score_terms
    >>> fit = draw_mismatched_fit()
    >>> best = find_best_term(fit, score_terms(fit, by_run=False))
    >>> made = add_term(fit, best, "open term 0")
    >>> bool(made.chi2 < fit.chi2 - 800)
    True
    """
    # the search at another noise, or with other terms beside, comes by the same steps
    key = name, term.place.name, term.covariate.formula, tuple(term.score.estimate.tolist())
    added: ExtendedFit | None = fit.recall(("open", *key), lambda: _fit_with_term(fit, term, name))
    return added


def _fit_with_term(fit: ExtendedFit, term: Term, name: str) -> ExtendedFit | None:
    effect = make_open_effect(term.place, term.covariate, name)
    values = {
        q.name: float(v) if np.isfinite(v) else 0.0
        for q, v in zip(effect.parameters, term.score.estimate, strict=True)
    }
    try:
        return extended_fit.fit(
            fit.series,
            fit_point.add_effect(fit.point, effect, values),
            fit.freedom,
            near=fit.flow.near,
        )
    except extended_fit.DivergedError:
        return None


def fit_of_term(fit: ExtendedFit, name: str, term: Term) -> Term:
    """The term with its coefficients and their σ as they stand in the fit.

    Parameters
    ----------
    fit
        With the term.
    name
        That the fit gives it.
    term
        As it was chosen.

    Returns
    -------
    Term
        With the estimate and σ of the fit.

    Examples
    --------
    The split ν·δμ that a mismatch g of 2 % makes, −gKΩ, at 22.5°:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.search.remainder import add_term, find_best_term
    >>> from hrg_cli.stages.diagnosis.search.remainder import fit_of_term, score_terms
    >>> fit = draw_mismatched_fit()
    >>> best = find_best_term(fit, score_terms(fit, by_run=False))
    >>> made = add_term(fit, best, "open term 0")
    >>> fit_of_term(made, "open term 0", best).score.estimate.round(3).tolist()
    [0.0, -0.011]
    """
    values = next(values for effect, values in fit.point.active if effect.name == name)
    estimate = np.array(list(values.values()))
    std = np.array([fit.parameter_std(name, c) for c in values])
    return replace(term, score=replace(term.score, estimate=estimate, std=std))


def exchange_terms(
    fit: ExtendedFit, chosen: list[tuple[str, Term]], noise: NoiseLevel, by_run: bool
) -> tuple[ExtendedFit, list[tuple[str, Term]]]:
    """Every term against all others beside the rest, and against none: the first was chosen before
    the others were there.

    Parameters
    ----------
    fit
        With the terms.
    chosen
        Name and term of each.
    noise
        That gains are judged by.
    by_run
        Terms with a number of every run's own are looked through too.

    Returns
    -------
    tuple
        The fit and the terms.

    Examples
    --------
    One term alone has nothing to be exchanged beside:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.search.inquiry import STATED
    >>> from hrg_cli.stages.diagnosis.search.remainder import add_term, exchange_terms
    >>> from hrg_cli.stages.diagnosis.search.remainder import find_best_term, score_terms
    >>> fit = draw_mismatched_fit()
    >>> best = find_best_term(fit, score_terms(fit, by_run=False))
    >>> made = add_term(fit, best, "open term 0")
    >>> exchange_terms(made, [("open term 0", best)], STATED, by_run=False)[0] is made
    True
    """
    if len(chosen) < 2:
        return fit, chosen
    rows = len(fit.residual)
    for name, _ in list(chosen):
        reduced = leave_out(fit, name)
        if reduced is None:
            continue
        lost = (compute_bic(reduced) - compute_bic(fit)) / noise.slow
        new = find_best_term(reduced, score_terms(reduced, by_run))
        better = new.compute_bic_gain(rows, noise)
        place = [one for one, _ in chosen].index(name)
        if max(better, lost) < WORTH:
            fit, chosen = reduced, [*chosen[:place], *chosen[place + 1 :]]
        # what the term itself earned must be beaten by the odds: the new one was chosen among all
        elif better > lost + WORTH:
            again = add_term(reduced, new, name)
            if again is not None and compute_bic(again) < compute_bic(fit) - WORTH * noise.slow:
                fit, chosen = again, [*chosen[:place], (name, new), *chosen[place + 1 :]]
    return fit, chosen


def smooth_columns(fit: ExtendedFit) -> list[tuple[slice, Array]]:
    """Slow cosines in time of all four components of the wave, run by run: what a deterministic
    misfit would look like, (N_r, m) each.

    Parameters
    ----------
    fit
        Of the runs.

    Returns
    -------
    list of tuple
        Rows of each run in the residual, and the columns.

    Examples
    --------
    Six cosines of four components:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.search.remainder import smooth_columns
    >>> [columns.shape for _, columns in smooth_columns(draw_fit())]
    [(200, 24), (200, 24), (200, 24)]
    """
    series = fit.series
    frame = np.swapaxes(to_reals(find_directions(fit.flow.prediction.seen)), -1, -2)
    good = series.weight > 0
    last, first = np.max(series.time_s, axis=1, where=good, initial=-np.inf), series.time_s[:, 0]
    x = (series.time_s - first[:, None]) / (last - first)[:, None]
    slow = np.cos(np.pi * np.arange(1, SMOOTH + 1) * x[..., None])
    out = (slow[:, :, None, :, None] * frame[:, :, :, None, :]).reshape(*series.weight.shape, 4, -1)
    blocks = fit.basis.own
    return [
        (rows, out[k][good[k]].reshape(-1, out.shape[-1])) for k, (rows, _) in enumerate(blocks)
    ]


def judge_adequacy(fit: ExtendedFit) -> tuple[float, float]:
    """(χ² per degree of freedom of the residual's smooth part, its p): 1 and not small when nothing
    is left but white noise.

    Parameters
    ----------
    fit
        Of the runs.

    Returns
    -------
    tuple of float
        About 1 and not small of noise.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.search.remainder import judge_adequacy
    >>> [bool(judge_adequacy(fit)[1] > 0.01) for fit in (draw_fit(), draw_mismatched_fit())]
    [True, False]
    """
    from scipy.special import chdtrc

    power, rank = measure_smooth_part(fit)
    return (power / rank, float(chdtrc(rank, power))) if rank else (1.0, 1.0)


def measure_smooth_part(fit: ExtendedFit) -> tuple[float, int]:
    """χ² of the residual's smooth part, and its degrees of freedom.

    Parameters
    ----------
    fit
        Of the runs.

    Returns
    -------
    tuple
        About as large one as the other where only noise is left.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.search.remainder import measure_smooth_part
    >>> power, degrees = measure_smooth_part(draw_fit())
    >>> bool(power < 2 * degrees), degrees > 20
    (True, True)
    """
    # the open search asks, and so do the closing checks
    found: tuple[float, int] = fit.recall(
        "smooth part",
        lambda: evidence.measure_smooth_power(fit.residual, fit.basis, smooth_columns(fit)),
    )
    return found
