"""A thermometer that stands still in one run of five that swing alike, at a small misfit: what all runs do
at one time of theirs accounts for it as well as the temperature, of which one run does not tell."""

import numpy as np
import pytest
from diagnosis_programme import programme
from wrong_runs import estimated, recordings

from hrg_cli.stages.diagnose import diagnose, summarise


def swinging(seed, stuck):
    """Five runs through one swing of the temperature each, which the frequency follows."""
    table = programme(seed, {"thermal_frequency": {"relative_1_k": 1.2e-8}}, runs=5)
    for k, run in enumerate(table["run"]):
        run["environment"]["temperature"] = {
            "kind": "cycle", "low_degc": 24.5 + 0.3 * k, "high_degc": 25.5 + 0.3 * k,
            "period_s": 2.0, "shape": "sine",
        }  # fmt: skip
    records = recordings(table, seed)
    if stuck:
        still = np.full_like(np.asarray(records[2].temperature_degc, float), 25.1)
        records[2] = records[2].replace(temperature_degc=still)
    return summarise(diagnose(estimated(records)))


@pytest.mark.parametrize("seed", [3, pytest.param(4, marks=pytest.mark.slow)])
def test_a_thermometer_that_stands_still_is_named_at_a_small_misfit(seed):
    """ "Unexplained" by a tone of the frequency before."""
    out = swinging(seed, stuck=True)
    assert out["baseline"]["chi2_per_dof"] < 3
    assert [(one["run_id"], one["what"]) for one in out["suspect_runs"]] == [
        ("run2", "thermometer stuck")
    ]


@pytest.mark.slow
def test_runs_that_swing_alike_keep_their_cause():
    out = swinging(3, stuck=False)
    assert out["verdict"] == "explained"
    assert [one["name"] for one in out["effects"]] == ["thermal_frequency"]
