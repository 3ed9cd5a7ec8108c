"""The slow generator against another reference frequency, against the exact motion and in the two
other forms of PHYSICS, and its exponential where its eigenvalues meet."""

import numpy as np
import pytest
from scipy.linalg import expm

from hrg_cli.physics import resonator
from hrg_cli.physics.ellipse import compute_stokes
from hrg_cli.physics.resonator import J, Mechanics, make_reflection

GYRO = Mechanics(
    frequency_hz=5000.0,
    damping_rate_1_s=0.3,
    damping_split_1_s=0.03,
    damping_axis_rad=0.35,
    frequency_split_rad_s=0.2,
    stiffness_axis_rad=0.9,
)
OF_THE_PAGE = Mechanics(1003.7, 0.4, 0.02, 0.35, 0.4, 0.9, 0.554)
"""The gyro of PHYSICS §5."""


@pytest.mark.parametrize("second_order", [0.0, 1.0])
def test_against_a_lower_reference_the_envelope_turns_forward(second_order):
    """An oscillation above its reference frequency gains 2π(f − f_ref) a second in phase."""
    own = resonator.build_generator(GYRO, 0.5, second_order=second_order)
    below = resonator.build_generator(GYRO, 0.5, GYRO.frequency_hz - 0.25, second_order)
    turn = 2j * np.pi * 0.25 * np.eye(2)
    assert np.allclose(below - own, turn, rtol=0, atol=1e-3 * abs(turn[0, 0]))


@pytest.mark.parametrize("apart", [0.0, 0.99e-4, 1.01e-4, 3e-3])
def test_the_exponential_holds_where_eigenvalues_meet(apart):
    """L with eigenvalues h ± d and a large off-diagonal, which the small difference multiplies."""
    L = np.array([[-0.1 + 0.3j, 1e3], [apart**2 / 1e3, -0.1 + 0.3j]])
    found, exact = resonator.exponentiate(L, 1.0), expm(L)
    assert np.allclose(found[0], exact[0], rtol=1e-11, atol=0)


@pytest.mark.parametrize(("second_order", "low", "high"), [(1.0, 0.0, 1e-11), (0.0, 1e-5, 4e-5)])
def test_what_the_second_order_is_worth(second_order, low, high):
    """PHYSICS §5: four seconds at 1 rad/s against the exponential of the second-order motion."""
    omega, time_s = OF_THE_PAGE.omega_rad_s, 4.0
    turning = OF_THE_PAGE.scale_factor * J
    damping = OF_THE_PAGE.build_damping_matrix() - turning
    motion = np.block(
        [[np.zeros((2, 2)), np.eye(2)], [-OF_THE_PAGE.build_stiffness_matrix(), -2 * damping]]
    )
    start = np.array([0.955 + 0.006j, 0.296 - 0.019j])
    speed = (1j * omega * np.eye(2) + resonator.build_generator(OF_THE_PAGE, 1.0)) @ start
    exact = (expm(motion * time_s) @ np.concatenate([start.real, speed.real]))[:2]
    L = resonator.build_generator(OF_THE_PAGE, 1.0, second_order=second_order)
    slow = (expm(L * time_s) @ start * np.exp(1j * omega * time_s)).real
    assert low <= np.abs(slow - exact).max() < high


def test_the_second_order_written_out():
    """PHYSICS §5: L = L₀ − jΓ²/2ω − [Γ, Δ]/2ω, and its three parts of a gyro without damping split."""
    omega, turning = OF_THE_PAGE.omega_rad_s, OF_THE_PAGE.scale_factor * J
    first = resonator.build_generator(OF_THE_PAGE, 1.0, second_order=0)
    full = resonator.build_generator(OF_THE_PAGE, 1.0)
    gamma = OF_THE_PAGE.build_damping_matrix() - turning
    delta = OF_THE_PAGE.frequency_split_rad_s * make_reflection(4 * OF_THE_PAGE.stiffness_axis_rad)
    out = first - 1j * gamma @ gamma / (2 * omega) - (gamma @ delta - delta @ gamma) / (2 * omega)
    assert np.abs(out - full).max() < 1e-4 * np.abs(first - full).max()
    nu, k = OF_THE_PAGE.damping_rate_1_s, OF_THE_PAGE.scale_factor
    parts = 1j * k**2 / (2 * omega) * np.eye(2) + 1j * nu * k / omega * J + k / omega * J @ delta
    even = -1j * (nu * np.eye(2) - turning) @ (nu * np.eye(2) - turning) / (2 * omega)
    even = even + (turning @ delta - delta @ turning) / (2 * omega)
    assert np.allclose(even + 1j * nu**2 / (2 * omega) * np.eye(2), parts, rtol=0, atol=1e-15)


def test_the_stokes_form_is_the_generator():
    """PHYSICS §0: the derivative of the Stokes numbers of u' = L u, against their linear equation."""
    L = resonator.build_generator(OF_THE_PAGE, 0.7, second_order=0)
    u, h = np.array([0.9 + 0.1j, 0.3 - 0.2j]), 1e-5
    found = (compute_stokes(u + h * (L @ u)) - compute_stokes(u - h * (L @ u))) / (2 * h)
    s0, s1, s2, s3 = compute_stokes(u)
    nu, damping, split = 0.4, 0.02, 0.4
    turning = 0.554 * 0.7
    along, across = (np.exp(4j * angle) for angle in (0.35, 0.9))
    said = [
        -2 * nu * s0 - 2 * damping * (along.real * s1 + along.imag * s2),
        -2 * nu * s1
        - 2 * damping * along.real * s0
        + 2 * turning * s2
        + 2 * split * across.imag * s3,
        -2 * nu * s2
        - 2 * damping * along.imag * s0
        - 2 * turning * s1
        - 2 * split * across.real * s3,
        -2 * nu * s3 - 2 * split * (across.imag * s1 - across.real * s2),
    ]
    assert np.allclose(found, said, rtol=0, atol=1e-9)
