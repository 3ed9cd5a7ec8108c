"""The pick-off's law against the field in the gap: Laplace's equation between a rim that swings in
cos 2θ and eight electrodes at virtual ground, no capacitor's formula.

Outside the rim r = 1 + w(θ) at unit voltage and inside the grounded circle r = R,
    u = A ln(r/R) + Σ a_k sinh(k ln(r/R)) cos kθ + b_k sinh(k ln(r/R)) sin kθ,
which is zero at R; the coefficients follow from u = 1 on the rim. An electrode carries the charge
−∫∂u/∂r R dθ over its width, a channel the sum of its four with their signs, as amplifiers see it.
"""

import numpy as np
import pytest

from hrg_cli.physics.electrodes import SIGNS, pick_off

GAP, NARROW = 0.007, 1e-3
"""Of the radius, and half an electrode's width, rad. 0.1 mm on 15 mm."""
ORDERS = np.arange(2, 62, 2)
ANGLES = np.arange(256) * 2 * np.pi / 256
TURN = np.arange(64) * 2 * np.pi / 64
"""Phases of one oscillation."""


def charges(x, y, half_width):
    """Charge of both channels (2,) with the rim displaced by x cos 2θ + y sin 2θ, in gaps."""
    outer = 1 + GAP
    depth = np.log((1 + GAP * (x * np.cos(2 * ANGLES) + y * np.sin(2 * ANGLES))) / outer)
    # in units of the sinh at rest: no number is huge
    rest = np.sinh(ORDERS * np.log(1 / outer))
    radial = np.sinh(ORDERS * depth[:, None]) / rest
    kt = ORDERS * ANGLES[:, None]
    columns = np.column_stack([depth, radial * np.cos(kt), radial * np.sin(kt)])
    found = np.linalg.lstsq(columns, np.ones(len(ANGLES)), rcond=None)[0]
    assert np.abs(columns @ found - 1).max() < 1e-9
    level, even, odd = found[0], *np.split(found[1:], 2)
    out = np.zeros(2)
    for k in range(8):
        middle = k * np.pi / 4
        wide = 2 * np.sin(ORDERS * half_width) / ORDERS
        shape = even * np.cos(ORDERS * middle) + odd * np.sin(ORDERS * middle)
        out[k % 2] -= SIGNS[k] * (2 * half_width * level + np.sum(ORDERS / rest * shape * wide))
    return out


def fundamental(signal):
    """Complex amplitude of the first harmonic over one oscillation."""
    return 2 * np.mean(signal * np.exp(-1j * TURN))


def growth_of_field(a, half_width, current):
    """By how much more than in proportion the first harmonic of channel C grows up to a gaps: of
    the charge (the carrier's amplitude), or of the current at constant voltage."""

    def seen(amplitude):
        charge = np.array([charges(c, 0.0, half_width)[0] for c in amplitude * np.cos(TURN)])
        if current:
            orders = np.fft.fftfreq(len(TURN), 1 / len(TURN))
            charge = np.real(np.fft.ifft(1j * orders * np.fft.fft(charge)))
        return abs(fundamental(charge)) / amplitude

    return seen(a) / seen(1e-3) - 1


def growth_of_law(law, a):
    one = np.ones(8)
    z, v = (a * np.stack([f(TURN), 0 * TURN]) for f in (np.cos, lambda x: -np.sin(x)))
    return abs(fundamental(pick_off(law, 1.0, one, one, z, v)[0])) / a - 1


@pytest.mark.parametrize("law", ["alternating", "constant-voltage"])
@pytest.mark.parametrize("a", [0.05, 0.2])
def test_the_field_has_the_laws_cubic_factor(law, a):
    """γ = 1; the print read without its dots, γ = 3, is three times off."""
    field = growth_of_field(a, NARROW, law == "constant-voltage")
    assert growth_of_law(law, a) == pytest.approx(field, rel=1e-3)
    assert growth_of_law("printed", a) > 2.9 * field


@pytest.mark.parametrize("half_width_deg", [5.0, 15.0, 22.5])
def test_wide_electrodes_see_less_of_the_cubic_and_some_of_the_other_channel(half_width_deg):
    """An electrode sees c cos 2ψ + s sin 2ψ over its width: the law c + γc³ + κcs² is that of narrow
    ones, γ = 1 and κ = 0; else γ = ⟨cos³⟩/⟨cos⟩ and κ = 3⟨cos sin²⟩/⟨cos⟩, 0.83 and 0.5 where eight
    electrodes leave no room between them."""
    half, a = np.radians(half_width_deg), 0.05
    psi = np.linspace(-half, half, 2001)
    first = np.mean(np.cos(2 * psi))
    gamma = growth_of_field(a, half, False) / growth_of_law("alternating", a)
    assert gamma == pytest.approx(np.mean(np.cos(2 * psi) ** 3) / first, rel=3e-3)
    alone = charges(a, 0.0, half)[0]
    kappa = (charges(a, a, half)[0] / alone - 1) / a**2
    expected = 3 * np.mean(np.cos(2 * psi) * np.sin(2 * psi) ** 2) / first
    assert kappa == pytest.approx(expected, rel=0.03)
