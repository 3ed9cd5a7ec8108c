"""Where a fit of the extended model stands, and what the effects see of the runs there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ...effects.effect import Effect
from ...physics.plant import SlowState
from ...physics.resonator import Mechanics
from ..envelopes import coordinates
from .measured_runs import MeasuredRuns

Array = np.ndarray
Active = tuple[tuple[Effect, Mapping[str, float]], ...]
"""Effects with all their parameters' values."""


@dataclass(frozen=True)
class Point:
    """Where a fit stands: coordinates (7,), the runs' start states (R, 2) and frequency offsets
    (R,), effects with values."""

    p: Array
    start: Array
    offset_rad_s: Array
    active: Active = ()


def add_effect(point: Point, effect: Effect, values: Mapping[str, float]) -> Point:
    """The point with one more effect (or another value of it)."""
    others = tuple(pair for pair in point.active if pair[0].name != effect.name)
    return replace(point, active=(*others, (effect, dict(values))))


def remove_effect(point: Point, name: str) -> Point:
    """The point without an effect."""
    return replace(point, active=tuple(pair for pair in point.active if pair[0].name != name))


def mechanics(p: Array, series: MeasuredRuns) -> Mechanics:
    """The resonator of coordinates p at the reference frequency."""
    return coordinates.to_mechanics(p, series.reference_frequency_hz, series.mode_number)


def state_of(series: MeasuredRuns, point: Point) -> SlowState:
    """What the effects look at, (R, n); the effects' own changes of the environment applied."""
    state = SlowState(
        mechanics=mechanics(point.p, series),
        time_s=series.time_s,
        temperature_degc=series.temperature_degc,
        temperature_rate_degc_s=series.temperature_rate_degc_s,
        branch=series.branch,
        rate_rad_s=series.rate_rad_s,
        table_angle_rad=series.table_angle_rad,
        drive=np.zeros((*series.time_s.shape, 2), complex),
        forced=series.forced,
        phase_rad=series.phase_rad,
        omega_r_rad_s=2 * np.pi * series.reference_frequency_hz,
        run=series.numbers[:, None],
    )
    for effect, values in point.active:
        state = effect.slow_environment(values, state)
    return state
