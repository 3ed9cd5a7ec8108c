"""Diagnosis, the runs' frequency offsets: their scatter about common means, and the wander from run
to run that it asks for."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ....fitting import least_squares
from ....fitting.causes import designs, evidence
from ....fitting.causes.extended_fit import ExtendedFit
from .inquiry import NoiseLevel

Array = np.ndarray


@dataclass(frozen=True)
class Offsets:
    """The runs' frequency offsets (R,), their covariance (R, R), the means that are free (R, h),
    all in rad/s."""

    value: Array
    covariance: Array
    means: Array

    def compute_misfit(self, wander: float, extra: Array | None = None) -> tuple[float, Array]:
        """(χ² that means and extra columns leave, their projector's whitened basis) with a wander
        of that size."""
        C = np.linalg.cholesky(self.covariance + wander**2 * np.eye(len(self.value)))
        columns = self.means if extra is None else np.concatenate([self.means, extra], axis=1)
        basis = designs.orthonormalise(np.linalg.solve(C, columns), 1e-6)
        y = np.linalg.solve(C, self.value)
        left = y - basis @ (basis.T @ y)
        return float(left @ left), basis

    def subtract(self, shift: Array, covariance: Array) -> Offsets:
        """The offsets without a shift (R,) that is known with a covariance (R, R)."""
        return replace(self, value=self.value - shift, covariance=self.covariance + covariance)

    def compute_information(self, response: Array) -> Array:
        """Of the offsets on what moves them by `response` (R, m), the means free: (m, m)."""
        C = np.linalg.cholesky(self.covariance)
        basis = designs.orthonormalise(np.linalg.solve(C, self.means), 1e-6)
        seen = np.linalg.solve(C, response)
        seen = seen - basis @ (basis.T @ seen)
        return seen.T @ seen

    def fit_response(self, response: Array, wander: float) -> tuple[Array, Array]:
        """(sizes (q,), covariance (q, q)) of what moves them by `response` (R, q), the means
        free, beside a wander of that size."""
        C = np.linalg.cholesky(self.covariance + wander**2 * np.eye(len(self.value)))
        design = np.linalg.solve(C, np.concatenate([self.means, response], axis=1))
        solution, covariance = least_squares.solve(design, np.linalg.solve(C, self.value), 1e-6)
        first = self.means.shape[1]
        return solution[first:], covariance[first:, first:]

    def estimate_wander(self, extra: Array | None = None) -> float:
        """s of largest restricted likelihood: where χ² equals the degrees of freedom left, 0 where
        it is smaller from the start."""
        dof = len(self.value) - self.compute_misfit(0.0, extra)[1].shape[1]
        if dof <= 0 or self.compute_misfit(0.0, extra)[0] <= dof:
            return 0.0
        low, high = 0.0, 10 * float(np.ptp(self.value)) + float(np.sqrt(np.trace(self.covariance)))
        # χ² falls with the wander throughout, and at `high` is below the freedom; 60 halvings end
        # at the rounding of a double
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (
                (middle, high) if self.compute_misfit(middle, extra)[0] > dof else (low, middle)
            )
        return high


def read_offsets(fit: ExtendedFit, noise: NoiseLevel) -> tuple[Offsets, list[int]]:
    """The offsets of a fit and their places among its parameters.

    Parameters
    ----------
    fit
        Of the runs.
    noise
        That gains are judged by.

    Returns
    -------
    tuple
        The offsets, and their places (R,).

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.search.inquiry import STATED
    >>> from hrg_cli.stages.diagnosis.search.offsets import read_offsets
    >>> offsets, places = read_offsets(draw_fit(), STATED)
    >>> offsets.value.shape, offsets.covariance.shape, len(places)
    ((3,), (3, 3), 3)
    """
    runs = len(fit.series.names)
    index = [fit.layout.frequency(k) for k in range(runs)]
    forced = fit.series.forced[:, 0] > 0
    means = np.stack([kind.astype(float) for kind in (~forced, forced) if kind.any()], axis=1)
    return (
        Offsets(fit.point.offset_rad_s, fit.covariance[np.ix_(index, index)] * noise.slow, means),
        index,
    )


def judge_scatter(offsets: Offsets, beside: Array | None = None) -> tuple[float, float]:
    """(equivalent z, p) of the offsets' scatter about their means against their own noise.

    Parameters
    ----------
    offsets
        Of the runs.
    beside
        What else of them is free, (R, q).

    Returns
    -------
    tuple of float
        Both small and large where the runs agree.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.search.inquiry import STATED
    >>> from hrg_cli.stages.diagnosis.search.offsets import judge_scatter, read_offsets
    >>> z, p = judge_scatter(read_offsets(draw_fit(), STATED)[0])
    >>> z < 2, p > 0.05
    (True, True)
    """
    chi2, basis = offsets.compute_misfit(0.0, beside)
    dof = len(offsets.value) - basis.shape[1]
    return evidence.find_significance(chi2, dof) if dof > 0 else (0.0, 1.0)


def find_lone_run(offsets: Offsets, chance: float) -> int | None:
    """The one run without which the others' offsets agree.

    Parameters
    ----------
    offsets
        Of the runs.
    chance
        Of the others' scatter being noise down to which they agree.

    Returns
    -------
    int or None
        Its place; None where there is none, or where more than one would do.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.search.offsets import Offsets, find_lone_run
    >>> far = np.array([0.0, 1.0, 0.01, -0.01])
    >>> find_lone_run(Offsets(far, 1e-4 * np.eye(4), np.ones((4, 1))), 1e-6)
    1
    """
    runs = range(len(offsets.value))
    if len(runs) <= offsets.means.shape[1] + 1:
        return None
    agreeing = [run for run in runs if judge_scatter(offsets, point_at(run, offsets))[1] > chance]
    return agreeing[0] if len(agreeing) == 1 else None


def point_at(run: int, offsets: Offsets) -> Array:
    """What moves one run's offset alone: free beside the means, it leaves that run out.

    Parameters
    ----------
    run
        Its place.
    offsets
        Of the runs.

    Returns
    -------
    ndarray
        (R, 1).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.search.offsets import Offsets, point_at
    >>> point_at(1, Offsets(np.zeros(3), np.eye(3), np.ones((3, 1))))[:, 0].tolist()
    [0.0, 1.0, 0.0]
    """
    return np.eye(len(offsets.value))[:, [run]]
