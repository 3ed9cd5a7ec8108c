"""Finding the frequency: far below 1/duration, at even and uneven times, close to the Cramér-Rao
bound."""

import numpy as np
import pytest

from hrg_cli.fitting.samples import frequency as finding


def start(time: np.ndarray, y: np.ndarray, rate: float) -> float:
    grid, power = finding.compute_even_power(y, rate)
    return finding.find_peak(grid, power, 2 * rate / len(time), rate / 2)[0]


def test_refined_frequency_errs_like_the_cramer_rao_bound() -> None:
    rng = np.random.default_rng(1)
    n, rate, noise = 4000, 40_000.0, 0.05
    time = np.arange(n) / rate
    errors = []
    for _ in range(60):
        frequency = rng.uniform(300, 0.48 * rate)
        u = np.exp(2j * np.pi * (frequency * time + rng.uniform()))
        y = (
            np.stack([u.real, (0.5j * u).real])
            + noise * rng.normal(size=(2, n))
            + rng.normal(size=(2, 1)) * 3
        )
        errors.append(finding.refine_frequency(time, y, start(time, y, rate)) - frequency)
    bound = np.sqrt(6 * 2 * noise**2 / (1.25 * n)) / (np.pi * np.sqrt(2) * n / rate)
    assert np.sqrt(np.mean(np.square(errors))) < 1.6 * bound
    assert bound < 1e-3 * rate / n


def test_refined_frequency_of_a_carriers_side_bands() -> None:
    rng = np.random.default_rng(2)
    n, rate, carrier, frequency = 6000, 100_000.0, 21_000.0, 3_217.3
    time = np.arange(n) / rate
    envelope = np.cos(2 * np.pi * frequency * time + 1)
    y = np.stack([envelope, 0.4 * envelope]) * np.sin(
        2 * np.pi * carrier * time + 0.3
    ) + 1e-3 * rng.normal(size=(2, n))
    grid, power = finding.fold_carrier(*finding.compute_even_power(y, rate), carrier)
    rough = finding.find_peak(grid, power, 50, rate / 2 - carrier)[0]
    assert finding.refine_frequency(time, y, rough, carrier) == pytest.approx(frequency, abs=2e-3)


def test_least_squares_power_is_what_lstsq_explains() -> None:
    rng = np.random.default_rng(3)
    time = np.sort(rng.uniform(5, 9, 300))
    y = rng.normal(size=(2, 300)) + np.array([[3.0], [-2.0]])
    grid = np.arange(0.4, 30, 0.1)
    power = finding.compute_least_squares_power(time, y, grid)
    for k in (0, 7, 150, 295):
        basis = np.stack(
            [np.cos(2 * np.pi * grid[k] * time), np.sin(2 * np.pi * grid[k] * time), np.ones(300)],
            1,
        )
        left = sum(np.linalg.lstsq(basis, channel, rcond=None)[1][0] for channel in y)
        assert power[k] == pytest.approx(
            ((y - y.mean(1, keepdims=True)) ** 2).sum() - left, rel=1e-5
        )


def test_uneven_times_find_the_frequency_within_a_thousandth_of_a_bin() -> None:
    rng = np.random.default_rng(4)
    time = np.cumsum(rng.choice([0.243, 0.314], 1000))
    frequency = 0.1118
    y = np.stack(
        [np.cos(2 * np.pi * frequency * time), 0.2 * np.sin(2 * np.pi * frequency * time)]
    ) + 1e-3 * rng.normal(size=(2, 1000))
    grid = np.arange(2, 400) / 4 / (time[-1] - time[0])
    rough = finding.find_peak(grid, finding.compute_least_squares_power(time, y, grid), 0, 10)[0]
    assert finding.refine_frequency(time, y, rough) == pytest.approx(
        frequency, abs=1e-3 / (time[-1] - time[0])
    )


def test_noise_rarely_passes_for_an_oscillation() -> None:
    rng = np.random.default_rng(5)
    passed = 0
    for n in (64, 500, 4000):
        for _ in range(100):
            grid, power = finding.compute_even_power(rng.normal(size=(2, n)), 1.0)
            passed += finding.find_peak(grid, power, 1.5 / n, 0.5)[
                1
            ] > finding.compute_detection_ratio(1, len(grid) // finding.PADDING)
    assert passed <= 1
