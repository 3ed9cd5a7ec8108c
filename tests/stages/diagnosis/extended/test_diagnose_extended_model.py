"""The extended model, simulated, gives the measured runs back to the noise: courses of temperature
and rate, loops of forced runs."""

import tomllib

import numpy as np
import pytest
from diagnosis_programme import programme, verdict, waves

from hrg_cli.physics import ellipse
from hrg_cli.stages.diagnose import diagnose, summarise


def envelopes(wave):
    return ellipse.compute_envelopes(
        wave.main_amplitude, wave.quadrature_amplitude, wave.wave_angle_rad, wave.phase_rad
    )


def misfit(table):
    """Of every run, rms over σ of 20 windows' means of measured less simulated (no noise in the
    simulation)."""
    diagnosis, out = verdict(table)
    model = tomllib.loads(diagnosis.extended_model)
    for run in model["run"]:
        run["recording"] |= table["recording"]
        run["readout"] = {"noise": 0.0}
    found = []
    for measured, simulated in zip(waves(table), waves(model), strict=True):
        turn = np.exp(
            2j
            * np.pi
            * (measured.reference_frequency_hz - simulated.reference_frequency_hz)
            * simulated.time_s
        )
        count = min(len(measured), len(simulated)) // 20 * 20
        difference = (
            envelopes(measured)[:count] * turn[:count, None] - envelopes(simulated)[:count]
        ) / measured.signal_std[:count, None]
        found.append(
            float(
                np.sqrt(np.mean(np.abs(difference.reshape(-1, 20, 2).mean(axis=1)) ** 2) / 2 * 20)
            )
        )
    return out, np.array(found)


@pytest.mark.parametrize(
    "effect", (pytest.param("thermal_hysteresis", marks=pytest.mark.slow), "thermal_frequency")
)
def test_a_cycle_of_temperature_is_given_back(effect):
    values = (
        {"relative": 1e-7}
        if effect == "thermal_hysteresis"
        else {"relative_1_k": 3e-7, "reference_temperature_degc": 22.0}
    )
    out, found = misfit(programme(8, {effect: values}, cycle=True, runs=4))
    assert [e["name"] for e in out["effects"]] == [effect]
    assert found.max() < 5  # the turning points are known to a row


@pytest.mark.slow
def test_a_rate_in_steps_is_given_back():
    rate = {"kind": "steps", "levels_rad_s": [1.0, -1.0, 2.0, 0.0], "dwell_s": 0.45}
    _, found = misfit(programme(14, runs=3, rate=rate))
    assert found.max() < 6


def test_the_loops_of_a_forced_run_are_given_back():
    force = {
        "in_phase_c_1_s": 1e-4,
        "in_phase_s_1_s": 0.0,
        "quadrature_c_1_s": 2e-4,
        "quadrature_s_1_s": 1e-4,
    }
    table = programme(15, {"parasitic_force": force}, forced=True, quadrature_loop="finite", runs=4)
    for run in table["run"]:
        if "control" in run:
            run["control"] |= {
                "quadrature_gain_1_s": 9.0,
                "amplitude_gain_1_s": 7.0,
                "amplitude": 1.01 * run["start"]["amplitude"],
            }
    out, found = misfit(table)
    assert [e["name"] for e in out["effects"]] == ["parasitic_force"]
    # a frame that may begin beside the wave, which no file holds, is in what the runs do not tell
    assert found.max() < 8


def test_the_amplitude_loop_of_a_drive_without_a_log_is_given_back():
    """Its command is the one that holds the measured amplitude; carried back to the run's begin, the
    pull to that grew by e¹⁰, and a set amplitude taken for the measured one stood 10 σ off."""
    table = programme(15, forced=True, runs=4)
    for run in table["run"]:
        if "control" in run:
            run["control"]["amplitude"] = 1.002 * run["start"]["amplitude"]
            run["start"]["quadrature"] = 0.05
    found = summarise(
        diagnose([w.replace(drive_main=None, drive_quadrature=None) for w in waves(table)])
    )
    written = found["written_model"]
    assert found["verdict"] == "adequate"
    assert written["rms_over_noise"] < 1.1 * written["fitted_rms_over_noise"]
