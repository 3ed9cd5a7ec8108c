"""Harmonics whose size is in doubt: averaged over how large each may be instead of kept or dropped.

A harmonic that held-out data cannot prove may still be larger than the stated error of what is
kept. Each harmonic g of 2mθ gets a Gaussian prior c_g ~ N(0, τ_g² R) with an unknown scale τ_g; the
mean and covariance over τ_g (Gibbs sampling on a grid, each step's mixture summed exactly) are the
table's. A clear harmonic is left as it is, an absent one is put to nearly zero, one in doubt keeps
its doubt in the covariance: of what two linear defects make no less than its chance before the
data.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..least_squares import invert_definite
from .normal_pieces import LEAST_SEEN, TableSolution, solve
from .table_layout import Model, TableLayout

Array = np.ndarray
COMMON_SHARE = 0.75
"""Share of a harmonic's prior variance that is the same at all nodes."""
DRIFT_SIZES = (1.0, 4.0, 16.0, 64.0, 256.0, 1024.0)
"""τ of the drift's grid in standard deviations of the harmonic when all else is known. A drift has
no natural size: as likely in one decade as in another; the largest is at least the harmonic's own
size."""
SCALE_FACTOR_SIZES = (2e-5, 2e-4, 2e-3, 2e-2)
"""τ of the scale factor's grid relative to K₀: what read-outs have (PHYSICS §1(a): mismatch
1e-4…1e-2, gap nonlinearity of 1 to 10 % of the gap). What the data would have shown, were it there,
leaves no doubt; what they are too noisy to show does. Harmonics below 20 ppm that the data do not
show count as absent."""
ABSENT = 0.01
"""τ of an absent harmonic, in the same standard deviations."""
ABSENT_TO_PRESENT = {"drift": (0.3, 1.0, 4.0, 20.0), "scale": (0.0, 0.1, 0.1, 5.0)}
"""Odds before the data of harmonic 0, 1, 2 and all higher ones of 2mθ (PHYSICS §0, harmonic
theorem): one linear defect makes the first or a constant drift, which electronics make besides; two
of them or a cubic term the second, more are needed above. A scale factor there always is.
Read-outs have some mismatch as a rule; absent harmonics within the sizes above are refuted by clean
data whatever the odds."""
OF_TWO_FAULTS = 2
"""Highest harmonic that two linear defects make: gyros have it as a rule, if small."""
PLAIN = 2
"""Place, among absent and the sizes, of the first that data see rather than the prior."""
UNSEEN = 1e-12
"""Information that directions have which no data see, over that of one coefficient by itself."""
SWEEPS, BURN_IN = 16, 4
FEWER_SWEEPS = 7
"""Enough where the mean alone is wanted."""
_Moments = tuple[Array, Array]
"""Mean and second moment about the flat solution."""


@dataclass(frozen=True)
class Doubtful:
    """A harmonic that may be absent: places (J, 2) in the coefficients, (J, 1) of a constant, the
    odds of that before the data, and the sizes it may have."""

    places: Array
    odds: float
    sizes: Array
    relative: bool
    """Whether the sizes are in standard deviations of the harmonic."""
    chance: float = 0.0
    """That it is there and of any size, which data that do not show it leave as it was."""


def find_doubtful_harmonics(
    layout: TableLayout,
    kinds: Sequence[str],
    scale_factor: float,
    beyond: Mapping[str, int] | None = None,
) -> list[Doubtful]:
    """Every harmonic of the given kinds that may be absent, each with the odds of that and the
    sizes it may have: all of a drift, the mean scale factor excepted.

    Parameters
    ----------
    layout
        Order of the coefficients.
    kinds
        "drift", "scale" or both.
    scale_factor
        K₀, of which a read-out's harmonics are parts.
    beyond
        By kind: the harmonics above this one alone.

    Returns
    -------
    list of Doubtful
        By kind, lowest first.

    Examples
    --------
    One linear defect makes a constant drift or harmonic 1; harmonic 2 needs two of them, and is
    less likely:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.shrinkage import find_doubtful_harmonics
    >>> from hrg_cli.fitting.tables.table_layout import TableLayout
    >>> layout = TableLayout(np.array([20.0]), "temperature", 2, 2, 0)
    >>> [(one.places.tolist(), one.odds) for one in find_doubtful_harmonics(layout, ["drift"], 0.3)]
    [([[0]], 0.3), ([[1, 2]], 1.0), ([[3, 4]], 4.0)]
    """
    out = []
    for kind in kinds:
        drift = kind == "drift"
        limit, part = (
            (layout.drift_harmonics, layout.drift)
            if drift
            else (layout.scale_harmonics, layout.scale)
        )
        sizes = np.array(DRIFT_SIZES) if drift else np.array(SCALE_FACTOR_SIZES) * abs(scale_factor)
        first = 0 if drift else 1
        for k in range(first if beyond is None else 1 + beyond[kind], limit + 1):
            own = np.arange(max(2 * k - 1, 0), 2 * k + 1)
            places = np.array([part(j).start + own for j in range(len(layout.nodes))])
            odds = ABSENT_TO_PRESENT[kind][min(k, 3)]
            chance = 1 / (1 + odds) if k <= OF_TWO_FAULTS else 0.0
            out.append(Doubtful(places, odds, sizes, drift, chance))
    return out


def average_over_doubt(
    information: Array,
    vector: Array,
    doubtful: Sequence[Doubtful],
    seed: int,
    sweeps: int = SWEEPS,
) -> TableSolution:
    """Posterior mean and covariance of the coefficients, the doubtful harmonics' prior scales
    integrated out.

    Parameters
    ----------
    information, vector
        Normal equations (size, size) and (size,) with unit noise.
    doubtful
        The harmonics whose size is in doubt.
    seed
        Of the draws.
    sweeps
        Of the Gibbs sampler, the first `BURN_IN` of them not counted.

    Returns
    -------
    TableSolution
        Of all coefficients.

    Examples
    --------
    A harmonic of 100 σ stays as it is; one of half a σ is more likely absent:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.shrinkage import average_over_doubt, find_doubtful_harmonics
    >>> from hrg_cli.fitting.tables.table_layout import TableLayout
    >>> layout = TableLayout(np.array([20.0]), "temperature", 2, 2, 0)
    >>> doubtful = find_doubtful_harmonics(layout, ["drift"], 0.3)
    >>> measured = np.array([0, 100, 0, 0.5, 0, 0.3])
    >>> found = average_over_doubt(np.eye(6), measured, doubtful, seed=0).coefficients
    >>> bool(found[1] > 99), bool(0 < found[3] < 0.25)
    (True, True)
    """
    generator = np.random.default_rng(seed)
    groups = [harmonic.places for harmonic in doubtful]
    A, flat = _fit_flat(information, vector)
    b = A @ flat
    grids = [_prior_variances(A, flat, g, harmonic) for g, harmonic in zip(groups, doubtful)]
    # begun where nothing is shrunk
    scale = [len(grid) - 1 for grid in grids]
    nodes = len(groups[0]) if groups else 1
    one = COMMON_SHARE * np.ones((nodes, nodes)) + (1 - COMMON_SHARE) * np.eye(nodes)
    # a defect of the read-out is the same at all nodes but for its own course with temperature
    priors = [np.kron(one, np.eye(g.shape[1])) for g in groups]
    inverse_priors = [np.linalg.inv(prior) for prior in priors]

    def invert_without(n: int) -> Array:
        """Covariance with the priors of all harmonics but one; summed anew, since what a narrow
        prior adds and takes off again would leave its rounding."""
        precision = A.copy()
        for k, (g, grid, i) in enumerate(zip(groups, grids, scale)):
            if k != n:
                precision[np.ix_(g.ravel(), g.ravel())] += inverse_priors[k] / grid[i]
        return invert_definite(precision)

    passes: list[list[_Moments]] = [[] for _ in groups]
    seen: list[list[_Moments]] = [[] for _ in groups]
    for sweep in range(sweeps):
        # Gibbs: the harmonic's own prior is taken out, its sizes weighed by what all others leave,
        # one drawn. The mean over sizes is summed exactly at each step (Rao and Blackwell), so a
        # dozen sweeps do; their order is drawn, since harmonics in a fixed one follow each other
        for n in generator.permutation(len(groups)):
            own = groups[n].ravel()
            covariance = invert_without(n)
            mean, gain = covariance @ b, covariance[:, own]
            weights, plain, steps = _weigh_sizes(
                mean, gain, own, grids[n], priors[n], doubtful[n].odds
            )
            if sweep >= BURN_IN:
                passes[n].append(_sum_mixture(mean - flat, covariance, weights, steps))
                seen[n].append(_sum_mixture(mean - flat, covariance, plain, steps))
            scale[n] = int(generator.choice(len(weights), p=weights))
    away, spread = _combine(passes, seen, doubtful)
    return TableSolution(flat + away, spread, float(np.trace(spread @ A)))


def _fit_flat(A: Array, b: Array) -> tuple[Array, Array]:
    """The information with a little in every direction, and the fit without priors.

    What no data see keeps a finite, wide variance about the fit: about 0 that would draw there what
    they hardly see.
    """
    flat = solve(A, b, Model("flat", np.eye(len(b)))).coefficients
    least = UNSEEN * np.maximum(np.diag(A), LEAST_SEEN * np.diag(A).max())
    return A + np.diag(least), flat


def _sum_mixture(
    away: Array, covariance: Array, weights: Array, steps: Sequence[Array]
) -> _Moments:
    """Mean and second moment over the sizes of one harmonic, the others' held: about the flat
    solution, where mean and square of small differences keep their digits."""
    first, second = np.zeros_like(away), np.zeros_like(covariance)
    for weight, whitened in zip(weights, steps):
        # It could change no digit that is read.
        if weight < 1e-9:
            continue
        own = away - whitened[:, 1:].T @ whitened[:, 0]
        first += weight * own
        second += weight * (covariance - whitened[:, 1:].T @ whitened[:, 1:] + np.outer(own, own))
    return first, second


def _combine(
    passes: Sequence[Sequence[_Moments]],
    seen: Sequence[Sequence[_Moments]],
    doubtful: Sequence[Doubtful],
) -> _Moments:
    """Mean and covariance over all passes, each harmonic's own as the passes over its sizes say.

    A size that has a chance of one in fifty is hardly ever among a dozen draws, though it makes
    nearly all of the variance: of its own harmonic the sum over sizes knows it, and the rest, C =
    C_rest|g + W C_g Wᵀ with W = C[:, g] C_g⁻¹, follows (Jeffrey's rule; positive semidefinite).
    """
    away, second = (np.mean([one[i] for own in passes for one in own], axis=0) for i in (0, 1))
    covariance = second - np.outer(away, away)
    for own_passes, own_seen, harmonic in zip(passes, seen, doubtful):
        own = harmonic.places.ravel()
        block = np.ix_(own, own)
        first = np.mean([one[own] for one, _ in own_passes], axis=0)
        square = np.mean([two[block] for _, two in own_passes], axis=0)
        likely = square - np.outer(first, first)
        plain = _about(first, own_seen, own)
        kept = harmonic.chance * plain + (1 - harmonic.chance) * likely
        along = np.linalg.solve(covariance[block], covariance[own]).T
        changed = kept - covariance[block]
        away = away + along @ (first - away[own])
        covariance = covariance + along @ changed @ along.T
    return away, covariance


def _about(mean: Array, moments: Sequence[_Moments], own: Array) -> Array:
    """Second moment about a mean of a harmonic that is there, and of a size that data see.

    How many decades its size might lie in counts against a harmonic that is hardly seen, and is no
    evidence. What was there by a chance before data that do not tell is so behind them; with the
    odds of the decades it was 0 within a tenth of what they exclude.
    """
    first = np.mean([one[own] for one, _ in moments], axis=0)
    second = np.mean([two[np.ix_(own, own)] for _, two in moments], axis=0)
    return np.asarray(second - np.outer(first, mean) - np.outer(mean, first) + np.outer(mean, mean))


def _prior_variances(A: Array, flat: Array, own: Array, harmonic: Doubtful) -> Array:
    """Variances that a harmonic's prior may have, the first for one that is absent; the last holds
    what a fit without a prior (`flat`) found, so that nothing seen is shrunk away."""
    # σ of a cosine, or sine, common to all nodes: what the data tell of the harmonic as a whole
    told = float(np.mean([A[np.ix_(own[:, a], own[:, a])].sum() for a in range(own.shape[1])]))
    one_std = 1 / np.sqrt(told)
    sizes = np.append(ABSENT * one_std, harmonic.sizes * (one_std if harmonic.relative else 1.0))
    sizes[-1] = max(sizes[-1], float(np.sqrt(np.mean(flat[own] ** 2))))
    return np.asarray(sizes**2)


def _weigh_sizes(
    mean: Array, gain: Array, own: Array, variances: Array, prior: Array, odds: float
) -> tuple[Array, Array, list[Array]]:
    """Posterior weights of a harmonic's prior variances, of those alone that data see, and each
    one's whitened step from the mean without any prior on it.

    The marginal likelihood of variance v is that of the harmonic's own mean, N(0, C + vP): C its
    covariance without the prior, P the prior's shape.
    """
    logs, steps = [], []
    for variance in variances:
        factor = np.linalg.cholesky(gain[own] + variance * prior)
        whitened = np.linalg.solve(factor, np.column_stack([mean[own], gain.T]))
        logs.append(
            -0.5 * float(whitened[:, 0] @ whitened[:, 0]) - float(np.log(np.diag(factor)).sum())
        )
        steps.append(whitened)
    before = np.full(len(variances), 1 / (len(variances) - 1))
    before[0] = odds
    plain = np.where(np.arange(len(variances)) < PLAIN, 0.0, before)
    return _weigh(before, np.array(logs)), _weigh(plain, np.array(logs)), steps


def _weigh(before: Array, logs: Array) -> Array:
    """Weights of logarithms of likelihoods, of those that have a chance before the data."""
    there = before > 0
    weights = np.zeros_like(before)
    weights[there] = before[there] * np.exp(logs[there] - logs[there].max())
    return np.asarray(weights / weights.sum())
