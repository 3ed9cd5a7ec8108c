"""Feed-through of the drive into the pick-off.

Physics: a stray capacitance couples the drive voltage into the channels. The voltage is that of the main drive, of scalar amplitude
a_ΦA and coherent with the wave's phase, whatever the wave's angle.
Equation: u_m = u + (κ + jη)·2a_ΦA e^{jφ}/ω with κ, η vectors (C, S): κ coherent with displacement, η with velocity, both in multiples
of the displacement force/ω²; δθ = Re(e·e_B)/(m a), δr = −Im(e·e_B)/a: second harmonic mθ of the angle, ∝ u/a   (PHYSICS R9).
Size: 1e-6 … 1e-3 of the amplitude.
Mistaken for: coherent offset. What separates it: it vanishes when the drive is off.
"""

import numpy as np

from ..physics.plant import Readout, Samples, SlowState
from .effect import Array, Effect, Parameter, Values, along, frame


def readout(p: Values, readout: Readout) -> None:
    """Adds the main drive's scalar amplitude, turned to the wave's phase, to each channel."""
    coupling = np.array([p["displacement_c"] + 1j * p["velocity_c"], p["displacement_s"] + 1j * p["velocity_s"]])
    last = {"phase": 0.0}

    def step(block: Samples, y: Array) -> Array:
        if not np.any(block.drive):
            return y
        w = (block.z - 1j * block.v_over_omega).T
        phase = np.unwrap(np.concatenate([[last["phase"]], np.angle(along(w, frame(w, 0.0)[1])[:, 0])]), period=np.pi)[1:]
        last["phase"] = float(phase[-1])
        turn, e_A, _, _ = frame(w, phase)
        scalar = np.sum(block.drive.T * e_A, axis=-1)  # Re[2j a_ΦA e^{j(φ+ωt)}]/ω = −2 a_ΦA Im(turn)/ω
        span = max(3, int(round(2 * np.pi / max(abs(float(np.median(np.diff(phase)))), 1e-9))))
        box = np.ones(min(span, len(scalar)))
        amplitude = np.convolve(-scalar * turn.imag, box, "same") / np.convolve(turn.imag**2, box, "same")
        return y + np.real(coupling[:, None] * amplitude * turn)

    readout.steps.append(step)


def slow_readout(p: Values, u: Array, state: SlowState) -> Array:
    """u + (κ + jη)·2 a_ΦA e^{jφ}/ω."""
    turn, e_A, _, _ = frame(u, state.phase_rad)
    amplitude = np.real(along(state.drive, e_A)[..., 0] / turn)
    coupling = np.array([p["displacement_c"] + 1j * p["velocity_c"], p["displacement_s"] + 1j * p["velocity_s"]])
    return u + coupling * (2 * amplitude * turn / state.mechanics.omega_rad_s)[..., None]


EFFECT = Effect(
    name="drive_feedthrough",
    family="read-out",
    page=__doc__,
    parameters=tuple(
        Parameter(f"{part}_{channel}", "1", 10.0, f"coupling into {channel.upper()} coherent with {part}, in multiples of the drive as force/ω²")
        for part in ("displacement", "velocity")
        for channel in "cs"
    ),
    mistaken_for=("coherent_offset", "parasitic_force"),
    next_experiment="the same forced run with the drive switched off part of the time: feed-through vanishes with the drive, an offset stays",
    readout=readout,
    slow_readout=slow_readout,
)
