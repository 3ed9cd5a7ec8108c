"""A rate log that runs late or early against the samples is named with its time, and taken off."""

import json

import numpy as np
import pytest
from forced_runs import Truth, forced_run

from hrg_cli.stages.calibrate import calibrate, summarise

RATES = (-0.6, -0.35, 0.3, 0.65)


def programme(late_s=0.0, swing=0.5, draw=0):
    """Runs on a swinging table whose log holds Ω(t − late_s), and the truth."""
    truth = Truth(4, curved=False)
    waves = []
    for seed, mean in enumerate(RATES):
        course = lambda t, mean=mean, seed=seed: mean * (1 + swing * np.sin(1.9 * t + seed))  # noqa: E731
        wave = forced_run(truth, 20.0, course, 30, 10 * draw + seed, run_id=f"r{seed}")
        waves.append(wave.replace(rate_rad_s=course(wave.time_s - late_s)))
    return truth, waves


def tables_of(waves):
    """The tables, and what is said of them beside the one temperature."""
    tables = calibrate(waves, harmonics=2, scale_factor_harmonics=2, model="table", bootstrap=0)
    return tables, [reason for reason in tables.status_reasons if "near 20 °C" not in reason]


@pytest.mark.parametrize("late_s", [0.004, 0.03, 0.4, -0.02])
def test_a_late_log_is_named_and_taken_off(late_s):
    truth, waves = programme(late_s)
    tables, (said,) = tables_of(waves)
    found = summarise(tables)["rate_log"]
    assert found["late_s"] == pytest.approx(late_s, abs=4.5 * found["std_s"])
    assert found["std_s"] < 5e-4 and found["taken_off_s"] != 0
    assert tables.status == "suspect"
    way = "late" if late_s > 0 else "early"
    assert said.startswith("the rate logs are") and f"ms {way} against the samples" in said
    missed = tables.drift_rad_s[0] - truth.drift(20.0, np.asarray(tables.wave_angle_rad))
    assert np.sqrt(np.mean(missed**2)) < 3 * np.mean(tables.drift_rad_s_std)


def test_a_log_that_is_right_is_not_called_late():
    """Its lateness is stated with an error that holds it: over 12 draws, error over σ."""
    z = []
    for draw in range(12):
        tables, said = tables_of(programme(draw=draw)[1])
        found = json.loads(tables.details)["rate_log"]
        assert found["taken_off_s"] == 0 and not said
        z.append(found["late_s"] / found["std_s"])
    assert 0.55 < np.sqrt(np.mean(np.square(z))) < 1.5


def test_steady_rates_tell_nothing_of_the_logs_time():
    _, waves = programme(late_s=0.05, swing=0.0)
    tables, said = tables_of(waves)
    assert "rate_log" not in summarise(tables) and not said
