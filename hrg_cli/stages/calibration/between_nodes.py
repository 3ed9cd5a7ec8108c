"""What tables do not know between their nodes: how far drift and scale factor may bend there
unseen.

Runs that dwell at a few nodes show orders T_k of the temperature (Chebyshev) below their number J,
and none beyond; of those that they show, linear pieces and splines hold a part only. How the orders
fall says how large the unseen ones may be: each is taken as Gaussian, ρ times the one before, with
ρ anywhere from 0 to 1,

    c_k ~ N(0, s²ρ^{2(k−1)}),
    p(s, ρ | c) ∝ (1 + s²/3u²)^{−2} Π_k (sρ^{k−1})^{−h} exp(−h|c_k|²/2s²ρ^{2(k−1)}),

|c_k|² the mean over harmonics, of which h move: of a scale factor often the constant part alone, of
which two nodes may show the same by chance, and of three the middle one may lie on the line of the
others. u is what physics expects of c_1, and sizes below it are all as likely, so that a small
difference is no proof of a small bend (half-t of three degrees; Gelman, Bayesian Analysis 1, 2006).
What interpolation misses of each order is added in squares. Few nodes leave ρ open, and the tail is
heavy; every node more closes it.

Of many nodes, or where runs pass between them, each inner node is predicted from the others
instead.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.polynomial import chebyshev

from ...effects import find
from ...effects.effect import RELATIVE_TO_TEMPERATURE
from ...fitting.tables.joint import Fitted
from ...fitting.tables.normal_pieces import TableSolution
from ...fitting.tables.table_layout import TableLayout
from ...fourier import build_harmonic_basis, compute_node_weights

Array = np.ndarray
RATIOS = np.linspace(0.01, 1.0, 100)
"""Of one order's size to that of the order before."""
SIZES = np.geomspace(1e-5, 1e4, 181)
"""Of the first order, over its usual one."""
UNSEEN_ORDERS = 3
"""Orders beyond those that the nodes show which are counted."""
FINE = 201
"""Places over the nodes' range at which an order is looked at."""
BETWEEN = 0.5
"""Of `make_bump`, from which a row stands between nodes and not at one."""
PASSED = 0.1
"""Part of the rows between nodes from which the runs themselves judge the interpolation."""
PER_KELVIN = {
    name: next(p.typical for p in find(effect).parameters if p.name == RELATIVE_TO_TEMPERATURE)
    for name, effect in (
        ("drift_rad_s", "thermal_damping"),
        ("scale_factor", "scale_factor_temperature"),
    )
}
"""Usual relative change of a table a kelvin: of the damping, of which drift is made, and of K."""
FREQUENCY_PER_KELVIN = 85e-6
"""Of fused silica (PHYSICS §1, M9), where the nodes are of frequency."""
MOST_ORDERS = 6
"""Nodes up to which their values are told by orders: of more, even ones, a small error at a node is
a large one of the highest."""


@dataclass(frozen=True)
class _Nodes:
    """One table's values at the nodes (J, harmonics), their covariance over both, and the angles'
    basis (A, harmonics)."""

    places: Array
    values: Array
    covariance: Array
    basis: Array
    usual_change: float
    """Of order 1: relative change over half the nodes' range."""

    def count_moving(self, combined: Array) -> float:
        """How many harmonics make up combinations (k, J) of the nodes, noise taken off: (Σe)²/Σe²
        of their energies, every combination of the same weight; 1 where none is seen."""
        count = self.values.shape[1]
        covariance = self.covariance.reshape(len(self.places), count, len(self.places), count)
        noise = np.einsum("ki,ihjh,kj->kh", combined, covariance, combined)
        energy = np.maximum((combined @ self.values) ** 2 - noise, 0) * np.mean(self.basis**2, 0)
        whole = energy.sum(axis=1)
        parts = (energy[whole > 0] / whole[whole > 0, None]).sum(axis=0)
        return float(parts.sum() ** 2 / np.sum(parts**2)) if parts.any() else 1.0

    def compute_square(self, combined: Array) -> float:
        """Mean square over the wave angle of a combination (J,) of the nodes."""
        return float(np.mean((self._rows(combined) @ self.values.ravel()) ** 2))

    def compute_energy(self, combined: Array) -> float:
        """The same less what noise makes of it."""
        rows = self._rows(combined)
        noise = np.einsum("ai,ij,aj->a", rows, self.covariance, rows)
        return self.compute_square(combined) - float(np.mean(noise))

    def _rows(self, combined: Array) -> Array:
        """Of a combination at the angles (A, J · harmonics), by the values."""
        return (combined[None, :, None] * self.basis[:, None, :]).reshape(len(self.basis), -1)


def make_bump(x: Array, nodes: Array) -> Array:
    """How far places stand from the nodes: where interpolation is least sure.

    Parameters
    ----------
    x
        Places (n,), in the unit of the nodes.
    nodes
        (J,), rising.

    Returns
    -------
    ndarray
        (n,); 4u(1 − u) of the part u of the way to the next node: 0 at nodes, 1 midway.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.calibration.between_nodes import make_bump
    >>> make_bump(np.array([0.0, 5.0, 10.0, 15.0]), np.array([0.0, 10.0, 30.0])).tolist()
    [0.0, 1.0, 0.0, 0.75]
    """
    if len(nodes) < 2:
        return np.zeros(np.size(x))
    left = np.clip(np.searchsorted(nodes, x) - 1, 0, len(nodes) - 2)
    part = (np.asarray(x) - nodes[left]) / (nodes[left + 1] - nodes[left])
    return np.asarray(4 * np.abs(part * (1 - part)))


def estimate_interpolation_doubt(
    fitted: Fitted, solution: TableSolution, chi2: float, drift_limit: int, scale_limit: int
) -> dict[str, float]:
    """Standard deviation that interpolation adds midway between nodes.

    Where runs dwell at few nodes, from how the orders of the temperature fall; otherwise from how
    well each inner node is predicted by the others.

    Parameters
    ----------
    fitted
        The runs.
    solution
        The tables' coefficients with their covariance.
    chi2
        Per degree of freedom, by which the covariance is scaled.
    drift_limit, scale_limit
        Harmonics of 2mθ that the tables hold.

    Returns
    -------
    dict
        Of drift [rad/s] and scale factor; empty where there is one node, or where the runs pass
        between too few to leave one out.

    Examples
    --------
    One node says nothing of a course between nodes:

    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.table_layout import TableLayout
    >>> from hrg_cli.stages.calibration.between_nodes import estimate_interpolation_doubt
    >>> fitted = SimpleNamespace(layout=TableLayout(np.array([20.0]), "temperature", 2, 0, 0))
    >>> estimate_interpolation_doubt(fitted, None, 1.0, 0, 0)
    {}
    """
    layout = fitted.layout
    count = len(layout.nodes)
    kind = "cubic" if layout.interpolation in ("cubic", "smooth") else "linear"
    to_spare = count >= (5 if kind == "cubic" else 3)
    by_orders = 2 <= count <= MOST_ORDERS and _only_at_nodes(fitted)
    if not (to_spare or by_orders):
        return {}
    tables = layout.split_tables(solution.coefficients)
    out = {}
    for name, table, limit, part in (
        ("drift_rad_s", tables[0], drift_limit, layout.drift),
        ("scale_factor", tables[1], scale_limit, layout.scale),
    ):
        size = 1 + 2 * limit
        angles = np.linspace(0, np.pi / layout.mode_number, 24, endpoint=False)
        columns = np.concatenate([np.arange(layout.size)[part(j)][:size] for j in range(count)])
        nodes = _Nodes(
            layout.nodes,
            table[:, :size],
            solution.covariance[np.ix_(columns, columns)] * chi2,
            build_harmonic_basis(angles, limit, layout.mode_number),
            PER_KELVIN[name] * _half_range_k(layout),
        )
        out[name] = _judge_orders(nodes, kind) if by_orders else _judge_left_out(nodes, kind)
    return out


def _half_range_k(layout: TableLayout) -> float:
    """Half of what the nodes span, in kelvin."""
    half = float(np.ptp(layout.nodes)) / 2
    if layout.axis == "temperature":
        return half
    return half / (FREQUENCY_PER_KELVIN * float(np.mean(layout.nodes)))


def _only_at_nodes(fitted: Fitted) -> bool:
    """Whether the runs dwell at the nodes, so that none would show how tables bend between them."""
    layout = fitted.layout
    x = np.concatenate(
        [path.average_neighbours(path.find_abscissa(layout.axis)) for path in fitted.paths]
    )
    return float(np.mean(make_bump(x, layout.nodes) > BETWEEN)) < PASSED


def _judge_left_out(nodes: _Nodes, kind: str) -> float:
    """From predicting each inner node from the others.

    Leaving a node out doubles the spacing; what noise explains of the misses is taken off, the rest
    counts by a quarter (cubic; the outer stretches are the worst) or a third (linear, whose error
    falls with the square of the spacing).
    """
    shrink = 1 / 4 if kind == "cubic" else 1 / 3
    count, excess = len(nodes.places), 0.0
    for j in range(1, count - 1):
        rest = np.arange(count) != j
        miss = np.zeros(count)
        miss[j], miss[rest] = (
            1.0,
            -compute_node_weights(nodes.places[[j]], nodes.places[rest], kind)[0],
        )
        excess += nodes.compute_energy(miss)
    return shrink * float(np.sqrt(max(excess, 0.0) / (count - 2)))


def _judge_orders(nodes: _Nodes, kind: str) -> float:
    """From what the interpolation misses of every order, seen and unseen."""
    count, (low, high) = len(nodes.places), (nodes.places[0], nodes.places[-1])
    within = np.linspace(-1, 1, FINE)
    at_nodes = (2 * nodes.places - low - high) / (high - low)
    to_orders = np.linalg.inv(chebyshev.chebvander(at_nodes, count - 1))
    shown = [nodes.compute_square(row) for row in to_orders]
    seen = [max(nodes.compute_energy(row), 0.0) for row in to_orders[1:]]
    usual = nodes.usual_change * float(np.sqrt(shown[0]))
    moving = nodes.count_moving(to_orders[1:])
    sizes = [*seen, *_predict_orders(shown[1:], moving, usual)]
    weights = compute_node_weights(within, at_nodes, kind)
    missed = [
        float(np.max((order(within) - weights @ order(at_nodes)) ** 2))
        for order in map(chebyshev.Chebyshev.basis, range(1, 1 + len(sizes)))
    ]
    return float(np.sqrt(np.dot(sizes, missed)))


def _predict_orders(seen: list[float], moving: float, usual: float) -> Array:
    """Mean squares of the next orders (UNSEEN_ORDERS,) from those seen (K,) of the first ones, of
    so many harmonics that move, and from the usual size of the first."""
    if not (usual > 0 and any(seen)):
        return np.zeros(UNSEEN_ORDERS)
    order, ratio, size = np.arange(len(seen)), RATIOS[:, None], usual * SIZES
    of_first = np.sum(np.array(seen) * ratio ** (-2.0 * order), axis=1, keepdims=True)
    log_sizes = len(seen) * np.log(size) + order.sum() * np.log(ratio)
    log_chance = -moving * (log_sizes + of_first / (2 * size**2))
    # sizes are looked at evenly in ln s
    log_chance += np.log(size) - 2 * np.log1p(SIZES**2 / 3)
    chance = np.exp(log_chance - log_chance.max())
    following = len(seen) + np.arange(UNSEEN_ORDERS)
    return np.asarray((chance @ size**2 / chance.sum()) @ ratio ** (2.0 * following))
