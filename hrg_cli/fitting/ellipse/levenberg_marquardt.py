"""Levenberg–Marquardt for {A, B, θ, φ, ψ}: the steps of `solve_gauss_newton` damped, so that the
residual never rises.

The angles are stepped, A and B are the exact linear solution at each trial's angles (variable
projection). With the power scale p = |z|²/2 (the greatest A² + B² can be) the damped normal matrix
is [[s+λp, 2AB], [2AB, s+λp]] for (θ, φ), s+λp for ψ, s = A²+B². λ follows Nielsen's rule (Madsen,
Nielsen & Tingleff, Methods for Non-Linear Least Squares Problems, 2004).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .gauss_newton import (
    Solution,
    compute_half_products,
    compute_model_signals,
    compute_projections,
    solve_amplitudes,
    solve_by_chunks,
)

Array = np.ndarray
FIRST_DAMPING = 1e-3


def solve_levenberg_marquardt(
    signals: Array,
    start: Array,
    *,
    residual_tolerance: float = 0.0,
    step_tolerance: float = 1e-10,
    max_iterations: int = 60,
    carrier_known: bool = False,
) -> Solution:
    """Least-squares solutions by damped steps; the residual never rises.

    Parameters
    ----------
    signals, start, residual_tolerance, step_tolerance, max_iterations, carrier_known
        As in `solve_gauss_newton`.

    Returns
    -------
    Solution
        Of all vectors.

    Examples
    --------
    From a start that is far off:

    >>> import numpy as np
    >>> from hrg_cli.fitting.ellipse.closed_form import choose_canonical
    >>> from hrg_cli.fitting.ellipse.levenberg_marquardt import solve_levenberg_marquardt
    >>> from hrg_cli.physics.signals import make_signals
    >>> true = np.array([[1.0, 0.1, 0.3, 0.2, 0.4]])
    >>> found = solve_levenberg_marquardt(make_signals(true), true + [0, 0, 0.6, 0.5, 0.5])
    >>> choose_canonical(found.x).round(6).tolist(), found.monotone.tolist()
    ([[1.0, 0.1, 0.3, 0.2, 0.4]], [True])
    """
    settings = residual_tolerance, step_tolerance, max_iterations, carrier_known
    return solve_by_chunks(_iterate, signals, start, settings)


@dataclass(frozen=True)
class TriedAngles:
    """Angles (3, n) with what follows from them: A and B (2, n), the half products, Σr² (n,)."""

    angles: Array
    AB: Array
    products: tuple[Array, ...]
    cost: Array

    @classmethod
    def from_angles(cls, z: Array, angles: Array) -> TriedAngles:
        """The angles with what follows from them.

        Parameters
        ----------
        z
            Signals (8, n).
        angles
            θ (electrical), φ, ψ (3, n), rad.

        Returns
        -------
        TriedAngles
            With the best A and B at these angles.
        """
        products = compute_half_products(*angles)
        A, B = solve_amplitudes(z, products)
        cost = ((z - compute_model_signals(A, B, products)) ** 2).sum(0)
        return cls(angles, np.stack([A, B]), products, cost)

    def select_windows(self, rows: Array) -> TriedAngles:
        """The same of some of the windows.

        Parameters
        ----------
        rows
            Which, bool or numbers.

        Returns
        -------
        TriedAngles
            Of these.
        """
        products = tuple(p[rows] for p in self.products)
        return TriedAngles(self.angles[:, rows], self.AB[:, rows], products, self.cost[rows])

    def move_to(self, other: TriedAngles, better: Array) -> TriedAngles:
        """The other angles where they are better.

        Parameters
        ----------
        other
            Of the same windows.
        better
            (n,) bool.

        Returns
        -------
        TriedAngles
            Of the same windows.
        """
        pairs = zip(other.products, self.products, strict=True)
        return TriedAngles(
            np.where(better, other.angles, self.angles),
            np.where(better, other.AB, self.AB),
            tuple(np.where(better, new, old) for new, old in pairs),
            np.where(better, other.cost, self.cost),
        )


def _iterate(
    signals: Array,
    out: Solution,
    rows: slice,
    residual_tolerance: float,
    step_tolerance: float,
    max_iterations: int,
    carrier_known: bool,
) -> None:
    # A loop of its own for the reason of `gauss_newton._iterate`: all windows step at once. They
    # leave the arrays as they end, so that a few slow ones cost no more than themselves.
    left = np.arange(rows.start, min(rows.stop, len(signals)))
    z = np.ascontiguousarray(signals[rows].T)
    size = (z**2).sum(0)
    here = TriedAngles.from_angles(z, np.ascontiguousarray(out.x[rows, 2:].T))
    damping, growth = np.full(len(left), FIRST_DAMPING), np.full(len(left), 2.0)
    for evaluation in range(1, max_iterations + 1):
        slope, move = _compute_move(z, here.AB, here.products, damping * size / 2, carrier_known)
        # what the quadratic model says the cost falls by, moveᵀ(λ·move + slope): Nielsen's gain is
        # the fall found over it
        promised = 2 * (move * (damping * size / 2 * move + slope)).sum(0)
        # moveᵀslope is the squared length of the step in the signals: scale-free, as no angle
        # alone is (of a small wave every angle is loose)
        length = 2 * (move * slope).sum(0)
        residual_rms = np.sqrt(here.cost / 8)
        done = (residual_rms <= residual_tolerance) | (length <= step_tolerance**2 * size)
        out.x[left] = np.concatenate([here.AB, here.angles]).T
        out.residual_rms[left] = residual_rms
        out.evaluations[left[done]] = evaluation
        go = ~done
        if not go.any():
            return
        left, z, size, here = left[go], z[:, go], size[go], here.select_windows(go)
        trial = TriedAngles.from_angles(z, here.angles + move[:, go])
        gain = (here.cost - trial.cost) / promised[go]
        better = trial.cost < here.cost
        damping, growth = _adapt_damping(damping[go], growth[go], gain, better)
        here = here.move_to(trial, better)


def _adapt_damping(
    damping: Array, growth: Array, gain: Array, better: Array
) -> tuple[Array, Array]:
    """Nielsen's rule: a step as good as promised (gain 1) divides λ by three; each bad one in a row
    multiplies it by twice as much."""
    lower = damping * np.maximum(1 / 3, 1 - (2 * gain - 1) ** 3)
    return np.where(better, lower, damping * growth), np.where(better, 2.0, 2 * growth)


def _compute_move(
    z: Array, AB: Array, products: tuple[Array, ...], damping: Array, carrier_known: bool
) -> tuple[Array, Array]:
    """Half the fall of the cost along each angle (3, n), and the damped step (JᵀJ + λ)⁻¹ of it.

    The angles θ and φ are coupled by 2AB alone, ψ by nothing: JᵀJ is a 2 × 2 block beside a number,
    inverted in closed form.
    """
    A, B = AB
    P, Q, psi_A, psi_B = compute_projections(z, products)
    slope = np.stack(
        [
            A * P + B * Q,
            A * Q + B * P,
            np.zeros_like(A) if carrier_known else A * psi_A + B * psi_B,
        ]
    )
    damped = A**2 + B**2 + damping
    determinant = damped**2 - (2 * A * B) ** 2
    move = np.stack(
        [
            (damped * slope[0] - 2 * A * B * slope[1]) / determinant,
            (damped * slope[1] - 2 * A * B * slope[0]) / determinant,
            slope[2] / damped,
        ]
    )
    return slope, move
