"""Natural sizes of an effect's parameters in a run's own units: the same run in milliseconds or in
pixels gets the same steps.

The catalogue states typical sizes for a shell of 5 kHz at unit amplitude. A parameter in s⁻ᵏ scales
with the oscillation's frequency to the k-th power, one in amplitudeᵏ with the data's amplitude;
what is dimensionless, or in kelvin, stays.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ...effects.effect import Effect, Parameter, no_term, same_signal, same_state
from ...physics.plant import SlowState
from .measured_runs import MeasuredRuns

Array = np.ndarray
CATALOGUE_HZ = 5000.0
"""Oscillation frequency for which the catalogue states its typical sizes."""
SMALL_PART = 1e-2
"""Difference step as a part of the typical size."""


def seconds_in(units: str) -> int:
    """Power of the second in a unit such as "rad s-1", "s-2", "s K-1" or "Hz"."""
    power = 0
    for factor in units.split():
        if factor == "Hz":
            power -= 1
        elif factor == "s" or (factor[1:].lstrip("-").isdigit() and factor[0] == "s"):
            power += int(factor[1:] or 1)
    return power


def typical(parameter: Parameter, amplitude: float, frequency_hz: float) -> float:
    """Typical size of a parameter for data of this amplitude and frequency."""
    in_time = (frequency_hz / CATALOGUE_HZ) ** -seconds_in(parameter.units)
    return parameter.typical * amplitude**parameter.amplitude_power * in_time


def amplitude_of(series: MeasuredRuns) -> float:
    """Root mean square amplitude of the data."""
    power = np.sum(np.abs(series.envelope) ** 2, axis=-1)
    return float(np.sqrt(power[series.weight > 0].mean()))


def steps_of(effect: Effect, series: MeasuredRuns) -> dict[str, float]:
    """Difference steps of an effect's fitted parameters for these data."""
    amplitude = amplitude_of(series)
    return {
        p.name: SMALL_PART * typical(p, amplitude, series.reference_frequency_hz)
        for p in effect.fitted()
    }


def strength(
    effect: Effect, values: Mapping[str, float], u: Array, state: SlowState
) -> tuple[float, float]:
    """How strongly an effect acts: (|du/dt| it adds over ω|u|, |change of what is seen| over |u|),
    root mean squares along the runs.

    Pure numbers, so that "small beside the oscillation" means the same in every unit. What an
    effect does to the environment counts by the turn it makes of the motion (rate) and by the part
    of the logged range it moves the temperature.
    """
    size = float(np.sqrt(np.mean(np.abs(u) ** 2)))
    if not size > 0:
        return 0.0, 0.0
    motion = seen = 0.0
    if effect.slow is not no_term:
        motion = (
            float(np.sqrt(np.mean(np.abs(effect.slow(values, u, state)) ** 2)))
            / size
            / state.omega_r_rad_s
        )
    if effect.slow_readout is not same_signal:
        seen = (
            float(np.sqrt(np.mean(np.abs(effect.slow_readout(values, u, state) - u) ** 2))) / size
        )
    if effect.slow_environment is not same_state:
        moved = effect.slow_environment(values, state)
        turn = np.sqrt(np.mean((moved.rate_rad_s - state.rate_rad_s) ** 2)) * abs(
            state.mechanics.scale_factor
        )
        motion = max(motion, float(turn) / state.omega_r_rad_s)
        span = float(np.ptp(state.temperature_degc))
        change = float(np.sqrt(np.mean((moved.temperature_degc - state.temperature_degc) ** 2)))
        seen = max(seen, change / span if span > 0 else 0.0)
    return motion, seen
