"""Diagnosis, causes against the runs' frequencies: what each would do to them, and whether the runs
themselves leave it the size that this asks for.

A cause's parameters θ are told by two independent things: by the rows of the runs, every run's
frequency free (information I = S⊥ᵀS⊥ of its sensitivities beside the base model), and by the
offsets, ô = H f + G θ + w (information M). Along v_k with vᵀ(M + I)v = 1 and vᵀMv = μ both are
diagonal. Where μ > ½ the offsets know more; only there may a cause follow them, elsewhere the runs
have said all.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ....fitting.causes import evidence
from ....fitting.causes.extended_fit import ExtendedFit
from ..fits.scoring import is_small
from ..fits.variants import Variant
from ..thresholds import EXCLUDED
from .inquiry import Inquiry
from .offsets import Offsets

Array = np.ndarray
SPARE = 2
"""Degrees of freedom that must be left over."""
QUIET = 0.01
"""p of the scatter that is left from which it counts as noise."""
TELLING = 4.0
"""χ² that the rows of the runs should show of the cause, from which what they do show is evidence
too."""
BLIND = 1e-9
"""Information, over the most there is, along which nothing is known."""


@dataclass(frozen=True)
class Pattern:
    """A cause against the offsets, or a slope and its bend together.

    known: what it may do to them, and `offsets`: these less what the rows say that it does; chance
    that this is none, by offsets and rows together; χ² it takes away, wander left, p of what is
    left as noise; whether the rows of the runs allow it.
    """

    variants: tuple[Variant, ...]
    known: Knowledge
    offsets: Offsets
    p_value: float
    gain: float
    wander: float
    left_p: float
    allowed: bool
    stands: bool
    """Whether the cause stands already, and this is what its runs alone do not show of it."""

    @property
    def name(self) -> str:
        """Of the cause, or of both."""
        return " and ".join(one.effect.name for one in self.variants)

    def compute_misfit(self, wander: float) -> float:
        """χ² of the offsets beside the cause and a wander of that size."""
        return self.offsets.compute_misfit(wander, self.known.response)[0]


def find_patterns(
    fit: ExtendedFit, offsets: Offsets, index: Sequence[int], inquiry: Inquiry
) -> list[Pattern]:
    """Every cause that could have made the runs' frequencies differ, the least likely by chance
    first; before all, one that stands already and leaves no more than noise.

    Parameters
    ----------
    fit
        Of the runs.
    offsets
        Of the runs' frequencies.
    index
        Their places among the parameters of the fit.
    inquiry
        The causes asked.

    Returns
    -------
    list of Pattern
        The least likely by chance first.

    Examples
    --------
    A gain mismatch makes no frequencies differ:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_case, draw_fit
    >>> from hrg_cli.stages.diagnosis.search.inquiry import STATED
    >>> from hrg_cli.stages.diagnosis.search.offsets import read_offsets
    >>> from hrg_cli.stages.diagnosis.search.run_patterns import find_patterns
    >>> offsets, index = read_offsets(draw_fit(), STATED)
    >>> find_patterns(draw_fit(), offsets, index, draw_case().inquiry)
    []
    """
    active = {effect.name for effect, _ in fit.point.active}
    asked = [
        one
        for v in inquiry.candidates
        if not (v.secants or v.anywhere)
        and (one := v if v.effect.name not in active else _unshown(v, fit)) is not None
    ]
    columns = fit.find_sensitivities([v.wanted for v in asked])
    alone: list[Asked] = [((one,), S) for one, S in zip(asked, columns, strict=True)]
    out = _judge_patterns(fit, alone, offsets, index, inquiry)
    out |= _judge_patterns(fit, _list_bent(alone, out), offsets, index, inquiry)
    return sorted(
        out.values(),
        key=lambda one: (not (one.stands and one.left_p > QUIET), one.p_value, -one.gain),
    )


Asked = tuple[tuple[Variant, ...], Array]
"""Causes that stand together, and their sensitivities (N, m)."""


def _list_bent(alone: Sequence[Asked], judged: Mapping[str, Pattern]) -> list[Asked]:
    """A slope and its bend together, where neither alone leaves no more than noise: about another
    reference a bend is a bend and a slope."""
    by_name = {variants[0].effect.name: (variants[0], S) for variants, S in alone}
    out: list[Asked] = []
    for bend, S in by_name.values():
        if bend.effect.bends not in by_name:
            continue
        slope, S_slope = by_name[bend.effect.bends]
        names = (slope.effect.name, bend.effect.name)
        if not any(name in judged and judged[name].left_p > QUIET for name in names):
            out.append(((slope, bend), np.concatenate([S_slope, S], axis=1)))
    return out


def _judge_patterns(
    fit: ExtendedFit,
    asked: Sequence[Asked],
    offsets: Offsets,
    index: Sequence[int],
    inquiry: Inquiry,
) -> dict[str, Pattern]:
    """Those that could have made the runs' frequencies differ, by name; of a cause that may stand
    in several ways the last."""
    active = {effect.name for effect, _ in fit.point.active}
    out = {}
    for variants, S in asked:
        response = (fit.covariance @ fit.design.multiply_transposed(S))[list(index)]
        if not np.all(np.isfinite(response)) or not response.any():
            continue
        known = Knowledge.from_sensitivities(fit, S, offsets, response, inquiry.noise.slow)
        if known is None or not _thinkable(known, variants, offsets, fit):
            continue
        stands = all(one.effect.name in active for one in variants)
        pattern = _pattern(variants, known, offsets, stands)
        if pattern is not None:
            out[pattern.name] = pattern
    return out


def share_among(variants: Sequence[Variant], sizes: Array) -> list[dict[str, float]]:
    """The values of causes that stand together, with sizes of all that they leave open.

    Parameters
    ----------
    variants
        Of the causes.
    sizes
        Beside what each begins with (m,), in the order of their parameters.

    Returns
    -------
    list of dict
        Of every cause by parameter.

    Examples
    --------
    >>> from hrg_cli.effects import find
    >>> from hrg_cli.stages.diagnosis.fits.variants import Variant
    >>> from hrg_cli.stages.diagnosis.search.run_patterns import share_among
    >>> share_among([Variant(find("gain_mismatch"), {"gain": 0.0}, {"gain": 1e-4})], [0.01])
    [{'gain': 0.01}]
    """
    left = iter(sizes)
    return [
        {**one.values, **{name: one.values[name] + float(next(left)) for name in one.steps}}
        for one in variants
    ]


@dataclass(frozen=True)
class Knowledge:
    """A cause's parameters along the v_k where the offsets tell more than the rows: response (R,
    q), directions (m, q), what the rows say of them (q,) with their information (q,).

    aside (m,): the rest, as the rows have it, which shifts the offsets by `shift` (R,) with
    covariance `blur` (R, R); chance: that the rows show as much of the cause by noise.
    """

    response: Array
    directions: Array
    told: Array
    information: Array
    aside: Array
    shift: Array
    blur: Array
    chance: float

    @classmethod
    def from_sensitivities(
        cls, fit: ExtendedFit, S: Array, offsets: Offsets, response: Array, slow: float
    ) -> Knowledge | None:
        """From sensitivities (N, m) and the response (R, m), the rows' variances times `slow`; None
        where the runs say all."""
        from scipy.special import chdtrc

        size = np.linalg.norm(S, axis=0)
        if not np.all(np.isfinite(size)) or not np.all(size > 0):
            return None
        # twice: of a column that lies nearly within the basis once leaves mostly the rounding of
        # what was taken off
        own = fit.basis.project_out(fit.basis.project_out(S / size))
        inside = own.T @ own / slow
        beside = offsets.compute_information(response / size)
        scale = np.sqrt(np.maximum(np.diag(inside + beside), 1e-300))
        power, vectors = np.linalg.eigh((inside + beside) / np.outer(scale, scale))
        seen = power > BLIND * power[-1]
        root = vectors[:, seen] / np.sqrt(power[seen]) / scale[:, None]
        share, turn = np.linalg.eigh(root.T @ beside @ root)
        V = root @ turn
        # what is left of 1 by rounding is nothing that rows say
        information = np.where(1.0 - share > BLIND, 1.0 - share, 0.0)
        rows = information > 0
        shown = V.T @ (own.T @ fit.residual / slow)
        told = np.divide(shown, information, out=np.zeros_like(shown), where=rows)
        # M + I is 1 along every v_k, so that half of it is where offsets and rows know as much
        better = share > 0.5
        if not better.any():
            return None
        moved, V = response / size @ V, V / size[:, None]
        told_power = float(np.sum(information * told**2))
        return cls(
            moved[:, better],
            V[:, better],
            told[better],
            information[better],
            V[:, ~better] @ told[~better],
            moved[:, ~better] @ told[~better],
            moved[:, ~better] / information[~better] @ moved[:, ~better].T,
            float(chdtrc(int(rows.sum()), told_power)) if rows.any() else 1.0,
        )


def _thinkable(
    known: Knowledge, variants: Sequence[Variant], offsets: Offsets, fit: ExtendedFit
) -> bool:
    """Whether along one direction the size that would scatter the offsets as they are is one that
    such causes can have, and that the rows of the runs do not exclude."""
    wander = offsets.estimate_wander()
    apart = known.response - known.response.mean(axis=0)
    for k, direction in enumerate(known.directions.T):
        needed = wander / max(float(np.sqrt(np.mean(apart[:, k] ** 2))), 1e-300)
        beyond = (needed - abs(known.told[k])) * np.sqrt(known.information[k])
        values = share_among(variants, needed * direction)
        if beyond < EXCLUDED and all(
            is_small(one.effect, of_it, fit) for one, of_it in zip(variants, values, strict=True)
        ):
            return True
    return False


def _pattern(
    variants: tuple[Variant, ...], known: Knowledge, offsets: Offsets, stands: bool
) -> Pattern | None:
    """How well the cause follows the offsets; None where too few runs are left to say so."""
    from scipy.special import chdtrc, fdtrc

    left = offsets.subtract(known.shift, known.blur)
    wander = left.estimate_wander(known.response)
    before, means = left.compute_misfit(wander)
    after, basis = left.compute_misfit(wander, known.response)
    rank, dof = basis.shape[1] - means.shape[1], len(left.value) - basis.shape[1]
    if rank < 1 or dof < SPARE:
        return None
    # the wander is the one beside the cause, so that after = dof where there is any: F judges the
    # cause by what it leaves, and by no less than the offsets' own noise
    p = float(fdtrc(rank, dof, (before - after) / rank / max(1.0, after / dof)))
    size, covariance = left.fit_response(known.response, wander)
    if known.shift.any() or float(np.sum(known.information * size**2)) > TELLING:
        p = evidence.combine_chances(p, known.chance)
    quiet = float(chdtrc(dof, left.compute_misfit(0.0, known.response)[0]))
    allowed = _agrees(known, size, covariance)
    return Pattern(variants, known, left, p, before - after, wander, quiet, allowed, stands)


def _agrees(known: Knowledge, size: Array, covariance: Array) -> bool:
    """Whether the rows of the runs allow the size that the offsets ask for."""
    from scipy.special import chdtrc

    told = known.information > 0
    if not told.any():
        return True
    apart = (size - known.told)[told]
    spread = covariance[np.ix_(told, told)] + np.diag(1 / known.information[told])
    distance = float(apart @ np.linalg.solve(spread, apart))
    # the chance of one number so many σ off, whatever the number of directions
    return bool(chdtrc(int(told.sum()), distance) > chdtrc(1, EXCLUDED**2))


def _unshown(variant: Variant, fit: ExtendedFit) -> Variant | None:
    """A cause that stands, with those of its parameters that its runs alone did not show; None
    where they showed all."""
    effect, values = next(pair for pair in fit.point.active if pair[0].name == variant.effect.name)
    fitted = {p.name for p in effect.fitted()}
    steps = {name: step for name, step in variant.steps.items() if name not in fitted}
    if not steps or any(values[name] != variant.values[name] for name in steps):
        return None
    return Variant(variant.effect, dict(values), steps)
