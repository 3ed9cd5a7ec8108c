"""Diagnosis of free runs whose frequency moves so far that their phases turn by radians about any
straight line: the motion is that of shape and angle, and the cause is found from there."""

import pytest
from diagnosis_programme import programme, verdict, waves

from hrg_cli.stages.diagnosis.base.joint_fit import fit_base

RELATIVE_1_K = 85e-6
"""Of fused silica; at 5 kHz a kelvin is 2.7 rad/s."""


@pytest.mark.parametrize("kelvin", [0.5, 6.0])
def test_a_frequency_that_moves_by_turns_is_one_cause_alone(kelvin):
    """Ramps of so many kelvin in 10 s, by which the phases bend by one radian or by ten."""
    effect = {"relative_1_k": RELATIVE_1_K, "reference_temperature_degc": 22.0}
    table = programme(5, {"thermal_frequency": effect}, runs=3, noise=3e-4, duration_s=10.0)
    for run, part in zip(table["run"], (1.0, -1.0, 0.5), strict=True):
        run["environment"]["temperature"] = {
            "kind": "ramp", "start_degc": 22.0, "stop_degc": 22.0 + part * kelvin
        }  # fmt: skip
    _, out = verdict(table)
    assert out["verdict"] == "explained", out["checks"]
    (cause,) = out["effects"]
    assert cause["name"] == "thermal_frequency"
    # a part per kelvin is one of the runs' own frequency, which the ramps move
    moved = RELATIVE_1_K * kelvin
    assert cause["parameters"]["relative_1_k"]["value"] == pytest.approx(RELATIVE_1_K, rel=moved)


def test_phases_that_are_not_judged_tell_no_frequency():
    """What the rule of long rows leaves of a frequency's column is rounding, along which the fit of
    shape and angle ran off: by 1 Hz here, by 1e8 rad/s in another's recording, whose phases were
    lost in what began from there."""
    table = programme(6, {}, runs=4, noise=1e-4, duration_s=5.0)
    for run, rate in zip(table["run"], (0.5, 1.0, -1.0, 0.5), strict=True):
        del run["environment"]["rate_rad_s"]
        sine = {"kind": "sine", "amplitude_rad_s": rate, "frequency_hz": 0.5}
        run["environment"]["rate"] = sine
    fit = fit_base(waves(table), 2, scale_factor=None, blocks=40, free_phase=True)
    assert fit.converged and fit.chi2 / fit.dof < 1.5
    assert fit.frequency_hz == pytest.approx(table["device"]["frequency_hz"], abs=0.05)
