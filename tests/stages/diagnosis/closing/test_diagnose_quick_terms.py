"""What is too quick for the residual's smooth part is not called adequate."""

import numpy as np
import pytest
from diagnosis_programme import programme, verdict

from hrg_cli.effects.effect import Effect, Parameter


def modulation(p, plant, env):
    plant.damping = plant.damping + (p["size"] * np.sin(2 * np.pi * 8.0 * env.time_s))[
        :, None, None
    ] * np.eye(2)


def test_a_quick_modulation_of_the_damping_is_found():
    size = Parameter("size", "s-1", 1.0, "size")
    stranger = Effect(
        name="stranger", family="test", page="modulation", parameters=(size,), plant=modulation
    )
    _, out = verdict(programme(12, {"stranger": {"size": 8e-3}}, runs=5), (stranger,))
    assert out["verdict"] == "unexplained" and out["effects"] == []
    term = out["remainder"]["terms"][0]
    assert term["place"] == "damping" and "tone of" in term["formula"]
    assert float(term["formula"].split("tone of ")[1].split(" Hz")[0]) == pytest.approx(8, abs=0.05)
