"""The drift D of m·dθ/dt = −KΩ + D: seed A (8), (9), the tangent law and the Adams integration,
with the errata of PHYSICS §4.

Angles: χ = 2m(θ − θ_μ), ζ = 2m(θ − θ_ω), r = a_B/a_A. Forces are envelope rates a_ΦA, a_ΦB with
phase errors Δφ_A, Δφ_B; both control terms enter as (a_Φ/a_A)·Δφ.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator
from itertools import islice

import numpy as np

from .resonator import Mechanics

Array = np.ndarray
Angle = float | Array


def _angles(mechanics: Mechanics, wave_angle_rad: Angle) -> tuple[Angle, Angle]:
    m2 = 2 * mechanics.mode_number
    return m2 * (wave_angle_rad - mechanics.damping_axis_rad), m2 * (
        wave_angle_rad - mechanics.stiffness_axis_rad
    )


def compute_drift(
    mechanics: Mechanics,
    wave_angle_rad: Angle,
    ratio: Angle = 0.0,
    quadrature_force: Angle = 0.0,
    main_force: Angle = 0.0,
) -> Array:
    """D of m·dθ/dt = −KΩ + D exactly, for any |r| < 1 (PHYSICS §4 to seed A (8)).

    D = [νδμ sin χ (1 + r²) − 2r δω cos ζ − f_B + r f_A]/(1 − r²), f_A = a_ΦA Δφ_A/a_A, f_B = a_ΦB
    Δφ_B/a_A.

    Parameters
    ----------
    mechanics
        The resonator.
    wave_angle_rad
        θ [rad], (...).
    ratio
        r = a_B/a_A, (...).
    quadrature_force, main_force
        f_B and f_A [1/s], (...).

    Returns
    -------
    ndarray
        D [rad/s], (...).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.drift import compute_drift
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> gyro = Mechanics(1000.0, 0.2, damping_split_1_s=0.01)
    >>> compute_drift(gyro, np.array([0.0, np.pi / 8])).round(6).tolist()
    [0.0, 0.01]
    """
    chi, zeta = _angles(mechanics, wave_angle_rad)
    r = np.asarray(ratio, float)
    damping = mechanics.damping_split_1_s * np.sin(chi) * (1 + r**2)
    return np.asarray(
        (
            damping
            - 2 * r * mechanics.frequency_split_rad_s * np.cos(zeta)
            - quadrature_force
            + r * main_force
        )
        / (1 - r**2)
    )


def compute_quasi_static_quadrature(
    mechanics: Mechanics,
    wave_angle_rad: Angle,
    drive: str = "force",
    quadrature_gain_1_s: float = 0.0,
) -> Array:
    """r once it follows the wave angle: δω sin ζ/λ, seed A after (9).

    λ is that of `compute_quadrature_decay`.

    For νt ≫ 1, δω ≪ ν and a wave that moves slowly against ν only.

    Parameters
    ----------
    mechanics
        The resonator.
    wave_angle_rad
        θ [rad], (...).
    drive
        "free", "force" or "parametric".
    quadrature_gain_1_s
        k_q of the quadrature loop.

    Returns
    -------
    ndarray
        r, (...).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.drift import compute_quasi_static_quadrature
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> gyro = Mechanics(1000.0, 0.2, frequency_split_rad_s=0.01)
    >>> round(float(compute_quasi_static_quadrature(gyro, np.pi / 8)), 6)
    0.05
    """
    _, zeta = _angles(mechanics, wave_angle_rad)
    return np.asarray(
        mechanics.frequency_split_rad_s
        * np.sin(zeta)
        / compute_quadrature_decay(mechanics, drive, quadrature_gain_1_s)
    )


def compute_quasi_static_drift(
    mechanics: Mechanics,
    wave_angle_rad: Angle,
    drive: str = "force",
    quadrature_gain_1_s: float = 0.0,
) -> Array:
    """D with the quasi-static quadrature: νδμ sin χ − (δω²/λ) sin 2ζ.

    Seed A (9); half of its second term with a parametric drive (PHYSICS M3p).

    Parameters
    ----------
    mechanics
        The resonator.
    wave_angle_rad
        θ [rad], (...).
    drive
        "free", "force" or "parametric".
    quadrature_gain_1_s
        k_q of the quadrature loop.

    Returns
    -------
    ndarray
        D [rad/s], (...).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.drift import compute_quasi_static_drift
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> gyro = Mechanics(1000.0, 0.2, frequency_split_rad_s=0.01)
    >>> round(float(compute_quasi_static_drift(gyro, np.pi / 16)), 6)
    -0.0005
    """
    chi, zeta = _angles(mechanics, wave_angle_rad)
    split = mechanics.frequency_split_rad_s**2 / compute_quadrature_decay(
        mechanics, drive, quadrature_gain_1_s
    )
    return np.asarray(mechanics.damping_split_1_s * np.sin(chi) - split * np.sin(2 * zeta))


def bound_drift(
    mechanics: Mechanics, drive: str = "force", quadrature_gain_1_s: float = 0.0
) -> Array:
    """D_max = νδμ + δω²/λ (seed A after the tangent law), λ of `compute_quadrature_decay`.

    Parameters
    ----------
    mechanics
        The resonator.
    drive
        "free", "force" or "parametric".
    quadrature_gain_1_s
        k_q of the quadrature loop.

    Returns
    -------
    ndarray
        rad/s; a bound where δω ≪ λ.

    Examples
    --------
    >>> from hrg_cli.physics.drift import bound_drift
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> gyro = Mechanics(1000.0, 0.2, damping_split_1_s=0.01, frequency_split_rad_s=0.01)
    >>> round(float(bound_drift(gyro)), 6)
    0.0105
    """
    split = np.square(mechanics.frequency_split_rad_s) / compute_quadrature_decay(
        mechanics, drive, quadrature_gain_1_s
    )
    return np.asarray(np.abs(mechanics.damping_split_1_s) + split)


def compute_quadrature_decay(
    mechanics: Mechanics, drive: str = "force", quadrature_gain_1_s: float = 0.0
) -> float:
    """λ that holds the quadrature back: ν of a force drive, 2ν of a parametric one, whose pump
    damps B (PHYSICS M3p), plus the loop's gain.

    In a free run-down r grows as δω sin ζ·t unchecked (PHYSICS M2); ν then stands for the growth
    until one time constant.

    Parameters
    ----------
    mechanics
        The resonator.
    drive
        "free", "force" or "parametric".
    quadrature_gain_1_s
        k_q of the quadrature loop.

    Returns
    -------
    float
        λ [1/s].

    Raises
    ------
    ValueError
        Another drive.

    Examples
    --------
    >>> from hrg_cli.physics.drift import compute_quadrature_decay
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> compute_quadrature_decay(Mechanics(1000.0, 0.2), "parametric", 1.0)
    1.4
    """
    if drive not in ("free", "force", "parametric"):
        raise ValueError(f'drive is "free", "force" or "parametric", not {drive!r}')
    return mechanics.damping_rate_1_s * (2 if drive == "parametric" else 1) + quadrature_gain_1_s


def find_settled_quadrature(
    mechanics: Mechanics,
    wave_angle_rad: Angle,
    drive: str = "force",
    quadrature_gain_1_s: float = 0.0,
) -> Array:
    """r at which `compute_quadrature_rate` vanishes at a fixed angle, for any split.

    Force: δω sin ζ/(ν − νδμ cos χ + k_q); a value beyond 1 says that there is none. Parametric:
    δω_s(1 − r²) = 2νr, so r = δω_s/(ν + √(ν² + δω_s²)), δω_s = δω sin ζ (PHYSICS §4).

    Parameters
    ----------
    mechanics
        The resonator.
    wave_angle_rad
        θ [rad], (...).
    drive
        "force" or "parametric".
    quadrature_gain_1_s
        k_q of the quadrature loop.

    Returns
    -------
    ndarray
        r, (...).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.drift import find_settled_quadrature
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> gyro = Mechanics(1000.0, 0.2, frequency_split_rad_s=0.15)
    >>> found = [find_settled_quadrature(gyro, np.pi / 8, d) for d in ("force", "parametric")]
    >>> [round(float(one), 4) for one in found]
    [0.75, 0.3333]
    """
    chi, zeta = _angles(mechanics, wave_angle_rad)
    nu, along = mechanics.damping_rate_1_s, mechanics.frequency_split_rad_s * np.sin(zeta)
    if drive == "parametric":
        return np.asarray(along / (nu + np.sqrt(nu**2 + along**2)))
    return np.asarray(
        along / (nu - mechanics.damping_split_1_s * np.cos(chi) + quadrature_gain_1_s)
    )


def compute_quadrature_rate(
    mechanics: Mechanics,
    wave_angle_rad: Angle,
    ratio: Angle,
    drive: str = "force",
    quadrature_gain_1_s: float = 0.0,
) -> Array:
    """dr/dt: the first two of seed A (7) divided, exact in r.

    a_A falls freely: δω_s(1 + r²) + 2νδμ cos χ·r; is held by a force along it: δω_s − (ν_B + k_q)
    r; or is pumped, p = ν_A + δω_s r: δω_s(1 − r²) − 2νr (PHYSICS M3p).

    Parameters
    ----------
    mechanics
        The resonator.
    wave_angle_rad
        θ [rad], (...).
    ratio
        r, (...).
    drive
        "free", "force" or "parametric".
    quadrature_gain_1_s
        k_q of the quadrature loop, which a force drive has.

    Returns
    -------
    ndarray
        1/s, (...).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.drift import compute_quadrature_rate
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> gyro = Mechanics(1000.0, 0.2, frequency_split_rad_s=0.01)
    >>> [round(float(compute_quadrature_rate(gyro, np.pi / 8, r)), 6) for r in (0.0, 0.1)]
    [0.01, -0.01]
    """
    chi, zeta = _angles(mechanics, wave_angle_rad)
    r, along = np.asarray(ratio, float), mechanics.frequency_split_rad_s * np.sin(zeta)
    friction = mechanics.damping_split_1_s * np.cos(chi)
    if drive == "free":
        return np.asarray(along * (1 + r**2) + 2 * friction * r)
    if drive == "parametric":
        return np.asarray(along * (1 - r**2) - 2 * mechanics.damping_rate_1_s * r)
    return np.asarray(along - (mechanics.damping_rate_1_s - friction + quadrature_gain_1_s) * r)


def make_motion(
    mechanics: Mechanics, rate_rad_s: float, drive: str, quadrature_gain_1_s: float = 0.0
) -> Callable[[float, Array], Array]:
    """The motion of angle and quadrature: m·dθ/dt = −KΩ + D(θ, r) with `compute_quadrature_rate`.

    Parameters
    ----------
    mechanics
        The resonator.
    rate_rad_s
        Ω.
    drive
        "free", "force" or "parametric".
    quadrature_gain_1_s
        k_q of the quadrature loop.

    Returns
    -------
    callable
        (t, (θ, r)) -> d(θ, r)/dt, as `integrate_by_adams` takes it; θ and r of one shape.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.drift import make_motion
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> motion = make_motion(Mechanics(1000.0, 0.2, scale_factor=0.5), 1.0, "free")
    >>> motion(0.0, np.zeros(2)).tolist()
    [-0.25, 0.0]
    """

    def slope(_: float, state: Array) -> Array:
        angle, r = state
        swing = compute_drift(mechanics, angle, r) - mechanics.scale_factor * rate_rad_s
        return np.stack(
            np.broadcast_arrays(
                swing / mechanics.mode_number,
                compute_quadrature_rate(mechanics, angle, r, drive, quadrature_gain_1_s),
            )
        )

    return slope


def follow_tangent_law(mechanics: Mechanics, start_rad: float, time_s: Angle) -> Array:
    """θ(t) at rest with damping split alone: tan m(θ − θ_μ) = tan m(θ₀ − θ_μ)·e^{2νδμ t}.

    Seed A, after (10), where the constant is omitted. The axis at θ_μ + π/2m, of least damping,
    attracts.

    Parameters
    ----------
    mechanics
        The resonator.
    start_rad
        θ₀.
    time_s
        t [s], (...).

    Returns
    -------
    ndarray
        θ [rad], (...), continuous in t.

    Examples
    --------
    >>> import math
    >>> from hrg_cli.physics.drift import follow_tangent_law
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> found = follow_tangent_law(Mechanics(1000.0, 0.2, damping_split_1_s=0.1), 0.1, 100.0)
    >>> round(float(found) / (math.pi / 4), 6)
    1.0
    """
    m = mechanics.mode_number
    offset = m * (start_rad - mechanics.damping_axis_rad)
    turns = np.round(offset / np.pi)
    efolds = 2 * mechanics.damping_split_1_s * np.asarray(time_s, float)
    growth = np.exp(np.minimum(efolds, 700.0))  # long there by then
    angle = np.arctan2(np.sin(offset - np.pi * turns) * growth, np.cos(offset - np.pi * turns))
    return np.asarray(mechanics.damping_axis_rad + (angle + np.pi * turns) / m)


def integrate_by_adams(
    rate: Callable[[float, Array], Array], start: Angle, step_s: float, steps: int
) -> Array:
    """The solution of dy/dt = f(t, y) at even times by `step_by_adams`.

    Parameters
    ----------
    rate
        f: (t, y) -> dy/dt.
    start
        y(0), of any shape.
    step_s
        Δt.
    steps
        How many.

    Returns
    -------
    ndarray
        y (steps + 1, ...), from y(0).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.drift import integrate_by_adams
    >>> round(float(integrate_by_adams(lambda t, y: -y, 1.0, 0.01, 100)[-1]), 8)
    0.36787944
    """
    first = np.asarray(start, float)
    return np.stack([first, *islice(step_by_adams(rate, first, step_s), steps)])


def step_by_adams(
    rate: Callable[[float, Array], Array], start: Array, step_s: float
) -> Iterator[Array]:
    """y after each step by the explicit four-point Adams method, error O(step⁴).

    y₄ = y₃ + Δt(55f₃ − 59f₂ + 37f₁ − 9f₀)/24 (seed A, after (10)); the first three steps by
    Runge–Kutta, which needs no slopes before the start.

    Parameters
    ----------
    rate
        f: (t, y) -> dy/dt.
    start
        y(0), of any shape.
    step_s
        Δt.

    Returns
    -------
    iterator of ndarray
        y at Δt, 2Δt, …, without end.

    Examples
    --------
    >>> from itertools import islice
    >>> import numpy as np
    >>> from hrg_cli.physics.drift import step_by_adams
    >>> steps = step_by_adams(lambda t, y: 2 * t, np.zeros(()), 1.0)
    >>> [round(float(y), 6) for y in islice(steps, 4)]
    [1.0, 4.0, 9.0, 16.0]
    """
    y, k = np.asarray(start, float), 0
    slopes: deque[Array] = deque(maxlen=4)
    while True:
        t = k * step_s
        slopes.append(np.asarray(rate(t, y)))
        if len(slopes) < 4:
            k1 = slopes[-1]
            k2 = rate(t + step_s / 2, y + step_s / 2 * k1)
            k3 = rate(t + step_s / 2, y + step_s / 2 * k2)
            k4 = rate(t + step_s, y + step_s * k3)
            y = y + step_s * (k1 + 2 * k2 + 2 * k3 + k4) / 6
        else:
            f0, f1, f2, f3 = slopes
            y = y + step_s * (55 * f3 - 59 * f2 + 37 * f1 - 9 * f0) / 24
        k += 1
        yield y
