"""As many nodes as a rate asks for: what its bends between them leave in the answer, known before
it shows in the nodes' own misfit.

Facts of cubic splines through a rate, found on sinusoids of 1 to 15 periods, on random walks and on
steps over 21, 41 and 81 nodes. E is the variance of a node's error by interpolation over that by
noise, g(k) the rise of χ² beyond chance a node that k nodes leave to twice as many.
- E = 10.5 g(k), within a factor of two, whatever the rate.
- g falls by 2¹² each time the nodes double where the rate is smooth, by 2⁴ where it walks at random
  or steps.
- So the fall from k/4 to k/2 nodes foretells g(k) from g(k/2). It has to be foretold: where the
  nodes' error is as large as their noise, g(k) is two of twenty numbers' χ², which nobody can see.
- A slow swing with a little walk on it takes the swing's fall for the walk's: then the gain of
  twice as many nodes is the judge, as far as it sees.

All this holds piece by piece: a run-down's first tenth may ask for nodes that its quiet end cannot
use.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from ..fitting.envelopes.rate_estimate import Loss, RateEstimate

A_GAIN = 10.5
"""E over g."""
ROUGHEST, SMOOTHEST = 3.0, 12.0
"""Powers of two by which g falls where the nodes double, at least and at most."""
FEWEST = 4
"""Nodes of a piece at least."""
NEGLIGIBLE = 0.1
"""Such a variance that a node's standard deviation need not hold: 5 % of it."""
DOUBTFUL = 0.5
"""Such a variance from which the standard deviations are too small by more than a fifth."""
DOUBTFUL_PIECE = 3.0
"""Such a variance of a piece of four nodes or more: twice the errors stated, and there only."""


WHOLE = (0.0, 1.0)


@dataclass(frozen=True)
class Bends:
    """E, the variance of the nodes' error by interpolation over that of noise, as foretold: of the
    whole run, and of its worst piece, from `begin_s` to `end_s`."""

    whole: float = 0.0
    worst: float = 0.0
    begin_s: float = 0.0
    end_s: float = 0.0
    logged: float = 0.0
    """The same by what the logged rate does between the nodes."""


def _predict_by_neighbours(found: RateEstimate) -> Bends:
    """What the nodes lose between them, by what fewer lose and more gain."""
    count = len(found.time_s)
    half, quarter = (count + 1) // 2, (count + 3) // 4
    if not found.converged or not 2 <= quarter < half < count:
        return Bends()
    by_half = found.measure_loss(half)
    left = 2.0 ** -_measure_fall(by_half, found.measure_loss(quarter))
    pieces = [WHOLE, *_cut_pieces(count)]

    def judge(piece: tuple[float, float]) -> float:
        foretold = left * _measure_variance(by_half, *piece, len(pieces))
        return _judge(foretold, found.finer, *piece, len(pieces))

    of_pieces = [judge(piece) for piece in pieces]
    worst = int(np.argmax(of_pieces))
    first, last = found.time_s[0], found.time_s[-1]
    begin, end = (float(first + part * (last - first)) for part in pieces[worst])
    return Bends(of_pieces[0], of_pieces[worst], begin, end)


def _measure_fall(by_half: Loss, by_quarter: Loss) -> float:
    """Powers of two by which g falls from a quarter of the nodes to half of them, and so falls
    on."""
    lost, spread = by_half.measure(slice(None))
    lost_more, _ = by_quarter.measure(slice(None))
    # a quarter of the nodes leave twice as much a node of theirs
    ratio = 2 * (lost_more - lost) / max(lost, spread)
    return float(np.clip(np.log2(max(ratio, 1.0)), ROUGHEST, SMOOTHEST))


def _cut_pieces(nodes: int) -> Iterator[tuple[float, float]]:
    """A run's halves, quarters, …, as parts of it."""
    pieces = 2
    while nodes // pieces >= FEWEST:
        edges = np.linspace(0.0, 1.0, pieces + 1)
        yield from itertools.pairwise(edges)
        pieces *= 2


def _find_nodes(loss: Loss, begin: float, end: float) -> slice:
    """Those of the nodes that lie in a part of the run."""
    count = len(loss.left)
    return slice(int(np.ceil(begin * count)), int(np.ceil(end * count)))


def _measure_variance(loss: Loss, begin: float, end: float, pieces: int) -> float:
    """E of a piece's fewer nodes by what they are seen to lose, 10.5 of it a node."""
    where = _find_nodes(loss, begin, end)
    if not loss.is_seen(where, pieces):
        return 0.0
    lost, _ = loss.measure(where)
    return A_GAIN * lost / (where.stop - where.start)


def _judge(foretold: float, finer: Loss | None, begin: float, end: float, pieces: int) -> float:
    """E of a piece, one of so many, as foretold, held between what twice as many nodes are seen to
    gain and what they gain at most."""
    if finer is None:
        return foretold
    where = _find_nodes(finer, begin, end)
    gained, spread = finer.measure(where)
    most = A_GAIN * (max(gained, 0.0) + 2 * spread) / (where.stop - where.start)
    return max(_measure_variance(finer, begin, end, pieces), min(foretold, most))


def follow(
    found: RateEstimate,
    fit: Callable[[int], RateEstimate],
    may_grow: bool,
    measure_log: Callable[[RateEstimate], float | None],
) -> tuple[RateEstimate, Bends]:
    """A rate on as many nodes as leave its curvature within the noise, as far as the run carries
    them.

    Parameters
    ----------
    found
        The rate on the fewest nodes.
    fit
        Number of nodes -> the rate on these.
    may_grow
        False: a number was asked for.
    measure_log
        What the logged rate does between the nodes (`measure_bends_of_log`); None: nobody knows.

    Returns
    -------
    tuple
        The rate, and what its nodes are foretold to leave of the curvature.

    Examples
    --------
    A rate that did not settle is not refined:

    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.rate_nodes import Bends, follow
    >>> found = Told(converged=False, time_s=[0.0, 1.0, 2.0])
    >>> follow(found, None, may_grow=True, measure_log=lambda _: None) == (found, Bends())
    True
    """
    logged = measure_log(found)
    while may_grow and found.converged and (logged or 0.0) > NEGLIGIBLE:
        finer = _fit_finer(found, fit)
        if finer is None:
            break
        found, logged = finer, measure_log(finer)
    if may_grow and logged is None and found.converged and not found.adequate:
        found = _find_adequate(found, fit)
        logged = measure_log(found)
    bends = _predict_by_neighbours(found)
    while may_grow and bends.worst > NEGLIGIBLE:
        finer = _fit_finer(found, fit)
        if finer is None:
            break
        found, bends = finer, _predict_by_neighbours(finer)
        logged = measure_log(found)
    return found, replace(bends, logged=logged or 0.0)


def _fit_finer(found: RateEstimate, fit: Callable[[int], RateEstimate]) -> RateEstimate | None:
    """The rate on twice as many nodes; None where the run does not carry them."""
    count = 2 * len(found.time_s) - 1
    if count > found.most_nodes:
        return None
    finer = fit(count)
    return finer if finer.converged else None


def _find_adequate(found: RateEstimate, fit: Callable[[int], RateEstimate]) -> RateEstimate:
    """The rate on the fewest nodes, doubled so often, that leave the noise alone; as it was where
    none do.

    Nodes farther apart than half a period of what swings show nothing of it, and neither do half or
    twice as many.
    """
    count = 2 * len(found.time_s) - 1
    while count <= found.most_nodes:
        finer = fit(count)
        if finer.converged and finer.adequate:
            return finer
        count = 2 * count - 1
    return found
