"""Bases of a window: exact for any fraction of a period, and the pull of an envelope that moves,
against direct fits."""

import numpy as np
import pytest

from hrg_cli.fitting.samples.basis import build_columns, build_window_basis


@pytest.mark.parametrize("moving", [False, True])
def test_a_steady_oscillation_is_fitted_exactly_in_any_window(moving: bool) -> None:
    rng = np.random.default_rng(1)
    for _ in range(100):
        rate = rng.uniform(1e3, 1e6)
        frequency = rate / rng.uniform(2.3, 40)
        samples = int(rng.uniform(3, 12) * rate / frequency) + 12
        basis = build_window_basis(samples, rate, (frequency,), (), moving)
        assert basis is not None
        tau = (np.arange(samples) - (samples - 1) / 2) / rate
        p, q, offset = rng.normal(size=3)
        y = (
            p * np.cos(2 * np.pi * frequency * tau)
            + q * np.sin(2 * np.pi * frequency * tau)
            + 100 * offset
        )
        np.testing.assert_allclose(y @ basis.orthonormal @ basis.triangle, [p, q], atol=1e-10)


@pytest.mark.parametrize("bands", [(1000.0,), (6000.0 - 1000.0, 6000.0 + 1000.0)])
@pytest.mark.parametrize("power", [1, 2])
def test_the_pull_of_slope_and_curvature_is_what_a_fit_of_a_moving_envelope_shows(
    bands: tuple[float, ...], power: int
) -> None:
    rng = np.random.default_rng(2)
    rate, samples = 51_234.0, 73
    nuisance = () if len(bands) == 1 else (6000.0,)
    basis = build_window_basis(samples, rate, bands, nuisance)
    assert basis is not None
    tau = (np.arange(samples) - (samples - 1) / 2) / rate
    motion = rng.normal(size=len(bands)) + 1j * rng.normal(size=len(bands))
    envelope = motion[:, None] * (tau if power == 1 else tau**2 / 2)
    y = (envelope * np.exp(2j * np.pi * np.outer(bands, tau))).real.sum(0)
    solution, left, *_ = np.linalg.lstsq(build_columns(tau, bands, nuisance), y, rcond=None)
    direct = solution[0 : 2 * len(bands) : 2] - 1j * solution[1 : 2 * len(bands) : 2]
    pull = basis.slope if power == 1 else basis.curvature
    np.testing.assert_allclose(
        pull.alpha[0] @ motion + pull.beta[0] @ motion.conj(),
        direct,
        rtol=1e-8,
        atol=1e-12 * abs(direct).max(),
    )
    parts = np.stack([motion.real, -motion.imag], -1).ravel()
    assert parts @ pull.left[0] @ parts == pytest.approx(left[0], rel=1e-6)


def test_variance_is_that_of_the_fit() -> None:
    rng = np.random.default_rng(3)
    basis = build_window_basis(14, 1.0, (0.11,))
    assert basis is not None
    fits = rng.normal(size=(40_000, 14)) @ basis.orthonormal @ basis.triangle
    np.testing.assert_allclose(fits.var(0), basis.variance, rtol=0.04)


def test_a_window_that_cannot_tell_its_unknowns_apart_has_no_basis() -> None:
    assert build_window_basis(2, 1000.0, (100.0,)) is None
    assert build_window_basis(20, 1000.0, (500.0,)) is None
    assert build_window_basis(20, 1000.0, (100.0, 100.0)) is None
