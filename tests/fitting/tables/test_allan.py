"""The Allan deviation against an outside authority and against what white noise and a ramp must
give."""

import numpy as np
import pytest

from hrg_cli.fitting.tables.allan import compute_allan_deviation


def test_agrees_with_allantools():
    allantools = pytest.importorskip("allantools")
    rate = np.random.default_rng(1).standard_normal(5000).cumsum() * 0.01 + np.random.default_rng(
        2
    ).standard_normal(5000)
    tau, deviation, _ = compute_allan_deviation(rate, 0.5)
    other_tau, other, _, _ = allantools.oadev(rate, rate=2.0, data_type="freq", taus=tau)
    np.testing.assert_allclose(other_tau, tau)
    np.testing.assert_allclose(deviation, other, rtol=1e-9)


def test_white_noise_falls_by_the_root_of_time():
    tau, deviation, relative = compute_allan_deviation(
        np.random.default_rng(3).standard_normal(200_000), 1.0
    )
    short = tau < 100
    assert np.all(np.abs(deviation[short] * np.sqrt(tau[short]) - 1) < 5 * relative[short])


def test_ramp_rises_with_time():
    tau, deviation, _ = compute_allan_deviation(2e-3 * np.arange(1000), 1.0)
    np.testing.assert_allclose(deviation, 2e-3 * tau / np.sqrt(2), rtol=1e-9)


def test_too_short_is_empty():
    assert all(len(part) == 0 for part in compute_allan_deviation(np.zeros(8), 1.0))


def test_the_stated_error_is_the_scatter_of_many_records():
    """White noise, overlapping: theory gives 0.82 of the stated error at long times (3N/2n degrees
    of freedom for N/n stated ones)."""
    rng = np.random.default_rng(4)
    found = [compute_allan_deviation(rng.standard_normal(1500), 1.0, 12) for _ in range(400)]
    tau, _, relative = found[0]
    deviations = np.array([deviation for _, deviation, _ in found])
    seen = deviations.std(axis=0) / deviations.mean(axis=0)
    middle = (tau >= 8) & (tau <= 150)
    assert middle.sum() >= 4
    assert np.all((seen / relative > 0.68)[middle] & (seen / relative < 1.1)[middle]), (
        seen / relative
    )
