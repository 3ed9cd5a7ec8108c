"""The wave of envelopes and back, for every mode number, and its continuous path over many
turns."""

import numpy as np
import pytest

from hrg_cli.physics import ellipse


@pytest.mark.parametrize("mode_number", [1, 2, 3])
def test_the_wave_of_envelopes_is_the_one_they_were_made_of(mode_number):
    angle = np.linspace(-0.99, 0.99, 41) * np.pi / (2 * mode_number)
    found = ellipse.find_wave(
        ellipse.compute_envelopes(1.3, -0.2, angle, 0.7, mode_number), mode_number
    )
    for values, wanted in zip(found, (1.3, -0.2, angle, 0.7)):
        assert np.allclose(values, wanted, rtol=0, atol=1e-12)


@pytest.mark.parametrize("mode_number", [1, 2, 3])
def test_a_turning_wave_has_one_continuous_path(mode_number):
    """Three turns of the angle and a slow phase: back from the copies in the smallest range, both
    come without a step, and as the same wave."""
    angle, phase = np.linspace(0.1, 3 * 2 * np.pi, 400), np.linspace(0.2, 4.0, 400)
    u = ellipse.compute_envelopes(1.0, 0.1, angle, phase, mode_number)
    _, _, short, turned = ellipse.find_wave(u, mode_number)
    assert np.ptp(short) <= np.pi / mode_number + 1e-9
    theta, phi = ellipse.unwrap(short, turned, mode_number)
    assert np.allclose(theta - theta[0], angle - angle[0], atol=1e-9)
    assert np.allclose(phi - phi[0], phase - phase[0], atol=1e-9)
    assert np.allclose(ellipse.compute_envelopes(1.0, 0.1, theta, phi, mode_number), u, atol=1e-9)
