"""The directions of a wave: what turns it, and what opens it, at any phase of the oscillation."""

import numpy as np
import pytest

from hrg_cli.fitting.causes.wave_frame import find_directions
from hrg_cli.physics import ellipse


def wave(angle, phase, quadrature, amplitude=1.3):
    return ellipse.compute_envelopes(
        np.array(amplitude), np.array(quadrature), np.array(angle), np.array(phase)
    )


@pytest.mark.parametrize("phase", (0.0, 0.6, np.pi / 4, 2.5, -1.9))
@pytest.mark.parametrize("quadrature", (0.0, 0.02))
def test_each_direction_is_one_coordinate_of_the_wave(phase, quadrature):
    """Angle and ellipticity were these at the phase 0 alone, and each other's at 45°: a slow error
    of the angle was none where the phase runs."""
    step, at = 1e-6, (0.3, phase, quadrature)
    changes = [
        wave(*at, amplitude=1.3 + step) - wave(*at),
        wave(at[0], at[1] + step, at[2]) - wave(*at),
        wave(at[0] + step, at[1], at[2]) - wave(*at),
        wave(at[0], at[1], at[2] + step) - wave(*at),
    ]
    seen = np.real(find_directions(wave(*at)) @ np.conj(np.stack(changes, axis=-1))) / step
    shares = np.abs(seen) / np.linalg.norm(seen, axis=0)
    np.testing.assert_allclose(np.diag(shares), 1.0, atol=3 * quadrature**2 + 1e-5)


def test_a_circle_has_directions_all_the_same():
    circle = np.array([1.0, 1j]) / np.sqrt(2)
    found = find_directions(circle)
    gram = np.real(found @ np.conj(found.T))
    np.testing.assert_allclose(gram, np.eye(4), atol=1e-12)
