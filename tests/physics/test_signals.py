"""The eight signals of seed B (1): the carrier's multiplication, the envelope convention and the
sixteen symmetries."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from oracles.solutions import symmetries

from hrg_cli.physics import ellipse
from hrg_cli.physics.signals import (
    compute_direct_envelopes,
    find_sidebands,
    from_sidebands,
    make_signals,
)

amplitude = st.floats(-2, 2)
angle = st.floats(-10, 10)
vectors = st.tuples(amplitude, amplitude, angle, angle, angle).map(np.array)


def test_the_signals_are_the_spectrum_of_displacement_times_carrier():
    """Twice C(t)·(−sin(ω_c t + ψ)), fitted by cosines and sines at ω_c ∓ ω, gives z: signs and
    order of (1), from samples."""
    generator = np.random.default_rng(1)
    t = np.arange(4000) / 4000
    lower, upper = 2 * np.pi * (400 - 50), 2 * np.pi * (400 + 50)
    basis = np.column_stack(
        [np.cos(lower * t), np.cos(upper * t), np.sin(lower * t), np.sin(upper * t)]
    )
    for _ in range(20):
        A, B, theta, phi, psi = x = generator.uniform(-3, 3, 5)
        u = ellipse.compute_envelopes(A, B, theta / 2, phi, mode_number=2)
        displacement = (u[:, None] * np.exp(2j * np.pi * 50 * t)).real
        seen = -2 * displacement * np.sin(2 * np.pi * 400 * t + psi)
        fitted = np.linalg.lstsq(basis, seen.T, rcond=None)[0]
        np.testing.assert_allclose(make_signals(x), fitted.T.ravel(), atol=1e-12)


@given(vectors)
def test_sidebands_are_the_envelope_turned_by_the_carrier_phase(x):
    A, B, theta, phi, psi = x
    u = ellipse.compute_envelopes(A, B, theta, phi, mode_number=1)
    lower, upper = find_sidebands(make_signals(x))
    np.testing.assert_allclose(lower, u * np.exp(-1j * psi), atol=1e-12)
    np.testing.assert_allclose(upper, u * np.exp(1j * psi), atol=1e-12)
    np.testing.assert_array_equal(from_sidebands(lower, upper), make_signals(x))


@given(vectors)
def test_sixteen_vectors_have_the_same_signals(x):
    copies = symmetries(x)
    assert copies.shape == (16, 5)
    np.testing.assert_allclose(
        make_signals(copies), np.broadcast_to(make_signals(x), (16, 8)), atol=1e-12
    )


def test_the_sixteen_are_different():
    copies = symmetries(np.array([1.0, 0.3, 0.2, 0.4, 0.7]))
    copies[:, 2:] = np.mod(copies[:, 2:] + 1e-9, 2 * np.pi)
    assert len(np.unique(copies.round(6), axis=0)) == 16


def test_direct_signals_are_cosine_and_sine_coefficients():
    four = np.array([0.3, -0.2, 0.7, 0.1])
    t = np.linspace(0, 1, 50)
    u = compute_direct_envelopes(four)
    np.testing.assert_allclose(
        (u[0] * np.exp(7j * t)).real, 0.3 * np.cos(7 * t) - 0.2 * np.sin(7 * t)
    )
    np.testing.assert_allclose(
        (u[1] * np.exp(7j * t)).real, 0.7 * np.cos(7 * t) + 0.1 * np.sin(7 * t)
    )
