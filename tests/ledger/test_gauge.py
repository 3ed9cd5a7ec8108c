"""Variance components: against the whole covariance matrix, the mean squares of a balanced study,
and known components over many draws."""

import numpy as np
import pytest

from hrg_cli.ledger import gauge
from hrg_cli.ledger.gauge import _design, _terms, study_gauge

STD = {"gyro": 0.7, "interaction": 0.3, "station": 0.5, "repeat": 0.2}


def study(rng, gyros=10, stations=3, repeats=3, own=0.0, known=True, **std):
    """A drawn crossed study and what the program says of it."""
    std = dict.fromkeys(STD, 0.0) | std
    shape = (gyros, stations, repeats)
    x = std["gyro"] * rng.standard_normal((gyros, 1, 1))
    x = x + std["station"] * rng.standard_normal((1, stations, 1))
    x = x + std["interaction"] * rng.standard_normal((gyros, stations, 1))
    x = x + np.hypot(std["repeat"], own) * rng.standard_normal(shape)
    gyro, station, _ = np.indices(shape)
    stated = np.full(x.size, own if known else 0.0)
    return x, study_gauge(x.ravel(), stated, gyro.ravel().astype(str), station.ravel().astype(str))


def test_likelihood_is_that_of_the_whole_covariance_matrix():
    rng = np.random.default_rng(1)
    n = 20
    gyro, station = rng.integers(0, 5, n), rng.integers(0, 3, n)
    d = _design(rng.standard_normal(n), rng.random(n) * 0.3 + 0.01, gyro, station)

    def same(group):
        return (group[:, None] == group[None, :]).astype(float)

    whole = np.diag(d.own + STD["repeat"] ** 2) + STD["gyro"] ** 2 * same(d.gyro)
    whole += STD["interaction"] ** 2 * same(d.cell) + STD["station"] ** 2 * same(d.station)
    inverse, one = np.linalg.inv(whole), np.ones(n)
    power = one @ inverse @ one
    mean = one @ inverse @ d.values / power
    left = d.values - mean
    expected = np.linalg.slogdet(whole)[1] + np.log(power) + left @ inverse @ left
    found, centre = _terms(d, STD)
    assert found == pytest.approx(-0.5 * expected, rel=1e-12)
    assert centre == pytest.approx(mean, rel=1e-10)


def test_a_balanced_study_gives_the_mean_squares():
    """Where no mean square is below the one it is compared with, REML is the analysis of
    variance."""
    x, found = study(np.random.default_rng(1), gyro=1.0, station=0.4, interaction=0.3, repeat=0.2)
    g, s, r = x.shape
    mean, by_gyro, by_station, cell = x.mean(), x.mean((1, 2)), x.mean((0, 2)), x.mean(2)
    gyros = s * r * ((by_gyro - mean) ** 2).sum() / (g - 1)
    stations = g * r * ((by_station - mean) ** 2).sum() / (s - 1)
    rest = cell - by_gyro[:, None] - by_station + mean
    interaction = r * (rest**2).sum() / ((g - 1) * (s - 1))
    error = ((x - cell[:, :, None]) ** 2).sum() / (g * s * (r - 1))
    expected = {
        "gyro": (gyros - interaction) / (s * r),
        "station": (stations - interaction) / (g * r),
        "interaction": (interaction - error) / r,
        "repeat": error,
    }
    for name, variance in expected.items():
        assert found.components[name].std ** 2 == pytest.approx(variance, rel=1e-4)


def test_digits_are_not_lost_where_gyros_differ_a_million_times_more():
    x, found = study(np.random.default_rng(2), gyro=1.0, repeat=1e-6, station=3e-6)
    within = np.sqrt(((x - x.mean(2, keepdims=True)) ** 2).sum() / (10 * 3 * 2))
    assert found.components["repeat"].std == pytest.approx(within, rel=0.2)
    assert 5e-7 < found.components["station"].std < 2e-5


def test_own_sigma_separates_gauge_from_gyro_without_repeats():
    """60 gyros measured once, by a gauge as bad as the gyros differ: the spread that is left is
    theirs."""
    found = [study(np.random.default_rng(k), 60, 1, 1, own=1.0, gyro=1.0)[1] for k in range(12)]
    mean = np.sqrt(np.mean([f.gyro_std**2 for f in found]))
    assert mean == pytest.approx(1.0, abs=0.15)
    assert all(f.own_std == pytest.approx(1.0) and set(f.components) == {"gyro"} for f in found)


def test_what_cannot_be_told_is_not_named():
    rng = np.random.default_rng(3)
    assert study_gauge(rng.random(4), np.zeros(4), ["a", "a", "b", "b"], ["1"] * 4) is None
    apart = study_gauge(rng.random(8), np.full(8, 0.1), list("abcdefgh"), ["1"] * 4 + ["2"] * 4)
    assert set(apart.components) == {"gyro"}, "each gyro on one station only"
    repeats = study(rng, 6, 1, 3, own=0.1, gyro=1.0)[1]
    assert set(repeats.components) == {"gyro", "repeat"}


def test_honest_sigma_of_repeats_is_recognized():
    found = study(np.random.default_rng(4), 20, 1, 4, own=0.1, gyro=1.0)[1]
    ratio, low, high = found.scatter_over_own
    assert low < 1 < high and 0.7 < ratio < 1.3
    worse = study(np.random.default_rng(4), 20, 1, 4, own=0.1, repeat=0.3, gyro=1.0)[1]
    assert worse.scatter_over_own[1] > 1 and worse.components["repeat"].low > 0


def coverage(draws, seed):
    """How often each component's 95 % interval holds what was put in."""
    true = {"gyro": 1.0, "station": 0.5, "interaction": 0.2, "repeat": 0.3}
    rng = np.random.default_rng(seed)
    inside = dict.fromkeys(true, 0)
    for _ in range(draws):
        found = study(rng, 12, 4, 2, own=0.1, **true)[1]
        for name, value in true.items():
            part = found.components[name]
            inside[name] += part.low <= value <= part.high
    return {name: count / draws for name, count in inside.items()}


def test_intervals_hold_sample():
    for name, share in coverage(8, 1).items():
        assert share >= 0.5, name


@pytest.mark.slow
def test_intervals_hold():
    """Profile likelihood: 95 % of many draws; with four stations a little less for theirs."""
    for name, share in coverage(200, 2).items():
        assert 0.88 < share <= 0.99, (name, share)


def test_the_study_of_a_production_takes_few_looks_at_its_results(monkeypatch):
    """The time of `hrg ledger show`; 3600 before slopes were taken together and intervals sought
    from inside."""
    looks, look = [], gauge.compute_likelihoods
    monkeypatch.setattr(
        gauge, "compute_likelihoods", lambda *given: (looks.append(1), look(*given))[1]
    )
    _, found = study(
        np.random.default_rng(5), 200, 2, 2, 0.1, gyro=1.0, interaction=0.1, station=0.3, repeat=0.1
    )
    assert len(found.components) == 4 and len(looks) < 1000
    for component in found.components.values():
        assert 0 < component.low < component.std < component.high < np.inf
