"""Feed-through of the drive into the pick-off.

Physics: a stray capacitance couples the drive voltage into the channels. The voltage is that of the
main drive, of scalar amplitude a_ΦA and coherent with the wave's phase, whatever the wave's angle.
Equation: u_m = u + (κ + jη) a_ΦA e^{jφ}, κ and η vectors (C, S): parts coherent with displacement
and with velocity;
δθ = Re(e·e_B)/(m a), δr = −Im(e·e_B)/a, e = (κ + jη) a_ΦA: harmonic mθ, ∝ drive/a   (PHYSICS R9).
Size: 1e-6 … 1e-3 of the amplitude; a_ΦA = ν a in steady state. Mistaken for: coherent offset,
parasitic force. What separates it: it vanishes when the drive is off.
"""

import numpy as np

from ..physics.plant import Readout, Samples, SlowState
from .effect import Array, Effect, Parameter, Values, find_frame, follow_phase, project


def _read_vector(p: Values) -> Array:
    """κ + jη, complex (2,)."""
    return np.array(
        [
            p["displacement_c_s"] + 1j * p["velocity_c_s"],
            p["displacement_s_s"] + 1j * p["velocity_s_s"],
        ]
    )


def readout(p: Values, readout: Readout) -> None:
    """y + Re[(κ + jη)·a_ΦA e^{j(φ+ωt)}], the phase followed from block to block."""
    coupling, last = _read_vector(p), list[Array]()

    def step(block: Samples, y: Array) -> Array:
        w = (block.z - 1j * block.v_over_omega).T
        phase = follow_phase(w, last)
        turn, e_A, _, _ = find_frame(w, phase)
        amplitude = np.real(project(block.drive.T, e_A)[:, 0] / turn)
        return y + np.real(coupling[:, None] * amplitude * turn)

    readout.steps.append(step)


def slow_readout(p: Values, u: Array, state: SlowState) -> Array:
    """u + (κ + jη) a_ΦA e^{jφ}."""
    turn, e_A, _, _ = find_frame(u, state.phase_rad)
    amplitude = np.real(project(state.drive, e_A)[..., 0] / turn)
    return u + _read_vector(p) * (amplitude * turn)[..., None]


EFFECT = Effect(
    name="drive_feedthrough",
    family="read-out",
    page=__doc__,
    parameters=tuple(
        Parameter(
            f"{part}_{channel}_s",
            "s",
            3e-4,
            f"coupling into {channel.upper()} coherent with {part}, signal over drive",
        )
        for part in ("displacement", "velocity")
        for channel in "cs"
    ),
    mistaken_for=("coherent_offset", "parasitic_force"),
    next_experiment=(
        "the forced run with the drive switched off part of the time: feed-through vanishes with"
        " the drive, an offset stays"
    ),
    readout=readout,
    slow_readout=slow_readout,
    coherent=True,
    shown_by=("drive",),
)
