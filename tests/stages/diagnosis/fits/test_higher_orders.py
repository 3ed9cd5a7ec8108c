"""The next order of a cause: fitted where the data ask for it, and held where they do not."""

import numpy as np
import pytest
from diagnosis_programme import programme, verdict

from hrg_cli.effects import Effect, Parameter

SWING = 0.15
"""Of an amplifier's tanh at an amplitude of 1."""


def compress(p, readout):
    """y → tanh(κ y)/κ = y − κ²y³/3 + 2κ⁴y⁵/15 − …"""
    readout.steps.append(lambda block, y: np.tanh(p["swing"] * y) / p["swing"])


AMPLIFIER = Effect(
    "compressing_amplifier",
    "read-out",
    "An amplifier that compresses.",
    (Parameter("swing", "1", SWING, "its argument at an amplitude of 1"),),
    readout=compress,
    makes_harmonics=True,
)


def test_an_amplifiers_tanh_is_a_cubic_and_its_fifth_order():
    """With the cubic alone it was off, and a step of a gain and a knock stood beside it."""
    table = programme(5, {"compressing_amplifier": {"swing": SWING}}, runs=4, noise=2e-5)
    record, told = verdict(table, (AMPLIFIER,))
    assert [one["name"] for one in told["effects"]] == ["pickoff_nonlinearity"]
    assert record.status == "valid" and told["verdict"] == "explained", record.status_reasons
    found = told["effects"][0]["parameters"]
    for name, true in (("cubic", -(SWING**2) / 3), ("quintic", 2 * SWING**4 / 15)):
        # the seventh order, 17κ⁶/315, is in neither
        assert found[name]["value"] == pytest.approx(
            true, abs=4 * found[name]["std"] + 0.02 * abs(true)
        )
    assert found["quintic"]["value"] > 5 * found["quintic"]["std"]


def test_a_cubic_alone_keeps_its_fifth_order_held():
    _, told = verdict(programme(5, {"pickoff_nonlinearity": {"cubic": 2e-3}}, runs=4))
    (one,) = told["effects"]
    assert set(one["parameters"]) == {"cubic"} and one["held"] == {}
