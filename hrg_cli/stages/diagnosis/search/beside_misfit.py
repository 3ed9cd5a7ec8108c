"""Diagnosis, a cause beside a misfit: whether what it takes away stands out of what no cause
explains.

Where the final model leaves more than the stated noise, every further cause of the catalogue takes
something of the rest away, and at the stated noise each of them is "significant". What is left is
then the yardstick: the power λ_b of the residual in bands of half cycles a run, and how many
independent numbers it consists of, n_b = 3(Σc²)²/Σc⁴ of its coefficients c (Satterthwaite 1946):
one where all of it is a single slow shape. A cause of rank q that takes Δχ² away along d, the
difference of the residuals without and with it, has
    F = (Δχ²/q)/Σ w_b λ_b,   w_b = |d_b|²/|d|²,   with q and n degrees of freedom, 1/n = Σ w_b²/n_b.
n_b is that of the residual *without* the cause, less q: of a rest of three shapes any cause of
three parameters takes all. In bands where nothing is left over the noise is the stated one, λ = 1
and n = ∞, and F is the usual Δχ².

The chance is that of the best of as many causes as take different things away along such a misfit.

A cause that stands out may still be one of many that take the same away: beside a misfit a rival is
whatever comes within the odds of `WORTH` at the power λ that is left.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....fitting.causes import evidence
from ....fitting.causes.extended_fit import ExtendedFit, resolve_along_wave
from ..fits.refits import compute_bic, hold_unseen, leave_out, refit
from ..fits.scoring import count_places, score_effects
from ..fits.variants import Variant
from ..thresholds import BESIDE_MISFIT, INADEQUATE, MOST_RIVALS, WORTH
from .remainder import search_rest
from .search_case import Case
from .selection import Found

Array = np.ndarray
FIRST_BAND = 4
"""Half cycles a run in the lowest band; each further band ends at twice the one before."""
LEAST = 0.1
"""Independent numbers of a rest that a cause of as many parameters takes whole: so few that nothing
can be said."""
TRIED = 10
"""Other causes refitted to see whether they take as much away."""


def drop_indistinct(case: Case) -> Case:
    """The case without the causes that do not stand out of what is left over, or whose place too
    many others could take.

    The weakest goes first, and the rest is looked at again. Where nothing is left over the case
    stays as it is, and so do causes whose sizes stand out of the misfit already.

    Parameters
    ----------
    case
        The causes and what they leave over.

    Returns
    -------
    Case
        The same where nothing is given up.

    Examples
    --------
    Of a gain mismatch alone nothing is left over:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case
    >>> from hrg_cli.stages.diagnosis.search.beside_misfit import drop_indistinct
    >>> [one.score.name for one in drop_indistinct(draw_found_case()).search.found]
    ['gain_mismatch']
    """
    stands = False
    while (
        not stands
        and case.remainder is not None
        and any(one.sizes is None for one in case.search.found)
    ):
        search = case.search
        judged = sorted(
            (
                _judge_cause(one, without, search.final, case.inquiry.candidates)
                for one in search.found
                if one.sizes is None
                and (without := leave_out(search.final, one.variant.effect.name, base=search.base))
            ),
            key=lambda j: -j.chance,
        )
        case, stands = _settle_rivals(case, judged)
    return case


@dataclass(frozen=True)
class JudgedCause:
    """A cause, the fit without it, the mean power of the misfit along what it takes away (1: none),
    and the chance, for all causes tried, that the misfit lends it that much."""

    cause: Found
    without: ExtendedFit
    power: float
    chance: float


def _judge_cause(
    one: Found, without: ExtendedFit, final: ExtendedFit, candidates: Sequence[Variant]
) -> JudgedCause:
    rank = max(1, one.score.rank)
    taken = TakenAway.from_fits(final, without, rank)
    tried = _independent_tries(without, candidates, taken.power)
    tried *= count_places(one.variant.effect, without)
    chance = evidence.correct_for_tries(taken.compute_chance(rank), min(tried, one.tried))
    return JudgedCause(one, without, taken.beside, chance)


def _independent_tries(without: ExtendedFit, candidates: Sequence[Variant], power: Array) -> float:
    """How many independent tests the causes beside a fit are along a misfit of this power (B,) in
    its bands: of a slow one all that is slow takes the same away."""
    spaces = []
    for score, _ in score_effects(without, candidates):
        if score.visible:
            spectrum = Spectrum.from_values(score.space, without)
            spaces.append(spectrum.coefficients * np.sqrt(power[spectrum.band])[:, None])
    return evidence.count_independent(spaces)


def _settle_rivals(case: Case, judged: Sequence[JudgedCause]) -> tuple[Case, bool]:
    """The case after the first cause that does not stand is given up; or with the rivals of all
    that do, and True."""
    for one in judged:
        stands = one.chance <= BESIDE_MISFIT
        others = _rivals(case.search.final, one, case.inquiry.candidates) if stands else []
        if not stands and (simpler := _simpler(case, one)) is not None:
            return simpler, False
        if not stands or len(others) > MOST_RIVALS:
            return case.give_up(one.cause, one.without), False
        named = one.cause.add_rivals(others)
        found = tuple(named if f.variant is one.cause.variant else f for f in case.search.found)
        case = replace(case, search=replace(case.search, found=found))
    return case, True


def _simpler(case: Case, one: JudgedCause) -> Case | None:
    """The case with a rival of fewer parameters in the place of a cause that does not stand; None
    where none stands either. What takes as much away with less may stand where more does not."""
    ranked = score_effects(one.without, case.inquiry.candidates)
    pairs = [
        pair
        for pair in ranked
        if pair[0].name in one.cause.rivals and pair[0].rank < one.cause.score.rank
    ]
    for level, fit, score, variant in refit(one.without, pairs, ranked):
        others = {one.cause.variant.effect.name, *one.cause.rivals} - {score.name}
        worth = compute_bic(one.without) - level
        found = Found(
            hold_unseen(variant, fit), score, one.cause.tried, worth, tuple(sorted(others))
        )
        if _judge_cause(found, one.without, fit, case.inquiry.candidates).chance <= BESIDE_MISFIT:
            kept = case.give_up(one.cause, one.without).search
            last = tuple(s for s, _ in score_effects(fit, case.inquiry.candidates))
            search = replace(kept, final=fit, found=(*kept.found, found), last=last)
            return replace(case, search=search, remainder=search_rest(fit, case.inquiry.noise))
    return None


def _rivals(final: ExtendedFit, one: JudgedCause, candidates: Sequence[Variant]) -> list[str]:
    """Other causes that take as much of the misfit away as this one, to the odds of `WORTH`."""
    if one.power <= 1.0:
        return []
    name, limit = one.cause.variant.effect.name, compute_bic(final) + WORTH * one.power
    close = [
        pair
        for pair in score_effects(one.without, candidates)
        if pair[0].visible and pair[0].name != name
    ]
    trials = refit(one.without, close[:TRIED], close)
    return [variant.effect.name for level, _, _, variant in trials if level < limit]


@dataclass(frozen=True)
class TakenAway:
    """What a cause of some parameters takes of a misfit away.

    lost: Δχ²; share (B,): in which bands; power (B,): of what is left there, for each of the
    `numbers` (B,) that it consists of (1 and inf where it is the stated noise).
    """

    lost: float
    share: Array
    power: Array
    numbers: Array

    @classmethod
    def from_fits(cls, final: ExtendedFit, without: ExtendedFit, rank: int) -> TakenAway:
        """By a cause that is in the final fit and not in the other one, of the same rows."""
        from scipy.special import chdtrc

        difference = Spectrum.from_values(without.residual - final.residual, final).squares
        share = np.array([squares.sum() for squares in difference])
        left = Spectrum.from_values(final.residual, final).squares
        before = Spectrum.from_values(without.residual, final).squares
        power, numbers = np.ones(len(left)), np.full(len(left), np.inf)
        for b, (squares, first) in enumerate(zip(left, before, strict=True)):
            if len(squares) and chdtrc(len(squares), squares.sum()) < INADEQUATE:
                numbers[b] = max(
                    min(
                        count_independent_numbers(squares), count_independent_numbers(first) - rank
                    ),
                    LEAST,
                )
                power[b] = max(float(squares.sum()) / numbers[b], 1.0)
        return cls(without.chi2 - final.chi2, share / max(share.sum(), 1e-300), power, numbers)

    @property
    def beside(self) -> float:
        """Mean power of what is left along what was taken; 1: the stated noise."""
        return float(self.share @ self.power)

    def compute_chance(self, rank: int) -> float:
        """Probability that so many parameters take as much away by chance: that of Δχ² where
        nothing is left over."""
        from scipy.special import chdtrc, fdtrc

        if self.lost <= 0:
            return 1.0
        unsure = float(np.sum(self.share**2 / self.numbers))
        if unsure == 0:
            return float(chdtrc(rank, self.lost / self.beside))
        return float(fdtrc(rank, 1 / unsure, self.lost / rank / self.beside))


@dataclass(frozen=True)
class Spectrum:
    """Coefficients (N, ...) of a residual over orthonormal cosines in time, of every run and of the
    wave's four components, and the band (N,) of each."""

    coefficients: Array
    band: Array

    @classmethod
    def from_values(cls, residual: Array, fit: ExtendedFit) -> Spectrum:
        """Of values (N, ...) over σ that stand on the rows of a fit, along whose wave the
        components lie."""
        from scipy.fft import dct

        good, own = fit.series.weight > 0, resolve_along_wave(fit, residual)
        coefficients, band = [], []
        for components, kept in zip(own, good, strict=True):
            count = int(kept.sum())
            if count == 0:
                continue
            coefficients.append(
                dct(components[kept], axis=0, norm="ortho").reshape(-1, *residual.shape[1:])
            )
            # octaves: what is left of a slow misfit falls by powers of the frequency, and a band
            # must hold enough coefficients to know its power
            octave = np.floor(np.log2(np.maximum(np.arange(count), 1) / FIRST_BAND)) + 1
            band.append(np.repeat(np.maximum(octave, 0).astype(int), 4))
        return cls(np.concatenate(coefficients), np.concatenate(band))

    @property
    def cell(self) -> Array:
        """Number (N,) of the band and component of each coefficient."""
        return 4 * self.band + np.arange(len(self.band)) % 4

    @property
    def squares(self) -> list[Array]:
        """Squared coefficients, band by band."""
        return [self.coefficients[self.band == b] ** 2 for b in range(int(self.band.max()) + 1)]


def count_independent_numbers(squares: Array) -> float:
    """How many independent numbers of equal size squared coefficients amount to.

    Parameters
    ----------
    squares
        Of coefficients, (k,).

    Returns
    -------
    float
        Their number, where they are as noise is.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.search.beside_misfit import count_independent_numbers
    >>> squares = np.random.default_rng(0).standard_normal(10_000) ** 2
    >>> round(count_independent_numbers(squares) / 10_000, 1)
    1.0
    """
    whole = float(squares.sum())
    return 3 * whole**2 / float(np.sum(squares**2)) if whole > 0 else np.inf
