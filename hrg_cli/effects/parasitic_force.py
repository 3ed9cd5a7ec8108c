"""Constant parasitic force, coherent with the wave's phase.

Physics: leakage into a forcer, or base vibration coherent with the wave, pushes along a fixed
direction.
Equation: u' += f e^{jφ}, f complex (C, S); mθ̇ = Re(f·e_B)/a, ṙ = −Im(f·e_B)/a   (PHYSICS C11).
A drive's leakage ends with the drive; a reference that goes on beside it (a phase-locked loop's
oscillator on the forcers) pushes in free runs, too: in_free_runs = 1.
Size: 1e-4 ν a. Mistaken for: coherent offset and feed-through (angle errors; this is an error of
the rate, independent of Ω). What separates it: a free run, where it grows as 1/a, and two rates of
rotation.
"""

from collections.abc import Sequence

import numpy as np

from ..physics.plant import Control, SlowState
from .effect import IN_FREE_RUNS, Array, Effect, Parameter, Runs, Values, find_frame


def _read_vector(p: Values) -> Array:
    """f, complex (2,)."""
    return np.array(
        [
            p["in_phase_c_1_s"] + 1j * p["quadrature_c_1_s"],
            p["in_phase_s_1_s"] + 1j * p["quadrature_s_1_s"],
        ]
    )


def control(p: Values, control: Control) -> None:
    """f; in a free run beside a drive whose commands are replayed, and are nought."""
    control.parasitic_force = control.parasitic_force + _read_vector(p)
    if p[IN_FREE_RUNS] and not control.forced:
        control.forced, control.log = True, np.zeros((1, 3))


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """f e^{jφ} while the drive is on, or always."""
    acting = np.where(p[IN_FREE_RUNS], 1.0, state.forced)
    return _read_vector(p) * (acting * find_frame(u, state.phase_rad)[0])[..., None]


def list_cases(_: Runs) -> Sequence[Values]:
    """With the drive alone, and always."""
    return ({}, {IN_FREE_RUNS: 1.0})


EFFECT = Effect(
    name="parasitic_force",
    family="control",
    page=__doc__,
    parameters=(
        *(
            Parameter(
                f"{part}_{channel}_1_s",
                "amplitude s-1",
                3e-4,
                f"force on {channel.upper()}, {part.replace('_', ' ')}",
                amplitude_power=1,
            )
            for part in ("in_phase", "quadrature")
            for channel in "cs"
        ),
        Parameter(IN_FREE_RUNS, "1", 0.0, "1: it pushes in free runs, too", fitted=False),
    ),
    mistaken_for=("coherent_offset", "drive_feedthrough"),
    next_experiment=(
        "the forced run at two rates and a free ring-down: a force changes the rate, an offset the"
        " angle"
    ),
    control=control,
    slow=slow,
    coherent=True,
    shown_by=("drive",),
    starts=list_cases,
)
