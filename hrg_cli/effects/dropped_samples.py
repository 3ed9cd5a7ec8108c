"""Samples lost at an instant.

Physics: the logger loses samples and closes the gap up; what follows comes from later instants than
its place says.
Equation: for t > t₀: u_m(t) = u(t + τ) e^{jω_r τ}: a step ωτ of phase and θ̇τ of the angle at the same instant   (PHYSICS R14).
Size: a few samples. Mistaken for: phase slip of a loop. What separates it: the joint step of phase
and angle; a sample counter.
"""

import numpy as np

from ..physics.plant import Readout, SlowState
from ..physics.resonator import build_generator, exponentiate
from .effect import Array, Effect, Parameter, Values
from .envelope_jumps import find_own_runs, find_part_after, list_instants, make_run_parameter


def readout(p: Values, readout: Readout) -> None:
    """Samples lost at `time_s`."""
    if p["lost_s"] > 0:
        readout.dropped.append((p["time_s"], p["lost_s"]))


def slow_readout(p: Values, u: Array, state: SlowState) -> Array:
    """e^{jω_r τ} exp(Lτ) u after the instant, L of the resonator at the rate of the moment."""
    L = build_generator(state.mechanics, state.rate_rad_s, state.omega_r_rad_s / (2 * np.pi))
    later = np.exp(1j * state.omega_r_rad_s * p["lost_s"]) * np.einsum(
        "...ij,...j->...i", exponentiate(L, p["lost_s"]), u
    )
    after = find_part_after(np.asarray(state.time_s), p["time_s"]) * find_own_runs(p, state)
    return u + after[..., None] * (later - u)


EFFECT = Effect(
    name="dropped_samples",
    family="read-out",
    page=__doc__,
    parameters=(
        Parameter("lost_s", "s", 1e-4, "time lost, a whole number of samples"),
        Parameter("time_s", "s", 0.5, "instant of the loss", fitted=False, required=True),
        make_run_parameter(),
    ),
    mistaken_for=("a phase slip",),
    next_experiment="log a sample counter beside the channels",
    readout=readout,
    slow_readout=slow_readout,
    seen_in="waveform",
    whole_samples=True,
    starts=list_instants,
)
