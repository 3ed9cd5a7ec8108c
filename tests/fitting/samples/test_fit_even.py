"""The residual of a window's fit keeps its digits however small the noise is beside the wave."""

import numpy as np
import pytest

from hrg_cli.fitting.samples.basis import build_window_basis
from hrg_cli.fitting.samples.windows import fit_even
from hrg_cli.records import Recording, collect
from hrg_cli.stages.demodulate import demodulate

RATE, HZ = 64_000.0, 5003.37


@pytest.mark.parametrize("noise", [1e-3, 1e-5, 1e-6, 1e-7, 1e-8])
@pytest.mark.parametrize("samples", [13, 640])
def test_residual_at_any_noise(noise, samples):
    """Against the same fit in extended precision: within 1 %; the difference of sums loses up to 44
    % at 1e-7 of the wave."""
    rng = np.random.default_rng(0)
    basis = build_window_basis(samples, RATE, (HZ,))
    t = np.arange(50 * samples) / RATE
    y = (3.0 + np.cos(2 * np.pi * HZ * t + 0.3) + noise * rng.standard_normal(len(t))).reshape(
        50, samples
    )
    left = fit_even(y, basis)[1]
    turned = (
        y - np.cos(2 * np.pi * HZ * t + 0.3).reshape(y.shape) - 3.0
    )  # the wave itself lies in the basis
    q = turned.astype(np.longdouble) @ basis.orthonormal
    true = ((turned - q @ basis.orthonormal.T) ** 2).sum(1).astype(float)
    np.testing.assert_allclose(left, true, rtol=0.01)


def test_standard_deviations_at_a_hundred_nanovolt_beside_a_volt():
    rng = np.random.default_rng(1)
    t = np.arange(60_000) / RATE
    u = np.exp(2j * np.pi * HZ * t - 0.05 * t)
    c, s = (g * u.real + 1e-7 * rng.standard_normal(len(t)) for g in (1.0, 0.6))
    for periods in (1, 5, 50):
        made = collect(
            demodulate(
                Recording(c=c, s=s, sample_rate_hz=RATE, mode="free"), periods_per_window=periods
            )
        )
        expected = 1e-7 * np.sqrt(2 / (made.window_s * RATE))
        assert np.median(made.signals_std) == pytest.approx(expected, rel=0.12)
