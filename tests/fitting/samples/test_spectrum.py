"""The residual spectrum: level, lines, and what its colour means for the coefficients."""

import numpy as np
import pytest

from hrg_cli.fitting.samples.basis import build_window_basis
from hrg_cli.fitting.samples.spectrum import (
    AveragedSpectrum,
    Colour,
    compute_look_residual,
    estimate_colour,
    find_lines,
)

RATE, SEGMENT, SEGMENTS = 8000.0, 1024, 30


def averaged(make, even: bool = True) -> AveragedSpectrum:  # type: ignore[no-untyped-def]
    spectrum = AveragedSpectrum(np.fft.rfftfreq(SEGMENT, 1 / RATE))
    for k in range(SEGMENTS):
        time = (np.arange(SEGMENT) + k * SEGMENT) / RATE
        spectrum.add(time, make(time), even)
    return spectrum


def test_white_noise_has_its_level_and_no_lines() -> None:
    rng = np.random.default_rng(1)
    found = 0
    for _ in range(20):
        spectrum = averaged(lambda time: rng.normal(size=(2, len(time))) * [[1.0], [3.0]])
        np.testing.assert_allclose(spectrum.mean()[5:-5].mean(0), [2 / RATE, 18 / RATE], rtol=0.03)
        found += len(find_lines(spectrum.frequency_hz, spectrum.mean(), spectrum.segments)[0])
    assert found == 0


def test_direct_sums_at_true_times_agree_with_the_fast_transform() -> None:
    rng = np.random.default_rng(2)
    blocks = rng.normal(size=(SEGMENTS, 2, SEGMENT))
    one, two = iter(blocks), iter(blocks)
    np.testing.assert_allclose(
        averaged(lambda _: next(one)).mean()[1:-1],
        averaged(lambda _: next(two), False).mean()[1:-1],
        rtol=1e-6,
    )


def test_lines_carry_frequency_and_amplitude() -> None:
    rng = np.random.default_rng(3)

    def make(time: np.ndarray) -> np.ndarray:
        hum, tone = np.cos(2 * np.pi * 150 * time), np.sin(2 * np.pi * 2345.6 * time)
        return np.stack([0.3 * hum, 0.8 * tone]) + rng.normal(size=(2, len(time)))

    spectrum = averaged(make)
    where, amplitude, ratio = find_lines(spectrum.frequency_hz, spectrum.mean(), spectrum.segments)
    assert len(where) == 2 and ratio[0] > ratio[1] > 2
    assert where == pytest.approx([2345.6, 150], abs=3)
    assert amplitude[0, 1] == pytest.approx(0.8, rel=0.05) and amplitude[1, 0] == pytest.approx(
        0.3, rel=0.1
    )


def test_an_oscillation_that_decays_and_turns_leaves_no_residual() -> None:
    time = np.arange(16_384) / 64_000
    u = np.exp((-0.35 + 1.6j) * time + 2j * np.pi * 5003.3 * time)
    y = np.stack([u.real + 0.2, 0.3 * u.imag - 4])
    residual, reach = compute_look_residual(time, y, (5003.3,))
    assert np.abs(residual).max() < 1e-3 and reach < 100


def test_a_wave_that_turns_fast_leaves_white_noise() -> None:
    """Turning by forty radians within a look is no noise beside the oscillation, and the noise that
    is there stays."""
    rng = np.random.default_rng(8)
    time = np.arange(16_384) / 2_000
    for turning in (0.4, 5.0, 60.0):
        phase = 2 * np.pi * 871.3 * time
        y = np.stack([np.cos(turning * time), np.sin(turning * time)]) * np.cos(phase)
        noise = 1e-3 * rng.normal(size=y.shape)
        residual, reach = compute_look_residual(time, y + noise, (871.3,))
        assert residual.std() == pytest.approx(1e-3, rel=0.08), turning
        assert turning / (2 * np.pi) < 4 / time[-1] + reach


def test_colour_is_the_ratio_a_trial_shows() -> None:
    """Errors of fitted windows over their residual's promise, simulated, against the spectrum's
    prediction."""
    rng = np.random.default_rng(4)
    samples, frequency = 23, 400.0
    basis = build_window_basis(samples, RATE, (frequency,))
    assert basis is not None

    def make(time: np.ndarray) -> np.ndarray:
        hum = 3 * np.cos(2 * np.pi * 100 * time + rng.uniform(0, 7))
        harmonic = 3 * np.cos(2 * np.pi * 800 * time + rng.uniform(0, 7))
        return np.stack([hum, harmonic]) + 0.3 * rng.normal(size=(2, len(time)))

    spectrum = averaged(make)
    noise = estimate_colour(
        spectrum.frequency_hz, spectrum.mean(), spectrum.segments, basis, RATE, ()
    )
    y = make(np.arange(samples * 40_000) / RATE).reshape(2, -1, samples)
    q = y @ basis.orthonormal
    white2 = ((y**2).sum((1, 2)) - (q**2).sum((1, 2))) / (basis.freedom * y.shape[1])
    seen = (q @ basis.triangle).var(1) / (white2[:, None] * basis.variance)
    np.testing.assert_allclose(noise.whole, seen, rtol=0.15)
    assert seen[0].max() > 3 and seen[1].max() < 0.4


def test_white_noise_has_colour_one() -> None:
    rng = np.random.default_rng(5)
    for samples in (8, 40, 400):
        basis = build_window_basis(samples, RATE, (1000.3,))
        assert basis is not None
        spectrum = averaged(lambda time: rng.normal(size=(2, len(time))))
        noise = estimate_colour(
            spectrum.frequency_hz, spectrum.mean(), spectrum.segments, basis, RATE, ()
        )
        assert noise.is_white


def test_lines_that_few_windows_hold_take_nothing_off_the_others_noise() -> None:
    """A wave clipped at its top for a twentieth of the run leaves harmonics there alone: the other
    windows keep the noise of their own samples."""
    samples, bad = 23, 5
    basis = build_window_basis(samples, RATE, (400.0,))
    assert basis is not None

    def seen(size: float) -> Colour:
        rng, looks = np.random.default_rng(8), iter(range(1000))

        def make(time: np.ndarray) -> np.ndarray:
            held = size if next(looks) < bad else 0.0
            return held * np.cos(2 * np.pi * 800 * time) + 0.3 * rng.normal(size=(2, len(time)))

        spectrum = averaged(make)
        return estimate_colour(
            spectrum.frequency_hz, spectrum.mean(), spectrum.segments, basis, RATE, ()
        )

    assert seen(0.0).is_white
    noise = seen(8.0)
    assert noise.whole.max() < 0.5
    quiet, loud = np.full((4, 1), 0.09), np.full((4, 1), 0.09 + 32.0)
    np.testing.assert_allclose(noise.take_windows(0, quiet), 1, rtol=0.1)
    assert (noise.take_windows(0, loud) < 0.5).all()
