"""Diagnosis, beside a gross misfit: what happens at one instant and stands out of it.

A misfit that no cause explains is slow: whatever is as slow takes a part of it away, and says
nothing. What changes from one row to the next is no slow course. It is judged by its generalised
least-squares score, the residual itself being the noise: its power λ_b in bands of half cycles a
run, of each of the wave's four components on its own, with the cause taken out,
    ΔX² = |P r_w|²,  r_w = (T r)/√λ off the model's own columns,  P onto the cause's (T S)/√λ,
T the orthonormal cosines of `Spectrum`; F as there. The sizes are those of the same least squares
and stay as they are in the fit, which the misfit would else bend to its own ends.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....effects import EFFECTS
from ....effects.effect import INSTANT, RUN, Effect
from ....effects.envelope_jumps import FEWEST
from ....fitting.causes import designs, evidence, extended_fit, fit_point
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.causes.measured_runs import MeasuredRuns
from ....fitting.least_squares import invert_information
from ..fits.refits import hold_effect, leave_out
from ..fits.scoring import count_places, is_gross, is_possible, score_effects
from ..fits.strike_instants import settle_instants
from ..fits.variants import Variant, list_variants
from ..fits.whole_samples import count_whole
from ..thresholds import INADEQUATE, MOST_RIVALS, NEVER_LESS, SIGNIFICANT, WORTH
from .beside_misfit import Spectrum, count_independent_numbers
from .remainder import search_rest
from .search_case import Case
from .selection import Found

Array = np.ndarray
SWEEPS = 4
"""Times that sizes and the misfit beside them follow from one another."""
APART = range(-4, 5)
"""Half rows by which the instant may lie beside where the rows jump most."""


@dataclass(frozen=True)
class Strike:
    """A cause at an instant: Δχ² against the misfit, its rank and chance, its parameters' sizes and
    σ (K,), and ΔBIC."""

    variant: Variant
    gain: float
    rank: int
    chance: float
    size: Array
    std: Array
    criterion: float

    def is_of_whole_samples(self, step_s: float | None) -> bool:
        """Whether a size that comes in whole samples is one; nothing else is asked to be."""
        if step_s is None or not self.variant.effect.whole_samples:
            return True
        return bool(count_whole(self.size, self.std, step_s)[1].all())


def place_strikes(case: Case) -> Case:
    """The case with the instants of its causes where they leave least within their rows.

    Parameters
    ----------
    case
        Causes and what they leave over.

    Returns
    -------
    Case
        The same where no instant gains what a cause must be worth.

    Examples
    --------
    A mismatch has no instant:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case
    >>> from hrg_cli.stages.diagnosis.search.instants import place_strikes
    >>> place_strikes(draw_found_case()) is draw_found_case()
    True
    """
    names = {one.variant.effect.name for one in case.search.found if one.sizes is None}
    settled = settle_instants(case.search.final, names)
    if settled.chi2 > case.search.final.chi2 - WORTH * case.inquiry.noise.slow:
        return case
    case = replace(case, search=replace(case.search, final=settled))
    if case.remainder is None:
        return case
    return replace(case, remainder=search_rest(settled, case.inquiry.noise))


def take_strikes(case: Case) -> Case:
    """The case with what stands out of a gross misfit at an instant, one after another; as it is
    where the misfit is none, and without them where open terms describe all of it alone.

    Parameters
    ----------
    case
        Causes and what they leave over.

    Returns
    -------
    Case
        With at most so many strikes as causes are asked for.

    Examples
    --------
    Beside a mismatch that describes all, nothing is looked for:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case
    >>> from hrg_cli.stages.diagnosis.search.instants import take_strikes
    >>> take_strikes(draw_found_case()) is draw_found_case()
    True
    """
    if case.remainder is None or not is_gross(case.search.final):
        return case
    sharp = [effect for effect in EFFECTS if effect.of_one_run]
    before, slow = case, _drop_instants(case, sharp)
    case = slow
    step_s = case.inquiry.sampling_step_s
    for _ in range(case.inquiry.most):
        found = _clearest(case.search.final, sharp, step_s) if is_gross(case.search.final) else None
        if found is None:
            break
        fit, one = found
        last = tuple(score for score, _ in score_effects(fit, case.inquiry.candidates))
        search = replace(case.search, final=fit, found=(*case.search.found, one), last=last)
        case = replace(case, search=search)
    if case is before:
        return case
    struck = replace(case, remainder=search_rest(case.search.final, case.inquiry.noise))
    if case is slow:
        return struck
    if slow is not before:
        slow = replace(slow, remainder=search_rest(slow.search.final, slow.inquiry.noise))
    return slow if _is_described(slow) and slow.criterion <= struck.criterion else struck


def _is_described(case: Case) -> bool:
    """Whether open terms describe all that the causes leave, down to the noise: of less a strike
    may still be a part."""
    if case.remainder is None:
        return True
    fit = case.remainder.fit
    return fit.chi2 < NEVER_LESS * case.inquiry.noise.slow * fit.dof


def _drop_instants(case: Case, sharp: Sequence[Effect]) -> Case:
    """The case without the causes at an instant that plain least squares found: beside a gross
    misfit their sizes are its own."""
    names = {effect.name for effect in sharp}
    search = case.search
    for one in search.found:
        if one.variant.effect.name in names:
            reduced = leave_out(search.final, one.variant.effect.name, base=search.base)
            if reduced is not None:
                search = search.give_up(one, reduced, case.inquiry.candidates)
    return case if search is case.search else replace(case, search=search)


def _clearest(
    fit: ExtendedFit, effects: Sequence[Effect], step_s: float | None
) -> tuple[ExtendedFit, Found] | None:
    """The fit with the cause at an instant that chance makes least, and what it cannot be told
    from; None where chance makes it, where too many would do, or where it has no fit; `step_s`: of
    the sampling, where it is even."""
    active = {effect.name for effect, _ in fit.point.active}
    tried = list_variants_around(
        list_variants([effect for effect in effects if effect.name not in active], fit), fit.series
    )
    strikes = [one for one in list_strikes(fit, tried) if one.is_of_whole_samples(step_s)]
    if not strikes:
        return None
    best = max(strikes, key=lambda one: one.criterion)
    rivals = {
        one.variant.effect.name
        for one in strikes
        if one.criterion > best.criterion - WORTH
    } - {best.variant.effect.name}  # fmt: skip
    # the places are those where the rows jump most, of all rows
    places = sum(count_places(effect, fit) for effect in effects)
    chance = evidence.correct_for_tries(min(one.chance for one in strikes), places)
    if chance > SIGNIFICANT or len(rivals) > MOST_RIVALS:
        return None
    with contextlib.suppress(extended_fit.DivergedError):
        sizes = {
            name: (best.variant.values[name] + float(size), float(std))
            for name, size, std in zip(best.variant.steps, best.size, best.std, strict=True)
        }
        values = {**best.variant.values, **{name: size for name, (size, _) in sizes.items()}}
        again = fit_beside_held(fit, best.variant.effect, values)
        if not (again.converged and is_possible(best.variant.effect, again)):
            return None
        S = fit.find_sensitivities([best.variant.wanted])[0]
        score = evidence.score(best.variant.effect.name, fit.residual, S, fit.basis)
        return again, Found(best.variant, score, places, best.gain, tuple(sorted(rivals)), sizes)
    return None


def list_variants_around(tried: Sequence[Variant], series: MeasuredRuns) -> list[Variant]:
    """The variants at instants half rows apart about theirs, whole periods away, with rows enough
    on either side: the rows know the instant to a part of their length.

    Parameters
    ----------
    tried
        Causes where they may strike.
    series
        Of the runs.

    Returns
    -------
    list of Variant
        Nine of each that has an instant, fewer near a run's ends.

    Examples
    --------
    Rows of 20 ms, and a wave that was turned at 0.5 s:

    >>> from hrg_cli.effects import find
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_knocked_fit
    >>> from hrg_cli.stages.diagnosis.fits.places import place_cause
    >>> from hrg_cli.stages.diagnosis.fits.variants import list_variants
    >>> from hrg_cli.stages.diagnosis.search.instants import list_variants_around
    >>> fit = draw_knocked_fit()
    >>> first = place_cause(*list_variants([find("momentum_kick")], fit), fit)[:1]
    >>> [round(one.values["time_s"], 2) for one in list_variants_around(first, fit.series)]
    [0.46, 0.47, 0.48, 0.49, 0.5, 0.51, 0.52, 0.53, 0.54]
    """
    period = 1 / series.reference_frequency_hz
    out = []
    for one in tried:
        if INSTANT in one.values and not one.anywhere:
            number = max(0, int(one.values[RUN]))
            t = series.time_s[number][series.weight[number] > 0]
            row = float(np.median(np.diff(t)))
            shifts = sorted({period * round(k * row / 2 / period) for k in APART})
            places = [one.values[INSTANT] + shift for shift in shifts]
            out += [
                replace(one, values={**one.values, INSTANT: place})
                for place in places
                if t[FEWEST] < place < t[-1 - FEWEST]
            ]
    return out


def fit_beside_held(fit: ExtendedFit, effect: Effect, values: Mapping[str, float]) -> ExtendedFit:
    """The fit again beside an effect that stays as it is.

    Parameters
    ----------
    fit
        Without the effect.
    effect
        A cause.
    values
        Of all its parameters.

    Returns
    -------
    ExtendedFit
        With the effect active and none of its parameters free.

    Examples
    --------
    >>> from hrg_cli.effects import find
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_mismatched_fit
    >>> from hrg_cli.stages.diagnosis.search.instants import fit_beside_held
    >>> fit = draw_mismatched_fit()
    >>> beside = fit_beside_held(fit, find("gain_mismatch"), {"gain": 0.02})
    >>> beside.values("gain_mismatch"), bool(beside.chi2 < fit.chi2 / 2)
    ({'gain': 0.02}, True)
    """
    point = fit_point.add_effect(fit.point, hold_effect(effect), values)
    return extended_fit.fit(fit.series, point, fit.freedom)


def list_strikes(fit: ExtendedFit, tried: Sequence[Variant]) -> list[Strike]:
    """Of every variant that these runs show beside the model.

    Parameters
    ----------
    fit
        Without the causes that are tried.
    tried
        Where and how they may strike.

    Returns
    -------
    list of Strike
        In the order of what is tried; without those that the model follows.

    Examples
    --------
    A wave of size 1 that was turned by 1 mrad of θ, 2 mrad of 2θ, at 0.5 s, taken for a knock:

    >>> import numpy as np
    >>> from hrg_cli.effects import find
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_knocked_fit
    >>> from hrg_cli.stages.diagnosis.fits.places import place_cause
    >>> from hrg_cli.stages.diagnosis.fits.variants import list_variants
    >>> from hrg_cli.stages.diagnosis.search.instants import list_strikes
    >>> fit = draw_knocked_fit()
    >>> tried = place_cause(*list_variants([find("momentum_kick")], fit), fit)
    >>> best = max(list_strikes(fit, tried), key=lambda one: one.criterion)
    >>> best.rank, bool(1e-3 < np.hypot(*best.size) < 2e-3)
    (3, True)
    """
    columns = fit.find_sensitivities([variant.wanted for variant in tried])
    model = _model(fit)
    residual = Spectrum.from_values(fit.residual, fit)
    out = []
    for variant, S in zip(tried, columns, strict=True):
        free = fit.basis.project_out(fit.basis.project_out(S))
        shown = np.linalg.norm(free, axis=0) > evidence.BLIND * np.linalg.norm(S, axis=0)
        if shown.all():
            out.append(
                _strike(variant, Spectrum.from_values(free, fit).coefficients, model, residual)
            )
    return out


def _strike(variant: Variant, S: Array, model: Array, residual: Spectrum) -> Strike:
    """Of a variant with coefficients S (N, K) off the model's (N, k)."""
    from scipy.special import fdtrc

    r, cell = residual.coefficients, residual.cell
    # a phase that says at which instant counts, too
    size, rank = np.zeros(S.shape[1]), sum(p.fitted_then for p in variant.effect.parameters)
    rank += S.shape[1]
    for _ in range(SWEEPS):
        power, numbers = measure_misfit_power(r - S @ size, r, cell, rank)
        weight = 1 / np.sqrt(power[cell])
        own = np.linalg.qr(model * weight[:, None])[0]
        free, left = S * weight[:, None], r * weight
        # twice, for the rounding of what the first took off
        for _ in range(2):
            free, left = free - own @ (own.T @ free), left - own @ (own.T @ left)
        information = invert_information(free.T @ free)
        size = information @ (free.T @ left)
    taken = free @ size
    gain = float(taken @ taken)
    share = np.bincount(cell, taken**2, len(power)) / max(gain, 1e-300)
    unsure = max(float(np.sum(share**2 / numbers)), 1e-12)
    std = np.sqrt(np.maximum(np.diag(information), 0.0))
    chance = float(fdtrc(rank, 1 / unsure, gain / rank))
    return Strike(
        variant, gain, rank, chance, size, std, evidence.find_bic_gain(gain, rank, len(r))
    )


def measure_misfit_power(left: Array, before: Array, cell: Array, rank: int) -> tuple[Array, Array]:
    """Mean power (B,) of coefficients (N,) in every cell, at least the stated noise's 1, and of how
    many independent numbers it consists, inf where it is that noise.

    Parameters
    ----------
    left
        Coefficients (N,) of what is left, over the stated σ.
    before
        The same with a cause in them.
    cell
        Cell (N,) of each, 0 to B − 1.
    rank
        Parameters of that cause.

    Returns
    -------
    power, numbers : ndarray
        Each (B,).

    Examples
    --------
    A misfit of thirty times the noise in the first cell, noise in the second:

    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.search.instants import measure_misfit_power
    >>> left, cell = np.array([30.0, -30.0, 0.1, 0.2]), np.array([0, 0, 1, 1])
    >>> power, numbers = measure_misfit_power(left, left, cell, rank=1)
    >>> power.tolist(), bool(np.isinf(numbers[1]))
    ([900.0, 1.0], True)
    """
    from scipy.special import chdtrc

    power, numbers = np.ones(cell.max() + 1), np.full(cell.max() + 1, np.inf)
    for b in range(len(power)):
        squares = left[cell == b] ** 2
        if len(squares) and chdtrc(len(squares), squares.sum()) < INADEQUATE:
            power[b] = max(float(squares.mean()), 1.0)
            numbers[b] = max(
                min(
                    count_independent_numbers(squares),
                    count_independent_numbers(before[cell == b] ** 2) - rank,
                ),
                1.0,
            )
    return power, numbers


def _model(fit: ExtendedFit) -> Array:
    """Coefficients (N, k) of an orthonormal basis of the model's own columns."""
    J = fit.design.to_matrix()
    basis = designs.orthonormalise(J[:, np.linalg.norm(J, axis=0) > 0], designs.CLEAR_RANK)
    return Spectrum.from_values(basis, fit).coefficients
