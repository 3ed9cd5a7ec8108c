"""Gauss–Newton iteration of seed B for {A, B, θ, φ, ψ} by its explicit formulas (2), many vectors
at once.

F's columns obey JᵀJ = 2·diag(1, 1, [[A²+B², 2AB], [2AB, A²+B²]], A²+B²), and F is orthogonal to its
angle columns, so that the signals themselves take the place of the residual. A and B are solved
first, at the old angles; then the three angles step together with the fresh A and B. So the start x
= 0, where J is singular, is allowed (this is Kaufman's variable projection step).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

Array = np.ndarray
CHUNK_ROWS = 8192


@dataclass(frozen=True)
class Solution:
    """Where each vector's iteration ended.

    x (n, 5); residual_rms (n) = √(Σr²/8) of the last evaluated point; evaluations (n) of the
    residual, negative where the iteration did not converge; monotone (n): the residual never rose.
    """

    x: Array
    residual_rms: Array
    evaluations: Array
    monotone: Array


def compute_half_products(theta: Array, phi: Array, psi: Array) -> tuple[Array, ...]:
    """Half products csm, csp, ccm, ccp, ssm, ssp, scm, scp of (2): (cos|sin)θ · (sin|cos)(φ ∓ ψ) /
    2.

    Parameters
    ----------
    theta, phi, psi
        θ (electrical), φ, ψ (n,), rad.

    Returns
    -------
    tuple of ndarray
        Eight, (n,) each.

    Examples
    --------
    At θ = 0 those of sin θ vanish:

    >>> import numpy as np
    >>> from hrg_cli.fitting.ellipse.gauss_newton import compute_half_products
    >>> products = compute_half_products(np.zeros(1), np.full(1, np.pi / 3), np.zeros(1))
    >>> [round(float(one[0]), 4) for one in products]
    [0.433, 0.433, 0.25, 0.25, 0.0, 0.0, 0.0, 0.0]
    """
    cos, sin = np.cos(theta) / 2, np.sin(theta) / 2
    sin_m, cos_m, sin_p, cos_p = (
        np.sin(phi - psi),
        np.cos(phi - psi),
        np.sin(phi + psi),
        np.cos(phi + psi),
    )
    return (
        cos * sin_m,
        cos * sin_p,
        cos * cos_m,
        cos * cos_p,
        sin * sin_m,
        sin * sin_p,
        sin * cos_m,
        sin * cos_p,
    )


def solve_amplitudes(z: Array, products: tuple[Array, ...]) -> tuple[Array, Array]:
    """A and B of (2), the exact linear solution at given angles.

    Parameters
    ----------
    z
        Signals (8, n).
    products
        Half products of the angles.

    Returns
    -------
    A : ndarray
        (n,), unit of the signals.
    B : ndarray
        (n,).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.ellipse.gauss_newton import compute_half_products, solve_amplitudes
    >>> from hrg_cli.physics.signals import make_signals
    >>> x = np.array([[1.0, 0.1, 0.3, 0.2, 0.4]])
    >>> A, B = solve_amplitudes(make_signals(x).T, compute_half_products(*x.T[2:]))
    >>> A.round(9).tolist(), B.round(9).tolist()
    ([1.0], [0.1])
    """
    z1, z2, z3, z4, z5, z6, z7, z8 = z
    csm, csp, ccm, ccp, ssm, ssp, scm, scp = products
    A = z1 * csm - z2 * csp - z3 * ccm - z4 * ccp + z5 * ssm - z6 * ssp - z7 * scm - z8 * scp
    B = z1 * scm - z2 * scp + z3 * ssm + z4 * ssp - z5 * ccm + z6 * ccp - z7 * csm - z8 * csp
    return A, B


def compute_projections(z: Array, products: tuple[Array, ...]) -> tuple[Array, Array, Array, Array]:
    """Sums of (2) that move the angles.

    Parameters
    ----------
    z
        Signals (8, n).
    products
        Half products of the angles.

    Returns
    -------
    tuple of ndarray
        P and Q, which move θ and φ, and those that A and B multiply in the step of ψ, (n,) each.

    Examples
    --------
    At the signals' own angles nothing moves:

    >>> import numpy as np
    >>> from hrg_cli.fitting.ellipse.gauss_newton import (
    ...     compute_angle_steps, compute_half_products, compute_projections,
    ... )
    >>> from hrg_cli.physics.signals import make_signals
    >>> x = np.array([[1.0, 0.1, 0.3, 0.2, 0.4]])
    >>> sums = compute_projections(make_signals(x).T, compute_half_products(*x.T[2:]))
    >>> steps = compute_angle_steps(x[:, 0], x[:, 1], sums, False)
    >>> bool(np.abs(steps).max() < 1e-15)
    True
    """
    z1, z2, z3, z4, z5, z6, z7, z8 = z
    csm, csp, ccm, ccp, ssm, ssp, scm, scp = products
    P = -z1 * ssm + z2 * ssp + z3 * scm + z4 * scp + z5 * csm - z6 * csp - z7 * ccm - z8 * ccp
    Q = z1 * ccm - z2 * ccp + z3 * csm + z4 * csp + z5 * scm - z6 * scp + z7 * ssm + z8 * ssp
    psi_A = -z1 * ccm - z2 * ccp - z3 * csm + z4 * csp - z5 * scm - z6 * scp - z7 * ssm + z8 * ssp
    psi_B = z1 * ssm + z2 * ssp - z3 * scm + z4 * scp - z5 * csm - z6 * csp + z7 * ccm - z8 * ccp
    return P, Q, psi_A, psi_B


def compute_model_signals(A: Array, B: Array, products: tuple[Array, ...]) -> Array:
    """Signals F of (1), by the half products of the same angles.

    Parameters
    ----------
    A, B
        Semi-axes (n,).
    products
        Half products of the angles.

    Returns
    -------
    ndarray
        (8, n).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.ellipse.gauss_newton import (
    ...     compute_half_products,
    ...     compute_model_signals,
    ... )
    >>> from hrg_cli.physics.signals import make_signals
    >>> x = np.array([[1.0, 0.1, 0.3, 0.2, 0.4]])
    >>> made = compute_model_signals(x[:, 0], x[:, 1], compute_half_products(*x.T[2:]))
    >>> bool(np.abs(made.T - make_signals(x)).max() < 1e-15)
    True
    """
    csm, csp, ccm, ccp, ssm, ssp, scm, scp = products
    A, B = 2 * A, 2 * B
    return np.stack(
        [
            A * csm + B * scm,
            -A * csp - B * scp,
            -A * ccm + B * ssm,
            -A * ccp + B * ssp,
            A * ssm - B * ccm,
            -A * ssp + B * ccp,
            -A * scm - B * csm,
            -A * scp - B * csp,
        ]
    )


def compute_angle_steps(
    A: Array, B: Array, sums: tuple[Array, ...], carrier_known: bool
) -> tuple[Array, Array, Array]:
    """Steps Δθ, Δφ, Δψ of (2).

    Δθ = (A P − B Q)/(A² − B²), Δφ = (A Q − B P)/(A² − B²), Δψ = (A ψ_A + B ψ_B)/(A² + B²).

    Parameters
    ----------
    A, B
        Semi-axes (n,).
    sums
        P, Q, ψ_A, ψ_B (n,) of `compute_projections`.
    carrier_known
        Whether ψ keeps its value.

    Returns
    -------
    tuple of ndarray
        (n,) each, rad.

    Examples
    --------
    A straight wave whose angle is off by 0.01 rad:

    >>> import numpy as np
    >>> from hrg_cli.fitting.ellipse.gauss_newton import (
    ...     compute_angle_steps, compute_half_products, compute_projections,
    ... )
    >>> from hrg_cli.physics.signals import make_signals
    >>> x = np.array([[1.0, 0.0, 0.3, 0.2, 0.4]])
    >>> off = compute_half_products(x[:, 2] - 0.01, x[:, 3], x[:, 4])
    >>> sums = compute_projections(make_signals(x).T, off)
    >>> steps = compute_angle_steps(x[:, 0], x[:, 1], sums, False)
    >>> [round(float(one[0]), 5) + 0.0 for one in steps]
    [0.01, 0.0, 0.0]
    """
    P, Q, psi_A, psi_B = sums
    # the block of JᵀJ for (θ, φ) has the determinant 4(A² − B²)²; one factor cancels, because Jᵀz
    # is made of the same A and B. At |A| = |B| the orbit is a circle, which has no wave angle.
    determinant, power = A**2 - B**2, A**2 + B**2
    psi_step = np.zeros_like(A) if carrier_known else (A * psi_A + B * psi_B) / power
    return (A * P - B * Q) / determinant, (A * Q - B * P) / determinant, psi_step


def make_step(z: Array, x: Array, carrier_known: bool = False) -> Array:
    """One iteration of (2): A and B at the old angles, the angles with the fresh A and B.

    Parameters
    ----------
    z
        Signals (n, 8).
    x
        A, B, θ (electrical), φ, ψ (n, 5).
    carrier_known
        Whether ψ keeps its value.

    Returns
    -------
    ndarray
        (n, 5).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.ellipse.gauss_newton import make_step
    >>> from hrg_cli.physics.signals import make_signals
    >>> true = np.array([[1.0, 0.1, 0.3, 0.2, 0.4]])
    >>> x = true + [0, 0, 0.1, 0.1, 0.1]
    >>> for _ in range(2):
    ...     x = make_step(make_signals(true), x)
    ...     print(f"{np.abs(x - true).max():.0e}")
    2e-02
    2e-06
    """
    z, (_, _, theta, phi, psi) = z.T, x.T
    products = compute_half_products(theta, phi, psi)
    A, B = solve_amplitudes(z, products)
    d_theta, d_phi, d_psi = compute_angle_steps(
        A, B, compute_projections(z, products), carrier_known
    )
    return np.stack([A, B, theta + d_theta, phi + d_phi, psi + d_psi], axis=-1)


def solve_gauss_newton(
    signals: Array,
    start: Array,
    *,
    residual_tolerance: float = 0.0,
    step_tolerance: float = 1e-10,
    max_iterations: int = 60,
    carrier_known: bool = False,
) -> Solution:
    """Iterate (2) until the residual rms or the step is small.

    A vector is done when √(Σr²/8) ≤ residual_tolerance, or when the step would change the modelled
    signals by less than step_tolerance of their size (noisy signals have no exact solution).
    Evaluations of the residual are counted, k + 1 for k steps.

    Parameters
    ----------
    signals
        Of both channels' side bands (n, 8).
    start
        A, B, θ (electrical), φ, ψ (n, 5).
    residual_tolerance
        Unit of the signals.
    step_tolerance
        Part of the signals.
    max_iterations
        Evaluations of the residual at most.
    carrier_known
        Whether ψ keeps its start.

    Returns
    -------
    Solution
        Of all vectors.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.ellipse.gauss_newton import solve_gauss_newton
    >>> from hrg_cli.physics.signals import make_signals
    >>> true = np.array([[1.0, 0.1, 0.3, 0.2, 0.4]])
    >>> found = solve_gauss_newton(make_signals(true), true + [0, 0, 0.1, 0.1, 0.1])
    >>> found.x.round(9).tolist(), found.evaluations.tolist()
    ([[1.0, 0.1, 0.3, 0.2, 0.4]], [4])
    """
    settings = residual_tolerance, step_tolerance, max_iterations, carrier_known
    return solve_by_chunks(_iterate, signals, start, settings)


Settings = tuple[float, float, int, bool]
"""Tolerances of the residual and of the step, most iterations, whether ψ is known."""


def solve_by_chunks(
    iterate: Callable[[Array, Solution, slice, float, float, int, bool], None],
    signals: Array,
    start: Array,
    settings: Settings,
) -> Solution:
    """What an iteration makes of the signals, some rows at a time.

    Parameters
    ----------
    iterate
        Writes its solutions of some rows into the arrays of a `Solution`.
    signals
        Of both channels' side bands (n, 8).
    start
        A, B, θ (electrical), φ, ψ (n, 5).
    settings
        Of the iteration, handed on.

    Returns
    -------
    Solution
        Rows that the iteration does not touch count as failed.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.ellipse.gauss_newton import solve_by_chunks
    >>> def give_up(signals, out, rows, *settings):
    ...     pass
    >>> found = solve_by_chunks(give_up, np.ones((2, 8)), np.zeros((2, 5)), (0.0, 1e-10, 60, False))
    >>> found.evaluations.tolist()
    [-60, -60]
    """
    rows, most = len(signals), settings[2]
    solution = Solution(
        np.array(start, float),
        np.full(rows, np.nan),
        np.full(rows, -most, np.int16),
        np.ones(rows, bool),
    )
    with np.errstate(all="ignore"):
        for first in range(0, rows, CHUNK_ROWS):
            iterate(signals, solution, slice(first, first + CHUNK_ROWS), *settings)
    return solution


def _iterate(
    signals: Array,
    out: Solution,
    rows: slice,
    residual_tolerance: float,
    step_tolerance: float,
    max_iterations: int,
    carrier_known: bool,
) -> None:
    """One chunk; vectors that are done leave the working arrays.

    A loop of its own, not `least_squares.descend`: thousands of windows step at once by formulas
    (2), for which no Jacobian is ever made, and each ends when it is done.
    """
    left = np.arange(rows.start, min(rows.stop, len(signals)))
    z = np.ascontiguousarray(signals[rows].T)
    x = np.ascontiguousarray(out.x[rows].T)
    size = (z**2).sum(0)
    before = np.full(len(left), np.inf)
    for evaluation in range(1, max_iterations + 1):
        products = compute_half_products(*x[2:])
        rms = np.sqrt(((z - compute_model_signals(x[0], x[1], products)) ** 2).sum(0) / 8)
        out.monotone[left] &= ~(rms > before)
        out.residual_rms[left] = rms
        A, B = solve_amplitudes(z, products)
        d_theta, d_phi, d_psi = compute_angle_steps(
            A, B, compute_projections(z, products), carrier_known
        )
        power = A**2 + B**2
        # |J·step|² = 2·moved, by the JᵀJ at the head of this file: by how much the step changes the
        # modelled signals, to first order
        moved = (
            (A - x[0]) ** 2
            + (B - x[1]) ** 2
            + power * (d_theta**2 + d_phi**2 + d_psi**2)
            + 4 * A * B * d_theta * d_phi
        )
        done = (rms <= residual_tolerance) | (2 * np.abs(moved) <= step_tolerance**2 * size)
        out.x[left] = x.T
        out.evaluations[left[done]] = evaluation
        go = ~done
        if not go.any():
            return
        x = np.stack([A, B, x[2] + d_theta, x[3] + d_phi, x[4] + d_psi])[:, go]
        left, z, size, before = left[go], z[:, go], size[go], rms[go]
