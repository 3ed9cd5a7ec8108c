"""A search for causes that leads nowhere ends after stated work, names nothing and says so; sound
runs come nowhere near that."""

import json

import numpy as np
import pytest
from synthetic_waves import run_down

from hrg_cli.effects import EFFECTS
from hrg_cli.fitting.causes import motion_budget
from hrg_cli.stages import diagnose as stage
from hrg_cli.stages.diagnose import diagnose

SEARCHED = sum(effect.seen_in == "dynamics" for effect in EFFECTS)


def runs(jumps=0, seed=1):
    """Two free runs; the angle of the first jumps at random rows by random angles."""
    found = [
        run_down(theta, rate, seconds=1.0, window=5e-3, seed=n, gyro_id="G")
        for n, (theta, rate) in enumerate(((0.1, 0.0), (0.6, 2.0)))
    ]
    rng, angle = np.random.default_rng(seed), np.array(found[0].wave_angle_rad)
    for _ in range(jumps):
        angle[int(rng.integers(len(angle))) :] += rng.normal()
    return [found[0].replace(wave_angle_rad=angle), found[1]]


def test_a_search_that_was_stopped_names_nothing(monkeypatch):
    monkeypatch.setattr(stage, "MOTIONS_EACH", 5)
    found = diagnose(runs(jumps=3))
    told = json.loads(found.report)
    assert found.status == "suspect" and told["verdict"] == "unexplained" and not told["effects"]
    [check] = told["checks"]
    assert check["name"] == "search_finished" and not check["passed"]
    assert f"stopped after {5 * SEARCHED} fitted motions" in found.status_reasons[0]


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_wave_that_jumps_ends_within_its_bound(seed):
    motions = stage.MOTIONS_EACH * SEARCHED
    with motion_budget.limit_motions(10 * motions):
        found = diagnose(runs(jumps=3, seed=seed))
    assert json.loads(found.report)["verdict"] in ("unexplained", "partly explained")


def test_sound_runs_stay_far_below(monkeypatch):
    """At a hundredth of the work they are still diagnosed to the end."""
    monkeypatch.setattr(stage, "MOTIONS_EACH", stage.MOTIONS_EACH / 100)
    found = diagnose(runs())
    assert "search_finished" not in {c["name"] for c in json.loads(found.report)["checks"]}


def test_the_limit_counts_the_motions_of_all_fits(monkeypatch):
    """Not those outside, and the inner limit is its own."""
    spent = motion_budget.spend_motion
    with motion_budget.limit_motions(3):
        for _ in range(3):
            spent()
        with motion_budget.limit_motions(1):
            spent()
        with pytest.raises(motion_budget.WorkSpentError, match="after 3 fitted motions"):
            spent()
    spent()
