"""A cause too small for χ² and whiteness that moves what is told: hidden in raw samples, it takes
the word "valid" away, whichever way the resonator is identified."""

import zlib

import numpy as np
import pytest

from hrg_cli.fitting.causes.extended_fit import DivergedError
from hrg_cli.stages.identification import unmodelled
from hrg_cli.stages.identify import identify, summarise
from hrg_cli.studies.hidden import draw_programme, hide, make_waves

SIZE, NOISE = 8.0, 3e-4
FAR_OFF = {
    "nonlinear_damping": "damping_rate_1_s",
    "damping_drift": "damping_rate_1_s",
    "ageing": "damping_axis_rad",
    "coherent_offset": "scale_factor",
}


def hidden(name):
    """Waves with a cause of 8 σ of an ideal detector, and the device's own values."""
    random = np.random.default_rng([0, 0, zlib.crc32(name.encode())])
    hiding = hide(name, random, NOISE)
    return hiding.measure(SIZE, int(random.integers(2**31))), hiding.table["device"]


def moved(resonator):
    checks = {check["name"]: check for check in summarise(resonator)["checks"]}
    return checks["unmoved_by_causes"]


@pytest.mark.parametrize(("name", "parameter"), FAR_OFF.items())
def test_what_a_small_cause_moves_is_not_valid(name, parameter):
    """Their χ² is 1.00 to 1.05: each was "valid", 10 to 30 σ off."""
    waves, device = hidden(name)
    found = identify(waves)
    value, std, _ = found.parameters()[parameter]
    check = moved(found)
    assert abs(value - device[parameter]) > 5 * std and found.chi2_per_dof < 1.1
    assert found.status == "suspect" and not check["passed"] and check["value"] > 5
    assert parameter in check["sentence"] and check["sentence"] in found.status_reasons


@pytest.mark.parametrize(
    "how",
    [
        {"method": "products"},
        {"method": "propagator"},
        {"method": "all"},
        {"fit_rate": True},
        {"scale_factor": "known"},
        {"earth_rate_deg_h": 0.01},
    ],
)
def test_every_way_asks(how):
    waves, device = hidden("nonlinear_damping")
    if how.get("scale_factor") == "known":
        how = {"scale_factor": device["scale_factor"]}
    found = identify(waves, **how)
    assert found.status != "valid" and not moved(found)["passed"]


def test_a_cause_that_moves_nothing_leaves_it_valid():
    """A frequency that follows the temperature is 8 σ of the phases and a σ of the damping."""
    waves, _ = hidden("thermal_frequency")
    found = identify(waves)
    assert found.status == "valid" and moved(found)["passed"]


def test_runs_that_cannot_be_asked_keep_their_answer(monkeypatch):
    def lose_the_way(*_, **__):
        raise DivergedError("no fit")

    waves, _ = hidden("thermal_frequency")
    monkeypatch.setattr(unmodelled, "fit_base", lose_the_way)
    found = identify(waves)
    assert found.status == "valid"
    assert "unmoved_by_causes" not in {c["name"] for c in summarise(found)["checks"]}


@pytest.mark.parametrize("seed", range(6))
def test_clean_runs_are_valid(seed):
    """One in ten thousand is not."""
    random = np.random.default_rng([70, seed])
    table = draw_programme(random, "thermal_gradient", 10 ** random.uniform(-5, -2.5))
    found = identify(make_waves(table, seed, "thermal_gradient"))
    assert found.status == "valid" and moved(found)["value"] == 0
