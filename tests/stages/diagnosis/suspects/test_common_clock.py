"""Rate logs that are late by the same time in every run, as one recorder or one filter makes them."""

import numpy as np
import pytest
from diagnosis_programme import programme
from wrong_runs import COURSES

from hrg_cli import collect, demodulate, diagnose, estimate, simulate
from hrg_cli.stages.diagnose import summarise

RUNS = 4


def make_periods(late_s, effects=None):
    """Demodulated runs whose table swings, each otherwise, and whose logs come late by τ: at t a mean
    over the window of what was at t − τ, A sin 2πf(t − τ) · sinc f·window."""
    table = programme(7, effects, runs=RUNS, duration_s=1.5, rate=COURSES)
    out = []
    for k, run in enumerate(table["run"]):
        swing, hz = 1.0 + 0.3 * k, 0.6 + 0.2 * k
        run["environment"]["rate"] = COURSES | {"amplitude_rad_s": swing, "frequency_hz": hz}
        recording = collect(simulate(table, run=run["run_id"], seed=0))
        periods = collect(demodulate(recording, periods_per_window=40.0))
        seen = swing * np.sinc(hz * periods.window_s)
        late = seen * np.sin(2 * np.pi * hz * (np.asarray(periods.time_s) - late_s))
        out.append(periods.replace(rate_rad_s=late))
    return out


def find_lateness(report):
    """The one suspicion's time in seconds; the report must blame all runs and no physics."""
    (told,) = report["suspect_runs"]
    assert told["run_id"] == "all runs"
    assert report["effects"] == []
    moved = float(told["evidence"].split("moved by ")[1].split()[0])
    assert told["what"] == ("rate log late" if moved < 0 else "rate log early")
    return -moved


@pytest.mark.parametrize("late_s", [0.15, 0.01, 2e-4, -0.004])
def test_a_lateness_of_all_logs_is_named(late_s):
    """By 0.1 to 0.5 s it was "partly explained" by a knock or a step of a gain of 5 to 21 σ."""
    periods = make_periods(late_s)
    report = summarise(diagnose([collect(estimate(p)) for p in periods]))
    found = find_lateness(report)
    assert found == pytest.approx(late_s, rel=0.02, abs=5e-5)
    right = [collect(estimate(p, rate_late_s=found)) for p in periods]
    assert summarise(diagnose(right))["verdict"] == "adequate"


def test_a_lateness_beside_a_real_cause():
    periods = make_periods(0.01, {"gain_mismatch": {"gain": 0.004}})
    found = find_lateness(summarise(diagnose([collect(estimate(p)) for p in periods])))
    assert found == pytest.approx(0.01, rel=0.02)
    right = [collect(estimate(p, rate_late_s=found)) for p in periods]
    report = summarise(diagnose(right))
    assert [one["name"] for one in report["effects"]] == ["gain_mismatch"]
    assert report["verdict"] == "explained"


@pytest.mark.parametrize("effect", [None, {"scale_factor_temperature": {"relative_1_k": 2e-3}}])
def test_logs_in_time_are_not_blamed(effect):
    report = summarise(diagnose([collect(estimate(p)) for p in make_periods(0.0, effect)]))
    assert report["suspect_runs"] == []
    assert [one["name"] for one in report["effects"]] == list(effect or {})
