"""Quadrature loop of finite gain.

Physics: a proportional loop drives the quadrature by −k_q a_B and leaves r = δω sin ζ/(ν + k_q)
standing.
Equation: the e_B component of u is damped by k_q; D = −δω² sin 2ζ/(ν + k_q)   (PHYSICS C6).
Size: 1 … 100 1/s.
Mistaken for: damping split of second order (8θ). What separates it: a sweep of the gain.
"""

from ..physics.plant import Control, SlowState
from .effect import Array, Effect, Parameter, Values, find_frame, project


def control(p: Values, control: Control) -> None:
    """A proportional loop of gain k_q."""
    if p["gain_1_s"] > 0:
        control.quadrature_loop = "finite"
        control.quadrature_gain_1_s = p["gain_1_s"]


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """−k_q (u·e_B) e_B while the drive is on."""
    e_B = find_frame(u, state.phase_rad)[2]
    return -p["gain_1_s"] * state.forced[..., None] * project(u, e_B) * e_B


EFFECT = Effect(
    name="finite_quadrature_gain",
    family="control",
    page=__doc__,
    parameters=(Parameter("gain_1_s", "s-1", 1.0, "gain k_q of the loop", minimum=0.0),),
    mistaken_for=("damping split",),
    next_experiment="the same forced run at two gains of the quadrature loop",
    control=control,
    slow=slow,
    in_the_log="quadrature_drive",
    shown_by=("drive",),
)
