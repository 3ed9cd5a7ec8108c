"""The angle that a rate of the reference model sums up to, and what the resonator's own errors do to
both: error over σ over draws of noise and of resonators."""

import numpy as np
import pytest
from synthetic_waves import GYRO, as_wave, envelope

from hrg_cli.physics.resonator import PARAMETERS
from hrg_cli.records import Resonator
from hrg_cli.stages.rate import rate

SECONDS, WINDOW_S, FINE, NOISE = 3.0, 5e-3, 8, 1e-4
AMPLITUDE, MEAN, TURNS_S = 0.3, 0.5, 0.4
EXACT = 1e-6


def swing(t):
    return MEAN + AMPLITUDE * np.sin(2 * np.pi * TURNS_S * t)


def swung(t):
    """Its integral."""
    turned = (1 - np.cos(2 * np.pi * TURNS_S * t)) / (2 * np.pi * TURNS_S)
    return MEAN * t + AMPLITUDE * turned


def resonator(relative, seed):
    """Drawn from its own covariance, every value off by a part `relative` of itself; axes by a
    tenth of that in rad."""
    true = np.array([getattr(GYRO, name) for name, _ in PARAMETERS])
    axes = [name.endswith("axis_rad") for name, _ in PARAMETERS]
    std = relative * np.where(axes, 0.1, np.abs(true))
    return Resonator(
        name=np.array([name for name, _ in PARAMETERS], object),
        value=true + std * np.random.default_rng([seed, 9]).normal(size=len(true)),
        std=std,
        units=np.array([unit for _, unit in PARAMETERS], object),
        covariance=np.diag(std**2),
        mode_number=GYRO.mode_number,
    )


def wave_of(seed, mode="free"):
    """Windows of a run whose rate swings: an exact run-down, or a wave held up along the angle and
    quadrature that this has (what an in-phase force leaves)."""
    rng = np.random.default_rng(seed)
    fine = np.arange(1, int(SECONDS / WINDOW_S) * FINE + 1) * WINDOW_S / FINE
    u = envelope(GYRO, 0.2, swing, fine)[FINE - 1 :: FINE]
    if mode == "forced":
        u = u / np.sqrt(np.sum(np.abs(u) ** 2, axis=1, keepdims=True))
    wave = as_wave(u, fine[FINE - 1 :: FINE], NOISE, GYRO, rng, mode=mode)
    # noise across a wave of amplitude a turns mθ by noise/a
    std = NOISE / wave.main_amplitude / GYRO.mode_number
    return wave.replace(wave_angle_rad_std=std)


def ratios(mode, relative, draws):
    """Error over σ (draws, nodes) of the rates and of the angles after the first node, which is
    their origin."""
    of_rate, of_angle = [], []
    for seed in range(draws):
        found = rate(wave_of(seed, mode), resonator(relative, seed))
        assert found.status == "valid", found.status_reasons
        off = found.rate_estimate_rad_s - swing(found.time_s)
        of_rate.append(off / found.rate_estimate_rad_s_std)
        turned = swung(found.time_s) - swung(found.time_s[0])
        off = found.angle_estimate_rad - turned
        assert found.angle_estimate_rad_std[0] == 0 == off[0]
        of_angle.append((off / np.maximum(found.angle_estimate_rad_std, 1e-300))[1:])
    return np.array(of_rate), np.array(of_angle)


@pytest.mark.parametrize(
    ("mode", "relative"),
    [
        ("forced", EXACT),
        ("free", 1e-2),
        pytest.param("free", EXACT, marks=pytest.mark.slow),
        pytest.param("forced", 1e-2, marks=pytest.mark.slow),
    ],
)
def test_error_over_sigma_is_one_for_rate_and_angle(mode, relative):
    """24 draws; of a resonator that is off all nodes move alike, so they count as few."""
    of_rate, of_angle = ratios(mode, relative, 24)
    rms = [np.sqrt(np.mean(z**2)) for z in (of_rate, of_angle, of_angle[:, -1])]
    assert min(rms) > 0.6 and max(rms) < 1.5, rms


def test_with_the_earths_rate_given_the_answer_is_against_the_ground():
    """The wave feels the rate against the stars: Ω_E sin(latitude) more than the ground shows of a
    vertical axis; here a planet that turns four thousand times as fast, of which 0.2 rad/s is seen."""
    latitude, spin = 40.0, 0.3111
    seen = spin * np.sin(np.radians(latitude))
    exact = resonator(EXACT, 0)
    stars = rate(wave_of(0), exact)
    for told in ({"earth_rate_deg_h": np.degrees(seen) * 3600}, {"latitude_deg": latitude}):
        ground = rate(wave_of(0), exact, **told)
        turned = seen if "earth_rate_deg_h" in told else 7.2921150e-5 * np.sin(np.radians(latitude))
        off = ground.rate_estimate_rad_s - (swing(ground.time_s) - turned)
        assert np.sqrt(np.mean((off / ground.rate_estimate_rad_s_std) ** 2)) < 1.7
        fallen = stars.angle_estimate_rad - ground.angle_estimate_rad
        expected = turned * (ground.time_s - ground.time_s[0])
        assert fallen == pytest.approx(expected, rel=1e-6, abs=1e-9)
        assert ground.angle_estimate_rad_std == pytest.approx(stars.angle_estimate_rad_std)
