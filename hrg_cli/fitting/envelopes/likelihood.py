"""The likelihood of free runs: every run's envelopes by the exact slow model, all runs batched,
Gauss–Newton with nuisances eliminated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ..least_squares import StepTaken, descend, fit_columns, invert_scaled
from . import coordinates
from .coordinates import COUNT
from .response import Batch, Response, State, make_batch, respond

__all__ = [
    "Batch",
    "Fit",
    "Freedom",
    "eliminate_nuisances",
    "fit",
    "free_coordinates",
    "make_batch",
    "triangularise",
]

Array = np.ndarray
CONVERGED = 1e-3
"""Fall of χ² still to come, in units of χ²/dof, that is left."""
FURTHER = 2
"""Orders of the runs' phases beyond the fitted ones whose gain every step tells."""


@dataclass(frozen=True)
class Freedom:
    """What is fitted: p = origin + directions @ z, with an optional Gaussian prior (mean, std) a
    direction (std inf: none)."""

    names: tuple[str, ...]
    origin: Array
    directions: Array
    prior_mean: Array
    prior_std: Array

    def locate(self, p: Array) -> Array:
        """The z (k,) of the point that lies nearest to coordinates p (7,)."""
        return fit_columns(self.directions, p - self.origin)

    def project(self, columns: Array) -> Array:
        """Sensitivities along the directions (k, ...) from those along the first coordinates (6 or
        7, ...)."""
        part = self.directions[: len(columns)]
        rows, single = np.argmax(part, axis=0), np.count_nonzero(part, axis=0) == 1
        if np.all(single & (part.max(axis=0) == 1)):
            return columns[rows]  # coordinates themselves, which need no sums
        return np.tensordot(part.T, columns, 1)


@dataclass(frozen=True)
class Fit:
    """The optimum: state, upper-triangular square root of the information on z with the runs'
    nuisances eliminated, χ² and its freedom."""

    freedom: Freedom
    response: Response
    z: Array
    root: Array  # R with information RᵀR, (k, k), the prior included
    data_root: Array  # the same of the data alone
    chi2: float
    dof: int
    converged: bool
    iterations: int
    run_chi2: Array = field(default_factory=lambda: np.zeros(0))
    phase_demand: float = (
        0.0  # largest Δχ² a run gains from two further orders of its phase, in units of χ²/dof
    )
    truncation: float = (
        0.0  # what the last averaging along its own motion moved, in standard deviations
    )

    @property
    def p(self) -> Array:
        """Coordinates (7,)."""
        return self.response.state.p

    def compute_covariance_z(self) -> Array:
        """Covariance of z at the nominal noise."""
        inverse_root = invert_scaled(self.root)
        return inverse_root @ inverse_root.T


def triangularise(matrix: Array) -> Array:
    """The triangular factors R of matrix = QR, whose RᵀR is its Gram matrix.

    Parameters
    ----------
    matrix
        (..., n, k).

    Returns
    -------
    ndarray
        (..., min(n, k), k).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.likelihood import triangularise
    >>> matrix = np.array([[3.0, 1.0], [4.0, 2.0], [0.0, 2.0]])
    >>> R = triangularise(matrix)
    >>> bool(np.allclose(R.T @ R, matrix.T @ matrix)), float(R[1, 0])
    (True, 0.0)
    """
    return np.asarray(np.linalg.qr(matrix, mode="r"))


@dataclass(frozen=True)
class SharedRows:
    """Every run's design with its own nuisances eliminated: what is left speaks of z alone."""

    design: Array  # ∂/∂z, the rows of all runs stacked, (rows, k)
    residual: Array  # (rows,)
    back: Array  # (R, own, own + k + 1): what gives the runs' own steps back
    gain: Array  # Δχ² (R,) that two further orders of each run's phase would gain


def eliminate_nuisances(response: Response, freedom: Freedom) -> SharedRows:
    """The runs' rows without their own start states and phases, by QR of each run's columns.

    With the own columns first, the lower rows of R are free of them; the columns of the further
    phase orders stand behind the shared ones, so that only `gain` sees them.

    Parameters
    ----------
    response
        The model where it is linearised.
    freedom
        The k directions z that the runs share.

    Returns
    -------
    SharedRows
        Design and residual of z alone; what gives the runs' own steps back.

    Examples
    --------
    What a run tells of its damping is −t·e^{−νt}/σ less what its start's size, e^{−νt}/σ,
    explains of it:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.likelihood import eliminate_nuisances, free_coordinates
    >>> from hrg_cli.fitting.envelopes.response import State, make_batch, respond
    >>> t, p = np.linspace(0.0, 10.0, 101), np.array([0.1, 0, 0, 0, 0, 0, 0])
    >>> run = EnvelopeRun("", t, np.ones((101, 2)), 0 * t + 0.01, 0 * t, None, 5e3, 2, 0.1)
    >>> response = respond(make_batch([run]), State(p, np.array([[1, 0j]]), np.zeros((1, 1))))
    >>> design = eliminate_nuisances(response, free_coordinates(["damping"], p)).design
    >>> decay = np.exp(-0.1 * t) / 0.01
    >>> left = t * decay - decay * (decay @ (t * decay)) / (decay @ decay)
    >>> bool(np.isclose(np.sum(design**2), left @ left))
    True
    """
    shared = freedom.project(response.find_coordinate_sensitivities())
    own = response.find_run_sensitivities(FURTHER)
    k, s = len(own) - FURTHER, len(shared)
    columns = np.concatenate(
        [own[:k], shared, own[k:], (response.batch.envelope - response.model)[None]]
    )
    columns = response.batch.whiten(columns)
    R = triangularise(np.moveaxis(columns.reshape(*columns.shape[:2], -1).view(float), 0, 2))
    rows = R[:, k : k + s]
    return SharedRows(
        # -1 would be undefined where nothing is free
        design=rows[..., k : k + s].reshape(rows.shape[0] * rows.shape[1], s),
        residual=rows[..., -1].ravel(),
        back=R[:, :k, [*range(k + s), -1]],
        gain=np.sum(R[:, k + s : -1, -1] ** 2, axis=1),
    )


@dataclass(frozen=True)
class _Point:
    """Where the descent stands: z, what the model says there, χ² with the priors."""

    z: Array
    response: Response
    cost: float


@dataclass(frozen=True)
class _Step:
    """The rows linearised, the step of z and of the runs' own states and phases, and by how much
    the quadratic form says that χ² falls over it."""

    rows: SharedRows
    z: Array
    start: Array
    phase: Array
    predicted: float


class _Objective:
    """χ² of all runs with the Gaussian priors of the directions that have one; settled where χ² is
    as flat as its quadratic form says."""

    def __init__(self, data: Batch, freedom: Freedom, dof: int) -> None:
        self.data, self.freedom, self.dof = data, freedom, dof
        known = np.isfinite(freedom.prior_std)
        self.prior_rows = np.diag(np.where(known, 1 / np.where(known, freedom.prior_std, 1.0), 0.0))
        self.prior_rows = self.prior_rows[known]

    def evaluate(self, z: Array, start: Array, phase: Array) -> _Point:
        p = self.freedom.origin + self.freedom.directions @ z
        response = respond(self.data, State(p, start, phase))
        off = self.prior_rows @ (z - self.freedom.prior_mean)
        return _Point(z, response, response.chi2 + float(np.sum(off**2)))

    def linearise(self, point: _Point) -> _Step | None:
        """The Gauss–Newton step; None where numbers have run away."""
        rows = eliminate_nuisances(point.response, self.freedom)
        full = np.concatenate([rows.design, self.prior_rows])
        target = np.concatenate(
            [rows.residual, self.prior_rows @ (self.freedom.prior_mean - point.z)]
        )
        if not (np.isfinite(full).all() and np.isfinite(target).all()):
            return None  # LAPACK would print its complaint among the command's results
        step = fit_columns(full, target, 1e-13)
        own = _own_steps(rows.back, step)
        return _Step(
            rows=rows,
            z=step,
            start=own[:, [0, 2]] + 1j * own[:, [1, 3]],
            phase=own[:, 4:],
            predicted=float(np.sum((full @ step) ** 2)) + float(np.sum(rows.back[..., -1] ** 2)),
        )

    def move(self, point: _Point, step: _Step, size: float) -> _Point:
        """The point a part of the step further."""
        state = point.response.state
        return self.evaluate(
            point.z + size * step.z,
            state.start + size * step.start,
            state.phase + size * step.phase,
        )

    def is_settled(self, step: _Step, taken: StepTaken) -> bool:
        """Whether the fall of χ² still to come is below 1e-3 χ²/dof.

        A whole step reached the quadratic form's minimum: what is left is by how much χ² is not
        that form. A part of one leaves what the form says.
        """
        left = step.predicted
        if taken.size == 1.0:
            left = min(left, abs(taken.fall - step.predicted))
        return left < CONVERGED * max(1.0, taken.after / self.dof)


def fit(
    data: Batch, freedom: Freedom, z: Array, start: Array, phase: Array, max_iterations: int = 30
) -> Fit:
    """The least χ² of all runs by Gauss–Newton with step halving.

    It stops where χ² is as flat as its quadratic form says: a whole step whose fall of χ² is the
    predicted one to 1e-3 χ²/dof leaves a rest smaller than that.

    Parameters
    ----------
    data
        The runs, R of them.
    freedom
        What is fitted, k directions z.
    z
        First guess (k,).
    start
        Start states (R, 2), complex.
    phase
        Coefficients (R, orders) of (t/T)¹… [rad].
    max_iterations
        Steps at most.

    Returns
    -------
    Fit
        The optimum, with the information on z.

    Examples
    --------
    The damping of a run-down, from half of it:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.likelihood import fit, free_coordinates
    >>> from hrg_cli.fitting.envelopes.response import make_batch
    >>> t = np.linspace(0.0, 10.0, 101)
    >>> u = np.outer(np.exp(-0.1 * t), [1, 0j])
    >>> run = EnvelopeRun("", t, u, 0 * t + 0.01, 0 * t, None, 5e3, 2, 0.1)
    >>> space = free_coordinates(["damping"], np.zeros(7))
    >>> found = fit(make_batch([run]), space, np.array([0.05]), u[:1], np.zeros((1, 1)))
    >>> found.converged, round(float(found.p[0]), 6), found.dof
    (True, 0.1, 398)
    """
    dof = _dof(data, freedom, phase)
    objective = _Objective(data, freedom, dof)
    found = descend(objective, objective.evaluate(z, start, phase), max_iterations)
    response = found.point.response
    if found.converged and found.step is not None:
        rows = found.step.rows  # the last step was too small to change them
    else:
        rows = eliminate_nuisances(response, freedom)
    return Fit(
        freedom=freedom,
        response=response,
        z=found.point.z,
        root=triangularise(np.concatenate([rows.design, objective.prior_rows])),
        data_root=triangularise(rows.design),
        chi2=response.chi2,
        dof=dof,
        converged=found.converged,
        iterations=found.steps,
        run_chi2=np.sum(np.abs(response.compute_residual()) ** 2, axis=(1, 2)),
        phase_demand=float(rows.gain.max()) / max(1.0, response.chi2 / dof),
    )


def _own_steps(back: Array, step: Array) -> Array:
    """Steps of the runs' own start states and phases (R, k) that belong to a step of z; directions
    without information stay."""
    k = back.shape[1]
    right = back[:, :, -1] - back[:, :, k:-1] @ step
    size = np.abs(np.diagonal(back[:, :, :k], axis1=1, axis2=2))
    if np.all(size > 1e-10 * size.max(axis=1, keepdims=True)):
        return np.linalg.solve(back[:, :, :k], right[..., None])[..., 0]
    return np.stack(
        [np.linalg.lstsq(R[:, :k], r, rcond=1e-14)[0] for R, r in zip(back, right, strict=True)]
    )


def _dof(data: Batch, freedom: Freedom, phase: Array) -> int:
    rows = sum(len(r) for r in data.runs)
    return max(1, 4 * rows - len(data.runs) * (4 + phase.shape[1]) - len(freedom.names))


def free_coordinates(
    names: Sequence[str], origin: Array, prior: dict[str, tuple[float, float]] | None = None
) -> Freedom:
    """Coordinates fitted one by one, the others held.

    Parameters
    ----------
    names
        Of the free ones, of `COORDINATES`.
    origin
        Where the others are held, (7,).
    prior
        Mean and standard deviation of those that have a prior.

    Returns
    -------
    Freedom
        A direction for each name.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.likelihood import free_coordinates
    >>> space = free_coordinates(["damping"], np.full(7, 0.5), {"damping": (0.1, 0.02)})
    >>> (space.origin + space.directions @ [0.2]).tolist(), space.prior_std.tolist()
    ([0.2, 0.5, 0.5, 0.5, 0.5, 0.5, 0.5], [0.02])
    """
    index = [coordinates.COORDINATES.index(n) for n in names]
    prior = prior or {}
    held = np.array(origin, float)
    held[index] = 0.0
    return Freedom(
        names=tuple(names),
        origin=held,
        directions=np.eye(COUNT)[:, index],
        prior_mean=np.array([prior.get(n, (0.0, np.inf))[0] for n in names]),
        prior_std=np.array([prior.get(n, (0.0, np.inf))[1] for n in names]),
    )
