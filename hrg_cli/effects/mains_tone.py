"""A tone of the mains (or of any other machine) in the channels.

Physics: an interference at a fixed frequency f_m is added to both channels; near the resonance it
beats in the envelopes.
Equation: C += Re[e_C e^{jω_m t}], so u_m = u + e e^{j(ω_m − ω_r)t}, e complex (C, S)   (PHYSICS R16).
Size: 1e-6 … 1e-3 of the amplitude. Mistaken for: nothing in the slow model, as long as it is not at
the resonance. What separates it: the residual's spectrum; the line stays when the temperature moves
the resonance.
"""

import numpy as np

from ..physics.plant import Readout, Samples, SlowState
from .effect import Array, Effect, Parameter, Values


def _read_vector(p: Values) -> Array:
    """e = e_cos − j e_sin, complex (2,)."""
    return np.array([p["c_cos"] - 1j * p["c_sin"], p["s_cos"] - 1j * p["s_sin"]])


def readout(p: Values, readout: Readout) -> None:
    """y + Re[e e^{jω_m t}]."""
    e, omega = _read_vector(p), 2 * np.pi * p["frequency_hz"]

    def step(block: Samples, y: Array) -> Array:
        return y + np.real(e[:, None] * np.exp(1j * omega * block.time_s))

    readout.steps.append(step)


def slow_readout(p: Values, u: Array, state: SlowState) -> Array:
    """u + e e^{j(ω_m − ω_r)t}."""
    beat = np.exp(
        1j * (2 * np.pi * p["frequency_hz"] - state.omega_r_rad_s) * np.asarray(state.time_s)
    )
    return u + _read_vector(p) * beat[..., None]


EFFECT = Effect(
    name="mains_tone",
    family="read-out",
    page=__doc__,
    parameters=(
        *(
            Parameter(
                f"{channel}_{part}",
                "amplitude",
                1e-4,
                f"tone in {channel.upper()}, {part} part",
                amplitude_power=1,
            )
            for channel in "cs"
            for part in ("cos", "sin")
        ),
        Parameter("frequency_hz", "Hz", 50.0, "frequency of the tone", fitted=False, required=True),
    ),
    mistaken_for=(),
    next_experiment="the same run at another temperature: the resonance moves, the tone does not",
    readout=readout,
    slow_readout=slow_readout,
    seen_in="waveform",
    makes_tone=True,
)
