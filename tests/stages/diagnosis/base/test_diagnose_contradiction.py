"""A log whose rate contradicts the motion is a fault of the log, named by run; a great effect is
none."""

import numpy as np
import pytest
from diagnosis_programme import programme, waves

from hrg_cli.errors import HrgError
from hrg_cli.stages.diagnose import diagnose, summarise
from hrg_cli.stages.identify import identify


def turned(runs, k):
    return [w.replace(rate_rad_s=-w.rate_rad_s) if i == k else w for i, w in enumerate(runs)]


def refused(runs):
    diagnosis = diagnose(runs)
    out = summarise(diagnosis)
    assert diagnosis.status == "refused" and out["effects"] == []
    return {one["run_id"]: one for one in out["suspect_runs"]}


def test_a_rate_of_the_wrong_sign_is_named_by_its_run():
    found = refused(turned(waves(programme(5, runs=4)), 2))
    assert list(found) == ["run2"] and found["run2"]["what"] == "rate log of wrong sign"


def test_rotation_without_a_log_is_told_from_a_cause():
    found = refused([w.replace(rate_rad_s=None) for w in waves(programme(6))])
    assert {name: one["what"] for name, one in found.items()} == {
        "run2": "rate log missing",
        "run3": "rate log missing",
    }
    rates = [
        float(found[name]["evidence"].split("turns as at ")[1].split()[0])
        for name in ("run2", "run3")
    ]
    assert np.allclose(rates, [2.0, -2.0], rtol=0.2)


def test_an_effect_of_many_thousand_sigma_is_a_cause_and_no_contradiction():
    out = summarise(diagnose(waves(programme(7, {"gain_mismatch": {"gain": 0.05}}))))
    assert out["baseline"]["chi2_per_dof"] > 1e3
    assert out["effects"][0]["name"] == "gain_mismatch"


def test_runs_of_two_gyros_are_refused_by_their_names_and_without_names_by_their_frequencies():
    one, other = (waves(programme(seed, runs=2)) for seed in (8, 9))
    named = [w.replace(gyro_id=gyro) for gyro, runs in (("A-1", one), ("B-2", other)) for w in runs]
    for stage in (diagnose, identify):
        with pytest.raises(
            HrgError, match=r"2 gyros were given \(A-1: run0, run1; B-2: run0, run1\)"
        ):
            stage(named)
    apart = [
        w.replace(gyro_id="", run_id=f"{k}{w.run_id}")
        for k, runs in enumerate((one, other))
        for w in runs
    ]
    with pytest.raises(HrgError, match=r"not of one gyro: (0run0, 0run1|1run0, 1run1) at"):
        diagnose(apart)
