"""Offset of the demodulated signals: leakage of the loop's reference at the oscillation's own
frequency.

Physics: the reference that follows the wave's phase leaks into the pick-off; the envelopes get a
constant vector e, coherent with φ.
Equation: u_m = u + e e^{jφ}, e complex (C, S); δθ = Re(e·e_B)/(m a), δr = −Im(e·e_B)/a   (PHYSICS R10).
Size: 1e-6 … 1e-4 of the amplitude. Mistaken for: drive feed-through. What separates it: a
ring-down, in which its angle error grows as 1/a, e^{+νt}.
"""

import numpy as np

from ..physics.plant import Readout, Samples, SlowState
from .effect import Array, Effect, Parameter, Values, find_frame, follow_phase


def _read_vector(p: Values) -> Array:
    """e, complex (2,)."""
    return np.array(
        [p["in_phase_c"] + 1j * p["quadrature_c"], p["in_phase_s"] + 1j * p["quadrature_s"]]
    )


def readout(p: Values, readout: Readout) -> None:
    """y + Re[e·e^{j(φ+ωt)}], the phase taken from displacement and velocity and followed from block
    to block."""
    e, last = _read_vector(p), list[Array]()

    def step(block: Samples, y: Array) -> Array:
        w = (block.z - 1j * block.v_over_omega).T
        phase = follow_phase(w, last)
        return y + np.real(e[:, None] * np.exp(1j * phase))

    readout.steps.append(step)


def slow_readout(p: Values, u: Array, state: SlowState) -> Array:
    """u + e e^{jφ}."""
    return u + _read_vector(p) * find_frame(u, state.phase_rad)[0][..., None]


EFFECT = Effect(
    name="coherent_offset",
    family="read-out",
    page=__doc__,
    parameters=tuple(
        Parameter(
            f"{part}_{channel}",
            "amplitude",
            1e-4,
            f"offset of {channel.upper()}, {part.replace('_', ' ')}",
            amplitude_power=1,
        )
        for part in ("in_phase", "quadrature")
        for channel in "cs"
    ),
    mistaken_for=("drive_feedthrough", "parasitic_force"),
    next_experiment=(
        "a long ring-down: the offset's angle error grows as the amplitude falls; feed-through is"
        " absent there"
    ),
    readout=readout,
    slow_readout=slow_readout,
    coherent=True,
)
