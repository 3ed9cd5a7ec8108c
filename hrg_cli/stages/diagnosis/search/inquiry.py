"""Diagnosis, what every step of a search is given: the causes asked for, how many at most, and the
noise that gains are judged by."""

from __future__ import annotations

from dataclasses import dataclass

from ..fits.variants import Variant


@dataclass(frozen=True)
class NoiseLevel:
    """Noise beside that which the windows state.

    white: σ between neighbouring windows over the stated one, by which the fits' weights were
    divided; slow: variance of the residual's slow part over that of white noise, where it is taken
    for wandering noise: gains in χ² are divided by it.
    """

    white: float = 1.0
    slow: float = 1.0


STATED = NoiseLevel()
"""The noise that the windows state."""


@dataclass(frozen=True)
class Inquiry:
    """The ways in which causes may stand, how many are taken in at most, the noise, and the step of
    the runs' even sampling [s], None where it is not known or not one."""

    candidates: tuple[Variant, ...]
    most: int
    noise: NoiseLevel = STATED
    sampling_step_s: float | None = None
