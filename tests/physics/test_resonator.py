"""The slow generator against another reference frequency, and its exponential where its eigenvalues
meet."""

import numpy as np
import pytest
from scipy.linalg import expm

from hrg_cli.physics import resonator
from hrg_cli.physics.resonator import Mechanics

GYRO = Mechanics(
    frequency_hz=5000.0,
    damping_rate_1_s=0.3,
    damping_split_1_s=0.03,
    damping_axis_rad=0.35,
    frequency_split_rad_s=0.2,
    stiffness_axis_rad=0.9,
)


@pytest.mark.parametrize("second_order", [0.0, 1.0])
def test_against_a_lower_reference_the_envelope_turns_forward(second_order):
    """An oscillation above its reference frequency gains 2π(f − f_ref) a second in phase."""
    own = resonator.generator(GYRO, 0.5, second_order=second_order)
    below = resonator.generator(GYRO, 0.5, GYRO.frequency_hz - 0.25, second_order)
    turn = 2j * np.pi * 0.25 * np.eye(2)
    assert np.allclose(below - own, turn, rtol=0, atol=1e-3 * abs(turn[0, 0]))


@pytest.mark.parametrize("apart", [0.0, 0.99e-4, 1.01e-4, 3e-3])
def test_the_exponential_holds_where_eigenvalues_meet(apart):
    """L with eigenvalues h ± d and a large off-diagonal, which the small difference multiplies."""
    L = np.array([[-0.1 + 0.3j, 1e3], [apart**2 / 1e3, -0.1 + 0.3j]])
    found, exact = resonator.exponential(L, 1.0), expm(L)
    assert np.allclose(found[0], exact[0], rtol=1e-11, atol=0)
