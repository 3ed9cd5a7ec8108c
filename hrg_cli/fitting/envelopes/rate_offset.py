"""One unknown constant rate common to all runs, added to what their logs say: Ω = Ω_log + Ω₀,
fitted beside the resonator.

The generator is L(p, Ω_log) + K·Ω₀·J. For a given Ω₀ the likelihood is the ordinary one with the
table angle turned by Ω₀·t more; the step of Ω₀ comes from the joint least squares over the runs'
own unknowns, the coordinates and Ω₀, so that σ and the covariance of the others hold Ω₀'s own
uncertainty.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..least_squares import invert_information
from .base_fit import fit_base_model
from .base_freedom import Known
from .coordinates import SCALE_FACTOR
from .envelope_runs import EnvelopeRun, turn_table
from .likelihood import Fit
from .response import stack_reals

Array = np.ndarray
STEPS = 12
SETTLED = 0.02
"""Part of a standard deviation by which the last step may still move the offset."""
DISTINCT = 1e-4
"""Part of the offset's own information that must be left beside the other unknowns for it to be
told from them."""


@dataclass(frozen=True)
class RateOffset:
    """The fit at the offset, Ω₀ and its standard deviation at the nominal noise [rad/s], what the
    other coordinates' covariance gains by it (k, k), the part of its information left beside them,
    and whether it settled.
    """

    fit: Fit
    value: float
    std: float
    beside: Array
    distinct: float
    converged: bool


def fit_rate_offset(
    runs: Sequence[EnvelopeRun], known: Known, blocks: int, start_rad_s: float = 0.0
) -> RateOffset:
    """The common offset of the runs' logged rates, fitted beside the resonator.

    Parameters
    ----------
    runs
        With the table turn that their logs say.
    known
        What is held of the resonator, K where it is known.
    blocks
        Rows to which each run is averaged.
    start_rad_s
        First guess of the offset.

    Returns
    -------
    RateOffset
        The fit at the offset, its standard deviation, and what the others' covariance gains by it.

    Raises
    ------
    HrgError
        Nothing can be fitted.

    Examples
    --------
    Two run-downs at 1 and −1 rad/s whose log misses 0.01 rad/s:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.base_freedom import Known
    >>> from hrg_cli.fitting.envelopes.coordinates import build_generator
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.rate_offset import fit_rate_offset
    >>> t, p, runs = np.arange(0.0, 10.0, 0.05), np.array([0.1, 0.02, 0.01, 0.2, 0.1, 0.3, 1.0]), []
    >>> for rate in (1.0, -1.0):
    ...     grow, mode = np.linalg.eig(build_generator(p, rate + 0.01, 2 * np.pi * 5e3))
    ...     u = (mode * np.exp(np.outer(t, grow))[:, None]) @ np.linalg.solve(mode, [1.0, 0.1j])
    ...     runs.append(EnvelopeRun("", t, u, 0 * t + 1e-4, rate * t, None, 5e3, 2, 0.05))
    >>> found = fit_rate_offset(runs, Known(), 100)
    >>> found.converged, round(found.value, 5)
    (True, 0.01)
    """
    # No `least_squares.descend`: a point here is a whole fit of the other unknowns, which has come
    # down already, and the step holds them free. Halving it would cost a fit each; steps that grow
    # are bounded instead.
    value, before = start_rad_s, np.inf
    for _ in range(STEPS):
        fit = fit_base_model([turn_table(r, value) for r in runs], known, blocks)
        step, std, beside, distinct = _step(fit)
        if not np.isfinite(step) or distinct < DISTINCT:
            break
        if abs(step) < SETTLED * std:
            return RateOffset(fit, value + step, std, beside, distinct, True)
        if abs(step) > before:  # farther than the last step: beyond where the slope holds
            step = float(np.sign(step)) * before / 2
        value, before = value + step, abs(step)
    return RateOffset(fit, value, std, beside, distinct, False)


def _step(fit: Fit) -> tuple[float, float, Array, float]:
    """Gauss–Newton step of the offset, its standard deviation, cov(z) it adds (k, k), and the part
    of its information left to it."""
    information, gradient, alone = _normal_equations(fit)
    k = len(fit.freedom.names)
    inverse = invert_information(information)
    variance = float(inverse[k, k])
    if not (variance > 0 and alone > 0):
        return float("nan"), float("inf"), np.zeros((k, k)), 0.0
    # Ω₀ free widens the others by var(Ω₀) times how far they move with it
    along = inverse[:k, k] / variance
    return (
        float(inverse[k] @ gradient),
        float(np.sqrt(variance)),
        variance * np.outer(along, along),
        1 / (variance * alone),
    )


def _normal_equations(fit: Fit) -> tuple[Array, Array, float]:
    """(information (k + 1, k + 1), gradient (k + 1,)) of the coordinates and, last, of Ω₀, the
    runs' own unknowns taken out; and what Ω₀ would have of information if all else were known."""
    response, freedom = fit.response, fit.freedom
    data = response.batch
    # KΩ₀ turns the wave at every instant of a row: the same shape at its ends and its middle
    shape = np.full((1, *data.step_s.shape), response.state.p[SCALE_FACTOR])
    turning = response.find_turning_sensitivity(shape, shape, shape)
    along = freedom.project(response.find_coordinate_sensitivities())
    columns = data.whiten(np.concatenate([along, turning], axis=0))
    own, residual = data.whiten(response.find_run_sensitivities()), response.compute_residual()
    k = len(freedom.names)
    prior = np.where(np.isfinite(freedom.prior_std), freedom.prior_std, np.inf) ** -2.0
    information = np.diag(np.append(prior, 0.0))
    gradient = np.append(prior * (freedom.prior_mean - fit.z), 0.0)
    alone = 0.0
    for run, record in enumerate(data.runs):
        n = len(record)
        # frequency and first values of each run are projected off (Frisch and Waugh 1933)
        Q, _ = np.linalg.qr(stack_reals(own[:, run, :n]))
        design = stack_reals(columns[:, run, :n])
        alone += float(design[:, k] @ design[:, k])
        design = design - Q @ (Q.T @ design)
        r = residual[run, :n].ravel()
        information += design.T @ design
        gradient += design.T @ np.concatenate([r.real, r.imag])
    return information, gradient, alone
