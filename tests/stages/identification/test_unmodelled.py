"""A cause too small for χ² and whiteness that moves what is told: hidden in raw samples, it takes
the word "valid" away, whichever way the resonator is identified."""

import zlib

import numpy as np
import pytest
from synthetic_waves import errors, programme

from hrg_cli.fitting.causes.extended_fit import DivergedError
from hrg_cli.fitting.envelopes import condensed
from hrg_cli.physics.resonator import Mechanics
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


@pytest.mark.parametrize("how", [{}, {"fit_rate": True}, {"earth_rate_deg_h": 0.5}])
def test_records_that_are_read_by_blocks_are_asked_too(monkeypatch, how):
    """More windows than fit into memory were not asked, though theirs is the smallest σ."""
    waves, _ = hidden("nonlinear_damping")
    whole = moved(identify(waves, **how))
    for name, size in (("IN_MEMORY", 100), ("SAMPLE", 600), ("CONDENSED", 1200), ("BLOCK", 997)):
        monkeypatch.setattr(condensed, name, size)
    blockwise = moved(identify(waves, **how))
    assert not blockwise["passed"] and abs(blockwise["value"] / whole["value"] - 1) < 0.05


def test_swings_that_are_read_by_blocks_show_no_cause(monkeypatch):
    """The table's angle of averaged rows is their rate's course again, to 1e-6 rad."""
    gyro = Mechanics(5000.0, 1 / 60, 1e-4, 0.35, 5e-3, 0.9, 0.554)
    courses = [(0.1, lambda t: 0.3 * np.sin(2 * t) + 0.1), (0.5, -0.2), (0.9, 0.0)]
    waves = programme(gyro, seed=3, runs=courses, std=1e-5, window=0.01, seconds=60.0)
    for name, size in (("IN_MEMORY", 1000), ("SAMPLE", 3000), ("CONDENSED", 6000), ("BLOCK", 997)):
        monkeypatch.setattr(condensed, name, size)
    found = identify(waves)
    assert found.status == "valid" and moved(found)["value"] == 0.0
    assert max(map(abs, errors(found, gyro).values())) < 4


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
