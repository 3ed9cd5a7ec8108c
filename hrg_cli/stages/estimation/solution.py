"""The ellipse of every window of a block: the closed form (PHYSICS §0), or an iteration that starts
where a sequential run would have started it (seed B (2)).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...fitting.ellipse.closed_form import choose_canonical, solve_closed_form
from ...fitting.ellipse.gauss_newton import solve_gauss_newton
from ...fitting.ellipse.levenberg_marquardt import solve_levenberg_marquardt
from ...physics.signals import compute_direct_envelopes, from_sidebands
from ...records import Array

ITERATIVE = {"gauss-newton": solve_gauss_newton, "levenberg-marquardt": solve_levenberg_marquardt}
WORSE = 1e-6
"""A solver that ends with a misfit this fraction above the global least one has not converged to
the solution."""


@dataclass(frozen=True)
class SolverSettings:
    """The settings that every block needs; the carrier phase is None where it is estimated."""

    solver: str
    start: str
    carrier_phase_rad: float | None
    tolerance: float
    max_iterations: int


@dataclass(frozen=True)
class LastSolution:
    """What the next block needs of the one before: its last solution x (5), and A₀ of the start
    "fixed"."""

    x: Array
    fixed_amplitude: float


def solve_block(
    signals: Array, direct: bool, how: SolverSettings, last: LastSolution | None
) -> tuple[Array, Array, Array, LastSolution | None]:
    """The ellipse of every window of a block.

    Parameters
    ----------
    signals
        Of the windows, (n, 8) of a carrier's sidebands or (n, 4) of a direct read-out.
    direct
        The read-out is direct.
    how
        The solver's settings.
    last
        What the block before left; None: this is the first one.

    Returns
    -------
    tuple
        x (n, 5) canonical: a_A, a_B, mθ, φ, ψ; rms of the misfit (n,); iterations (n,); what the
        next block needs. Rows that are not finite stay NaN with −1 iterations.

    Examples
    --------
    A line along C of amplitude 2, φ = 0:

    >>> import numpy as np
    >>> from hrg_cli.stages.estimation.solution import SolverSettings, solve_block
    >>> how = SolverSettings("closed-form", "previous", None, 1e-12, 20)
    >>> x, *_ = solve_block(np.array([[2.0, 0.0, 0.0, 0.0]]), True, how, None)
    >>> abs(x.round(9)).tolist()
    [[2.0, 0.0, 0.0, 0.0, 0.0]]
    """
    n = len(signals)
    x, misfit, iterations = np.full((n, 5), np.nan), np.full(n, np.nan), np.full(n, -1, np.int16)
    finite = find_finite(signals)
    if not finite.any():
        return x, misfit, iterations, last
    z = signals if finite.all() else signals[finite]
    if direct:
        u = compute_direct_envelopes(z)
        # Two equal sidebands at ψ = 0 are the direct signals: one solver serves both read-outs.
        z = from_sidebands(u, u)
    best, rms = solve_closed_form(z, how.carrier_phase_rad)
    counts = np.zeros(len(z), np.int16)
    if last is None:
        last = LastSolution(best[0], float(np.median(best[:, 0])))
    if how.solver in ITERATIVE:
        solution = ITERATIVE[how.solver](
            z,
            _choose_starts(best, how.start, last),
            step_tolerance=how.tolerance,
            max_iterations=how.max_iterations,
            carrier_known=how.carrier_phase_rad is not None,
        )
        # The closed form is the global minimum: an iteration that ends above it ended elsewhere. Of
        # a perfect fit the rms is rounding, hence the second term.
        stuck = ~(solution.residual_rms <= rms * (1 + WORSE) + 1e-7 * best[:, 0])
        counts = np.where(stuck, -np.abs(solution.evaluations), solution.evaluations)
        fit, rms = (
            choose_canonical(solution.x, how.carrier_phase_rad is not None),
            solution.residual_rms,
        )
    else:
        fit = best
    rms = np.zeros(len(z)) if direct else rms
    if len(z) == n:
        return fit, rms, counts, LastSolution(best[-1].copy(), last.fixed_amplitude)
    x[finite], misfit[finite], iterations[finite] = fit, rms, counts
    return x, misfit, iterations, LastSolution(best[-1], last.fixed_amplitude)


def find_finite(rows: Array) -> Array:
    """Rows whose values are all finite.

    Their sum is: as a product, several times as fast as a look at each value.

    Parameters
    ----------
    rows
        (n, k).

    Returns
    -------
    ndarray
        (n,) bool.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.estimation.solution import find_finite
    >>> find_finite(np.array([[1.0, 2.0], [np.nan, 0.0], [np.inf, 1.0]])).tolist()
    [True, False, False]
    """
    return np.asarray(np.isfinite(rows @ np.ones(rows.shape[1])))


def _choose_starts(best: Array, start: str, last: LastSolution) -> Array:
    """Start values (n, 5) of an iterating solver.

    "previous" is the solution of the row before. A sequential run would have found it by iterating;
    it is the global minimum, known beforehand as the closed form, so all rows start at once from
    the very values that the sequential run has where it converges.
    """
    if start == "closed-form":
        return best
    previous = np.concatenate([last.x[None], best[:-1]])
    if start == "fixed":
        previous[:, :3] = last.fixed_amplitude, 0.0, 0.0
    return previous
