"""The least count of a converter is found from the values alone, and nothing is found where there
is none."""

import numpy as np
import pytest

from hrg_cli.least_count import find_least_count
from hrg_cli.records import Recording, collect
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.estimate import estimate

RATE = 48_000.0
T = np.arange(30_000) / RATE


def wave(amplitude: float, noise: float, seed: int = 0) -> np.ndarray:
    return amplitude * np.cos(2 * np.pi * 5003.37 * T) + noise * np.random.default_rng(
        seed
    ).standard_normal(len(T))


@pytest.mark.parametrize("step", [1.0, 3.0517578125e-05, 0.02, 7.3e-9])
@pytest.mark.parametrize("offset", [0.0, 0.31])
def test_step_of_rounded_floats(step, offset):
    values = step * (np.rint(wave(300, 0.4)) + offset)
    assert find_least_count([values]) == pytest.approx(step, rel=1e-6)


def test_step_of_values_printed_with_few_digits():
    """A 16-bit converter of ±1 V whose log has six decimals: the values lie off the lattice by
    their rounding."""
    values = np.round(2.0**-15 * np.rint(wave(20_000, 2)), 6)
    assert find_least_count([values]) == pytest.approx(2.0**-15, rel=1e-3)


def test_integers_in_a_wider_word_keep_the_converters_step():
    codes = 256 * np.rint(wave(2000, 1)).astype("i4")
    assert find_least_count([codes[:9000], codes[9000:]]) == 256
    assert find_least_count([codes[:9000] // 256]) == 1


@pytest.mark.parametrize("dtype", ["f8", "f4"])
def test_a_continuum_has_none(dtype):
    for seed in range(20):
        assert find_least_count([wave(1.0, 1e-3, seed).astype(dtype)]) == 0.0
    assert find_least_count([np.zeros(100)]) == 0.0 and find_least_count([]) == 0.0


def test_it_travels_to_the_wave_and_says_whether_rounding_is_the_noise():
    """Rounding of 0.05 V makes 90 % of the residual of one recording and a thousandth of another's;
    a float recording has none."""
    shares = {}
    for name, noise in (("rounded", 0.005), ("noisy", 0.5)):
        c, s = (0.05 * np.rint(wave(a, noise, k) / 0.05) for k, a in enumerate((1.0, 0.63)))
        periods = collect(
            demodulate(
                Recording(c=c, s=s, sample_rate_hz=RATE, mode="free", c_units="V", s_units="V")
            )
        )
        made = collect(estimate(periods))
        assert made.least_count == pytest.approx(0.05)
        shares[name] = made.quantisation_share
    assert shares["rounded"] > 0.8 and shares["noisy"] == pytest.approx(
        0.05**2 / 12 / 0.25, rel=0.1
    )
    plain = collect(
        demodulate(Recording(c=wave(1, 0.1), s=wave(0.6, 0.1, 1), sample_rate_hz=RATE, mode="free"))
    )
    assert plain.least_count is None and plain.quantisation_share is None
