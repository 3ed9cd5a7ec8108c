"""Diagnosis, the functional form of a damping that changes: the power of the amplitude it follows, and what physics forbids.

A passive resonator's linear damping is nowhere negative: ν − |νδμ| ≥ 0. A catalogued damping that needs it negative has the wrong
form, and so has one whose power, left free, comes out as another. The better form, −d ln a/dt = ν + ν_n (a/a₀)^n with n fitted, takes its
place; where ν is forbidden even then, it is held at zero, and what else shows up beside the passive form is sought again.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...effects import nonlinear_damping
from ...effects.effect import Effect, Parameter
from ...fitting.causes import extended_fit
from ...fitting.causes.extended_fit import Fit
from ...physics.plant import SlowState
from .search import WORTH, Found, Search, Variant, adopted, as_fitted, bic, scored

Array = np.ndarray
NAME = "nonlinear_damping"
FORBIDDEN = 2.0
"""σ by which the least linear damping must be negative to count as forbidden."""
DIFFERENT = 4.0
"""σ by which a fitted power must differ from the catalogue's."""
PROMISING, SHORTLIST, QUICK = 4.0, 6, 5
"""Score in σ from which a cause is refitted beside the passive form, the most that are, and in how many steps."""
LEAST, MOST = -0.5, 8.0
"""Powers that are sought."""


@dataclass(frozen=True)
class Form:
    """The better form: power and ν_n at a₀ with σ, whether ν was forbidden and is held at 0, ν before, χ², what it is not told from."""

    power: float
    power_std: float
    damping_1_s: float
    damping_std_1_s: float
    amplitude: float
    forbidden: bool
    passive: bool
    catalogue_damping_1_s: float
    catalogue_std_1_s: float
    chi2_catalogue: float
    chi2: float
    rivals: tuple[str, ...] = ()

    @property
    def formula(self) -> str:
        """Formula with its numbers."""
        linear = "" if self.passive else "ν + "
        numbers = f"n = {self.power:.2f} ± {self.power_std:.2f}, ν_n = {self.damping_1_s:.3g} 1/s, a₀ = {self.amplitude:.4g}"
        return f"−d ln a/dt = {linear}ν_n·(a/a₀)^n, {numbers}"

    @property
    def sentence(self) -> str:
        """What is wrong with the catalogue's form and what is better."""
        why = (
            f"would need a linear damping of {self.catalogue_damping_1_s:.2g} ± {self.catalogue_std_1_s:.1g} 1/s along its weaker axis, "
            "which physics forbids"
            if self.forbidden
            else f"falls short by {self.chi2_catalogue - self.chi2:.3g} in χ²"
        )
        better = f"a damping that follows a^n, n = {self.power:.2f} ± {self.power_std:.2f}"
        text = f"the catalogue's damping in a² fits only roughly: it {why}; better is {better}"
        if self.passive:
            text += " without a linear part"
        return text + (f"; not told apart from {' and '.join(self.rivals)}" if self.rivals else "")

    def amended(self, effect: dict[str, Any]) -> dict[str, Any]:
        """The report's entry of the damping, its z that of ν_n at a₀: at unit amplitude level and power are hardly told apart."""
        if effect["name"] != NAME:
            return effect
        z = self.damping_1_s / self.damping_std_1_s
        return effect | {"z": z, "p_value": float(np.exp(-0.5 * min(z**2, 1400.0))), "form": self.formula}

    def completed(self, remainder: dict[str, Any] | None) -> dict[str, Any]:
        """The remainder with what the catalogue's form leaves open in front."""
        terms = remainder["terms"] if remainder else []
        further = f"; then {remainder['description']}" if remainder and terms else ""
        return {
            "description": self.sentence + further,
            "covariate": "amplitude",
            "harmonic": None,
            "formula": self.formula,
            "power": {"value": self.power, "std": self.power_std},
            "terms": terms,
        }


def least_damping(fit: Fit) -> tuple[float, float]:
    """(ν − |νδμ|, σ): the linear damping along the weaker axis."""
    p = fit.point.p
    size = float(np.hypot(p[1], p[2]))
    slope = np.array([1.0, *(-p[1:3] / size if size > 0 else (0.0, 0.0))])
    index = [fit.names.index(f"p{k}") if f"p{k}" in fit.names else -1 for k in range(3)]
    there = [k for k in range(3) if index[k] >= 0]
    rows = [index[k] for k in there]
    variance = slope[there] @ fit.covariance[np.ix_(rows, rows)] @ slope[there] if there else 0.0
    return float(p[0]) - size, float(np.sqrt(max(variance, 0.0)))


def better(search: Search, candidates: Sequence[Variant], noise_factor: float, most: int) -> tuple[Search, Form | None]:
    """The search with the damping's better form in the catalogue's place, or as it was where that serves.

    Causes that the search added to a form that fits only roughly are sought again beside the better one.
    """
    place = next((f for f in search.found if f.variant.effect.name == NAME), None)
    coloured = search.base.series.colour is not None
    if place is None or (len(search.found) > 1 and not coloured):
        return search, None
    with contextlib.suppress(extended_fit.DivergedError):
        old = search.final if len(search.found) == 1 else adopted(search.base, place.score, place.variant)
        amplitude = extended_fit.amplitude_of(old.series)
        fit = _fitted(old, amplitude, old.freedom)
        if fit is None:
            return search, None
        inflate = noise_factor**0.5
        low, low_std = least_damping(old)
        forbidden = low < -FORBIDDEN * inflate * low_std
        power, power_std = _power(fit)
        wrong = abs(power - 2) > DIFFERENT * power_std * inflate and old.chi2 - fit.chi2 > WORTH * noise_factor
        if not forbidden and not wrong:
            return search, None
        held = forbidden and least_damping(fit)[0] < 0
        edge = None
        if held:
            # what the forbidden damping did may be another cause's work
            passive = _passive(old, amplitude)
            if passive is None:
                return search, None
            fit, edge = passive, _edge(passive, old.point.p[1:3])
        fit, others = _beside(fit, candidates, noise_factor, most - 1)
        if not held and bic(fit) > bic(search.final):
            return search, None
        if edge is not None and bic(edge) < bic(fit) + WORTH * noise_factor:
            others = [replace(f, rivals=(*f.rivals, "damping_split_1_s")) for f in others]
        final = _in_the_catalogue(fit, amplitude, fit.freedom)
        power, power_std = _power(final)
        level, level_std = _level(final, amplitude)
        numbers = (power, inflate * power_std, level, inflate * level_std, amplitude)
        form = Form(*numbers, forbidden, held, low, inflate * low_std, old.chi2, final.chi2, place.rivals)
        values = {e.name: v for e, v in final.point.active}[NAME]
        own = replace(place, variant=Variant(FREE, values, {"damping_1_s": 1.0, "power": 1.0}))
        last = tuple(s for s, _ in scored(final, candidates))
        return replace(search, final=final, found=(own, *others), last=last), form
    return search, None


def refitted(fit: Fit, form: Form) -> Fit | None:
    """A fit with the catalogue's damping fitted again with that damping in the better form."""
    if form.passive:
        return _passive(fit, form.amplitude)
    return _fitted(fit, form.amplitude, fit.freedom)


def _with_power_free() -> Effect:
    effect = nonlinear_damping.EFFECT
    return replace(effect, parameters=tuple(replace(p, fitted=True) for p in effect.parameters))


FREE = _with_power_free()
"""The catalogue's effect with the power fitted."""


def _at(amplitude: float) -> Effect:
    """The same with its level at the data's amplitude, which the power hardly moves."""

    def slow(p: Mapping[str, float], u: Array, state: SlowState) -> Array:
        power = float(np.clip(p["power"], LEAST, MOST))
        return nonlinear_damping.slow({"damping_1_s": p["level_1_s"] * amplitude**-power, "power": power}, u, state)

    parameters = (Parameter("level_1_s", "s-1", 1e-5, "damping at the data's amplitude"), Parameter("power", "1", 1.0, "power"))
    return Effect(name=NAME, family="resonator", page="", parameters=parameters, slow=slow)


def _fitted(fit: Fit, amplitude: float, freedom: extended_fit.Freedom, p: Array | None = None) -> Fit | None:
    """The fit with the power free, from where the catalogue's form stands."""
    values = {e.name: v for e, v in fit.point.active}[NAME]
    power = values.get("power", 2.0)
    level = values["damping_1_s"] * amplitude**power if "damping_1_s" in values else values["level_1_s"]
    point = fit.point if p is None else replace(fit.point, p=p)
    point = extended_fit.with_effect(point, _at(amplitude), {"level_1_s": level, "power": power})
    try:
        again = extended_fit.fit(fit.series, point, freedom, most=12)
    except extended_fit.DivergedError:
        return None
    return again if LEAST < _power(again)[0] < MOST else None


def _passive(fit: Fit, amplitude: float) -> Fit | None:
    """Power free, linear damping held at zero."""
    std = fit.freedom.std.copy()
    std[:3] = 0.0
    p = fit.point.p.copy()
    p[:3] = 0.0
    values = {e.name: v for e, v in fit.point.active}[NAME]
    level = values["damping_1_s"] * amplitude**2 + fit.point.p[0]
    point = extended_fit.with_effect(fit.point, nonlinear_damping.EFFECT, {"damping_1_s": level * amplitude**-2.0, "power": 2.0})
    start = replace(fit, flow=replace(fit.flow, prediction=replace(fit.prediction, point=point)))
    return _fitted(start, amplitude, replace(fit.freedom, std=std), p)


def _beside(fit: Fit, candidates: Sequence[Variant], noise_factor: float, most: int) -> tuple[Fit, list[Found]]:
    """Forward selection with every promising cause refitted; of causes not told apart the one with the fewest parameters stands first."""
    found: list[Found] = []
    while len(found) < most:
        ranked = [(s, v) for s, v in scored(fit, candidates) if s.visible and s.z > PROMISING * noise_factor**0.5]
        trials = []
        for score, variant in ranked[:SHORTLIST]:
            with contextlib.suppress(extended_fit.DivergedError):
                trials.append((adopted(fit, score, variant, QUICK), score, variant))
        trials = [t for t in trials if bic(fit) - bic(t[0]) > WORTH * noise_factor]
        if not trials:
            break
        level = min(bic(t[0]) for t in trials)
        near = [t for t in trials if bic(t[0]) < level + WORTH * noise_factor]
        best, score, variant = min(near, key=lambda t: (t[1].rank, t[0].chi2))
        rivals = tuple(t[2].effect.name for t in near if t[0] is not best)
        found.append(Found(as_fitted(variant, best), score, len(ranked), (bic(fit) - bic(best)) / noise_factor, rivals))
        fit = extended_fit.fit(best.series, best.point, best.freedom)
    return fit, found


def _edge(passive: Fit, direction: Array) -> Fit | None:
    """The passive fit with a linear damping along one axis only, the most a passive split can be; it starts from the split as fitted."""

    def slow(p: Mapping[str, float], u: Array, state: SlowState) -> Array:
        c, s = u[..., 0], u[..., 1]
        along, across = np.stack([c, -s], -1), np.stack([s, c], -1)
        return -(np.hypot(p["cos_1_s"], p["sin_1_s"]) * u + p["cos_1_s"] * along + p["sin_1_s"] * across)

    parameters = (Parameter("cos_1_s", "s-1", 1e-6, ""), Parameter("sin_1_s", "s-1", 1e-6, ""))
    effect = Effect(name="one-sided damping", family="resonator", page="", parameters=parameters, slow=slow)
    start = {"cos_1_s": float(direction[0]), "sin_1_s": float(direction[1])}
    with contextlib.suppress(extended_fit.DivergedError):
        return extended_fit.fit(passive.series, extended_fit.with_effect(passive.point, effect, start), passive.freedom, most=10)
    return None


def _in_the_catalogue(fit: Fit, amplitude: float, freedom: extended_fit.Freedom) -> Fit:
    """The same fit with the damping in the catalogue's own parameters."""
    values = {e.name: v for e, v in fit.point.active}[NAME]
    own = {"damping_1_s": values["level_1_s"] * amplitude ** -values["power"], "power": values["power"]}
    # the same optimum, looked at in coordinates in which steps would be poor
    same = extended_fit.fit(fit.series, extended_fit.with_effect(fit.point, FREE, own), freedom, most=0)
    return replace(same, converged=fit.converged)


def _power(fit: Fit) -> tuple[float, float]:
    """The power and its σ."""
    return float({e.name: v for e, v in fit.point.active}[NAME]["power"]), fit.std(f"{NAME}.power")


def _level(fit: Fit, amplitude: float) -> tuple[float, float]:
    """ν_n at the data's amplitude and its σ, from the catalogue's parameters."""
    values = {e.name: v for e, v in fit.point.active}[NAME]
    level = values["damping_1_s"] * amplitude ** values["power"]
    index = [fit.names.index(f"{NAME}.{name}") for name in ("damping_1_s", "power")]
    slope = np.array([amplitude ** values["power"], level * np.log(amplitude)])
    return float(level), float(np.sqrt(max(slope @ fit.covariance[np.ix_(index, index)] @ slope, 0.0)))
