"""Figures of where a simulation departs from the motion: known differences come out in the quantity
they were put into."""

import re

import numpy as np
import pytest
from records_by_hand import diagnosis

from hrg_cli.physics import ellipse
from hrg_cli.reporting.figures.departure import plot_departure
from hrg_cli.reporting.figures.drawing import use_style

RAISED = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹−", "-0123456789-")


def figures(words):
    """The two rms figures of a caption, before and after."""
    found = re.findall(r"(\S+) (?:mrad|%|% of a_A) rms", words)
    return [float(x.translate(RAISED).replace("×10", "e")) for x in found]


def reals(u):
    return np.concatenate([u.real, u.imag], axis=1)


@pytest.mark.parametrize("mode_number", [1, 2, 3])
@pytest.mark.parametrize(
    ("quantity", "size", "rms"),
    [("wave angle", 2e-3, 2.0), ("amplitude", 5e-3, 0.5), ("phase", 3e-3, 3.0)],
)
def test_a_known_difference_stands_in_its_own_figure(quantity, size, rms, mode_number):
    t = np.linspace(0, 10, 400)
    a, theta, phase = np.exp(-0.05 * t), 0.4 * t, 0.7 * t
    changed = {
        "wave angle": (a, theta + size, phase),
        "amplitude": (a * (1 + size), theta, phase),
        "phase": (a, theta, phase + size),
    }[quantity]
    simulated = reals(ellipse.compute_envelopes(a, 0.02 * a, theta, phase, mode_number))
    measured = reals(
        ellipse.compute_envelopes(changed[0], 0.02 * changed[0], *changed[1:], mode_number)
    )
    record = diagnosis().replace(
        run=np.zeros(len(t), "i4"), time_s=t, wave_angle_rad=theta, main_amplitude=a, temperature_degc=None,
        measured=measured, simulated_before=simulated, simulated_after=measured, residual_before=measured - simulated,
        residual_after=0 * measured,
    )  # fmt: skip
    with use_style():
        plots = {p.key: p.words for p in plot_departure(record, mode_number)}
    for key, words in plots.items():
        if not key.startswith("departure-"):
            continue
        before, after = figures(words)
        assert after == pytest.approx(0, abs=1e-9)
        assert before == pytest.approx(
            rms if key == f"departure-{quantity.replace(' ', '-')}" else 0, abs=2e-2 * rms
        )
