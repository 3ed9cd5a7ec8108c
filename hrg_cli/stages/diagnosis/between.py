"""Diagnosis between the runs: their frequencies, which every run's own fit leaves free, against
what each cause predicts of them.

ô = H f + G θ + w, w ~ N(0, Σ + s²): ô (R,) the fitted offsets with covariance Σ, H the mean of the
free and of the forced runs, G what a cause's parameters θ do to them, s an unexplained wander from
run to run, estimated beside each cause by restricted likelihood. A cause is named where it takes
away so much of the scatter that, with s unknown, chance would not (F test), whatever the wander's
size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...fitting.causes import evidence, extended_fit
from ...fitting.causes.extended_fit import Fit
from .case import Case
from .inquiry import NoiseLevel
from .search import Found
from .variants import Variant

Array = np.ndarray
SCATTER = 1e-6
"""Chance of the offsets' scatter being noise from which it is looked into."""
SIGNIFICANT, BESIDE_NOISE = 1e-3, 1e-2
"""Corrected chance of a false alarm allowed; the second where what is left is no more than the
offsets' own noise."""
QUIET = 0.01
"""p of the scatter that is left from which it counts as noise."""
SPARE = 2
"""Degrees of freedom that must be left over."""
LEAST = 0.3
"""Smallest wander assumed, in σ of the offsets: fewer runs do not know it better."""
MOST = 2
RIVAL = 10.0


@dataclass(frozen=True)
class Offsets:
    """The runs' frequency offsets (R,), their covariance (R, R), the means that are free (R, h),
    all in rad/s."""

    value: Array
    covariance: Array
    means: Array

    def misfit(self, wander: float, extra: Array | None = None) -> tuple[float, Array]:
        """(χ² that means and extra columns leave, their projector's whitened basis) with a wander
        of that size."""
        C = np.linalg.cholesky(self.covariance + wander**2 * np.eye(len(self.value)))
        columns = self.means if extra is None else np.concatenate([self.means, extra], axis=1)
        basis = evidence.orthonormal(np.linalg.solve(C, columns), 1e-6)
        y = np.linalg.solve(C, self.value)
        left = y - basis @ (basis.T @ y)
        return float(left @ left), basis

    def wander(self, extra: Array | None = None) -> float:
        """s of largest restricted likelihood: where χ² equals the degrees of freedom left, 0 where
        it is smaller from the start."""
        dof = len(self.value) - self.misfit(0.0, extra)[1].shape[1]
        if dof <= 0 or self.misfit(0.0, extra)[0] <= dof:
            return 0.0
        low, high = 0.0, 10 * float(np.ptp(self.value)) + float(np.sqrt(np.trace(self.covariance)))
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if self.misfit(middle, extra)[0] > dof else (low, middle)
        return high


def offsets_of(fit: Fit, noise: NoiseLevel) -> tuple[Offsets, list[int]]:
    """The offsets of a fit and their places among its parameters."""
    runs = len(fit.series.names)
    index = [fit.layout.frequency(k) for k in range(runs)]
    forced = fit.series.forced[:, 0] > 0
    means = np.stack([kind.astype(float) for kind in (~forced, forced) if kind.any()], axis=1)
    return (
        Offsets(fit.point.offset_rad_s, fit.covariance[np.ix_(index, index)] * noise.slow, means),
        index,
    )


def scatter(offsets: Offsets) -> tuple[float, float]:
    """(equivalent z, p) of the offsets' scatter about their means against their own noise."""
    chi2, basis = offsets.misfit(0.0)
    dof = len(offsets.value) - basis.shape[1]
    return evidence.significance(chi2, dof) if dof > 0 else (0.0, 1.0)


@dataclass(frozen=True)
class Pattern:
    """A cause against the offsets: what it does to them (R, m), F test's p, χ² it takes away,
    wander left, p of what is left as noise."""

    variant: Variant
    response: Array
    p_value: float
    gain: float
    wander: float
    left_p: float
    stands: bool
    """Whether the cause stands already, and this is what its runs alone do not show of it."""


def patterns(
    fit: Fit, offsets: Offsets, index: list[int], candidates: Sequence[Variant]
) -> list[Pattern]:
    """Every cause that changes the runs' frequencies differently, the least likely by chance first;
    before all, one that stands already and leaves no more than noise."""
    from scipy.special import chdtrc, fdtrc

    active = {effect.name for effect, _ in fit.point.active}
    out: dict[str, Pattern] = {}
    open_ones = [
        one
        for v in candidates
        if not v.secants
        and (one := v if v.effect.name not in active else _unshown(v, fit)) is not None
    ]
    for variant, S in zip(open_ones, fit.sensitivities([v.wanted for v in open_ones]), strict=True):
        response = (fit.covariance @ fit.design.along(S))[index]
        if not np.all(np.isfinite(response)) or not response.any():
            continue
        wander = offsets.wander(response)
        before, means = offsets.misfit(wander)
        after, basis = offsets.misfit(wander, response)
        rank, dof = basis.shape[1] - means.shape[1], len(offsets.value) - basis.shape[1]
        if rank < 1 or dof < SPARE:
            continue
        p = float(fdtrc(rank, dof, (before - after) / rank / max(1.0, after / dof)))
        left = float(chdtrc(dof, offsets.misfit(0.0, response)[0]))
        stands = variant.effect.name in active
        out[variant.effect.name] = Pattern(
            variant, response, p, before - after, wander, left, stands
        )
    return sorted(
        out.values(),
        key=lambda one: (not (one.stands and one.left_p > QUIET), one.p_value, -one.gain),
    )


def _unshown(variant: Variant, fit: Fit) -> Variant | None:
    """A cause that stands, with those of its parameters that its runs alone did not show; None
    where they showed all."""
    effect, values = next(pair for pair in fit.point.active if pair[0].name == variant.effect.name)
    fitted = {p.name for p in effect.fitted()}
    steps = {name: step for name, step in variant.steps.items() if name not in fitted}
    if not steps or any(values[name] != variant.values[name] for name in steps):
        return None
    return Variant(variant.effect, dict(values), steps)


def take_from_frequencies(case: Case) -> Case:
    """The case with the causes that the runs' frequencies show, and what is to be said of these
    frequencies."""
    search, candidates, noise = case.search, case.inquiry.candidates, case.inquiry.noise
    fit, found = search.final, list(search.found)
    follows: list[str] = []
    ranked: list[Pattern] = []
    while len(follows) < MOST:
        offsets, index = offsets_of(fit, noise)
        if len(offsets.value) - offsets.means.shape[1] < SPARE + 1 or scatter(offsets)[1] > SCATTER:
            break
        ranked = patterns(fit, offsets, index, candidates)
        if not ranked:
            break
        best = ranked[0]
        p = evidence.corrected(best.p_value, len(ranked))
        if p > (BESIDE_NOISE if best.left_p > QUIET else SIGNIFICANT):
            break
        fit, one = _adopted(fit, best, ranked, offsets)
        found = [f for f in found if f.variant.effect.name != one.variant.effect.name]
        found.append(one)
        follows.append(one.variant.effect.name)
        ranked = []
    said = _said(fit, noise, follows, [o for o in ranked if o.left_p > QUIET], len(ranked))
    return replace(case, search=replace(search, final=fit, found=tuple(found)), frequencies=said)


def _adopted(
    fit: Fit, best: Pattern, ranked: Sequence[Pattern], offsets: Offsets
) -> tuple[Fit, Found]:
    """The fit with the cause, the runs' frequencies held together up to the wander that is left."""
    C = np.linalg.cholesky(offsets.covariance + best.wander**2 * np.eye(len(offsets.value)))
    design = np.linalg.solve(C, np.concatenate([offsets.means, best.response], axis=1))
    size = np.linalg.norm(design, axis=0)
    solution = np.linalg.lstsq(
        design / np.where(size > 0, size, 1.0), np.linalg.solve(C, offsets.value), rcond=1e-6
    )[0]
    estimate = (solution / np.where(size > 0, size, 1.0))[offsets.means.shape[1] :]
    values = dict(best.variant.values)
    for name, value in zip(best.variant.steps, estimate, strict=True):
        values[name] += float(value)
    own = float(np.sqrt(np.median(np.diag(offsets.covariance))))
    freedom = replace(fit.freedom, offset_std=max(best.wander, LEAST * own))
    # what the cause does to the frequencies leaves the offsets, or a great one would start many
    # turns away
    point = replace(fit.point, offset_rad_s=fit.point.offset_rad_s - best.response @ estimate)
    again = extended_fit.fit(
        fit.series, extended_fit.with_effect(point, best.variant.effect, values), freedom
    )
    S = fit.sensitivities([best.variant.wanted])[0]
    score = evidence.score(best.variant.effect.name, fit.residual, S, fit.basis)
    level = offsets.misfit(best.wander, best.response)[0]
    rivals = [
        o.variant.effect.name
        for o in ranked[1:]
        if offsets.misfit(best.wander, o.response)[0] < level + RIVAL
    ]
    rank = int(best.response.any(axis=0).sum())
    worth = evidence.criterion(best.gain, rank, len(fit.residual))
    return again, Found(
        best.variant, replace(score, p_value=best.p_value), len(ranked), worth, tuple(rivals)
    )


def _freed(fit: Fit, follows: Sequence[str]) -> Fit:
    """Every run's frequency free again, the causes it follows held where they are."""
    active = []
    for effect, values in fit.point.active:
        if effect.name in follows:
            effect = replace(
                effect, parameters=tuple(replace(p, fitted=False) for p in effect.parameters)
            )
        active.append((effect, values))
    return extended_fit.fit(
        fit.series,
        replace(fit.point, active=tuple(active)),
        replace(fit.freedom, offset_std=np.inf),
    )


def _said(
    fit: Fit, noise: NoiseLevel, follows: Sequence[str], fitting: Sequence[Pattern], tried: int
) -> dict[str, Any]:
    """The runs' frequencies with errors, their scatter, and one sentence. fitting: causes, of so
    many tried, that leave no more than noise, which chance does too often in so few runs."""
    free = _freed(fit, follows) if follows else fit
    offsets, _ = offsets_of(free, noise)
    hz = 1 / (2 * np.pi)
    std = np.sqrt(np.diag(offsets.covariance)) * hz
    out: dict[str, Any] = {
        "hz": free.frequency_hz.tolist(),
        "std_hz": std.tolist(),
        "follow": list(follows),
        "would_follow": [],
    }
    if len(offsets.value) <= offsets.means.shape[1]:
        return out | {
            "scatter_hz": None,
            "sigma": None,
            "sentence": "one run alone: its frequency is compared with no other's",
        }
    z, p = scatter(offsets)
    wander = offsets.wander() * hz
    out |= {"scatter_hz": wander, "sigma": z}
    if p > SCATTER:
        sentence = "the runs' frequencies agree within their errors"
        return out | {
            "sentence": (
                sentence
                + (f" once {' and '.join(follows)} is taken into account" if follows else "")
            )
        }
    beside = f"beside {' and '.join(follows)} " if follows else ""
    differ = (
        f"{beside}the frequencies of the runs differ by {wander:.3g} Hz from run to run ({z:.3g}"
        " sigma); "
    )
    if fitting:
        names = [one.variant.effect.name for one in fitting]
        chance = evidence.corrected(fitting[0].p_value, tried)
        return out | {
            "would_follow": names,
            "sentence": (
                f"{differ}{' or '.join(names)} would make them so, but so few runs line up with one"
                f" of {tried} causes by chance with p = {chance:.2g}: record more runs;"
                f" {fitting[0].variant.effect.next_experiment}"
            ),
        }
    return out | {
        "sentence": (
            f"{differ}nothing in the catalogue follows it, every run keeps a frequency of its own; "
            + (
                "log the temperature of every run"
                if not fit.series.has_temperature
                else "repeat a run as it was"
            )
        )
    }
