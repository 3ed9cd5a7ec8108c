"""The likelihood of free runs: every run's envelopes by the exact slow model, all runs batched,
Gauss–Newton with nuisances eliminated."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from . import coordinates
from .coordinates import COUNT
from .response import Batch, Response, State, batch, real, respond
from .scaled_columns import invert_scaled, measure_columns

__all__ = [
    "Batch",
    "Fit",
    "Freedom",
    "batch",
    "eliminate_nuisances",
    "fit",
    "free_coordinates",
    "real",
    "triangle",
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

    def along(self, columns: Array) -> Array:
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

    def covariance_z(self) -> Array:
        """Covariance of z at the nominal noise."""
        inverse_root = invert_scaled(self.root)
        return inverse_root @ inverse_root.T


def triangle(matrix: Array) -> Array:
    """The triangular factors R of matrix = QR, (..., k, k)."""
    return np.asarray(np.linalg.qr(matrix, mode="r"))


def eliminate_nuisances(response: Response, freedom: Freedom) -> tuple[Array, Array, Array, Array]:
    """Each run's design with its own nuisances eliminated by QR: rows of ∂/∂z and residual stacked
    over the runs, what gives the nuisance steps back (R, k, ·), and Δχ² (R,) that two further
    orders of each run's phase would gain.
    """
    shared = freedom.along(response.coordinate_sensitivities())
    own = response.run_sensitivities(FURTHER)
    k, s = len(own) - FURTHER, len(shared)
    columns = np.concatenate(
        [own[:k], shared, own[k:], (response.batch.envelope - response.model)[None]]
    )
    columns = response.batch.over_noise(columns)
    R = triangle(np.moveaxis(columns.reshape(*columns.shape[:2], -1).view(float), 0, 2))
    rows = R[:, k : k + s]
    gain = np.sum(R[:, k + s : -1, -1] ** 2, axis=1)
    return (
        rows[..., k : k + s].reshape(-1, s),
        rows[..., -1].ravel(),
        R[:, :k, [*range(k + s), -1]],
        gain,
    )


def fit(
    data: Batch, freedom: Freedom, z: Array, start: Array, phase: Array, max_iterations: int = 30
) -> Fit:
    """Gauss–Newton with step halving from z, start states (R, 2) and phases (R, k); stops where χ²
    is as flat as its quadratic form says.

    A whole step whose fall of χ² is the predicted one to 1e-3 χ²/dof leaves a rest smaller than
    that.
    """
    prior = np.isfinite(freedom.prior_std)
    prior_rows = np.diag(np.where(prior, 1 / np.where(prior, freedom.prior_std, 1.0), 0.0))[prior]

    def cost(response: Response, z: Array) -> float:
        return response.chi2 + float(np.sum((prior_rows @ (z - freedom.prior_mean)) ** 2))

    def at(z: Array, start: Array, phase: Array) -> Response:
        return respond(data, State(freedom.origin + freedom.directions @ z, start, phase))

    response = at(z, start, phase)
    current, converged, iteration = cost(response, z), False, 0
    while iteration < max_iterations:
        iteration += 1
        design, residual, back, gain = eliminate_nuisances(response, freedom)
        full = np.concatenate([design, prior_rows])
        target = np.concatenate([residual, prior_rows @ (freedom.prior_mean - z)])
        if not (np.isfinite(full).all() and np.isfinite(target).all()):
            break  # LAPACK would print its complaint among the command's results
        length = measure_columns(full)
        step = np.linalg.lstsq(full / length, target, rcond=1e-13)[0] / length
        own = _own_steps(back, step)
        predicted = float(np.sum((full @ step) ** 2)) + float(np.sum(back[..., -1] ** 2))
        size = 1.0
        while True:
            trial_z = z + size * step
            trial = at(
                trial_z,
                response.state.start + size * (own[:, [0, 2]] + 1j * own[:, [1, 3]]),
                response.state.phase + size * own[:, 4:],
            )
            value = cost(trial, trial_z)
            # the margins are the rounding of a χ² near its minimum, or near zero
            if value <= current * (1 + 1e-12) + 1e-9 or size < 1e-3:
                break
            size /= 2
        if not np.isfinite(value) or value > current * (1 + 1e-6) + 1e-3:
            break
        # A whole step reached the quadratic form's minimum; what is left is by how much χ² is not
        # that form.
        left = min(predicted, abs(current - value - predicted)) if size == 1.0 else predicted
        z, response, current = trial_z, trial, value
        if left < CONVERGED * max(1.0, current / max(1, _dof(data, freedom, phase))):
            converged = True
            break
    if not converged:  # else the last step was too small to change it
        design, _, _, gain = eliminate_nuisances(response, freedom)
    residual = response.residual()
    dof = _dof(data, freedom, phase)
    return Fit(
        freedom=freedom,
        response=response,
        z=z,
        root=triangle(np.concatenate([design, prior_rows])),
        data_root=triangle(design),
        chi2=response.chi2,
        dof=dof,
        converged=converged,
        iterations=iteration,
        run_chi2=np.sum(np.abs(residual) ** 2, axis=(1, 2)),
        phase_demand=float(gain.max()) / max(1.0, response.chi2 / dof),
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
    """Coordinates fitted one by one, the others held at `origin` (7,)."""
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
