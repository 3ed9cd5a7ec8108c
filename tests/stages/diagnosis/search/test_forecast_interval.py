"""The interval of a forecast holds what the same gyro's other records show of it."""

import numpy as np
from diagnosis_programme import programme, waves

from hrg_cli import diagnose
from hrg_cli.stages.diagnose import summarise

DRAWS = 12


def test_the_interval_holds_the_ratio_of_other_draws():
    """One run, its last part forecast from the first: nothing but the noise differs.

    What is to be held is the ratio of all draws' errors together. 95 % intervals of twelve draws
    hold it fewer than ten times with a chance of 2 %; the ratios themselves scatter by 8 %, so
    that an interval half as wide would not do, and one of a whole ratio says nothing.
    """
    table = programme(
        5, {"cubic_stiffness": {"pull_rad_s": 1.5e-3}}, runs=1, noise=3e-4, duration_s=4.0
    )
    told = [summarise(diagnose(waves(table, seed=seed)))["forecast"] for seed in range(DRAWS)]
    before, after = (
        np.sqrt(np.mean([one[key] ** 2 for one in told])) for key in ("before", "after")
    )
    held = [one["low"] <= before / after <= one["high"] for one in told]
    assert sum(held) >= 10, [(one["low"], one["high"]) for one in told]
    assert all(one["high"] - one["low"] < one["ratio"] for one in told)
    assert all(one["held_out"] == "time" and one["low"] > 1 for one in told)
