"""The matrix that makes the noise of two channels white, against its definition; the correlation of
their noise as the spectra show it."""

import numpy as np
import pytest

from hrg_cli.fitting.noise import channel_noise
from hrg_cli.fitting.samples.spectrum import AveragedSpectrum, estimate_correlation
from hrg_cli.records import Recording, collect
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.diagnosis.suspects import transformations
from hrg_cli.stages.estimate import estimate


def turned(c, s, angle):
    """Covariance of channels of σ c and s after a turn by an angle."""
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    return turn @ np.diag([c**2, s**2]) @ turn.T


def stated(covariance):
    """Standard deviations (1, 2) and correlation."""
    std = np.sqrt(np.diag(covariance))
    return std[None], float(covariance[0, 1] / std.prod())


@pytest.mark.parametrize("angle", [0.0, 0.3, np.pi / 4, 2.0])
@pytest.mark.parametrize("c, s", [(3, 1), (0.01, 0.1), (1, 40)])
def test_whitened_noise_is_white_and_its_mean_variance_is_kept(c, s, angle):
    covariance = turned(c, s, angle)
    W = channel_noise.compute_whitening(*stated(covariance))
    relative = covariance / (np.trace(covariance) / 2)
    np.testing.assert_allclose(W @ relative @ W.T, np.eye(2), atol=1e-9)
    np.testing.assert_allclose(
        channel_noise.compute_spread(W[None])[0], np.sqrt(np.diag(relative)), rtol=1e-9
    )


@pytest.mark.parametrize("c, s", [(1, 1), (1.08, 1), (1, 0), (1, 1e-5), (np.nan, 1)])
def test_equal_noise_and_a_dead_channel_are_weighed_as_one(c, s):
    assert channel_noise.compute_whitening(np.array([[c, s]] * 9), 0.0) is None
    assert channel_noise.compute_whitening(None, None) is None


def test_a_ratio_that_the_rows_contradict_is_theirs():
    random = np.random.default_rng(4)
    noise = random.standard_normal((400, 2)) + 1j * random.standard_normal((400, 2))
    t = np.linspace(0, 1, 400)[:, None]
    wave = 1e3 * np.exp(-t) * np.exp(2j * t) * np.array([1.0, 0.5])
    spoilt = np.array([[5.0, 2.0]] * 400)  # what a jump leaves in both, more where more is seen
    assert channel_noise.compute_whitening(spoilt, None) is not None
    W = channel_noise.compute_whitening(spoilt, None, wave + noise)
    assert W is None or np.linalg.cond(W) < 1.2
    # rows between which the wave moves by more than its noise say nothing of that
    fast = wave * np.exp(300j * t)
    kept = channel_noise.compute_whitening(spoilt, None, fast + noise)
    np.testing.assert_array_equal(kept, channel_noise.compute_whitening(spoilt, None))


def test_reals_are_whitened_as_envelopes_are_and_back():
    random = np.random.default_rng(0)
    W = np.stack([channel_noise.compute_whitening(*stated(turned(3, 1, a))) for a in (0.2, 1.0)])
    u = random.standard_normal((2, 5, 2)) + 1j * random.standard_normal((2, 5, 2))
    white = channel_noise.whiten(W, u)
    reals = np.concatenate([u.real, u.imag], axis=-1)[..., None]
    np.testing.assert_allclose(
        channel_noise.whiten_reals(W, reals)[..., 0],
        np.concatenate([white.real, white.imag], axis=-1),
    )
    np.testing.assert_allclose(channel_noise.whiten(channel_noise.invert(W), white), u)


def averaged(noise, segments=40, width=256):
    out = AveragedSpectrum(np.fft.rfftfreq(width, 1e-3))
    for piece in np.split(noise, segments, axis=1):
        out.add(np.arange(width) * 1e-3, piece, True)
    return out


@pytest.mark.parametrize("common", [0.0, 0.6, -0.9])
def test_spectra_show_what_the_channels_noise_has_in_common(common):
    random = np.random.default_rng(2)
    mix = np.linalg.cholesky(np.array([[1.0, common], [common, 1.0]]))
    noise = np.array([[5.0], [1.0]]) * (mix @ random.standard_normal((2, 40 * 256)))
    noise += np.sin(2 * np.pi * 260.0 * np.arange(40 * 256) * 1e-3)  # a line is no noise
    found = estimate_correlation(averaged(noise), (250.0,), 100.0, ((245.0, 255.0),))
    assert found == pytest.approx(common, abs=0.06)


def recording(noise, sigma=1e-3):
    t = np.arange(16000) / 8000
    c, s = np.cos(2 * np.pi * 1000 * t), 0.5 * np.cos(2 * np.pi * 1000 * t)
    c, s = np.stack([c, s]) + sigma * noise
    return Recording(c=c, s=s, sample_rate_hz=8000.0, mode="free")


def test_a_wave_states_the_noise_of_either_channel_and_what_they_have_in_common():
    random = np.random.default_rng(1)
    covariance = turned(4, 1, 0.5)
    noise = np.linalg.cholesky(covariance) @ random.standard_normal((2, 16000))
    wave = collect(estimate(collect(demodulate(recording(noise), periods_per_window=20))))
    std, common = stated(covariance)
    # of n samples a coefficient has the variance 2σ²/n
    np.testing.assert_allclose(
        np.median(wave.channel_std, axis=0), 1e-3 * std[0] * np.sqrt(2 / 160), rtol=0.05
    )
    assert wave.noise_correlation == pytest.approx(common, abs=0.03)
    np.testing.assert_allclose(np.mean(wave.channel_std**2, axis=1), wave.signal_std**2, rtol=1e-9)
    swapped = transformations.swap_channels(wave)
    np.testing.assert_array_equal(swapped.channel_std, wave.channel_std[:, ::-1])
    assert swapped.noise_correlation == wave.noise_correlation
    inverted = transformations.invert_channel(wave)
    assert inverted.noise_correlation == -wave.noise_correlation
