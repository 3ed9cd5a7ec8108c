"""A cause of the catalogue that an open law outdoes has explained nothing, even where the law is not
so much better that the cause gives way to it."""

import numpy as np
from diagnosis_programme import programme, waves

from hrg_cli import diagnose
from hrg_cli.stages.diagnose import summarise

RATES = (0.05, -0.3, 0.7, -1.1, 1.0, 0.4)
UNEVEN = (0.0, 0.5, -0.4, 0.0, 0.6, 0.3)


def log_of(rate_rad_s, bend):
    """What a log shows of a rate Ω that the gyro answers as Ω′(1 + bend·Ω′²)."""
    logged = np.array(rate_rad_s, float)
    for _ in range(20):
        logged = rate_rad_s / (1 + bend * logged**2)
    return logged


def report_of(bend, effects=None):
    """Runs at one rate each, whose mean temperature follows the rate as far as it turned the table's
    motor warm."""
    table = programme(11, effects, runs=len(RATES), noise=1e-4)
    for k, (run, rate) in enumerate(zip(table["run"], RATES, strict=True)):
        start = 20.0 + 3.0 * rate**2 + UNEVEN[k]
        warm = {"kind": "ramp", "start_degc": start, "stop_degc": start + 0.4}
        run["environment"] = {"temperature": warm, "rate_rad_s": rate}
    taken = [w.replace(rate_rad_s=log_of(w.rate_rad_s, bend)) for w in waves(table)]
    return summarise(diagnose(taken))


def test_a_scale_factor_that_bends_with_rate_is_not_explained_by_temperature():
    """It was "explained" by a scale factor that follows temperature, with K 11 σ off."""
    for bend in (4e-5, 6e-5):
        report = report_of(bend)
        assert [e["name"] for e in report["effects"]] == ["scale_factor_temperature"]
        assert report["verdict"] == "partly explained"
        failed = [check for check in report["checks"] if not check["passed"]]
        assert [check["name"] for check in failed] == ["catalogued_form"]
        assert "turning × (Ω/Ω₀)³" in failed[0]["sentence"]


def test_a_scale_factor_that_follows_temperature_stays_explained():
    report = report_of(0.0, {"scale_factor_temperature": {"relative_1_k": 1.5e-4}})
    assert report["verdict"] == "explained"
    assert [e["name"] for e in report["effects"]] == ["scale_factor_temperature"]
