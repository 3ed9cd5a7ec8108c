"""The score of a forecast: the density that it gave what came."""

import numpy as np
from scipy.stats import multivariate_normal

from hrg_cli.stages.diagnosis.search.forecast import Errors


def errors(random, rows=7, learned=3):
    return Errors(
        run=np.zeros(rows, int),
        time_s=np.arange(rows, dtype=float),
        difference=random.standard_normal((rows, 4)),
        parts=np.zeros((rows, 4)),
        learned=random.standard_normal((rows, 4, learned)),
        weight=random.uniform(0.5, 2.0, rows),
    )


def test_the_surprise_is_minus_twice_the_logarithm_of_the_density():
    random = np.random.default_rng(3)
    found, wanted = [], []
    for misfit in (1.0, 4.0):
        for _ in range(2):
            one = errors(random)
            e = (one.difference * one.weight[:, None]).ravel()
            M = (one.learned * one.weight[:, None, None]).reshape(len(e), -1)
            C = misfit * np.eye(len(e)) + M @ M.T
            found.append(one.compute_surprise(misfit))
            wanted.append(-2 * multivariate_normal(np.zeros(len(e)), C).logpdf(e))
            wanted[-1] -= len(e) * np.log(2 * np.pi * misfit)
    np.testing.assert_allclose(found, wanted, rtol=1e-10)


def test_what_a_forecast_does_not_know_costs_it_little():
    """An error along what was not learned is no surprise, one beside it is."""
    random = np.random.default_rng(4)
    one = errors(random)
    one.difference[:] = 0.0
    far = 30 * one.learned[..., 0]
    along = Errors(one.run, one.time_s, far, one.parts, 100 * one.learned, one.weight)
    beside = Errors(one.run, one.time_s, far, one.parts, 1e-3 * one.learned, one.weight)
    assert along.compute_surprise(1.0) < 60 < 1000 < beside.compute_surprise(1.0)
