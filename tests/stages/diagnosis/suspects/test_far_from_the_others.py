"""One run so far from the others that no fit finds the way from them to it."""

import numpy as np
from diagnosis_programme import programme, waves

from hrg_cli.stages.diagnose import diagnose, summarise


def swinging(seed):
    """Five runs, of which two are at rest and three swing."""
    table = programme(seed, runs=5, noise=1e-4)
    for number, run in enumerate(table["run"]):
        run["environment"] = {"temperature_degc": 22.0}
        if number > 1:
            run["environment"]["rate"] = {
                "kind": "sine",
                "amplitude_rad_s": 0.5 + 0.2 * number,
                "frequency_hz": 0.4 + 0.1 * number,
            }
    return table


def test_a_quite_unlike_gyro_is_named():
    """Of another damping, splits five times as large, other axes: the base model of both at once
    has no meaning, and from the others' figures none leads to its own."""
    table = swinging(3)
    runs = waves(table)
    odd = swinging(3) | {"run": [table["run"][3]]}
    own = table["device"]
    odd["device"] = own | {
        "damping_rate_1_s": 1.7 * own["damping_rate_1_s"],
        "damping_split_1_s": 5 * own["damping_split_1_s"],
        "frequency_split_rad_s": 5 * own["frequency_split_rad_s"],
        "stiffness_axis_rad": own["stiffness_axis_rad"] + 0.5,
    }
    runs[3] = waves(odd)[0]
    out = summarise(diagnose(runs))
    assert [(one["run_id"], one["what"]) for one in out["suspect_runs"]] == [
        ("run3", "another gyro")
    ]


def test_a_log_that_is_stuck_in_one_run_is_named():
    """No factor makes a constant log right."""
    runs = waves(swinging(4))
    runs[3] = runs[3].replace(rate_rad_s=np.full(len(runs[3]), 0.3))
    out = summarise(diagnose(runs))
    assert [(one["run_id"], one["what"]) for one in out["suspect_runs"]] == [
        ("run3", "rate log stuck")
    ]
