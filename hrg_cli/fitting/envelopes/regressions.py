"""Pooled weighted least squares of seed A's methods (`seed_a_methods.py`) over the runs' envelopes.

All are linear in the coordinates of `coordinates.py`. What differences and sums over rows of finite
length leave out (x²/6 of what turns by x a row) is found by putting the method's own answer through
its own equations without noise, and is taken off, until neither changes. Standard deviations are
the envelopes' noise carried through the equations (`noise_propagation.py`): what neighbouring
differences share cancels.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..noise import noise_propagation
from .coordinates import COUNT
from .envelope_runs import EnvelopeRun
from .equations import WIDE_STEP, Equations
from .likelihood import Freedom
from .method_ranges import find_refusal, list_warnings
from .seed_a_methods import EXACT, METHODS

Array = np.ndarray
Noiseless = Callable[[Array], list[EnvelopeRun]]
"""Coordinates (7,) -> the runs' rows as a resonator of these coordinates would show them, without
noise."""
CORRECTIONS = 6
"""Times the truncation is found anew at most."""
SETTLED = 0.05
"""Part of a standard deviation by which the last correction may still move an answer."""


@dataclass(frozen=True)
class Regression:
    """Coordinates (7,) with NaN where the method does not give them, covariance (7, 7), and what
    the method has to say about its range."""

    p: Array
    covariance: Array
    warnings: list[str] = field(default_factory=list)
    refused: str = ""
    run_chi2: Array = field(default_factory=lambda: np.zeros(0))
    """Each run's misfit squared over what its windows' stated noise predicts, summed, (R,)."""
    run_rows: Array = field(default_factory=lambda: np.zeros(0))
    """Equations of each run in it, (R,)."""
    unsettled: float = 0.0
    """What the last correction of the truncation moved, in the method's own standard deviations."""
    spread: NoiseSpread | None = None
    """What the envelopes' noise does to the method, where it was carried through its equations."""
    details: dict[str, Any] = field(default_factory=dict)
    """What it tells beside."""


@dataclass(frozen=True)
class WeightedRows:
    """Weighted rows of one run with its own unknowns (frequency, first values) projected off:
    design (N, k), target (N,), the projector's basis (N, c) and the weights (N,).
    """

    design: Array
    target: Array
    own: Array
    weight: Array


def weigh(run: EnvelopeRun, equations: Equations, freedom: Freedom) -> WeightedRows:
    """The regression's rows: the equations themselves, or the running sums of increments.

    Sums are begun anew after a gap: white noise of the envelopes is white in them. The run's own
    unknowns are projected off (Frisch and Waugh 1933), so that the shared ones come out as if all
    were fitted together.

    Parameters
    ----------
    run
        Whose equations they are.
    equations
        Of a method.
    freedom
        The k directions that are fitted.

    Returns
    -------
    WeightedRows
        Design (N, k) and target (N,) over their noise.

    Examples
    --------
    The damping from three rows of −u̇ = ν u, one of them twice as well known:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.equations import Equations
    >>> from hrg_cli.fitting.envelopes.likelihood import free_coordinates
    >>> from hrg_cli.fitting.envelopes.regressions import weigh
    >>> u = np.outer([1.0, 0.8, 0.6], np.eye(7)[0])
    >>> rows = Equations(u, 0.1 * u[:, 0], np.zeros(3), np.array([1.0, 1.0, 2.0]), np.arange(3))
    >>> found = weigh(None, rows, free_coordinates(["damping"], np.zeros(7)))
    >>> found.design[:, 0].round(9).tolist(), found.target.round(9).tolist()
    ([1.0, 0.8, 1.2], [0.1, 0.08, 0.12])
    """
    shared, target, weight = (
        equations.columns @ freedom.directions,
        equations.target - equations.columns @ freedom.origin,
        equations.weight,
    )
    if equations.levels is None:
        own = equations.offset[:, None]
    else:
        # sums, not differences: white noise of the envelopes is white in the sums, and weights are
        # those of single rows (differences would need the whole covariance)
        count = len(equations.levels)
        joined = np.column_stack([shared, target]).reshape(count, len(run) - 1, -1)
        sums = np.concatenate(
            [np.zeros((count, 1, joined.shape[2])), np.cumsum(joined, axis=1)], axis=1
        ).reshape(count * len(run), -1)
        shared, target, weight = sums[:, :-1], sums[:, -1], np.concatenate(equations.levels)
        # the first value of a sum is unknown; after a gap, which no increment bridges, once more
        step = np.diff(run.time_s)
        piece = np.concatenate([[0], np.cumsum(step > WIDE_STEP * np.median(step))])
        group = (np.arange(count)[:, None] * (piece[-1] + 1) + piece).ravel()
        own = (group[:, None] == np.arange(group[-1] + 1)).astype(float)
    own = own * weight[:, None]
    size = np.linalg.norm(own, axis=0)
    # The run's own unknowns are projected off (Frisch and Waugh): the shared ones come out as if
    # all were fitted together.
    basis = np.linalg.qr(own[:, size > 0])[0]
    rows = np.column_stack([shared, target]) * weight[:, None]
    rows = rows - basis @ (basis.T @ rows)
    return WeightedRows(rows[:, :-1], rows[:, -1], basis, weight)


def find_truncation(model: Sequence[EnvelopeRun], p: Array, method: str) -> list[Array]:
    """What the method's differences and sums leave of noiseless runs, equation by equation.

    The approximations of a method are none of it: those of small quadrature are judged by the exact
    equations' differences.

    Parameters
    ----------
    model
        Runs of coordinates p, without noise.
    p
        (7,).
    method
        Its name, as a user gives it.

    Returns
    -------
    list of ndarray
        (N,) of each run.

    Examples
    --------
    Central differences of e^{−νt} over steps of h are too steep by (νh)²/6:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.regressions import find_truncation
    >>> t, p = np.arange(9.0), np.array([0.1, 0, 0, 0, 0, 0, 0])
    >>> u = np.outer(np.exp(-0.1 * t), [1.0, 0j])
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-4, 0 * t, None, 5e3, 2, 1.0)
    >>> left = find_truncation([run], p, "moving-axes")[0][:7]
    >>> round(float((left / u[1:-1, 0].real / 0.1)[4]), 5), round(0.1**2 / 6, 5)
    (0.00167, 0.00167)
    """
    exact = METHODS[EXACT.get(method, method)]
    out = []
    for run in model:
        equations = exact(run)
        out.append(equations.target - equations.columns @ p)
    return out


@dataclass(frozen=True)
class NoiseSpread:
    """What the envelopes' noise does to a method: covariance (k, k) of its coordinates by the
    stated noise, and each run's predicted variance of every misfit."""

    covariance: Array
    variances: list[Array]


def solve(
    runs: Sequence[EnvelopeRun],
    freedom: Freedom,
    method: str,
    eliminate_rate: bool = False,
    model: Noiseless | None = None,
    start: Array | None = None,
    spread: NoiseSpread | None = None,
) -> Regression:
    """Pooled weighted least squares of one method over all runs, its noise carried to the answer.

    The noise's level is the stated one, or what the residuals say where that is more.

    Parameters
    ----------
    runs
        Free ones.
    freedom
        What is fitted.
    method
        Its name, as a user gives it.
    eliminate_rate
        Whether KΩ is replaced by −mθ̇, as published.
    model, start
        Noiseless rows for any coordinates, and the coordinates (7,) at which the truncation is
        first taken from them; None: the equations stay as published.
    spread
        What the noise does, where it is known already, from runs that hardly differ.

    Returns
    -------
    Regression
        Coordinates with NaN where the method does not give them; refused, with the reason, where it
        gives none.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.coordinates import COORDINATES, build_generator
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.likelihood import free_coordinates
    >>> from hrg_cli.fitting.envelopes.regressions import solve
    >>> from hrg_cli.physics.resonator import exponentiate
    >>> t, p = np.arange(0.0, 10.0, 0.05), np.array([0.1, 0.02, 0.01, 0.2, 0.1, 0.3, 0.0])
    >>> u = exponentiate(build_generator(p, 1.0, 3e4), t) @ [1.0, 0.1j]
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-4, t, None, 5e3, 2, 0.05)
    >>> found = solve([run], free_coordinates(COORDINATES[:6], np.zeros(7)), "stokes")
    >>> found.p[:6].round(4).tolist()
    [0.1, 0.02, 0.01, 0.2, 0.1, 0.3]
    """
    reason = find_refusal(runs, method)
    if reason:
        return _none(reason)
    published = [METHODS[method](run, eliminate_rate) for run in runs]
    corrected = model is not None and start is not None and not eliminate_rate
    here = np.zeros(COUNT) if start is None else np.array(start, float)
    left_out = [np.zeros(len(e.target)) for e in published]
    change = 0.0
    for turn in range(CORRECTIONS if corrected else 1):
        if model is not None and corrected:
            left_out = find_truncation(model(here), here, method)
        equations = [
            dataclasses.replace(e, target=e.target - t)
            for e, t in zip(published, left_out, strict=True)
        ]
        solution = _least_squares(runs, equations, freedom)
        if solution is None:
            return _none(f"no row of these runs is one that {method} takes; use likelihood")
        if spread is None or (turn > 1 and change >= SETTLED):
            spread = _spread(runs, equations, left_out, solution, method, eliminate_rate)
        chi2, rows = _misfits(runs, equations, left_out, solution.p, spread, method, eliminate_rate)
        p = solution.p
        covariance = spread.covariance * max(1.0, chi2.sum() / max(1, rows.sum()))
        known = np.isfinite(p) & (np.diag(covariance) > 0)
        change = (
            float(
                np.max(np.abs(p - here)[known] / np.sqrt(np.diag(covariance)[known]), initial=0.0)
            )
            if corrected
            else 0.0
        )
        here = np.where(np.isfinite(p), p, here)
        if change < SETTLED:
            break
    return Regression(
        p,
        covariance,
        list_warnings(runs, method, eliminate_rate),
        run_chi2=chi2,
        run_rows=rows,
        unsettled=change,
        spread=spread,
    )


def _none(reason: str) -> Regression:
    """No answer, and why."""
    return Regression(np.full(COUNT, np.nan), np.full((COUNT, COUNT), np.nan), refused=reason)


@dataclass(frozen=True)
class LinearSolution:
    """Coordinates p (7,), NaN where the equations say nothing; z = inverse (k, N)·targets, p =
    origin + directions (7, k)·z; the rows of every run."""

    p: Array
    inverse: Array
    directions: Array
    parts: list[WeightedRows]


def _least_squares(
    runs: Sequence[EnvelopeRun], equations: Sequence[Equations], freedom: Freedom
) -> LinearSolution | None:
    """The equations' weighted least squares; None where no equation weighs anything."""
    parts = [weigh(run, e, freedom) for run, e in zip(runs, equations, strict=True)]
    design, target = (
        np.concatenate([p.design for p in parts]),
        np.concatenate([p.target for p in parts]),
    )
    scale = np.linalg.norm(design, axis=0)
    used = scale > 0
    if not used.any():
        return None
    matrix = design[:, used] / scale[used]
    U, size, Vt = np.linalg.svd(matrix, full_matrices=False)
    # Directions 1e-8 below the strongest are left at the origin: nothing in the rows fixes them.
    keep = size > 1e-8 * size[0]
    inverse = (Vt[keep].T / size[keep]) @ U[:, keep].T / scale[used, None]
    D = freedom.directions[:, used]
    p = freedom.origin + D @ (inverse @ target)
    p[~(np.abs(D).sum(axis=1) > 0) & (np.abs(freedom.directions).sum(axis=1) > 0)] = np.nan
    return LinearSolution(p, inverse, D, parts)


def _misfit(
    e: Equations, known: Array, p: Array, method: str, eliminate_rate: bool
) -> Callable[[EnvelopeRun], Array]:
    """The misfits (N,) of a run's equations at p, its own frequency taken off, as a function of the
    run's envelopes."""
    p = np.nan_to_num(p)  # no column asks for what a method does not give
    left, own = (e.target - e.columns @ p) * e.weight, e.offset * e.weight
    offset = float(own @ left / (own @ own)) if np.any(own) else 0.0

    def misfit(moved: EnvelopeRun) -> Array:
        trial = METHODS[method](moved, eliminate_rate)
        return trial.target - known - trial.columns @ p - trial.offset * offset

    return misfit


def _spread(
    runs: Sequence[EnvelopeRun],
    equations: Sequence[Equations],
    left_out: Sequence[Array],
    solution: LinearSolution,
    method: str,
    eliminate_rate: bool,
) -> NoiseSpread:
    """The noise of every row of every run carried to the coordinates."""
    total, variances = np.zeros((len(solution.inverse),) * 2), []
    ends = np.cumsum([len(part.target) for part in solution.parts])
    for run, e, known, part, end in zip(
        runs, equations, left_out, solution.parts, ends, strict=True
    ):
        influence = solution.inverse[:, end - len(part.target) : end] * part.weight
        if e.levels is not None:  # an increment moves every sum after it
            nodes = influence.reshape(len(influence), len(e.levels), -1)
            influence = np.cumsum(nodes[:, :, :0:-1], axis=2)[:, :, ::-1].reshape(
                len(influence), -1
            )
        misfit = _misfit(e, known, solution.p, method, eliminate_rate)
        covariance, variance = noise_propagation.propagate_noise(
            run, misfit, e.first, e.reach, influence
        )
        total += covariance
        variances.append(variance)
    return NoiseSpread(solution.directions @ total @ solution.directions.T, variances)


def _misfits(
    runs: Sequence[EnvelopeRun],
    equations: Sequence[Equations],
    left_out: Sequence[Array],
    p: Array,
    spread: NoiseSpread,
    method: str,
    eliminate_rate: bool,
) -> tuple[Array, Array]:
    """Each run's χ² and its number of equations (R,)."""
    chi2, rows = [], []
    for run, e, known, variance in zip(runs, equations, left_out, spread.variances, strict=True):
        seen = variance > 0
        left = _misfit(e, known, p, method, eliminate_rate)(run)
        chi2.append(float(np.sum(left[seen] ** 2 / variance[seen])))
        rows.append(int(seen.sum()))
    return np.array(chi2), np.array(rows)
