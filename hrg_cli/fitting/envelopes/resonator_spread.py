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
from ...records.details import read_details_number
from .coordinates import SPLITS

Array = np.ndarray
CLEAR = 3.0
"""Standard deviations from which a split's axis has the deviation of its own slope; below, both
components have that of the size, where a resonator does not state them."""
UNIFORM = 0.999
"""Part of a uniform axis's deviation from which the stated one says that nothing is known of it."""


def make_mechanics(resonator: Resonator, scale_factor: float | None = None) -> Mechanics:
    """A resonator's values.

    Parameters
    ----------
    resonator
        With frequency and damping at least; splits that it lacks are 0.
    scale_factor
        K that is taken whatever the resonator holds; None: its own, 0 where it has none (then there
        is no input rate).

    Returns
    -------
    Mechanics
        Without uncertainty.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Resonator
    >>> from hrg_cli.fitting.envelopes.resonator_spread import make_mechanics
    >>> held = dict(
    ...     name=np.array(["frequency_hz", "damping_rate_1_s"]), units=np.array(["Hz", "s-1"])
    ... )
    >>> found = Resonator(
    ...     value=np.array([1000.0, 0.2]), std=np.zeros(2), covariance=np.eye(2), **held
    ... )
    >>> make_mechanics(found).scale_factor, make_mechanics(found, 0.55).scale_factor
    (0.0, 0.55)
    """
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


def make_vector(mechanics: Mechanics) -> Array:
    """A resonator as a vector in which errors are normal, even of splits that are lost in noise.

    Parameters
    ----------
    mechanics
        The resonator.

    Returns
    -------
    ndarray
        (ν, νδμ cos 2mθ_μ, νδμ sin 2mθ_μ, δω cos 2mθ_ω, δω sin 2mθ_ω, K), (6,).

    Examples
    --------
    >>> from hrg_cli.fitting.envelopes.resonator_spread import make_vector
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> make_vector(Mechanics(1000.0, 0.2, 0.01)).tolist()
    [0.2, 0.01, 0.0, 0.0, 0.0, 0.55]
    """
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
    """Resonators of vectors, whose fields broadcast over angles along the last axis.

    Parameters
    ----------
    x
        (..., 6), as `make_vector` has them.
    mechanics
        What the vector does not hold: frequency and mode number.

    Returns
    -------
    Mechanics
        Its fields (..., 1).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.resonator_spread import from_vector, make_vector
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> gyro = Mechanics(1000.0, 0.2, 0.01, 0.1)
    >>> bool(np.isclose(from_vector(make_vector(gyro), gyro).damping_axis_rad[0], 0.1))
    True
    """
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


def compute_slope_covariance(resonator: Resonator) -> Array:
    """Covariance of a resonator's parameters with its axes as the slopes of their splits make them:
    what anything computed from it moves with.

    The stated deviation of an axis whose split is lost in noise tells how far the axis may lie off
    (`inference.widen_axes`) and would move the split as a vector by more than its noise, and so
    would what an error across a split adds to its size. The stated components give the slopes'
    back: their variances add up to the size's and the tangent's.

    Parameters
    ----------
    resonator
        With k parameters.

    Returns
    -------
    ndarray
        (k, k), in the parameters' order and units.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Resonator
    >>> from hrg_cli.fitting.envelopes.resonator_spread import compute_slope_covariance
    >>> held = dict(name=np.array(["damping_rate_1_s"]), units=np.array(["s-1"]), value=np.ones(1))
    >>> compute_slope_covariance(Resonator(std=np.ones(1), covariance=np.eye(1), **held)).tolist()
    [[1.0]]
    """
    values = resonator.parameters()
    names = [str(n) for n in resonator.name]
    narrower, more = np.ones(len(names)), np.zeros(len(names))
    for size, axis, components in SPLITS:
        if not {size, axis} <= set(values):
            continue
        # the split points along 2mθ: an axis off by dθ moves it across itself by 2m·size·dθ
        lever = 2 * resonator.mode_number * abs(values[size][0])
        stated = lever * values[axis][1]
        slope = stated
        trace = _stated_trace(resonator, components)
        along = read_details_number(resonator.details, "split_slope_std", size, default=-1.0)
        along = values[size][1] if along < 0 else min(along, values[size][1])
        more[names.index(size)] = values[size][1] ** 2 - along**2
        if trace is not None:
            # both components' variances are those along and across the split, whatever its axis
            slope = np.sqrt(max(0.0, trace - along**2))
        elif values[axis][1] >= UNIFORM * np.pi / resonator.mode_number / np.sqrt(12):
            # any axis is as likely: across, the split is known no better than along
            slope = values[size][1]
        if slope > 0 and 0 < stated < np.inf:
            narrower[names.index(axis)] = slope / stated
    covariance = np.asarray(resonator.covariance, float) - np.diag(more)
    return np.asarray(np.outer(narrower, narrower) * covariance)


def _stated_trace(resonator: Resonator, components: tuple[str, ...]) -> float | None:
    """Sum of the variances of a split's components where the resonator states them."""
    stds = [
        read_details_number(resonator.details, "split_components", name, "std", default=-1.0)
        for name in components
    ]
    return float(np.sum(np.square(stds))) if min(stds) >= 0 else None


def compute_vector_covariance(resonator: Resonator) -> Array:
    """Covariance of `make_vector` a resonator.

    Parameters
    ----------
    resonator
        What it does not hold, or holds without a finite deviation, counts as known.

    Returns
    -------
    ndarray
        (6, 6).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Resonator
    >>> from hrg_cli.fitting.envelopes.resonator_spread import compute_vector_covariance
    >>> held = dict(name=np.array(["damping_rate_1_s"]), units=np.array(["s-1"]), value=np.ones(1))
    >>> found = Resonator(std=np.array([0.5]), covariance=np.array([[0.25]]), **held)
    >>> np.diag(compute_vector_covariance(found)).tolist()
    [0.25, 0.0, 0.0, 0.0, 0.0, 0.0]
    """
    m = resonator.mode_number
    values = resonator.parameters()
    order = [name for name in OF_GENERATOR if name in values and np.isfinite(values[name][1])]
    at = [[str(n) for n in resonator.name].index(name) for name in order]
    covariance = compute_slope_covariance(resonator)[np.ix_(at, at)]
    J = np.zeros((6, len(order)))
    for column, name in enumerate(order):
        for row, slope in _slopes(name, values, m):
            J[row, column] = slope
    moved = J @ covariance @ J.T
    for (size, axis, components), first in zip(SPLITS, (1, 3), strict=True):
        if not {size, axis} <= set(order) or _stated_trace(resonator, components) is not None:
            continue
        # a split within its noise points nowhere: either component has the size's deviation, or the
        # tangent's where that is more
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
    """x, then x ± σe along every principal direction of its covariance.

    Parameters
    ----------
    x
        (k,).
    covariance
        (k, k).

    Returns
    -------
    ndarray
        (1 + 2k, k): x, all x + σe, all x − σe.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.resonator_spread import spread_points
    >>> spread_points(np.array([1.0]), np.array([[0.25]])).ravel().tolist()
    [1.0, 1.5, 0.5]
    """
    # rounding may leave a covariance of lower rank an eigenvalue just below 0
    size, direction = np.linalg.eigh((covariance + covariance.T) / 2)
    step = (direction * np.sqrt(np.maximum(size, 0.0))).T
    return np.concatenate([x[None], x + step, x - step])


def find_deviation(values: Array) -> Array:
    """Standard deviation of f from its values at the vectors of `spread_points` (Nørgaard 2000).

    Parameters
    ----------
    values
        f there, (1 + 2k, ...).

    Returns
    -------
    ndarray
        (...), exact for linear functions and for squares.

    Examples
    --------
    x² at x = 0 with σ = 1 has the standard deviation √2:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.resonator_spread import find_deviation, spread_points
    >>> round(float(find_deviation(spread_points(np.zeros(1), np.eye(1)) ** 2)[0]) ** 2, 9)
    2.0
    """
    half = (len(values) - 1) // 2
    plus, minus, centre = values[1 : 1 + half], values[1 + half :], values[0]
    # f₊ − f₋ = 2f'σ and f₊ + f₋ − 2f₀ = f''σ²: var(f'x) = f'²σ², var(½f''x²) = ½f''²σ⁴ of a normal
    # x
    return np.asarray(
        np.sqrt(np.sum((plus - minus) ** 2 / 4 + (plus + minus - 2 * centre) ** 2 / 2, axis=0))
    )
