"""The noise of a run's increments: white angle noise and angle random walk, their covariance in
bands, and what whitens by it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...errors import HrgError
from ..tables.increments import AnglePath

Array = np.ndarray


@dataclass(frozen=True)
class AngleNoise:
    """White angle noise: `white` scales the shape of the blocks' stated variances (rad² of mθ);
    `walk` is q, rad²/s of mθ."""

    white: float
    walk: float


def find_noise_shape(path: AnglePath) -> Array:
    """Relative white variance of the blocks, mean one.

    The level is always estimated from the residuals; the windows' stated variances tell only how it
    is spread over the run.

    Parameters
    ----------
    path
        With the angle's stated variance a block.

    Returns
    -------
    ndarray
        (blocks,); ones where nothing is stated.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.noise.increment_noise import find_noise_shape
    >>> find_noise_shape(SimpleNamespace(angle_variance=np.array([1e-12, 3e-12]))).round(9).tolist()
    [0.5, 1.5]
    """
    mean = float(np.mean(path.angle_variance))
    return (
        path.angle_variance / mean
        if mean > 0 and (path.angle_variance > 0).all()
        else np.ones(len(path.angle_variance))
    )


def build_covariance_bands(path: AnglePath, noise: AngleNoise) -> Array:
    """Covariance of the increments between the angles of neighbouring blocks.

    It is tridiagonal. Neighbouring increments share a block, whose angle noise enters them with
    opposite signs; a walk averaged over a block of width w moves q·w/6 from each increment into
    their covariance.

    Parameters
    ----------
    path
        n + 1 blocks.
    noise
        White angle noise and walk.

    Returns
    -------
    ndarray
        (2, n) [rad² of mθ]: the diagonal, and below it the covariance with the next increment.

    Examples
    --------
    White angles alone: a difference has twice their variance, and shares half of it with each
    neighbour.

    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.noise.increment_noise import AngleNoise, build_covariance_bands
    >>> class Path(SimpleNamespace):
    ...     def __len__(self):
    ...         return 3
    >>> path = Path(angle_variance=np.ones(4), width_s=np.ones(4), interval_s=np.ones(3))
    >>> build_covariance_bands(path, AngleNoise(0.25, 0.0)).tolist()
    [[0.5, 0.5, 0.5], [-0.25, -0.25, 0.0]]
    """
    white, width = noise.white * find_noise_shape(path), path.width_s
    bands = np.zeros((2, len(path)))
    bands[0] = (
        white[1:]
        + white[:-1]
        + noise.walk * np.maximum(path.interval_s - (width[1:] + width[:-1]) / 6, 0)
    )
    # Neighbouring increments share a block: its angle noise enters them with opposite signs.
    # Averaging a walk over the block's width w moves q·w/6 from each increment into their
    # covariance.
    bands[1, :-1] = -white[1:-1] + noise.walk * width[1:-1] / 6
    return bands


NOT_POSITIVE = (
    "the covariance of the increments is not positive; times or widths of the windows do not fit"
    " together"
)


def whiten(bands: Array, columns: Array) -> tuple[Array, float]:
    """Columns whose rows are independent and of variance one, and the logarithm of the determinant.

    With V = L Lᵀ they are L⁻¹·columns and log det V: all that a likelihood of normal errors needs.

    Parameters
    ----------
    bands
        (2, n): lower bands of the covariance V.
    columns
        (n,) or (n, k).

    Returns
    -------
    tuple
        Columns of the same shape, and log det V.

    Raises
    ------
    HrgError
        V is not positive: times or widths of the windows do not fit together.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.noise.increment_noise import whiten
    >>> white, log_determinant = whiten(np.array([[4.0, 4.0], [0.0, 0.0]]), np.array([2.0, 6.0]))
    >>> white.tolist(), round(float(log_determinant / np.log(2)), 9)
    ([1.0, 3.0], 4.0)
    """
    from scipy.linalg.lapack import dpbtrf, dtbtrs

    factor, failed = dpbtrf(bands, lower=1)
    if failed:
        raise HrgError(NOT_POSITIVE)
    white, _ = dtbtrs(factor, columns, uplo="L")
    return np.asarray(white).reshape(columns.shape), 2 * float(np.log(factor[0]).sum())


class Whitener:
    """`whiten` a stretch of rows at a time: the factor is two numbers a row, only the columns are
    large."""

    def __init__(self, bands: Array) -> None:
        from scipy.linalg.lapack import dpbtrf

        self.factor, failed = dpbtrf(bands, lower=1)
        if failed:
            raise HrgError(NOT_POSITIVE)
        self.row, self.last = 0, np.zeros(0)

    def whiten_next(self, columns: Array) -> Array:
        """The next rows of L⁻¹·columns."""
        from scipy.linalg.lapack import dtbtrs

        first, stop = self.row, self.row + len(columns)
        if first:
            # The first row of a stretch hangs on the last of the one before by L's one band below.
            columns[0] -= self.factor[1, first - 1] * self.last
        white, _ = dtbtrs(self.factor[:, first:stop], columns, uplo="L")
        self.row, self.last = stop, white[-1].copy()
        return np.asarray(white)


NEEDED_GAIN = 6.0
"""Fall of −2 ln L that a run's own random walk must bring, the walk common to all runs apart."""


def estimate_noise(path: AnglePath, residual: Array, lost_degrees: float = 0.0) -> AngleNoise:
    """White angle noise and angle random walk of a run by maximum likelihood from residual
    increments.

    One parameter (their ratio) is searched; the level follows from the whitened residual. White
    noise that a walk hides is what the windows state, unless the residual denies it. A walk that
    gains less than `NEEDED_GAIN` of −2 ln L is none.

    Parameters
    ----------
    path
        n + 1 blocks.
    residual
        (n,): what a fit leaves of the increments [rad of mθ].
    lost_degrees
        Degrees of freedom that the fit took from this run.

    Returns
    -------
    AngleNoise
        Both.

    Examples
    --------
    A walk of 1e-4 rad²/s under white noise as large is found to a few per cent of a thousand steps:

    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.noise.increment_noise import estimate_noise
    >>> rng, n = np.random.default_rng(0), 1000
    >>> class Path(SimpleNamespace):
    ...     def __len__(self):
    ...         return n
    >>> path = Path(
    ...     angle_variance=np.full(n + 1, 1e-4 / 4),
    ...     width_s=np.zeros(n + 1),
    ...     interval_s=np.ones(n),
    ...     mode_number=2,
    ... )
    >>> walk = np.cumsum(1e-2 * rng.standard_normal(n + 1))
    >>> found = estimate_noise(path, np.diff(walk + 1e-2 * rng.standard_normal(n + 1)))
    >>> bool(abs(found.walk / 1e-4 - 1) < 0.25), bool(abs(found.white / 1e-4 - 1) < 0.25)
    (True, True)
    """
    time = float(np.median(path.interval_s))
    degrees = max(len(residual) - lost_degrees, 1.0)

    def look(log_ratio: float) -> tuple[float, float]:
        """(whitened square, log determinant) with white noise one and q·Δt in this ratio to it."""
        bands = build_covariance_bands(path, AngleNoise(1.0, np.exp(log_ratio) / time))
        white, log_determinant = whiten(bands, residual)
        return max(float(white @ white), 1e-300), log_determinant

    def free(log_ratio: float) -> float:
        square, log_determinant = look(log_ratio)
        return degrees * (np.log(square / degrees) + 1) + log_determinant

    log_ratio, best = _lowest(free)
    # e^−40 of the white noise: no walk at all.
    if free(-40.0) <= best + NEEDED_GAIN:
        return AngleNoise(look(-40.0)[0] / degrees, 0.0)
    stated = path.mode_number**2 * float(np.mean(path.angle_variance))
    if stated > 0:

        def held(log_ratio: float) -> float:
            square, log_determinant = look(log_ratio)
            return degrees * np.log(stated) + square / stated + log_determinant

        beside, likelihood = _lowest(held)
        if likelihood <= best + NEEDED_GAIN:
            return AngleNoise(stated, stated * float(np.exp(beside)) / time)
    variance = look(log_ratio)[0] / degrees
    return AngleNoise(variance, variance * float(np.exp(log_ratio)) / time)


def _lowest(height: Callable[[float], float]) -> tuple[float, float]:
    """Where a function of ln(q·Δt/white) is lowest, and how low."""
    from scipy.optimize import minimize_scalar

    # More than one minimum is possible: a coarse look over all ratios finds the lowest one's place.
    grid = np.arange(-18.0, 21.1, 3.0)
    near = grid[int(np.argmin([height(g) for g in grid]))]
    found = minimize_scalar(
        height, bounds=(near - 3.0, near + 3.0), method="bounded", options={"xatol": 0.05}
    )
    return float(found.x), float(found.fun)
