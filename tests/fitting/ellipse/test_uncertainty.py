"""Stated standard deviations against the scatter of estimates over seeded draws, and against the
closed formulas of PHYSICS §3."""

import numpy as np
import pytest

from hrg_cli.fitting.ellipse.closed_form import solve_closed_form
from hrg_cli.fitting.ellipse.uncertainty import (
    ANGLE_LIMIT,
    CARRIER_LIMIT,
    PHASE_LIMIT,
    compute_standard_deviations,
)
from hrg_cli.physics import ellipse
from hrg_cli.physics.signals import compute_direct_envelopes, make_signals

DRAWS = 4000
NAMES = ("A", "B", "theta", "phi", "psi")


def direct_signals(x: np.ndarray) -> np.ndarray:
    u = ellipse.compute_envelopes(x[:, 0], x[:, 1], x[:, 2], x[:, 3], 1)
    return np.stack([u[:, 0].real, -u[:, 0].imag, u[:, 1].real, -u[:, 1].imag], axis=-1)


def estimates(z: np.ndarray, carrier_phase_rad: float | None) -> np.ndarray:
    if z.shape[1] == 8:
        return solve_closed_form(z, carrier_phase_rad)[0]
    return np.stack([*ellipse.find_wave(compute_direct_envelopes(z), 1), np.zeros(len(z))], axis=-1)


def difference(found: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """found − truth modulo the shifts (π, π, 0), (0, 2π, 0), (0, π, π) of (θ, φ, ψ)."""
    error = found - truth
    for column in (2, 4):
        turns = np.round(error[:, column] / np.pi)
        error[:, column] -= np.pi * turns
        error[:, 3] -= np.pi * turns
    error[:, 3] -= 2 * np.pi * np.round(error[:, 3] / (2 * np.pi))
    return error


@pytest.mark.parametrize("sigmas", ["equal", "channels", "channels in common", "signals"])
@pytest.mark.parametrize("readout", ["direct", "carrier", "carrier, phase known"])
def test_errors_are_as_large_as_stated(readout, sigmas):
    generator = np.random.default_rng(1)
    count = 4 if readout == "direct" else 8
    truth = np.column_stack(
        [generator.uniform(0.5, 2, DRAWS), np.zeros(DRAWS), generator.uniform(-3, 3, (DRAWS, 3))]
    )
    truth[:, 1] = truth[:, 0] * generator.uniform(-0.8, 0.8, DRAWS)
    known = readout != "carrier"
    if known:
        truth[:, 4] = 0.7 if count == 8 else 0.0
    sigma = {
        "equal": np.full(count, 1e-3),
        "channels": np.repeat([1e-3, 5e-3], count // 2),
        "channels in common": np.repeat([1e-3, 2e-3], count // 2),
        "signals": 1e-3 * np.arange(1, count + 1),
    }[sigmas]
    exact = make_signals(truth) if count == 8 else direct_signals(truth)
    common = 0.8 if sigmas == "channels in common" else 0.0
    noise = generator.standard_normal(exact.shape)
    of_s = slice(count // 2, None)
    noise[:, of_s] = common * noise[:, : count // 2] + np.sqrt(1 - common**2) * noise[:, of_s]
    found = estimates(exact + sigma * noise, 0.7 if known else None)
    stated = compute_standard_deviations(
        found, np.broadcast_to(sigma**2, exact.shape), known, common
    )
    error = difference(found, truth)
    for column, name in enumerate(NAMES[: 4 if known else 5]):
        assert np.mean((error[:, column] / stated[:, column]) ** 2) == pytest.approx(1, abs=0.1), (
            name
        )
    if known:
        assert (stated[:, 4] == 0).all()


@pytest.mark.parametrize("readout", ["direct", "carrier", "carrier, phase known"])
def test_every_signals_variance_counts_by_its_own_slope(readout):
    """σ² = Σ (∂x/∂z_k)² σ_k² with the slopes of the closed form by differences, at single waves:
    averaged over phases the terms of P and Q would vanish."""
    generator = np.random.default_rng(3)
    count, known, rows, h = 4 if readout == "direct" else 8, readout != "carrier", 20, 1e-5
    phase = 0.7 if known and count == 8 else None
    x = np.column_stack(
        [np.ones(rows), generator.uniform(-0.7, 0.7, rows), generator.uniform(-1, 1, (rows, 3))]
    )
    if known:
        x[:, 4] = 0.7 if count == 8 else 0.0
    z = make_signals(x) if count == 8 else direct_signals(x)
    variances = 1e-12 * generator.uniform(0.1, 10, z.shape)
    expected = np.zeros((rows, 5))
    for k in range(count):
        step = h * np.eye(count)[k]
        slope = difference(estimates(z + step, phase), estimates(z - step, phase)) / (2 * h)
        expected += slope**2 * variances[:, k, None]
    stated = compute_standard_deviations(x, variances, known)
    np.testing.assert_allclose(stated, np.sqrt(expected), rtol=1e-5, atol=1e-12)


def test_equal_noise_gives_the_closed_formulas():
    x, s = np.array([[1.0, 0.4, 0.3, 0.2, 0.1]]), 1e-4
    sum_, gap = np.sqrt(1.16), 0.84
    expected = np.array([1, 1, sum_ / gap, sum_ / gap, 1 / sum_]) * s / np.sqrt(2)
    np.testing.assert_allclose(
        compute_standard_deviations(x, np.full((1, 8), s**2), False)[0], expected, rtol=1e-6
    )
    expected = np.array([1, 1, sum_ / gap, sum_ / gap, 0]) * s
    np.testing.assert_allclose(
        compute_standard_deviations(x, np.full((1, 4), s**2), True)[0], expected, rtol=1e-6
    )


@pytest.mark.parametrize("count", [4, 8])
def test_circular_and_vanishing_waves_have_large_finite_deviations(count):
    x = np.array(
        [[1, 1, 0.3, 0.2, 0.1], [1, -1 + 1e-9, 0.3, 0.2, 0.1], [0, 0, 0, 0, 0], [1e-8, 0, 0, 0, 0]],
        float,
    )
    stated = compute_standard_deviations(x, np.full((4, count), 1e-8), False)
    assert np.isfinite(stated).all()
    np.testing.assert_allclose(stated[:, 2], ANGLE_LIMIT, rtol=1e-3)
    np.testing.assert_allclose(stated[:, 3], PHASE_LIMIT, rtol=1e-3)
    np.testing.assert_allclose(stated[2:, 4], CARRIER_LIMIT if count == 8 else 0, rtol=1e-3)
    np.testing.assert_allclose(stated[:, :2], 1e-4 / np.sqrt(count / 4), rtol=1e-9)
    exact = compute_standard_deviations(x, np.zeros((4, count)), False)
    assert np.isfinite(exact).all()


def test_the_angle_of_a_circular_wave_really_scatters_that_much():
    truth = np.tile([1.0, 1.0, 0.3, 0.2, 0.0], (DRAWS, 1))
    found = estimates(
        direct_signals(truth) + 1e-3 * np.random.default_rng(2).standard_normal((DRAWS, 4)), None
    )
    stated = compute_standard_deviations(found, np.full((DRAWS, 4), 1e-6), True)
    spread = np.std(found[:, 2])
    assert spread == pytest.approx(ANGLE_LIMIT, rel=0.05)
    assert 0.2 * spread < np.median(stated[:, 2]) < 2 * spread


def test_limits_are_the_deviations_of_angles_of_which_nothing_is_known():
    """θ (electrical) and ψ repeat after π, φ after 2π: the deviation of a uniform angle over that
    range."""
    uniform = (np.arange(100_000) + 0.5) / 100_000 - 0.5
    assert (
        (np.pi * uniform).std()
        == pytest.approx(ANGLE_LIMIT, rel=1e-6)
        == pytest.approx(CARRIER_LIMIT, rel=1e-6)
    )
    assert (2 * np.pi * uniform).std() == pytest.approx(PHASE_LIMIT, rel=1e-6)
