"""The pick-off's law against the currents of its capacitors, differentiated numerically."""

import numpy as np
import pytest

from hrg_cli import collect, simulate
from hrg_cli.errors import HrgError
from hrg_cli.physics.electrodes import LAWS, SIGNS, compute_cubic_factor, pick_off

ONES = np.ones(8)


def currents(x, s, voltage, t, gap, gaps=ONES, gains=ONES):
    """Currents of both channels by d/dt of the charges C_k U, finite differences."""
    out = np.zeros((2, len(t)))
    for k in range(8):
        towards = SIGNS[k] * (x, s)[k % 2]
        charge = voltage / (gap * gaps[k] - towards)
        out[k % 2] += SIGNS[k] * gains[k] * np.gradient(charge, t)
    return out


def amplitude(y, t, omega):
    """|least-squares phasor| at ω of the inner samples."""
    basis = np.exp(1j * omega * t) * np.hanning(len(t))
    return 2 * abs(np.sum(y * basis)) / np.sum(np.hanning(len(t)))


@pytest.mark.parametrize(
    "gaps", [ONES, 1 + 0.1 * np.cos(np.arange(8) * 1.3)], ids=["equal", "own gaps"]
)
@pytest.mark.parametrize("law", ["alternating", "constant-voltage"])
def test_law_is_the_current_of_the_capacitors(law, gaps):
    gains = ONES if gaps is ONES else 1 + 0.05 * np.sin(np.arange(8))
    omega, carrier, gap = 2 * np.pi * 50.0, 2 * np.pi * 1500.0, 4.0
    t = np.arange(0, 0.4, 2e-6)
    x, s = np.cos(omega * t), 0.5 * np.sin(omega * t)
    v = np.stack([-np.sin(omega * t), 0.5 * np.cos(omega * t)])
    y = pick_off(law, gap, gaps, gains, np.stack([x, s]), v)
    size = gap**2 / 4  # of the sum of four currents to the displacement
    if law == "alternating":
        seen = currents(x, s, np.cos(carrier * t), t, gap, gaps, gains) * size
        for k in range(2):  # the current at the sidebands is that of the product, differentiated
            for side in (carrier - omega, carrier + omega):
                got = amplitude(y[k] * np.cos(carrier * t), t, side) * side
                assert amplitude(seen[k], t, side) == pytest.approx(got, rel=1e-3)
    else:
        seen = currents(x, s, np.ones_like(t), t, gap, gaps, gains) * size / omega
        assert np.abs(seen - y)[:, 5:-5].max() < 1e-4


@pytest.mark.parametrize("law", LAWS)
def test_cubic_factor_of_the_fundamental(law):
    omega, t = 2 * np.pi * 10.0, np.linspace(0, 1, 20_000, endpoint=False)
    for a in (0.02, 0.05):
        z = a * np.stack([np.cos(omega * t), np.cos(omega * t)])
        v = -a * np.stack([np.sin(omega * t), np.sin(omega * t)])
        y = pick_off(law, 1.0, ONES, ONES, z, v)[0]
        growth = 2 * abs(np.mean(y * np.exp(1j * omega * t))) / a - 1
        assert growth / (0.75 * a**2) == pytest.approx(
            compute_cubic_factor(law), rel=2 * a**2 + 0.01
        )


@pytest.mark.parametrize("law", LAWS)
def test_fundamental_is_the_integral_to_all_orders(law):
    """(1/π)∫ a cos²x/(1 − a²cos²x) dx = 2(1/√(1 − a²) − 1)/a = F(a). A velocity of the same charge has
    the same fundamental, a quarter period on; c(1 + c²)/(1 − c²)² is c·d/dc of c/(1 − c²), hence aF'."""
    x = np.linspace(0, 2 * np.pi, 4096, endpoint=False)
    for a in (0.1, 0.5, 0.9):
        z, v = a * np.cos(x) * np.ones((2, 1)), -a * np.sin(x) * np.ones((2, 1))
        y = pick_off(law, 1.0, ONES, ONES, z, v)[0]
        root = 1 / np.sqrt(1 - a**2)
        whole = 2 * (root - 1) / a
        if law == "printed":
            whole = 2 * a * root**3 - whole
        phase = -np.sin(x) if law == "constant-voltage" else np.cos(x)
        assert 2 * np.mean(y * phase) == pytest.approx(whole, rel=1e-12)
        assert abs(2 * np.mean(y * (np.sin(x) if law != "constant-voltage" else np.cos(x)))) < 1e-12


def test_equal_electrodes_one_by_one_are_the_closed_law():
    z = np.stack([np.linspace(-0.5, 0.5, 11), np.linspace(0.4, -0.4, 11)])
    nearly = ONES + 1e-12
    for law in LAWS:
        assert pick_off(law, 1.0, nearly, ONES, z, z[::-1]) == pytest.approx(
            pick_off(law, 1.0, ONES, ONES, z, z[::-1]), rel=1e-9, abs=1e-12
        )


def test_a_wave_that_reaches_a_gap_is_refused():
    with pytest.raises(HrgError, match="narrowest gap"):
        pick_off(
            "alternating",
            1.0,
            np.array([0.5, *ONES[1:]]),
            ONES,
            np.full((2, 3), 0.6),
            np.zeros((2, 3)),
        )


@pytest.mark.parametrize(("model", "most"), [("fast", 1e-7), ("slow", 1e-6)])
def test_a_constant_voltage_reads_the_velocity_of_the_displacement(model, most):
    """A split, a rate and a temperature that moves: what the electrodes give is the derivative of
    the displacement that `linear` gives, over the frequency, sample by sample."""
    h = 1 / 80_000.0
    config = {
        "device": {
            "frequency_hz": 1000.0, "time_constant_s": 0.5, "damping_split": 0.2, "damping_axis_rad": 0.3,
            "frequency_split_rad_s": 3.0, "stiffness_axis_rad": 0.9, "scale_factor": 0.55,
            "temperature": {"frequency_per_degc": 1e-4},
        },
        "start": {"wave_angle_rad": 0.2, "quadrature": 0.1},
        "environment": {
            "rate_rad_s": 6.0,
            "temperature": {"kind": "ramp", "start_degc": 20.0, "stop_degc": 40.0},
        },
        "recording": {"sample_rate_hz": 1 / h, "duration_s": 0.3},
    }  # fmt: skip
    velocity = {"readout": {"model": "full", "law": "constant-voltage", "gap": 1e7}}
    z, v = (
        np.stack([record.c, record.s])
        for record in (collect(simulate(config | extra, model=model)) for extra in ({}, velocity))
    )
    tenth = np.array([-1 / 1260, 5 / 504, -5 / 84, 5 / 21, -5 / 6])  # of the derivative, order 10
    weights = np.concatenate([tenth, [0.0], -tenth[::-1]])
    slope = np.stack([np.convolve(row, weights[::-1], mode="valid") for row in z]) / h
    assert np.abs(v[:, 5:-5] - slope / (2 * np.pi * 1000.0)).max() < most
