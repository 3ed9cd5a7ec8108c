"""A law that is named as a line and bends: the next order is named where the runs show it, and is in
every σ where they do not."""

import numpy as np
import pytest
from diagnosis_programme import programme, verdict

from hrg_cli.effects.effect import Effect, Parameter
from hrg_cli.physics.resonator import make_reflection

MIDDLE_DEGC, SPLIT_1_S = 22.5, 0.1


def turning_axis():
    """A damping axis that turns in proportion to the temperature; the catalogue has its slope."""

    def plant(p, plant, env):
        begin = 2 * plant.mechanics.mode_number * plant.mechanics.damping_axis_rad
        turn = 4 * p["turn_rad_k"] * (env.temperature_degc - MIDDLE_DEGC)
        change = np.array([make_reflection(begin + one) for one in turn]) - make_reflection(begin)
        plant.damping = plant.damping + plant.mechanics.damping_split_1_s * change

    turn = Parameter("turn_rad_k", "rad K-1", 1e-3, "turn of the damping axis per kelvin")
    return Effect("turning_axis", "resonator", "An axis that turns.", (turn,), plant=plant)


@pytest.mark.parametrize(("seed", "turn_rad_k", "told"), [(3, 0.003, False), (1, 0.01, True)])
def test_a_turning_damping_axis(seed, turn_rad_k, told):
    """12 mrad either way: the square of the turn is 15 of the line's own σ and in the split's; 40 mrad:
    it is named with its size."""
    table = programme(seed, {"turning_axis": {"turn_rad_k": turn_rad_k}}, cycle=True)
    table["device"]["damping_split_1_s"] = SPLIT_1_S
    for run in table["run"]:
        run["environment"]["temperature"] |= {
            "low_degc": MIDDLE_DEGC - 4,
            "high_degc": MIDDLE_DEGC + 4,
        }
    found = verdict(table, (turning_axis(),))[1]
    assert found["verdict"] == "explained"
    (cause,) = found["effects"]
    assert cause["name"] == "damping_split_temperature"
    split = next(v for v in found["values"] if v["name"] == "damping_split_1_s")
    assert abs(split["value"] - SPLIT_1_S) < 3 * split["std"] < 0.05 * SPLIT_1_S
    bend = [p for name, p in cause["parameters"].items() if name.endswith("k2")]
    assert bool(bend) == told
    if told:
        size, std = np.hypot(*(p["value"] for p in bend)), bend[0]["std"]
        assert abs(size - SPLIT_1_S * (4 * turn_rad_k) ** 2 / 2) < 3 * std
