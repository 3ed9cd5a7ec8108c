"""Diagnosis, a damping's form that is better than the catalogue's: its numbers and its words."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from .shapes import FREE, NAME, DampingShape


@dataclass(frozen=True)
class TriedForm:
    """A shape that physics allows, and χ² of all data with it."""

    shape: DampingShape
    chi2: float


@dataclass(frozen=True)
class Form:
    """The better form: shape, how many σ its level stands off zero, power, ν_n at a₀ and ν with σ;
    ν with the catalogue's and χ² of both; what it is not told from."""

    shape: DampingShape
    z: float
    power: tuple[float, float]
    level_1_s: tuple[float, float]
    linear_1_s: tuple[float, float]
    amplitude: float
    forbidden: bool
    catalogue_1_s: tuple[float, float]
    chi2_catalogue: float
    chi2: float
    rivals: tuple[str, ...] = ()
    tried: tuple[TriedForm, ...] = ()

    @property
    def catalogued(self) -> bool:
        """Whether the catalogue's page holds it: a power of its own beside a linear damping. One
        without that, or with a supply, is one of several that physics allows."""
        return self.shape == FREE

    @property
    def formula(self) -> str:
        """Formula with its numbers."""
        power, power_std = self.power
        linear = "ν + " if self.shape.linear else ""
        given = f"n = {power:g}" if self.shape.supplied else f"n = {power:.2f} ± {power_std:.2f}"
        numbers = f"{given}, ν_n = {_with_std(self.level_1_s)} 1/s, a₀ = {self.amplitude:.4g}"
        if self.shape.linear:
            numbers += f", ν = {_with_std(self.linear_1_s)} 1/s"
        return f"−d ln a/dt = {linear}ν_n·(a/a₀)^n, {numbers}"

    @property
    def sentence(self) -> str:
        """What is wrong with the catalogue's form and what is better."""
        why = (
            f"would need a linear damping of {_with_std(self.catalogue_1_s)} 1/s along its weaker"
            " axis, which physics forbids"
            if self.forbidden
            else f"falls short by {self.chi2_catalogue - self.chi2:.3g} in χ²"
        )
        power, power_std = self.power
        better = (
            f"a linear damping of {_with_std(self.linear_1_s)} 1/s beside {self.shape.words} that"
            " no log tells of"
            if self.shape.supplied
            else f"{self.shape.words}, n = {power:.2f} ± {power_std:.2f}"
        )
        text = f"the catalogue's damping in a² fits only roughly: it {why}; better is {better}"
        others = [t.shape.words for t in self.tried if t.shape != self.shape]
        if others:
            text += f", not told by χ² from {' or '.join(others)}"
        return text + (f"; not told apart from {' and '.join(self.rivals)}" if self.rivals else "")

    def amend(self, effect: dict[str, Any]) -> dict[str, Any]:
        """The report's entry of the damping, its z that of the level with the power as it is: the
        two are hardly told apart."""
        if effect["name"] != NAME:
            return effect
        return effect | {
            "z": self.z,
            "p_value": float(np.exp(-0.5 * min(self.z**2, 1400.0))),
            "form": self.formula,
        }

    def complete(self, remainder: dict[str, Any] | None) -> dict[str, Any]:
        """The remainder with what the catalogue's form leaves open in front."""
        terms = remainder["terms"] if remainder else []
        further = f"; then {remainder['description']}" if remainder and terms else ""
        return {
            "description": self.sentence + further,
            "covariate": "amplitude",
            "harmonic": None,
            "formula": self.formula,
            "power": {
                "value": self.power[0],
                "std": None if self.shape.supplied else self.power[1],
            },
            "shapes": [{"name": t.shape.words, "chi2": t.chi2} for t in self.tried],
            "terms": terms,
        }


def _with_std(number: tuple[float, float]) -> str:
    return f"{number[0]:.3g} ± {number[1]:.1g}"
