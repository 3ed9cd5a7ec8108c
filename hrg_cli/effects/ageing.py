"""Ageing: frequency and damping split that drift in time.

Physics: coating, mount and stress relax; frequency and damping split change in proportion to time.
Equation: φ̇ = ω α_t t, νδμ R(2mθ_μ) → … + t (m_c R(0) + m_s R(π/2)), t from the run's start or, over a
programme whose runs say when they began, from the first run's   (PHYSICS M12).
Size: 0.1 … 10 % per year; the parameters are per second. Mistaken for: temperature on one ramp,
cubic stiffness in a ring-down. What separates it: the same calibration repeated; a thermal cycle.
"""

from collections.abc import Sequence

import numpy as np

from ..physics.plant import Environment, Plant, SlowState
from ..physics.resonator import split_matrix
from .effect import Array, Effect, Parameter, Runs, Values

SINCE_FIRST = "since_first_run"


def plant(p: Values, plant: Plant, env: Environment) -> None:
    """ω (1 + α_t t), N += t (m_c R(0) + m_s R(π/2))."""
    t = env.time_s + p[SINCE_FIRST] * env.begun_s
    split = split_matrix(p["split_cos_1_s2"], p["split_sin_1_s2"])
    plant.stiffness = plant.retune_stiffness(p["frequency_1_s"] * t)
    plant.damping = plant.damping + t[:, None, None] * split


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """t (jω α_t − m_c R(0) − m_s R(π/2)) u."""
    t = state.time_s + p[SINCE_FIRST] * state.begun_s
    return np.asarray(t)[..., None] * slow_rate(p, u, state)


def slow_rate(p: Values, u: Array, state: SlowState) -> Array:
    """(jω α_t − m_c R(0) − m_s R(π/2)) u: while the frequency moves, aω^½ stays."""
    split = split_matrix(p["split_cos_1_s2"], p["split_sin_1_s2"])
    return 1j * state.mechanics.omega_rad_s * p["frequency_1_s"] * u - u @ split


def list_origins(runs: Runs) -> Sequence[Values]:
    """Time from every run's start, and from the first one's where the runs say when they began.

    Parameters
    ----------
    runs
        Measured.

    Returns
    -------
    sequence of dict
        One or two starts.

    Examples
    --------
    >>> import numpy as np
    >>> from types import SimpleNamespace
    >>> from hrg_cli.effects.ageing import list_origins
    >>> list_origins(SimpleNamespace(begun_s=np.array([0.0, 3600.0])))
    [{'since_first_run': 0.0}, {'since_first_run': 1.0}]
    """
    known = runs.begun_s is not None and np.ptp(runs.begun_s) > 0
    return [{SINCE_FIRST: origin} for origin in ((0.0, 1.0) if known else (0.0,))]


EFFECT = Effect(
    name="ageing",
    family="bench",
    page=__doc__,
    parameters=(
        Parameter("frequency_1_s", "s-1", 1e-7, "relative drift of the frequency per second"),
        Parameter("split_cos_1_s2", "s-2", 5e-4, "drift of νδμ cos 2mθ_μ per second"),
        Parameter("split_sin_1_s2", "s-2", 5e-4, "drift of νδμ sin 2mθ_μ per second"),
        Parameter(
            SINCE_FIRST,
            "1",
            1.0,
            "1: time counts from the start of the programme's first run; 0: from each run's own",
            fitted=False,
        ),
    ),
    mistaken_for=("thermal_frequency", "cubic_stiffness"),
    next_experiment="the same runs repeated later at the same temperatures, or a thermal cycle",
    plant=plant,
    slow=slow,
    slow_rate=slow_rate,
    starts=list_origins,
)
