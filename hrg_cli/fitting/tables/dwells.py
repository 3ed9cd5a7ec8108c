"""Least squares of a table of dwells: nodes of temperature, powers of the rate, spikes, and the
covariance that correlated rows leave."""

from __future__ import annotations

import numpy as np

from ...fourier import compute_node_weights
from ..least_squares import fit_columns, invert_scaled

Array = np.ndarray


FOLDS, STRETCHES = 5, 25
"""Every fifth of 25 stretches of the rows is left out together: neighbours stay together, and a
sweep of temperature is not cut short."""
FEWEST_LEFT = 4
"""Rows beyond the coefficients from which the scatter of the rows is told."""
FEWEST_FOR_SPIKES = 8
"""Rows beyond the coefficients from which a spike is told from a bend."""
ROWS_A_NODE = 5
"""Rows per coefficient from which the spacing of the nodes alone decides their number."""
LARGEST_CONDITION = 1e6
ON_GRID = 0.02
"""Part of a step by which rounded values may miss its multiples."""
ROUNDING = 1e-12
"""Relative scatter that is rounding, not noise."""


def list_node_choices(
    omega: Array, degc: Array, spacing: float, interpolation: str, turning: bool
) -> list[Array]:
    """Even nodes at most `spacing` apart, in every number that the rows can carry.

    Every node is seen, and rows are left over to tell their scatter. Where the rows are many for
    the nodes that the spacing asks for, it alone decides.

    Parameters
    ----------
    omega
        Rate (n,) [rad/s].
    degc
        Temperature (n,) [°C].
    spacing
        Largest distance of two nodes [°C].
    interpolation
        Between the nodes: "linear" or "cubic".
    turning
        Whether the rate changes, so that the scale factor has nodes too.

    Returns
    -------
    list of ndarray
        Each (J,) [°C]; one where the spacing decides, several where the rows must choose.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.dwells import list_node_choices
    >>> degc = np.linspace(0.0, 40.0, 100)
    >>> [n.tolist() for n in list_node_choices(0 * degc, degc, 20.0, "linear", False)]
    [[0.0, 20.0, 40.0]]
    >>> [len(n) for n in list_node_choices(0 * degc[::10], degc[::10], 5.0, "linear", False)]
    [2, 3, 4, 5, 6]
    """
    low, high = float(degc.min()), float(degc.max())
    if high - low < 1e-6:
        return [np.array([low])]
    count = int(np.clip(np.ceil((high - low) / spacing) + 1, 2, 12))
    a_node = 2 if turning else 1
    # A third of the rows stays to tell the scatter, four at the least.
    room = max(2, (len(degc) - max(FEWEST_LEFT, len(degc) // 3)) // a_node)
    able = []
    for n in range(2, min(count, room) + 1):
        nodes = np.linspace(low, high, n)
        X = build_dwell_design(omega, degc, nodes, interpolation, turning, [])
        size = np.linalg.norm(X, axis=0)
        if (size > 0).all() and np.linalg.cond(X / size) < LARGEST_CONDITION:
            able.append(nodes)
    if not able:
        return [np.array([(low + high) / 2])]
    if len(able[-1]) == count and len(degc) >= ROWS_A_NODE * a_node * count:
        return able[-1:]
    return able


def find_least_count(y: Array) -> float:
    """The step on whose multiples all values lie: the resolution of what measured them.

    Parameters
    ----------
    y
        Values (n,).

    Returns
    -------
    float
        In their unit; 0 where there is no grid to be seen.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.dwells import find_least_count
    >>> round(find_least_count(np.array([0.0, 0.25, 0.5, 1.25, 2.5])), 9)
    0.25
    >>> find_least_count(np.random.default_rng(0).standard_normal(50))
    0.0
    """
    steps = np.diff(np.unique(y))
    if len(steps) < 3:
        return 0.0
    step = float(steps.min())
    multiples = steps / step
    miss = float(np.max(np.abs(multiples - np.round(multiples)) / np.maximum(multiples, 1)))
    # one step apart all along, and two where a row lies in another band, is a ramp, which looks the
    # same without any grid; and a large multiple is always near a whole one
    telling = multiples[2 * miss * multiples < 1]
    return step if miss < ON_GRID and len(np.unique(np.round(telling))) > 2 else 0.0


def find_spikes(X: Array, residual: Array, keep: Array, limit: float, step: float) -> Array:
    """Rows further from the fit than `limit` robust standard deviations, each held against its own
    error.

    A row that helps to fix the curve is pulled to it: its residual has the variance s²(1 − h), h
    its leverage, and s²(1 + h) where it was left out. None is called a spike where too few rows are
    left over to tell.

    Parameters
    ----------
    X
        Columns (n, p) of the fit.
    residual
        (n,).
    keep
        (n,) bool: rows that the fit is of.
    limit
        Standard deviations, of 1.4826 times the median deviation.
    step
        Least count, which rows cannot scatter by less than; 0: none.

    Returns
    -------
    ndarray
        (n,) bool.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.dwells import find_spikes
    >>> residual = np.random.default_rng(0).standard_normal(50)
    >>> residual[7] = 30.0
    >>> np.flatnonzero(find_spikes(np.ones((50, 1)), residual, residual < 99, 6.0, 0.0)).tolist()
    [7]
    """
    left = int(keep.sum()) - X.shape[1]
    if left < FEWEST_FOR_SPIKES:
        return np.zeros(len(residual), bool)
    own = residual[keep]
    spread = 1.4826 * float(np.median(np.abs(own - np.median(own)))) * np.sqrt(keep.sum() / left)
    # Values on a grid cannot scatter by less than their rounding.
    spread = max(spread, step / np.sqrt(12))
    if spread <= ROUNDING * float(np.abs(X).max() + np.abs(residual).max()):
        return np.zeros(len(residual), bool)
    leverage = np.sum((X @ invert_scaled(X[keep])) ** 2, axis=1)
    # A row that was left out did not pull the curve: its residual has the variance s²(1 + h).
    error = np.sqrt(np.where(keep, np.maximum(1 - leverage, 0.1), 1 + leverage))
    return np.asarray(np.abs(residual) > limit * spread * error)


def build_dwell_design(
    omega: Array, degc: Array, nodes: Array, interpolation: str, turning: bool, powers: list[int]
) -> Array:
    """Columns of the output of dwells: −D + KΩ, and powers of the rate.

    Parameters
    ----------
    omega
        Rate (n,) [rad/s].
    degc
        Temperature (n,) [°C].
    nodes
        (J,) [°C].
    interpolation
        Between the nodes: "linear" or "cubic".
    turning
        Whether the scale factor has nodes too.
    powers
        Of the rate, beside the first.

    Returns
    -------
    ndarray
        (n, ·): −D at the nodes; where it turns, K·Ω at the nodes and the powers of the rate.

    Examples
    --------
    At 5 °C, midway between two nodes, and 2 rad/s, with Ω³:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.dwells import build_dwell_design
    >>> nodes = np.array([0.0, 10.0])
    >>> build_dwell_design(np.array([2.0]), np.array([5.0]), nodes, "linear", True, [3]).tolist()
    [[0.5, 0.5, 1.0, 1.0, 8.0]]
    """
    weights = compute_node_weights(degc, nodes, interpolation)
    if not turning:
        return weights
    return np.concatenate(
        [weights, weights * omega[:, None], *((omega**p)[:, None] for p in powers)], axis=1
    )


def choose_powers(
    y: Array,
    omega: Array,
    degc: Array,
    nodes: Array,
    interpolation: str,
    turning: bool,
    largest: int,
) -> tuple[list[int], dict[str, float]]:
    """Powers 2…P of the rate with the smallest held-out residual.

    Parameters
    ----------
    y
        Output (n,).
    omega
        Rate (n,) [rad/s].
    degc
        Temperature (n,) [°C].
    nodes
        (J,) [°C].
    interpolation
        Between the nodes: "linear" or "cubic".
    turning
        Whether the rate changes; otherwise no powers.
    largest
        Largest P tried; fewer than there are rates.

    Returns
    -------
    tuple
        The powers, and the held-out root mean square by P, in the output's unit.

    Examples
    --------
    A cubic characteristic is not predicted by the powers up to two:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.dwells import choose_powers
    >>> omega = np.tile(np.linspace(-2.0, 2.0, 9), 20)
    >>> y = omega + 0.1 * omega**3 + 1e-3 * np.random.default_rng(0).standard_normal(180)
    >>> powers, scores = choose_powers(y, omega, 0 * omega, np.array([0.0]), "linear", True, 3)
    >>> powers, scores["2"] > 10 * scores["3"]
    ([2, 3], True)
    """
    if not turning:
        return [], {
            "1": compute_held_out_rms(
                y, build_dwell_design(omega, degc, nodes, interpolation, turning, [])
            )
        }
    scores = {}
    for highest in range(1, min(largest, len(np.unique(omega)) - 1) + 1):
        X = build_dwell_design(
            omega, degc, nodes, interpolation, turning, list(range(2, highest + 1))
        )
        scores[str(highest)] = compute_held_out_rms(y, X)
    best = int(min(scores, key=lambda key: scores[key]))
    return list(range(2, best + 1)), scores


def compute_held_out_rms(y: Array, X: Array) -> float:
    """Root mean square of the rows predicted without their fold of stretches.

    Parameters
    ----------
    y
        Values (n,).
    X
        Columns (n, p).

    Returns
    -------
    float
        In the values' unit.

    Examples
    --------
    One spike of 10 in a hundred rows; what predicts it has not seen it:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.dwells import compute_held_out_rms
    >>> y = np.where(np.arange(100) == 50, 10.0, 0.0)
    >>> bool(compute_held_out_rms(y, np.ones((100, 1))) > y.std())
    True
    """
    fold = np.arange(len(y)) * min(STRETCHES, len(y)) // len(y) % FOLDS
    residual = np.empty(len(y))
    for f in range(FOLDS):
        own = fold == f
        residual[own] = y[own] - X[own] @ fit_columns(X[~own], y[~own])
    return float(np.sqrt(np.mean(residual**2)))


def compute_covariance(X: Array, residual: Array, step: float) -> Array:
    """Covariance of the coefficients of correlated rows.

    s²(XᵀX)⁻¹ times the inflation 1 + 2Σ(1 − k/K)ρ_k that the correlation of neighbouring rows asks
    for, never less than one. s² from the rows left over, at least a least count's step²/12, times
    n/(n − 2) for how little n of them tell it.

    Parameters
    ----------
    X
        Columns (n, p).
    residual
        (n,).
    step
        Least count of the values; 0: none.

    Returns
    -------
    ndarray
        (p, p); NaN where the rows lie on the curve to the last digit: what they scatter by is then
        not known.

    Examples
    --------
    The mean of ten thousand white values is known to a hundredth of their scatter:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.dwells import compute_covariance
    >>> white = np.random.default_rng(0).standard_normal(10_000)
    >>> round(float(compute_covariance(np.ones((10_000, 1)), white, 0.0)[0, 0] ** 0.5), 3)
    0.01
    """
    left = max(len(X) - X.shape[1], 0)
    power = float(residual @ residual)
    if left < 3 or (
        power / len(X) <= (ROUNDING * float(np.abs(X).max() + np.abs(residual).max())) ** 2
        and step == 0
    ):
        return np.full((X.shape[1], X.shape[1]), np.nan)
    variance = max(power / left, step**2 / 12) * left / (left - 2)
    lags = np.arange(1, max(2, min(len(X) // 10, 200)))
    correlations = (
        np.array([residual[k:] @ residual[:-k] for k in lags]) / power
        if power > 0
        else np.zeros(len(lags))
    )
    # sum up to the first lag without correlation: beyond it there is only noise to add
    stop = (
        int(np.argmax(correlations < 2 / np.sqrt(len(X))))
        if (correlations < 2 / np.sqrt(len(X))).any()
        else len(lags)
    )
    inflation = max(1.0, 1 + 2 * float(((1 - lags[:stop] / len(X)) * correlations[:stop]).sum()))
    inverse = invert_scaled(X)
    return np.asarray(inflation * variance * (inverse @ inverse.T))
