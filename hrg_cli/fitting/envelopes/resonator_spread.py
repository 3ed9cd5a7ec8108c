"""What a resonator's covariance means for anything computed from it: the resonator moved along each
of its uncertain directions.

The splits are moved as vectors (cos, sin) of 2mθ, in which their errors are normal even where a
split is lost in noise. With f± = f(x ± σe) along each principal direction e of the covariance and
f₀ = f(x),
    var f = Σ (f₊ − f₋)²/4 + (f₊ + f₋ − 2f₀)²/2
is exact for linear functions and for squares (Nørgaard et al., Automatica 36, 2000): δω² has a
standard deviation even at δω = 0.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...physics.resonator import OF_GENERATOR, Mechanics
from ...records import Resonator
from ...records.details import details_number
from .coordinates import SPLITS

Array = np.ndarray
CLEAR = 3.0
"""Standard deviations from which a split's axis has the deviation of its own slope; below, both
components have that of the size, where a resonator does not state them."""
UNIFORM = 0.999
"""Part of a uniform axis's deviation from which the stated one says that nothing is known of it."""


def mechanics_of(resonator: Resonator, scale_factor: float | None = None) -> Mechanics:
    """The resonator's values; a scale factor that it lacks is taken from `scale_factor`, else 0
    (then there is no input rate)."""
    given = {name: value for name, (value, _, _) in resonator.parameters().items()}
    factor = scale_factor if scale_factor is not None else given.get("scale_factor", 0.0)
    return Mechanics(
        given["frequency_hz"],
        given["damping_rate_1_s"],
        given.get("damping_split_1_s", 0.0),
        given.get("damping_axis_rad", 0.0),
        given.get("frequency_split_rad_s", 0.0),
        given.get("stiffness_axis_rad", 0.0),
        factor,
        resonator.mode_number,
    )


def vector_of(mechanics: Mechanics) -> Array:
    """(ν, νδμ cos 2mθ_μ, νδμ sin 2mθ_μ, δω cos 2mθ_ω, δω sin 2mθ_ω, K) (6,)."""
    a, b = (
        2 * mechanics.mode_number * mechanics.damping_axis_rad,
        2 * mechanics.mode_number * mechanics.stiffness_axis_rad,
    )
    nu, mu, split = (
        mechanics.damping_rate_1_s,
        mechanics.damping_split_1_s,
        mechanics.frequency_split_rad_s,
    )
    return np.array(
        [
            nu,
            mu * np.cos(a),
            mu * np.sin(a),
            split * np.cos(b),
            split * np.sin(b),
            mechanics.scale_factor,
        ]
    )


def from_vector(x: Array, mechanics: Mechanics) -> Mechanics:
    """The resonator of vectors x (..., 6), its fields of shape (..., 1): they broadcast over angles
    along the last axis."""
    nu, mc, ms, wc, ws, factor = np.moveaxis(np.asarray(x, float)[..., None], -2, 0)
    m2 = 2 * mechanics.mode_number
    return replace(
        mechanics,
        damping_rate_1_s=nu,
        damping_split_1_s=np.hypot(mc, ms),
        damping_axis_rad=np.arctan2(ms, mc) / m2,
        frequency_split_rad_s=np.hypot(wc, ws),
        stiffness_axis_rad=np.arctan2(ws, wc) / m2,
        scale_factor=factor,
    )


def slope_covariance(resonator: Resonator) -> Array:
    """Covariance of the resonator's parameters with its axes as the slopes of their splits make
    them: what anything computed from it moves with.

    The stated deviation of an axis whose split is lost in noise tells how far the axis may lie off
    (`inference.widen_axes`) and would move the split as a vector by more than its noise. The stated
    components give the slope's back: their variances add up to the size's and the tangent's.
    """
    values = resonator.parameters()
    names = [str(n) for n in resonator.name]
    narrower = np.ones(len(names))
    for size, axis, components in SPLITS:
        if not {size, axis} <= set(values):
            continue
        lever = 2 * resonator.mode_number * abs(values[size][0])
        stated = lever * values[axis][1]
        slope = stated
        trace = _stated_trace(resonator, components)
        if trace is not None:
            slope = np.sqrt(max(0.0, trace - values[size][1] ** 2))
        elif values[axis][1] >= UNIFORM * np.pi / resonator.mode_number / np.sqrt(12):
            slope = values[size][1]
        if slope > 0 and 0 < stated < np.inf:
            narrower[names.index(axis)] = slope / stated
    return np.asarray(np.outer(narrower, narrower) * np.asarray(resonator.covariance, float))


def _stated_trace(resonator: Resonator, components: tuple[str, ...]) -> float | None:
    """Sum of the variances of a split's components where the resonator states them."""
    stds = [
        details_number(resonator.details, "split_components", name, "std", default=-1.0)
        for name in components
    ]
    return float(np.sum(np.square(stds))) if min(stds) >= 0 else None


def vector_covariance(resonator: Resonator) -> Array:
    """Covariance (6, 6) of the vector; what the resonator does not hold, or holds without a finite
    deviation, counts as known."""
    m = resonator.mode_number
    values = resonator.parameters()
    order = [name for name in OF_GENERATOR if name in values and np.isfinite(values[name][1])]
    at = [[str(n) for n in resonator.name].index(name) for name in order]
    covariance = slope_covariance(resonator)[np.ix_(at, at)]
    J = np.zeros((6, len(order)))
    for column, name in enumerate(order):
        for row, slope in _slopes(name, values, m):
            J[row, column] = slope
    moved = J @ covariance @ J.T
    for (size, axis, components), first in zip(SPLITS, (1, 3), strict=True):
        if not {size, axis} <= set(order) or _stated_trace(resonator, components) is not None:
            continue
        if abs(values[size][0]) < CLEAR * values[size][1]:
            tangent2 = (2 * m * values[size][0]) ** 2 * covariance[
                order.index(axis), order.index(axis)
            ]
            moved[first : first + 2] = 0.0
            moved[:, first : first + 2] = 0.0
            moved[first, first] = moved[first + 1, first + 1] = max(values[size][1] ** 2, tangent2)
    return moved


def _slopes(
    name: str, values: dict[str, tuple[float, float, str]], m: int
) -> list[tuple[int, float]]:
    """Row and derivative of the vector by one parameter."""
    if name == "damping_rate_1_s":
        return [(0, 1.0)]
    if name == "scale_factor":
        return [(5, 1.0)]
    first = 1 if name.startswith("damping") else 3
    size = values.get(
        "damping_split_1_s" if first == 1 else "frequency_split_rad_s", (0.0, 0.0, "")
    )[0]
    angle = (
        2
        * m
        * values.get("damping_axis_rad" if first == 1 else "stiffness_axis_rad", (0.0, 0.0, ""))[0]
    )
    if name.endswith("axis_rad"):
        return [(first, -2 * m * size * np.sin(angle)), (first + 1, 2 * m * size * np.cos(angle))]
    return [(first, float(np.cos(angle))), (first + 1, float(np.sin(angle)))]


def spread_points(x: Array, covariance: Array) -> Array:
    """x (k,), then x ± σe along every principal direction of its covariance (k, k), (1 + 2k, k)."""
    size, direction = np.linalg.eigh((covariance + covariance.T) / 2)
    step = (direction * np.sqrt(np.maximum(size, 0.0))).T
    return np.concatenate([x[None], x + step, x - step])


def deviation(values: Array) -> Array:
    """Standard deviation of f from its values (1 + 2k, ...) at the vectors of `spread_points`."""
    half = (len(values) - 1) // 2
    plus, minus, centre = values[1 : 1 + half], values[1 + half :], values[0]
    return np.asarray(
        np.sqrt(np.sum((plus - minus) ** 2 / 4 + (plus + minus - 2 * centre) ** 2 / 2, axis=0))
    )
