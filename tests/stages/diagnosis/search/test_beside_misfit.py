"""A cause beside a misfit: the chance that the rest lends it what it takes away."""

from types import SimpleNamespace

import numpy as np

from hrg_cli.stages.diagnosis.search.beside_misfit import TakenAway

ROWS, DRAWS = 100, 300
SHAPES = 12


def slow(random, runs, columns, decay):
    """Random slow courses (runs, rows, 4, columns): cosines whose size falls with their order."""
    order = np.arange(float(SHAPES))
    cosines = (
        np.cos(np.pi * order * (np.arange(ROWS)[:, None] + 0.5) / ROWS) * (1 + order) ** -decay
    )
    return np.einsum("nj,rjcq->rncq", cosines, random.standard_normal((runs, SHAPES, 4, columns)))


def fit(residual, runs):
    shape = (runs, ROWS)
    return SimpleNamespace(
        residual=residual,
        chi2=float(residual @ residual),
        rows=np.argwhere(np.ones((*shape, 4), bool)),
        series=SimpleNamespace(weight=np.ones(shape), whitening=None),
        prediction=SimpleNamespace(seen=np.tile(np.array([1 + 0j, 0.2j]), (*shape, 1))),
    )


def chances(seed, runs, misfit, decay, own=0.0):
    """The chance told for a cause of random slow course, of size `own` σ, in a rest of size
    `misfit`."""
    random = np.random.default_rng(seed)
    out = []
    for _ in range(DRAWS):
        rest = (misfit * slow(random, runs, 1, decay)[..., 0]).ravel()
        rest = rest + random.standard_normal(rest.shape)
        cause = slow(random, runs, 1, decay).ravel()
        cause /= np.linalg.norm(cause)
        without = rest + own * cause
        final = without - (cause @ without) * cause
        out.append(TakenAway.from_fits(fit(final, runs), fit(without, runs), 1).compute_chance(1))
    return np.array(out)


def test_where_nothing_is_left_over_it_is_the_chance_of_chi_square():
    p = chances(1, 3, 0.0, 1.0)
    for level in (0.5, 0.1):
        assert abs(np.mean(p < level) - level) < 5 * np.sqrt(level * (1 - level) / DRAWS)


def test_a_rest_of_many_shapes_lends_little():
    # at the stated noise alone nearly every one of these would be significant at 1e-3
    assert np.mean(chances(2, 4, 5.0, 0.5) < 1e-3) < 0.05


def test_a_cause_far_beyond_the_rest_stands_out_of_it():
    assert np.mean(chances(3, 4, 2.0, 0.5, own=200.0) < 1e-3) > 0.95
