"""The forecast of runs whose rate steps: what a step may do to a run, which the fit leaves open, is left
open where a part of the runs teaches and where the others are predicted."""

import numpy as np
import pytest
from diagnosis_programme import programme

from hrg_cli import collect, demodulate, diagnose, estimate, simulate
from hrg_cli.fitting.causes.designs import Basis, orthonormalise
from hrg_cli.stages.diagnose import summarise

TRUE = {
    "nonlinear_damping": {"damping_1_s": 0.01},
    "phase_mismatch": {"phase_rad": 1e-4},
}
RATES = (0.5, -0.7, 1.0, -0.4)


def make_waves():
    """Four runs of which each turns over once, between two rows of a log that writes 100 a second."""
    table = programme(5, TRUE, runs=len(RATES), noise=1e-4, duration_s=4.0)
    out = []
    for rate, run in zip(RATES, table["run"], strict=True):
        steps = {
            "kind": "steps",
            "levels_rad_s": [rate, -rate],
            "dwell_s": 2.0,
            "transition_s": 1e-3,
        }
        run["environment"] = {"rate": steps}
        recording = collect(simulate(table, run=run["run_id"], seed=0))
        at_s = np.arange(0.007, 4.0, 0.01)
        logged = np.interp(at_s, recording.auxiliary_time_s, recording.rate_rad_s)
        recording = recording.replace(
            auxiliary_time_s=at_s, rate_rad_s=logged, temperature_degc=None
        )
        out.append(collect(estimate(collect(demodulate(recording, periods_per_window=40.0)))))
    return out


def test_a_second_cause_of_runs_whose_rate_steps_is_kept():
    """Both are predicted by half of the runs for the other half, steps and all."""
    report = summarise(diagnose(make_waves()))
    assert [one["name"] for one in report["effects"]] == list(TRUE)
    for one in report["effects"]:
        ((name, size),) = one["parameters"].items()
        assert size["value"] == pytest.approx(TRUE[one["name"]][name], abs=4 * size["std"])
    assert report["verdict"] == "explained", report["checks"]


def test_what_lives_on_some_rows_is_cut_with_them():
    random = np.random.default_rng(0)
    first, second = (orthonormalise(random.standard_normal((12, 2))) for _ in range(2))
    whole = Basis(((slice(4, 16), first), (slice(20, 32), second)), np.zeros((36, 0)))
    kept = np.ones(36, bool)
    kept[:10] = kept[32:] = False
    S = random.standard_normal((36, 3))
    cut = whole.select_rows(kept)
    left = cut.project_out(S[kept])
    # 6 rows of the first part are left, all of the second
    assert np.allclose(left[:6], S[10:16] - first[6:] @ np.linalg.lstsq(first[6:], S[10:16])[0])
    assert np.allclose(left[10:22], whole.project_out(S)[20:32])
    assert np.allclose(left[6:10], S[16:20])


def test_rounding_of_a_part_that_is_cut_away_is_no_direction():
    """A step's own rows begin where it does; those before it hold 1e-17 of it."""
    random = np.random.default_rng(0)
    part = np.concatenate([1e-17 * random.standard_normal((8, 2)), random.standard_normal((8, 2))])
    whole = Basis(((slice(0, 16), orthonormalise(part)),), np.zeros((16, 0)))
    assert whole.select_rows(np.arange(16) < 8).shape == (8, 0)
    assert whole.select_rows(np.arange(16) >= 8).shape == (8, 2)
