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


def half_products(theta: Array, phi: Array, psi: Array) -> tuple[Array, ...]:
    """csm, csp, ccm, ccp, ssm, ssp, scm, scp of (2): (cos|sin)θ · (sin|cos)(φ ∓ ψ) / 2."""
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


def amplitudes(z: Array, products: tuple[Array, ...]) -> tuple[Array, Array]:
    """A and B of (2), the exact linear solution at given angles; z (8, n)."""
    z1, z2, z3, z4, z5, z6, z7, z8 = z
    csm, csp, ccm, ccp, ssm, ssp, scm, scp = products
    A = z1 * csm - z2 * csp - z3 * ccm - z4 * ccp + z5 * ssm - z6 * ssp - z7 * scm - z8 * scp
    B = z1 * scm - z2 * scp + z3 * ssm + z4 * ssp - z5 * ccm + z6 * ccp - z7 * csm - z8 * csp
    return A, B


def projections(z: Array, products: tuple[Array, ...]) -> tuple[Array, Array, Array, Array]:
    """The sums of (2) that move the angles: P and Q (θ, φ), and those of ψ that A and B multiply; z
    (8, n)."""
    z1, z2, z3, z4, z5, z6, z7, z8 = z
    csm, csp, ccm, ccp, ssm, ssp, scm, scp = products
    P = -z1 * ssm + z2 * ssp + z3 * scm + z4 * scp + z5 * csm - z6 * csp - z7 * ccm - z8 * ccp
    Q = z1 * ccm - z2 * ccp + z3 * csm + z4 * csp + z5 * scm - z6 * scp + z7 * ssm + z8 * ssp
    psi_A = -z1 * ccm - z2 * ccp - z3 * csm + z4 * csp - z5 * scm - z6 * scp - z7 * ssm + z8 * ssp
    psi_B = z1 * ssm + z2 * ssp - z3 * scm + z4 * scp - z5 * csm - z6 * csp + z7 * ccm - z8 * ccp
    return P, Q, psi_A, psi_B


def model_signals(A: Array, B: Array, products: tuple[Array, ...]) -> Array:
    """F of (1), (8, n), by the half products of the same angles."""
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


def angle_steps(
    A: Array, B: Array, sums: tuple[Array, ...], carrier_known: bool
) -> tuple[Array, Array, Array]:
    """Δθ, Δφ, Δψ of (2)."""
    P, Q, psi_A, psi_B = sums
    # the block of JᵀJ for (θ, φ) has the determinant 4(A² − B²)²; one factor cancels, because Jᵀz is
    # made of the same A and B. At |A| = |B| the orbit is a circle, which has no wave angle.
    determinant, power = A**2 - B**2, A**2 + B**2
    psi_step = np.zeros_like(A) if carrier_known else (A * psi_A + B * psi_B) / power
    return (A * P - B * Q) / determinant, (A * Q - B * P) / determinant, psi_step


def step(z: Array, x: Array, carrier_known: bool = False) -> Array:
    """One iteration of (2): x (n, 5) -> x (n, 5), for signals z (n, 8)."""
    z, (_, _, theta, phi, psi) = z.T, x.T
    products = half_products(theta, phi, psi)
    A, B = amplitudes(z, products)
    d_theta, d_phi, d_psi = angle_steps(A, B, projections(z, products), carrier_known)
    return np.stack([A, B, theta + d_theta, phi + d_phi, psi + d_psi], axis=-1)


def gauss_newton(
    signals: Array,
    start: Array,
    *,
    residual_tolerance: float = 0.0,
    step_tolerance: float = 1e-10,
    max_iterations: int = 60,
    carrier_known: bool = False,
) -> Solution:
    """Iterate (2) from `start` (n, 5) for `signals` (n, 8) until the residual rms or the step is
    small.

    A vector is done when √(Σr²/8) ≤ residual_tolerance, or when the step would change the modelled
    signals by less than step_tolerance of their size (noisy signals have no exact solution).
    Evaluations of the residual are counted, k + 1 for k steps. With `carrier_known` ψ keeps its
    start.
    """
    settings = residual_tolerance, step_tolerance, max_iterations, carrier_known
    return by_chunks(_iterate, signals, start, settings)


Settings = tuple[float, float, int, bool]
"""Tolerances of the residual and of the step, most iterations, whether ψ is known."""


def by_chunks(
    iterate: Callable[[Array, Solution, slice, float, float, int, bool], None],
    signals: Array,
    start: Array,
    settings: Settings,
) -> Solution:
    """What `iterate` makes of the signals, some rows at a time; untouched rows count as failed."""
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

    A loop of its own, not `least_squares.descend`: thousands of windows step at once by formulas (2),
    for which no Jacobian is ever made, and each ends when it is done.
    """
    left = np.arange(rows.start, min(rows.stop, len(signals)))
    z = np.ascontiguousarray(signals[rows].T)
    x = np.ascontiguousarray(out.x[rows].T)
    size = (z**2).sum(0)
    before = np.full(len(left), np.inf)
    for evaluation in range(1, max_iterations + 1):
        products = half_products(*x[2:])
        rms = np.sqrt(((z - model_signals(x[0], x[1], products)) ** 2).sum(0) / 8)
        out.monotone[left] &= ~(rms > before)
        out.residual_rms[left] = rms
        A, B = amplitudes(z, products)
        d_theta, d_phi, d_psi = angle_steps(A, B, projections(z, products), carrier_known)
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
