"""A knock: momentum given at one instant.

Physics: something hits the case or the suspension; the velocity changes by Δż at t_k, the
displacement does not.
Equation: with z = Re U, ż = −ω Im U, U = u e^{jωt}, the envelopes jump by Δu = −j (Δż/ω) e^{−jωt_k}   (PHYSICS §8): two real numbers and
the instant, which the rows of a measurement know to a part of their length and the jump's own phase
to a part of a period: t_k is `time_s` and `phase_rad`/ω. Amplitude, quadrature, angle and phase
jump together, in proportions that the phase at t_k gives. Size: 1e-4 … 1 of the amplitude. The
parameters are Δż/ω, the amplitude that the knock gives a resonator at rest. Mistaken for: lost
samples (they turn both channels alike: θ and a_B stay), a run put together from two. What separates
it: the motion before and after is that of one resonator; a counter of samples, an accelerometer on
the case.
"""

import numpy as np

from ..physics.plant import Environment, Plant, SlowState
from .effect import RUN, Array, Effect, Parameter, Runs, Values
from .envelope_jumps import Jump, find_own_runs, find_strikes, make_run_parameter


def _read_velocity_over_omega(p: Values) -> Array:
    """Δż/ω (2,)."""
    return np.array([p["c_velocity_over_omega"], p["s_velocity_over_omega"]])


def plant(p: Values, plant: Plant, env: Environment) -> None:
    """ż += Δż at t_k, ω that of the resonator."""
    omega = plant.mechanics.omega_rad_s
    plant.kicks.append((p["time_s"] + p["phase_rad"] / omega, omega * _read_velocity_over_omega(p)))


def slow_jump(p: Values, state: SlowState) -> tuple[float, Array]:
    """(t_k, −j (Δż/ω) e^{−jω_r t_k}) in the run that was struck."""
    instant = p["time_s"] + p["phase_rad"] / state.mechanics.omega_rad_s
    jump = -1j * _read_velocity_over_omega(p) * np.exp(-1j * state.omega_r_rad_s * instant)
    return instant, find_own_runs(p, state)[..., None] * jump


def list_phased_instants(runs: Runs) -> list[Values]:
    """Where a run is struck, the clearest first, at the phase that makes the jump one of the
    velocity alone."""
    omega_r = 2 * np.pi * runs.reference_frequency_hz
    return [
        {"time_s": _find_instant_in_phase(jump, omega_r), RUN: float(jump.run)}
        for jump in find_strikes(runs)
    ]


def _find_instant_in_phase(jump: Jump, omega_r: float) -> float:
    """The instant next to that of a jump at which it is a velocity: j e^{jω_r t} Δu is real in both
    channels.

    A row knows the instant to a part of its length, the jump's phase knows it to a part of a
    period, half periods apart.
    """
    omega = omega_r + jump.turn_rad_s
    phase = float(np.angle(np.sum(jump.change**2))) / 2 + omega * jump.time_s + np.pi / 2
    return float(jump.time_s - (np.mod(phase + np.pi / 2, np.pi) - np.pi / 2) / omega)


EFFECT = Effect(
    name="momentum_kick",
    family="bench",
    page=__doc__,
    parameters=(
        Parameter(
            "c_velocity_over_omega",
            "amplitude",
            1e-3,
            "velocity that C was given, over ω",
            amplitude_power=1,
        ),
        Parameter(
            "s_velocity_over_omega",
            "amplitude",
            1e-3,
            "velocity that S was given, over ω",
            amplitude_power=1,
        ),
        Parameter(
            "phase_rad",
            "rad",
            1.0,
            "phase of the oscillation from time_s to the knock",
            fitted=False,
            fitted_then=True,
        ),
        Parameter("time_s", "s", 0.5, "instant of the knock", fitted=False, required=True),
        make_run_parameter("that was struck"),
    ),
    mistaken_for=("dropped_samples",),
    next_experiment="an accelerometer on the case, or the same run again: a knock comes once",
    plant=plant,
    slow_jump=slow_jump,
    starts=list_phased_instants,
)
