"""What slows a turning motion acts on its velocity, whose envelopes stand beside those of the
displacement by KΩ/ω: held against raw samples of driven gyros."""

from dataclasses import replace

import numpy as np
import pytest

from hrg_cli import collect, demodulate, estimate, simulate
from hrg_cli.effects import find
from hrg_cli.fitting.causes import extended_fit, fit_point
from hrg_cli.fitting.envelopes import coordinates
from hrg_cli.physics.resonator import Mechanics
from hrg_cli.stages.diagnosis.base.base_priors import choose_freedom
from hrg_cli.stages.diagnosis.base.data import prepare
from hrg_cli.stages.diagnosis.base.joint_fit import fit_base
from hrg_cli.stages.diagnosis.fits.open_terms import list_covariates

GYRO = {
    "device": {
        "frequency_hz": 2003.7,
        "damping_rate_1_s": 0.25,
        "frequency_split_hz": 0.03,
        "stiffness_axis_rad": 0.2,
        "scale_factor": 0.55,
    },
    "control": {
        "mode": "forced",
        "quadrature_loop": "finite",
        "quadrature_gain_1_s": 10.0,
    },
    "readout": {"noise": 1e-5},
    # many samples a period, none twice at the same phase: the loops' kicks come close to a steady force
    "recording": {"sample_rate_hz": 40000.0, "duration_s": 4.0},
}
REFERENCE_DEGC = 20.0
CASES = {
    "thermal_damping": (
        {"relative_1_k": 0.01, "reference_temperature_degc": REFERENCE_DEGC},
        (0, 40),
    ),
    "damping_drift": ({"slope_1_s2": 0.01}, (20, 20)),
    "nonlinear_damping": ({"damping_1_s": 0.05}, (20, 20)),
    "dry_friction": ({"slope_1_s": 0.05}, (20, 20)),
}


def driven_waves(effect, values, temperatures):
    """Runs of both signs of the rate at each temperature."""
    runs = [(rate, warm) for rate in (4.0, -4.0) for warm in temperatures]
    waves = []
    for k, (rate, warm) in enumerate(runs):
        world = {"rate_rad_s": rate, "temperature_degc": float(warm)}
        run = GYRO | {"environment": world, "effects": {effect: values}}
        samples = collect(simulate(run, seed=k))
        wave = collect(estimate(collect(demodulate(samples, periods_per_window=8))))
        waves.append(wave.replace(run_id=f"r{k}"))
    return waves


def misfit_of(waves, effect, values):
    """χ² per degree of freedom of the resonator with this effect, from the true values, its rows
    averaged along its own motion."""
    device = GYRO["device"]
    truth = Mechanics(
        device["frequency_hz"],
        device["damping_rate_1_s"],
        0.0,
        0.0,
        np.pi * device["frequency_split_hz"],
        device["stiffness_axis_rad"],
        device["scale_factor"],
    )
    series, guess, _ = prepare(waves, None, 120)
    known = replace(guess, p=coordinates.from_mechanics(truth))
    series, start, _ = prepare(waves, None, 120, along=known)
    freedom = choose_freedom(series, start, None)
    # of a real resonator: its second order is not the fit's to choose
    mean, std = np.append(freedom.mean[:6], 1.0), np.append(freedom.std[:6], 0.0)
    point = fit_point.add_effect(start, effect, effect.values(values))
    fit = extended_fit.fit(series, point, replace(freedom, mean=mean, std=std))
    return fit.chi2 / fit.dof


@pytest.mark.parametrize("name", CASES)
def test_a_damping_that_changes_makes_the_quadrature_of_a_turning_wave(name):
    """χ² is 1 within five of its standard deviations; with a force along the displacement's
    envelopes it is tens to thousands. Friction's kink at every turn of the motion falls between
    samples, so that the simulation itself is not exact to the noise."""
    values, temperatures = CASES[name]
    waves = driven_waves(name, values, temperatures)
    effect = find(name)
    beside = misfit_of(waves, replace(effect, acts_on="displacement"), values)
    along = misfit_of(waves, effect, values)
    assert beside > 10
    if name == "dry_friction":
        assert along < beside / 100
    else:
        assert along == pytest.approx(1, abs=0.15)


def test_a_temperature_that_only_rounding_moves_has_no_rate():
    waves = driven_waves("thermal_damping", *CASES["thermal_damping"])
    dusty = [
        w.replace(temperature_degc=w.temperature_degc + 1e-14 * np.arange(len(w))) for w in waves
    ]
    fit = fit_base(dusty, scale_factor=None, blocks=120, free_phase=False)
    formulas = {c.formula for c in list_covariates(fit.series, fit.prediction.motion)}
    assert "(T − T₀)/ΔT" in formulas and "Ṫ/Ṫ₀" not in formulas
