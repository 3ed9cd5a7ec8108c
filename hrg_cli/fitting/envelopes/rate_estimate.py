"""A rate found at even times: its spline, its integral and their standard deviations."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ..checks import check_goodness
from ..least_squares import whiten_covariance

Array = np.ndarray
MOST_NODES = 640
CHANCE = 1e-3
"""Probability by which a rise of χ² is no chance."""
ROUNDING = 1e-12
"""Part of a direction's size that rounding leaves of one that is none."""


@dataclass(frozen=True)
class Loss:
    """What fewer nodes leave of a rate: over its noise and node by node (k,), and the projection
    (k, k) that left it."""

    left: Array
    projection: Array

    @property
    def z(self) -> float:
        """The rise of χ² beyond chance, in its standard deviations."""
        rise, spread = self.measure(slice(None))
        return rise / spread if spread > 0 else 0.0

    def measure(self, where: slice) -> tuple[float, float]:
        """The rise of χ² beyond chance by some of the nodes, and its standard deviation by chance,
        √(2 tr M²)."""
        share = self.projection[where, where]
        rise = float(np.sum(self.left[where] ** 2) - np.trace(share))
        return rise, float(np.sqrt(2 * np.sum(share**2)))

    def is_seen(self, where: slice, pieces: int = 1) -> bool:
        """Whether that rise is more than chance, of one of so many pieces that are looked at."""
        from scipy.stats import chi2

        share = self.projection[where, where]
        mean, spread = float(np.trace(share)), float(np.sum(share**2))
        if mean <= ROUNDING:
            return False
        # as many equal parts of a χ² as have this mean and spread (Satterthwaite 1946)
        parts = mean**2 / spread
        square = float(np.sum(self.left[where] ** 2))
        return bool(chi2.sf(square * parts / mean, parts) < CHANCE / pieces)


@dataclass(frozen=True)
class RateEstimate:
    """Nodes (k,), rate [rad/s] with covariance (k, k), the plain estimate −m·dθ/dt/K on the nodes,
    and the fit's χ² per degree of freedom."""

    time_s: Array
    rate_rad_s: Array
    covariance: Array
    plain_rate_rad_s: Array
    chi2_per_dof: float
    dof: int
    finer: Loss | None = None
    """What twice as many nodes gain; None where the windows do not carry them."""
    converged: bool = True
    truncation: float = 0.0
    """What averaging along the better motion still moved, in standard deviations of a node."""
    residual: Array = field(default_factory=lambda: np.zeros((0, 4)))
    """What is left of the rows over their noise, (n, 4)."""
    most_nodes: int = MOST_NODES
    """Nodes that the run's windows carry at most."""
    window_s: float = 0.0
    """Length of a window."""
    phase_rad: Array = field(default_factory=lambda: np.zeros(0))
    """What the last round of a fit moved the phase by that a moving frequency makes, on its
    nodes."""
    frequency_moves_hz: float = 0.0
    """How far the frequency was found to move over the run; 0 where it was taken as constant."""

    @property
    def adequate(self) -> bool:
        """Whether χ² agrees with the noise the windows state."""
        return check_goodness(self.chi2_per_dof * self.dof, self.dof).passed

    @property
    def rate_rad_s_std(self) -> Array:
        """Standard deviations on the nodes."""
        return np.sqrt(np.diag(self.covariance))

    def measure_loss(self, nodes: int) -> Loss:
        """What χ² would rise by on fewer nodes: the part of the rate that a spline of so many nodes
        cannot follow, in standard deviations (Wald 1943), which it is drawn from node by node."""
        held = np.linspace(self.time_s[0], self.time_s[-1], nodes)
        whitening, known = self._whitened
        basis, size, _ = np.linalg.svd(
            whitening @ build_cardinals(self.time_s, held).T, full_matrices=False
        )
        followed = basis[:, size > ROUNDING * size[0]]
        left = known - followed @ followed.T
        return Loss(left @ (whitening @ self.rate_rad_s), left)

    @cached_property
    def _whitened(self) -> tuple[Array, Array]:
        """What makes the nodes independent, and the directions of which their rows tell at all: a
        gap leaves rates that none does."""
        return whiten_covariance(self.covariance)

    def integrate(self) -> tuple[Array, Array]:
        """Angle [rad] from the first node to each (k,), with its standard deviation: Ω is a spline
        of its nodes, so its integral is ∫Ω = WΩ, with the covariance W cov Wᵀ."""
        whole = integrate_cardinals(self.time_s, self.time_s).T
        # rounding may leave a variance just below 0 where nothing is turned
        variance = np.maximum(np.einsum("ij,jk,ik->i", whole, self.covariance, whole), 0.0)
        return whole @ self.rate_rad_s, np.sqrt(variance)


def build_cardinals(time_s: Array, grid: Array) -> Array:
    """Cubic splines that are 1 at one node and 0 at the others.

    Parameters
    ----------
    time_s
        Times at which they are wanted, (n,).
    grid
        The nodes, (k,).

    Returns
    -------
    ndarray
        (k, n).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.rate_estimate import build_cardinals
    >>> grid = np.arange(5.0)
    >>> bool(np.allclose(grid**3 @ build_cardinals(np.array([2.5]), grid), 2.5**3))
    True
    """
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(grid, np.eye(len(grid)))(time_s)).T


def integrate_cardinals(grid: Array, time_s: Array) -> Array:
    """The integrals of `build_cardinals` from the first node.

    Parameters
    ----------
    grid
        The nodes, (k,).
    time_s
        Where they end, (n,).

    Returns
    -------
    ndarray
        (k, n), s.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.rate_estimate import integrate_cardinals
    >>> round(float(np.ones(5) @ integrate_cardinals(np.arange(5.0), np.array([3.0]))[:, 0]), 9)
    3.0
    """
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(grid, np.eye(len(grid))).antiderivative()(time_s)).T
