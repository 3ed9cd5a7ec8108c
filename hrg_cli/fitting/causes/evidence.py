"""Evidence for causes in a whitened residual: scores, what can be told apart, selection. Knows
nothing of gyros.

Notation: r (N,) whitened residual of a base model with Jacobian J (N, k), S (N, m) a candidate's
sensitivities, all over σ. With Q an orthonormal basis of J: s⊥ = S − Q Qᵀ S, T = |P_{s⊥} r|² is the
fall of χ² the candidate buys with `rank` parameters.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

import numpy as np

from .designs import Basis

Array = np.ndarray
BLIND = 3e-4
"""Independence |s⊥|/|s| below which a candidate counts as invisible beside the base model."""
TOGETHER = 16
"""Columns of candidates multiplied with one another in one matrix product."""


@dataclass(frozen=True)
class Score:
    """A candidate's columns (N, m) beside a basis: fall of χ² `gain` for `rank` parameters,
    estimates with σ, independence.

    `made`: what makes the columns; `directions` (m, rank): their combinations whose parts beside
    the basis are orthonormal.
    """

    name: str
    gain: float
    rank: int
    z: float
    p_value: float
    estimate: Array
    std: Array
    independence: float
    made: Callable[[], Array] = field(repr=False)
    directions: Array = field(repr=False)
    basis: Basis = field(repr=False)

    @property
    def visible(self) -> bool:
        """Whether these data can show it at all."""
        return self.rank > 0

    @cached_property
    def columns(self) -> Array:
        """The candidate's sensitivities (N, m)."""
        return self.made()

    @cached_property
    def space(self) -> Array:
        """Orthonormal basis (N, rank) of what the candidate does beside the basis."""
        return self.basis.project_out(self.basis.project_out(self.columns @ self.directions))


def score(name: str, residual: Array, sensitivity: Array, basis: Basis) -> Score:
    """Score of one candidate beside the base model.

    Parameters
    ----------
    name
        Of the candidate.
    residual
        r (N,), over σ.
    sensitivity
        S (N, m), over σ.
    basis
        Of what the base model leaves free.

    Returns
    -------
    Score
        Fall of χ², estimate with σ, and the rest.

    Examples
    --------
    Beside a mean, four values that go up and down by 1.5 σ: 3 σ, the size known to 1/√4.

    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.designs import Basis
    >>> from hrg_cli.fitting.causes.evidence import score
    >>> mean, sides = Basis((), np.full((4, 1), 0.5)), np.array([[1.0], [-1.0], [1.0], [-1.0]])
    >>> found = score("sides", 1.5 * sides[:, 0], sides, mean)
    >>> round(found.gain, 9), round(found.z, 9), found.estimate.round(9), found.std
    (9.0, 3.0, array([1.5]), array([0.5]))
    """
    return score_candidates([name], residual, [sensitivity], basis)[0]


def score_candidates(
    names: Sequence[str], residual: Array, sensitivities: Sequence[Array], basis: Basis
) -> list[Score]:
    """Scores of many candidates beside the base model.

    Parameters
    ----------
    names
        Of the candidates.
    residual
        r (N,), over σ.
    sensitivities
        S (N, m) of each, over σ.
    basis
        Of what the base model leaves free.

    Returns
    -------
    list of Score
        In the order of the names.

    Examples
    --------
    What does the same as the base model is not seen beside it:

    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.designs import Basis
    >>> from hrg_cli.fitting.causes.evidence import score_candidates
    >>> mean, sides = Basis((), np.full((4, 1), 0.5)), np.array([[1.0], [-1.0], [1.0], [-1.0]])
    >>> tried = [sides, 0 * sides + 1]
    >>> found = score_candidates(["sides", "mean again"], 1.5 * sides[:, 0], tried, mean)
    >>> [(one.name, one.visible) for one in found]
    [('sides', True), ('mean again', False)]
    """
    ledger = Ledger(residual, basis)
    if sensitivities:
        ledger.enter(np.concatenate(sensitivities, axis=1), [S.shape[1] for S in sensitivities])
    return ledger.compute_scores(names, [partial(np.asarray, S) for S in sensitivities])


class Ledger:
    """What the scores of many candidates beside a basis come from; their columns are looked at once
    and not kept.

    With S of unit columns, B = Qᵀ S: s⊥ᵀ s⊥ = Sᵀ S − Bᵀ B and s⊥ᵀ r = Sᵀ r − Bᵀ Qᵀ r, exact to
    rounding over BLIND².
    """

    def __init__(self, residual: Array, basis: Basis) -> None:
        self.basis = basis
        self.beside = np.column_stack([basis.shared, residual])
        self.known = basis.project(residual)
        self.entries: list[tuple[Array, Array, Array]] = []

    def enter(self, S: Array, widths: Sequence[int]) -> None:
        """Candidates' columns side by side, (N, Σ widths)."""
        with np.errstate(over="ignore", invalid="ignore"):
            shared = self.beside.T @ S
            alone = [Q.T @ S[rows] for rows, Q in self.basis.own]
            B = self.basis.keep(np.concatenate([*alone, shared[:-1]]))
            c = shared[-1] - self.known @ B
        ends = np.cumsum([0, *widths])
        start = 0
        while start < len(widths):
            stop = max(start + 1, int(np.searchsorted(ends, ends[start] + TOGETHER, "right")) - 1)
            some = slice(ends[start], ends[stop])
            with np.errstate(over="ignore", invalid="ignore"):
                G = S[:, some].T @ S[:, some]
                size = np.sqrt(np.diag(G))
                unit = np.where(np.isfinite(size) & (size > 0), size, 1.0)
                P, projected = (
                    (G - B[:, some].T @ B[:, some]) / unit / unit[:, None],
                    c[some] / unit,
                )
            # only each candidate's own block is kept: products between candidates are not asked for
            for k in range(start, stop):
                own = slice(ends[k] - ends[start], ends[k + 1] - ends[start])
                self.entries.append((P[own, own], projected[own], size[own]))
            start = stop

    def compute_scores(
        self, names: Sequence[str], columns: Sequence[Callable[[], Array]]
    ) -> list[Score]:
        """Of all candidates in the order they were entered; `columns`: what makes their columns
        anew."""
        alike: dict[int, list[int]] = {}
        # those of one width together: one call of eigh for all of them instead of hundreds
        for number, (_, _, size) in enumerate(self.entries):
            alike.setdefault(len(size), []).append(number)
        out: dict[int, Score] = {}
        for numbers in alike.values():
            judged = _project_candidates(
                *(np.stack([self.entries[n][k] for n in numbers]) for k in range(3))
            )
            for n, (gain, rank, z, p, estimate, std, independence, directions) in zip(
                numbers, judged, strict=True
            ):
                out[n] = Score(
                    names[n],
                    gain,
                    rank,
                    z,
                    p,
                    estimate,
                    std,
                    independence,
                    columns[n],
                    directions,
                    self.basis,
                )
        return [out[n] for n in range(len(names))]


def _project_candidates(P: Array, c: Array, size: Array) -> Iterator[tuple[Any, ...]]:
    """Of candidates with m columns each: s⊥ᵀ s⊥ (n, m, m) and s⊥ᵀ r (n, m) of unit columns, their
    lengths before (n, m)."""
    usable = np.all(np.isfinite(size), axis=1) & np.any(size > 0, axis=1)
    P, c = np.where(usable[:, None, None], P, 0.0), np.where(usable[:, None], c, 0.0)
    s, V, directions = _shown_directions(P)
    keep = s > BLIND
    projected = np.einsum("nij,ni->nj", directions, c)
    gain, rank = np.sum(projected**2, axis=1), keep.sum(axis=1)
    lost = (
        np.sum(np.where(keep[:, None, :], 0.0, V**2), axis=2) > 0.5
    )  # directions the data do not show
    blind = lost | ~(size > 0) | (rank == 0)[:, None]
    safe = np.where(size > 0, size, 1.0)
    with np.errstate(invalid="ignore"):
        estimate = np.where(blind, np.nan, np.einsum("nij,nj->ni", directions, projected) / safe)
        std = np.where(blind, np.inf, np.sqrt(np.sum(directions**2, axis=2)) / safe)
    z, p = _significance(gain, rank)
    for n in range(len(P)):
        largest = float(s[n, -1]) if rank[n] else 0.0
        to_unit = directions[n][:, keep[n]] / safe[n][:, None]
        yield (
            float(gain[n]),
            int(rank[n]),
            float(z[n]),
            float(p[n]),
            estimate[n],
            std[n],
            largest,
            to_unit,
        )


def compute_gains(P: Array, c: Array) -> tuple[Array, Array]:
    """Falls of χ² and numbers of parameters of many candidates, from their products alone.

    Parameters
    ----------
    P
        s⊥ᵀ s⊥ (n, m, m) of unit columns.
    c
        s⊥ᵀ r (n, m).

    Returns
    -------
    tuple of ndarray
        (n,) and (n,); directions less than `BLIND` beside the base model do not count.

    Examples
    --------
    Two columns apart, each with 2 σ of the residual; then twice the same column:

    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.evidence import compute_gains
    >>> gain, rank = compute_gains(np.array([np.eye(2), np.ones((2, 2))]), np.full((2, 2), 2.0))
    >>> gain.round(6).tolist(), rank.tolist()
    ([8.0, 4.0], [2, 1])
    """
    s, _, directions = _shown_directions(P)
    return np.sum(np.einsum("nij,ni->nj", directions, c) ** 2, axis=1), np.sum(s > BLIND, axis=1)


def compute_chances(gain: Array, rank: Array) -> Array:
    """Probabilities that noise makes χ² fall by as much with so many parameters.

    Parameters
    ----------
    gain
        Falls of χ² (n,).
    rank
        Numbers of parameters (n,).

    Returns
    -------
    ndarray
        (n,); 1 without a parameter.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.evidence import compute_chances
    >>> compute_chances(np.array([9.0, 9.0, 9.0]), np.array([1, 2, 0])).round(4).tolist()
    [0.0027, 0.0111, 1.0]
    """
    return _significance(gain, rank)[1]


def _shown_directions(P: Array) -> tuple[Array, Array, Array]:
    """Of s⊥ᵀ s⊥ (n, m, m) of unit columns: independence (n, m) along the eigenvectors (n, m, m),
    and these over it, 0 where it is none."""
    power, V = np.linalg.eigh(P)
    s = np.sqrt(np.maximum(power, 0.0))
    keep = s > BLIND
    return s, V, np.where(keep[:, None, :], V / np.where(keep, s, 1.0)[:, None, :], 0.0)


def find_significance(gain: float, rank: int) -> tuple[float, float]:
    """How improbable a fall of χ² is by noise alone.

    Parameters
    ----------
    gain
        Fall of χ².
    rank
        Number of parameters that it took.

    Returns
    -------
    tuple of float
        |z| of one normal variable as improbable, and the probability p.

    Examples
    --------
    >>> from hrg_cli.fitting.causes.evidence import find_significance
    >>> z, p = find_significance(9.0, 1)
    >>> round(z, 6), round(p, 4)
    (3.0, 0.0027)
    """
    z, p = _significance(np.array(gain), np.array(rank))
    return float(z), float(p)


def _significance(gain: Array, rank: Array) -> tuple[Array, Array]:
    from scipy.special import chdtrc, ndtri

    p = np.where(rank > 0, chdtrc(np.maximum(rank, 1), gain), 1.0)
    # beyond 36 σ p underflows, and |z| of one variable is √χ² to a percent or two
    return np.where(p > 1e-280, np.maximum(0.0, -ndtri(p / 2)), np.sqrt(gain)), p


def combine_chances(p: float, q: float) -> float:
    """Chance that two independent tests together come out so small.

    −2 ln pq is χ² with four degrees of freedom (Fisher 1925), so that it is pq (1 − ln pq).

    Parameters
    ----------
    p, q
        Their chances alone.

    Returns
    -------
    float
        Their chance together.

    Examples
    --------
    >>> from hrg_cli.fitting.causes.evidence import combine_chances
    >>> round(combine_chances(0.05, 0.05), 4), combine_chances(1.0, 1.0)
    (0.0175, 1.0)
    """
    product = max(p, 1e-300) * max(q, 1e-300)
    return float(min(1.0, product * (1.0 - np.log(product))))


def count_independent(spaces: Sequence[Array]) -> float:
    """How many independent tests those along several spaces amount to.

    |S_jᵀ r|² and |S_kᵀ r|² of a residual r of this noise correlate by ρ = |S_jᵀ S_k|²/|S_jᵀ
    S_j||S_kᵀ S_k| (Frobenius norms); with the eigenvalues λ of √ρ the tests are as good as
    (Σ√λ)²/Σλ (Galwey 2009).

    Parameters
    ----------
    spaces
        S_k (N, q_k): orthonormal columns times the root of the noise's power.

    Returns
    -------
    float
        From 1, all the same, to their number, all apart.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.evidence import count_independent
    >>> first, second = np.eye(2)[:, :1], np.eye(2)[:, 1:]
    >>> [round(count_independent(pair), 6) for pair in ([first, second], [first, first])]
    [2.0, 1.0]
    """
    norms = [float(np.linalg.norm(S.T @ S)) for S in spaces]
    shared = np.array([[np.linalg.norm(S.T @ R) for R in spaces] for S in spaces])
    root = shared / np.sqrt(np.outer(norms, norms))
    values = np.maximum(np.linalg.eigvalsh(root), 0.0)
    return float(np.sum(np.sqrt(values)) ** 2 / np.sum(values))


def correct_for_tries(p_value: float, tried: float) -> float:
    """Chance of the best of several candidates: 1 − (1 − p)ⁿ (Šidák 1967).

    Parameters
    ----------
    p_value
        p of the best alone.
    tried
        n, how many independent ones were tried.

    Returns
    -------
    float
        That noise makes the best of them as good.

    Examples
    --------
    >>> from hrg_cli.fitting.causes.evidence import correct_for_tries
    >>> round(correct_for_tries(0.01, 5), 4), round(1e20 * correct_for_tries(1e-20, 5), 6)
    (0.049, 5.0)
    """
    # 1 − (1 − p)^n, which in this form keeps its digits where p is 1e-20
    return float(-np.expm1(tried * np.log1p(-min(p_value, 1 - 1e-16))))


def price_numbers(count: int, size: float, rows: int) -> float:
    """What q numbers found together have to take off χ² before they are worth anything: ln N for
    the first, and for the others what makes so large a fall as improbable as that of one.

    2 ln of the ratio of the tails of χ²_q and χ²_1 (Wilks 1938), at most ln N each (Schwarz 1978):
        ln N + min[(q − 1) ln(z²/2) − 2 ln Γ(q/2) + ln π, (q − 1) ln N],   z² ≥ q.

    Parameters
    ----------
    count
        q.
    size
        z², the fall of χ² by all of them.
    rows
        N, values that were fitted.

    Returns
    -------
    float
        Of all q; 0 of none.

    Examples
    --------
    Four numbers of 6 σ among 5000 values cost what 2 would at ln N each:

    >>> from hrg_cli.fitting.causes.evidence import price_numbers
    >>> [round(price_numbers(q, 36.0, 5000) / price_numbers(1, 36.0, 5000), 2) for q in (1, 2, 4)]
    [1.0, 1.47, 2.15]
    """
    if count == 0:
        return 0.0
    each = float(np.log(rows))
    by_chance = (
        (count - 1) * math.log(max(size, count) / 2)
        - 2 * math.lgamma(count / 2)
        + math.log(math.pi)
    )
    return each + min(by_chance, (count - 1) * each)


def find_bic_gain(gain: float, rank: int, rows: int) -> float:
    """What a candidate is worth: Δχ² − price, by the Bayesian information criterion (Schwarz 1978)
    for one number, and as `price_numbers` says for several.

    Parameters
    ----------
    gain
        Fall of χ².
    rank
        Number of parameters that it took.
    rows
        N, values that were fitted.

    Returns
    -------
    float
        Positive where it is worth its parameters.

    Examples
    --------
    Among a thousand values a parameter has to take 6.9 off χ²:

    >>> from hrg_cli.fitting.causes.evidence import find_bic_gain
    >>> round(find_bic_gain(10.0, 1, 1000), 1), round(find_bic_gain(10.0, 2, 1000), 1)
    (3.1, 0.3)
    """
    return gain - price_numbers(rank, gain, rows)


def correlate_spaces(a: Score, b: Score) -> float:
    """Largest canonical correlation of two candidates' spaces beside the base model.

    Parameters
    ----------
    a, b
        Their scores beside the same basis.

    Returns
    -------
    float
        0 to 1; 1 when one cannot be told from the other, 0 where one is not seen at all.

    Examples
    --------
    Beside a mean the first two and the last two of four values are the same but for the sign:

    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.designs import Basis
    >>> from hrg_cli.fitting.causes.evidence import correlate_spaces, score
    >>> mean, r = Basis((), np.full((4, 1), 0.5)), np.zeros(4)
    >>> first, last = np.array([[1.0], [1.0], [0.0], [0.0]]), np.array([[0.0], [0.0], [1.0], [1.0]])
    >>> round(correlate_spaces(score("first", r, first, mean), score("last", r, last, mean)), 9)
    1.0
    """
    if a.rank == 0 or b.rank == 0:
        return 0.0
    return float(np.linalg.svd(a.space.T @ b.space, compute_uv=False)[0])


def correlate_all_spaces(scores: Sequence[Score]) -> Array:
    """`correlate_spaces` of all pairs.

    Parameters
    ----------
    scores
        m candidates beside the same basis.

    Returns
    -------
    ndarray
        (m, m), ones along the diagonal.

    Examples
    --------
    Beside a mean, what goes up and down in turn and what is up in the first half are apart:

    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.designs import Basis
    >>> from hrg_cli.fitting.causes.evidence import correlate_all_spaces, score
    >>> mean, sides = Basis((), np.full((4, 1), 0.5)), np.array([[1.0], [-1.0], [1.0], [-1.0]])
    >>> half, r = np.array([[1.0], [1.0], [0.0], [0.0]]), np.zeros(4)
    >>> scores = [score("sides", r, sides, mean), score("half", r, half, mean)]
    >>> correlate_all_spaces(scores).round(9).tolist()
    [[1.0, 0.0], [0.0, 1.0]]
    """
    out = np.eye(len(scores))
    for i, a in enumerate(scores):
        for j in range(i):
            out[i, j] = out[j, i] = correlate_spaces(a, scores[j])
    return out


def measure_smooth_power(
    residual: Array, basis: Basis, smooth: Sequence[tuple[slice, Array]]
) -> tuple[float, int]:
    """Omnibus test: χ² of a residual along smooth columns beside the base model.

    Within their rows the columns are made orthonormal beside that part of the basis, A; with C = Qᵀ
    A of the shared part Q their products are I − Cᵀ C.

    Parameters
    ----------
    residual
        r (N,), over σ.
    basis
        Of what the base model leaves free.
    smooth
        Columns that live on some rows alone, on those of each own part of the basis in turn.

    Returns
    -------
    tuple
        χ² and its degrees of freedom.

    Examples
    --------
    A line through four values, beside the mean that the run has of its own:

    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.designs import Basis
    >>> from hrg_cli.fitting.causes.evidence import measure_smooth_power
    >>> rows, line = slice(0, 4), np.array([[-3.0], [-1.0], [1.0], [3.0]])
    >>> basis = Basis(((rows, np.full((4, 1), 0.5)),), np.zeros((4, 0)))
    >>> power, degrees = measure_smooth_power(line[:, 0], basis, [(rows, line)])
    >>> round(power, 9), degrees
    (20.0, 1)
    """
    a, C = [], []
    for (rows, S), (same, Q) in zip(smooth, basis.own, strict=True):
        assert rows == same
        # unit columns first, so that BLIND is a part of each and not of the longest
        S = S / np.maximum(np.sqrt(np.einsum("ij,ij->j", S, S)), 1e-300)
        S = S - Q @ (Q.T @ S)
        power, V = np.linalg.eigh(S.T @ S)
        keep = power > BLIND**2
        A = S @ (V[:, keep] / np.sqrt(power[keep]))
        a.append(A.T @ residual[rows])
        C.append(basis.shared[rows].T @ A)
    shared = np.concatenate(C, axis=1)
    # of the parts that live on some rows the columns have nothing
    alone = np.zeros((sum(Q.shape[1] for _, Q in basis.own), shared.shape[1]))
    together = basis.keep(np.concatenate([alone, shared]))
    left = np.concatenate(a) - together.T @ basis.project(residual)
    _, s, Vt = np.linalg.svd(together[together.any(axis=1)], full_matrices=False)
    power = 1 - s**2
    hidden = power < BLIND**2
    beside = Vt @ left
    # (I − Cᵀ C)⁻¹ = I + V (1/(1 − s²) − 1) Vᵀ; what the shared part hides altogether is taken off
    more = np.where(hidden, -1.0, 1 / np.where(hidden, 1.0, power) - 1)
    return float(left @ left + np.sum(more * beside**2)), len(left) - int(hidden.sum())
