"""What a person reads after `hrg diagnose` and `hrg calibrate --ladder`: every figure of the JSON
that decides something."""

import json

import numpy as np

from hrg_cli.records import Calibration, Diagnosis
from hrg_cli.reporting import tables

REPORT = {
    "verdict": "partly explained",
    "values": [
        {
            "name": "scale_factor",
            "value": 0.55,
            "std": 1e-5,
            "units": "1",
            "believed": 0.554,
            "sigma": -400.0,
            "wrong": True,
        },
        {
            "name": "damping_rate_1_s",
            "value": 0.3,
            "std": 1e-5,
            "units": "s-1",
            "believed": 0.3,
            "sigma": 0.1,
            "wrong": False,
        },
    ],
    "effects": [
        {
            "name": "thermal_gradient",
            "z": 31.25,
            "parameters": {"frequency_s_k": {"value": 1.25e-6, "std": 4e-8, "units": "s K-1"}},
            "indistinguishable_from": ["thermal_lag"],
            "next_experiment": "ramps of two slopes",
        }
    ],
    "gain": {
        "held_out": "runs",
        "drift_error_deg_h": {"before": 400.0, "before_std": 50.0, "after": 6.0, "after_std": 1.0},
    },
    "baseline": {"chi2_per_dof": 55.0},
    "after": {"chi2_per_dof": 1.5},
    "remainder": {"description": "damping × a step at t = 1.2 s"},
}


def diagnosis_of(report):
    nothing = np.zeros((0, 4))
    return Diagnosis(
        run=np.zeros(0, "i4"), time_s=np.zeros(0), wave_angle_rad=np.zeros(0), main_amplitude=np.zeros(0), measured=nothing,
        simulated_before=nothing, simulated_after=nothing, residual_before=nothing, residual_after=nothing, series="[]",
        run_ids='["1", "2"]', verdict=report["verdict"], report=json.dumps(report),
    )  # fmt: skip


def test_a_diagnosis_shows_wrong_values_causes_gain_remainder_and_the_next_run(capsys):
    tables.show(diagnosis_of(REPORT), REPORT)
    shown = capsys.readouterr().out
    lines = shown.splitlines()
    assert (
        lines[0].startswith("The drift is 400 °/h off")
        and "6 °/h are left" in lines[0]
        and "damping × a step at t = 1.2 s" in lines[0]
    )
    assert lines[1] == "gyro: bench fault; fit: suspect; verdict: partly explained"
    assert any("1.25(4)" in line and "thermal lag" in line for line in lines)
    assert any(line.startswith("scale factor K") and "−400" in line for line in lines)
    assert "next run, to tell thermal gradient or thermal lag: ramps of two slopes" in lines
    assert all(len(line) < 240 for line in lines)


def test_an_adequate_model_claims_no_gain(capsys):
    report = REPORT | {"verdict": "adequate", "effects": [], "values": [], "remainder": None}
    tables.show(diagnosis_of(report), report)
    shown = capsys.readouterr().out
    assert (
        "gyro: sound; fit: valid; verdict: adequate" in shown
        and "no fault was found" in shown
        and "better" not in shown
    )


def test_the_ladder_shows_the_faults_of_loops_and_readout_that_it_could_measure(capsys):
    report = {
        "loops": [
            {
                "name": "quadrature_drive_phase_error",
                "value": 5e-3,
                "std": 5e-5,
                "units": "rad",
                "z": 100.0,
            }
        ],
        "readout_matrix": {
            "gain_mismatch": 2e-3,
            "gain_mismatch_std": 1e-4,
            "electrode_nonorthogonality_rad": 0.0,
            "electrode_nonorthogonality_rad_std": 0.0,
        },
    }
    tables.show(object.__new__(Calibration), report)
    shown = capsys.readouterr().out
    assert "5.00(5) mrad" in shown and "100" in shown and "0.200(10) %" in shown
    assert "electrode nonorthogonality" not in shown
