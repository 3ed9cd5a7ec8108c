"""A thermometer that stands still in one run of five whose temperatures swing, each in its own
time: no parabola is the course that the run's frequency shows."""

import numpy as np
import pytest
from diagnosis_programme import programme
from wrong_runs import estimated, recordings

from hrg_cli.stages.diagnose import diagnose, summarise

DURATION_S = 2.0


def swung(seed, relative_1_k, still_at=None):
    """The diagnosis of five runs through 0.6 to 2 swings of ±1 °C; of run2, 1.3, the log holds one
    value."""
    table = programme(
        seed, {"thermal_frequency": {"relative_1_k": relative_1_k}}, runs=5, duration_s=DURATION_S
    )
    for k, run in enumerate(table["run"]):
        run["environment"]["temperature"] = {
            "kind": "cycle", "low_degc": 23.0 + 0.5 * k, "high_degc": 25.0 + 0.5 * k,
            "period_s": DURATION_S / (0.6 + 0.35 * k), "shape": "sine",
        }  # fmt: skip
    records = recordings(table, seed)
    if still_at is not None:
        still = np.full_like(np.asarray(records[2].temperature_degc, float), still_at)
        records[2] = records[2].replace(temperature_degc=still)
    return summarise(diagnose(estimated(records)))


@pytest.mark.parametrize(
    ("relative_1_k", "still_at"),
    [(1e-7, 25.0), pytest.param(1.5e-8, 25.3, marks=pytest.mark.slow)],
    ids=["gross", "small"],
)
def test_a_thermometer_that_stands_still_while_it_swings_is_named(relative_1_k, still_at):
    out = swung(7, relative_1_k, still_at)
    assert [(one["run_id"], one["what"]) for one in out["suspect_runs"]] == [
        ("run2", "thermometer stuck")
    ]
    told = out["suspect_runs"][0]["evidence"].split("moves by ")[1].split(" °C")[0]
    moved, std = map(float, told.split(" ± "))
    assert abs(moved - 2.0) < 4 * std < 40e-9 / relative_1_k


def test_temperatures_that_swing_each_in_its_time_are_no_mistake():
    out = swung(7, 1e-7)
    assert out["verdict"] == "explained" and out["suspect_runs"] == []
    assert [one["name"] for one in out["effects"]] == ["thermal_frequency"]
