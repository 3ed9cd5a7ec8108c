"""Ageing: frequency and damping split that drift in time.

Physics: coating, mount and stress relax; frequency and damping split change in proportion to time.
Equation: φ̇ = ω α_t t, νδμ R(2mθ_μ) → … + t (m_c R(0) + m_s R(π/2)) + t²(e_c R(0) + e_s R(π/2)), the
bend e being −β²νδμ/2 along the split where its axis turns by β a second, t from the run's start or, over a
programme whose runs say when they began, from the first run's   (PHYSICS M12).
Size: 0.1 … 10 % per year; the parameters are per second. Mistaken for: temperature on one ramp,
cubic stiffness in a ring-down. What separates it: the same calibration repeated; a thermal cycle.
"""

from collections.abc import Sequence

import numpy as np

from ..physics.plant import Environment, Plant, SlowState
from ..physics.resonator import Mechanics
from .bent_laws import make_bend, read_split
from .effect import Array, Effect, Parameter, Runs, Values, size_bend

SINCE_FIRST = "since_first_run"
SLOPE = ("split_cos_1_s2", "split_sin_1_s2")
"""Names of the slope's components."""
BEND = ("split_cos_1_s3", "split_sin_1_s3")
"""Names of the components of the split's bend."""


def plant(p: Values, plant: Plant, env: Environment) -> None:
    """ω (1 + α_t t), N += t (m_c R(0) + m_s R(π/2)) + t² (e_c R(0) + e_s R(π/2))."""
    t = env.time_s + p[SINCE_FIRST] * env.begun_s
    plant.stiffness = plant.retune_stiffness(p["frequency_1_s"] * t)
    t = t[:, None, None]
    plant.damping = plant.damping + t * (read_split(p, SLOPE) + t * read_split(p, BEND))


def slow(p: Values, u: Array, state: SlowState) -> Array:
    """t (jω α_t − m_c R(0) − m_s R(π/2)) u − t² (e_c R(0) + e_s R(π/2)) u."""
    t = np.asarray(state.time_s + p[SINCE_FIRST] * state.begun_s)[..., None]
    pulled = 1j * state.mechanics.omega_rad_s * p["frequency_1_s"] * u
    return t * (pulled - u @ read_split(p, SLOPE) - t * (u @ read_split(p, BEND)))


def slow_rate(p: Values, u: Array, state: SlowState) -> Array:
    """(jω α_t − m_c R(0) − m_s R(π/2)) u − 2t (e_c R(0) + e_s R(π/2)) u: while the frequency moves,
    aω^½ stays."""
    t = np.asarray(state.time_s + p[SINCE_FIRST] * state.begun_s)[..., None]
    pulled = 1j * state.mechanics.omega_rad_s * p["frequency_1_s"] * u
    return pulled - u @ read_split(p, SLOPE) - 2 * t * (u @ read_split(p, BEND))


def size_next_order(p: Values, mechanics: Mechanics) -> dict[str, float]:
    """|m|²/2νδμ of either component of the split's bend: that of a turn, or of a growth in
    proportion.

    Parameters
    ----------
    p
        Values of the effect's parameters.
    mechanics
        The linear resonator.

    Returns
    -------
    dict
        [1/s³].

    Examples
    --------
    >>> from hrg_cli.effects.ageing import size_next_order
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> gyro = Mechanics(5000.0, 1.0, damping_split_1_s=0.1)
    >>> size_next_order({"split_cos_1_s2": 0.0, "split_sin_1_s2": 0.01}, gyro)
    {'split_cos_1_s3': 0.0005, 'split_sin_1_s3': 0.0005}
    """
    slope = float(np.hypot(p[SLOPE[0]], p[SLOPE[1]]))
    return dict.fromkeys(BEND, size_bend(slope, mechanics.damping_split_1_s))


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
        Parameter(SLOPE[0], "s-2", 5e-4, "drift of νδμ cos 2mθ_μ per second"),
        Parameter(SLOPE[1], "s-2", 5e-4, "drift of νδμ sin 2mθ_μ per second"),
        make_bend(BEND[0], "s-3", 1e-5, "bend of νδμ cos 2mθ_μ per second squared"),
        make_bend(BEND[1], "s-3", 1e-5, "bend of νδμ sin 2mθ_μ per second squared"),
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
    size_next_order=size_next_order,
    starts=list_origins,
)
