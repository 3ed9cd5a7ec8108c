"""A read-out's nonlinearity is named only where its harmonics are in the samples."""

import numpy as np
import pytest
from diagnosis_programme import programme
from wrong_runs import estimated, recordings

from hrg_cli.effects import EFFECTS, Effect, Parameter
from hrg_cli.physics import ellipse
from hrg_cli.stages.diagnose import diagnose, summarise
from hrg_cli.stages.diagnosis.samples.heard import (
    bound_power_in_looks,
    compute_harmonic_power,
    is_excluded,
)

BY_NAME = {effect.name: effect for effect in EFFECTS}
CURVES = {
    "pickoff_nonlinearity": {"cubic": 4e-3},
    "converter_nonlinearity": {"mid_scale": 2e-3},
}


def test_harmonics_of_a_curve_are_those_of_its_fourier_series():
    amplitude = np.array([[1.0, 0.4], [0.7, 0.2]])
    gamma, h, level = 4e-3, 2e-3, 0.9
    third = compute_harmonic_power(BY_NAME["pickoff_nonlinearity"], {"cubic": gamma}, amplitude)[
        0
    ].mean(axis=0)
    # γ cos³ = γ(3 cos φ + cos 3φ)/4
    np.testing.assert_allclose(third, np.mean((gamma * amplitude**3 / 4) ** 2, 0) / 2, rtol=0.03)
    dead = compute_harmonic_power(
        BY_NAME["converter_nonlinearity"], {"mid_scale": h, "step": 0.0}, amplitude[:, :1]
    )
    # a square wave of height h: 4h/πn at the odd n, where h is small beside the amplitude
    np.testing.assert_allclose(
        dead.mean(axis=1)[:, 0], (4 * h / np.pi / np.array([3, 5, 7])) ** 2 / 2, rtol=0.05
    )
    clipped = compute_harmonic_power(
        BY_NAME["saturation"], {"inverse_level": 1 / level}, amplitude[:1]
    )
    assert clipped[0, 0, 0] > 0 and clipped[0, 0, 1] == pytest.approx(0.0, abs=1e-20)


def test_a_clip_just_under_the_top_makes_harmonics_at_the_top_alone():
    """A circuit that clips at 0.9985 of noisy channels of amplitude one: rows at 0.998 hold next to
    nothing (of 24 even amplitudes up to the top, two lay above and below them, and what was between
    was half of the top's)."""
    level, noise = 0.9985, 5e-4
    amplitude = np.array([0.9, 0.998, 0.999, 1.0, 1.0005])[:, None]
    third = compute_harmonic_power(
        BY_NAME["saturation"], {"inverse_level": 1 / level}, amplitude, noise
    )[0, :, 0]
    phase, draw = 2 * np.pi * np.arange(512) / 512, np.random.default_rng(4)
    for a, power in zip(amplitude[:, 0], third, strict=True):
        y = np.clip(a * np.cos(phase) + noise * draw.standard_normal((5000, 512)), -level, level)
        line = np.mean(2 * np.mean(y * np.cos(3 * phase), axis=1))
        assert power == pytest.approx(line**2 / 2, rel=0.1, abs=1e-11)


def test_harmonics_of_a_read_out_with_memory_are_those_of_its_loop():
    """Rayleigh's loop: βA² sgn(sin φ) sin²φ/2 beside the line, whose third multiple is a sine of
    size 4βA²/15π. It was asked with no samples at all around it, and ended in an internal error."""
    slope, amplitude = 2e-3, np.array([[1.0, 0.4], [0.7, 0.2]])

    def readout(p, readout):
        def step(block, y):
            turned = np.hypot(block.z, block.v_over_omega)
            loop = turned * block.z - np.sign(block.v_over_omega) * block.v_over_omega**2 / 2
            return y + p["slope"] * loop

        readout.steps.append(step)

    parameters = (Parameter("slope", "amplitude-1", 1e-3, "β"),)
    behind = Effect("behind", "read-out", "Rayleigh", parameters, readout=readout)
    third = compute_harmonic_power(behind, {"slope": slope}, amplitude)[0].mean(axis=0)
    expected = np.mean((4 * slope * amplitude**2 / 15 / np.pi) ** 2, 0) / 2
    np.testing.assert_allclose(third, expected, rtol=0.03)


def test_a_power_that_comes_and_goes_may_be_missed_by_the_looks():
    """Bursts of a tenth of the looks' distance lie between them at the worst, one that lasts is
    seen, and so are bursts along a run no longer than its looks; of the first instants, where a look
    is tapered, next to nothing is."""
    t = np.linspace(0.0, 160.0, 16001)
    burst = (np.mod(t, 160 / 15 * (1 - 0.01 / 15)) < 1.0).astype(float)[None, :, None]
    assert burst.mean() == pytest.approx(0.094, abs=0.01)
    assert (
        bound_power_in_looks(burst, t, 0.1)[0, 0] < 0.07
    )  # the first look alone, which may not move
    assert 0.5 * burst.mean() < bound_power_in_looks(burst, t, 20.0)[0, 0] < burst.mean()
    start = (t < 5.0).astype(float)[None, :, None]
    assert bound_power_in_looks(start, t, 20.0)[0, 0] < 0.1 * start.mean()
    assert bound_power_in_looks(np.ones((1, len(t), 1)), t, 0.1)[0, 0] == pytest.approx(1.0)


def measured(heard, name, part=1.0):
    """Waves with a curve's fundamental; with `heard` its harmonics too: bent samples, else bent
    envelopes of samples that are not."""
    table = programme(2, {name: CURVES[name]} if heard else None, runs=3, noise=1e-4)
    table["recording"]["sample_rate_hz"] = 40_009.0
    waves = estimated(recordings(table, 2))
    if heard:
        return waves
    out = []
    for wave in waves:
        columns = ("main_amplitude", "quadrature_amplitude", "wave_angle_rad", "phase_rad")
        u = ellipse.compute_envelopes(*(np.asarray(getattr(wave, c)) for c in columns))
        values = {"step": 0.0} | {k: part * v for k, v in CURVES[name].items()}
        u = BY_NAME[name].slow_readout(values, u, None)
        a_A, a_B, angle, phase = ellipse.find_wave(u)
        angle, phase = ellipse.unwrap(angle, phase)
        out.append(
            wave.replace(
                main_amplitude=a_A, quadrature_amplitude=a_B, wave_angle_rad=angle, phase_rad=phase
            )
        )
    return out


@pytest.mark.parametrize("name", CURVES)
def test_a_curve_is_excluded_by_samples_that_lack_its_harmonics_and_by_no_others(name):
    values = {"step": 0.0} | CURVES[name]
    least = {key: value / 20 for key, value in values.items()}
    without, beside = measured(False, name), measured(True, name)
    assert is_excluded(BY_NAME[name], values, without) and is_excluded(
        BY_NAME[name], least, without
    )
    assert not is_excluded(BY_NAME[name], values, beside)
    # two thirds of it may be a cause: the samples hold more than it makes
    assert not is_excluded(BY_NAME[name], {k: v / 1.5 for k, v in values.items()}, beside)
    folded = [w.replace(spectrum_frequency_hz=w.spectrum_frequency_hz / 3) for w in without]
    assert not is_excluded(BY_NAME[name], values, folded)


def test_bent_envelopes_of_straight_samples_are_no_pickoff():
    found = summarise(diagnose(measured(False, "pickoff_nonlinearity", 0.05)))
    assert not {e["name"] for e in found["effects"]} & {*CURVES, "saturation"}
    assert found["verdict"] not in ("explained", "adequate")
