"""The rate of driven runs from the reference model: simulated gyros with loops, errors counted in
their own standard deviations."""

import numpy as np
import pytest

from hrg_cli.errors import HrgError
from hrg_cli.records import Resonator, collect
from hrg_cli.stages.calibrate import calibrate
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.estimate import estimate
from hrg_cli.stages.rate import rate, summarise
from hrg_cli.stages.simulate import simulate

DEVICE = dict(
    frequency_hz=1000.0, damping_rate_1_s=0.3, damping_split_1_s=0.03, damping_axis_rad=0.35,
    frequency_split_rad_s=0.25, stiffness_axis_rad=0.9, scale_factor=0.55,
)  # fmt: skip
NAMES = [name for name in DEVICE]


def resonator(relative=0.0, seed=0, **change):
    value = np.array([{**DEVICE, **change}[n] for n in NAMES])
    std = np.abs(value) * relative
    value = value + std * np.random.default_rng(seed).normal(size=len(value))
    return Resonator(
        name=np.array(NAMES), value=value, std=std, units=np.array(["Hz", "s-1", "s-1", "rad", "rad s-1", "rad", "1"]),
        covariance=np.diag(std**2),
    )  # fmt: skip


def wave_of(control, seed=1, seconds=20.0, noise=3e-4, **more):
    loops = {} if control.get("mode") == "free" else dict(mode="forced", amplitude_gain_1_s=5.0)
    config = dict(
        device=DEVICE, readout=dict(noise=noise), control=loops | control,
        environment=dict(rate_rad_s=0.2, rate=dict(kind="sine", amplitude_rad_s=0.1, frequency_hz=0.08)),
        recording=dict(sample_rate_hz=8000.0, duration_s=seconds),
    ) | more  # fmt: skip
    periods = collect(demodulate(collect(simulate(config, seed=seed)), periods_per_window=10))
    return collect(estimate(periods))


@pytest.mark.parametrize("mode", ["free", "forced"])
def test_a_resonator_of_another_temperature_is_doubted(mode):
    """K has grown by 1e-3 on the way from 25 to 40 °C: 107 σ of the rate, "valid"; of a free run,
    "another resonator, or a rate that changes faster than 20 nodes follow"."""
    warm = DEVICE | dict(scale_factor=DEVICE["scale_factor"] * (1 + 1e-3))
    there = dict(rate_rad_s=0.2, temperature_degc=40.0)
    wave = wave_of(dict(mode=mode), seconds=10.0, device=warm, environment=there)
    now, then = (resonator().replace(temperature_degc=T) for T in (40.0, 25.0))
    found = rate(wave, then)
    assert found.status != "valid"
    assert (
        "at 40 °C, the resonator was identified at 25 °C"
        in found.status_reasons[0] + (found.status_reasons[-1])
    )
    same = rate(wave.replace(temperature_degc=wave.temperature_degc - 13.0), then)
    assert not any("was identified at" in one for one in same.status_reasons)
    unknown = rate(wave, now.replace(temperature_degc=None))
    assert not any("was identified at" in one for one in unknown.status_reasons)


def truth(time):
    return 0.2 + 0.1 * np.sin(2 * np.pi * 0.08 * time)


@pytest.mark.parametrize(
    "control",
    [
        dict(quadrature_loop="finite", quadrature_gain_1_s=5.0),
        dict(quadrature_loop="off"),
        dict(quadrature_loop="off", drive="parametric"),
        dict(quadrature_loop="spring", quadrature_gain_1_s=5.0),
    ],
    ids=["force", "open", "one electrode", "spring"],
)
def test_rate_of_a_driven_run(control):
    """A spring of σ turns the wave in second order, by about σ²/4ω, which shows beside so little
    noise."""
    wave = wave_of(control)
    found = rate(wave, resonator())
    assert found.status == "valid", found.status_reasons
    error = np.asarray(found.rate_estimate_rad_s) - truth(np.asarray(found.time_s))
    z = error / found.rate_estimate_rad_s_std
    assert np.sqrt(np.mean(z**2)) < (
        2.6 if control["quadrature_loop"] == "spring" else 1.7
    )  # 20 nodes and more: chance 1e-4
    assert np.sqrt(np.mean(error**2)) < 0.2 * np.sqrt(
        np.mean((np.asarray(found.residual_before_rad_s)) ** 2)
    )


def test_phase_error_of_the_quadrature_force_is_taken_out():
    """f_B = (a_ΦB/a_A)Δφ_B from the logged command, or from the first two of (7) where none is
    logged."""
    wave = wave_of(
        dict(quadrature_loop="finite", quadrature_gain_1_s=5.0, quadrature_phase_error_rad=0.05)
    )
    off = rate(wave, resonator())
    assert any("each milliradian" in reason for reason in off.status_reasons)
    for known in (wave, wave.replace(drive_main=None, drive_quadrature=None)):
        on = rate(known, resonator(), quadrature_phase_error_rad=0.05)
        assert not any("milliradian" in reason for reason in on.status_reasons)
        before, after = (
            np.sqrt(np.mean((np.asarray(f.rate_estimate_rad_s) - truth(np.asarray(f.time_s))) ** 2))
            for f in (off, on)
        )
        assert after < 0.2 * before


def test_deviations_hold_the_resonators_own():
    """Resonators drawn from their covariance: error over σ stays that of a normal variable."""
    wave = wave_of(dict(quadrature_loop="finite", quadrature_gain_1_s=5.0), noise=1e-4)
    z = []
    for seed in range(12):
        found = rate(wave, resonator(0.01, seed))
        z.append(
            (np.asarray(found.rate_estimate_rad_s) - truth(np.asarray(found.time_s)))
            / found.rate_estimate_rad_s_std
        )
    assert 0.4 < np.sqrt(np.mean(np.square(z))) < 1.7


def test_refusals():
    wave = wave_of(dict(quadrature_loop="off"), seconds=2.0)
    with pytest.raises(HrgError, match="no scale_factor"):
        rate(wave, resonator(scale_factor=0.0))
    with pytest.raises(HrgError, match="ask for fewer"):
        rate(wave, resonator(), nodes=100)
    with pytest.raises(HrgError, match="no force acts"):
        rate(wave.replace(mode="free"), resonator(), main_phase_error_rad=0.1)


def test_the_tables_rate_stands_beside_the_models():
    """Neither way knows the other's coefficients: tables of the true gyro agree with the true
    resonator, and a resonator whose K is 1e-3 too large stands 1e-3 of the rate below them. Its
    split is small, so that the drift's second order, which follows the rate, is in no table."""
    split = dict(frequency_split_rad_s=0.02)
    control = dict(quadrature_loop="finite", quadrature_gain_1_s=5.0)
    turning = [
        wave_of(control, seed=seed, device=DEVICE | split, environment=dict(rate_rad_s=rate_rad_s))
        for seed, rate_rad_s in ((11, 2.0), (12, -2.0))
    ]
    tables = calibrate(turning, harmonics=2, scale_factor_harmonics=0, model="table")
    wave = wave_of(control, seed=13, device=DEVICE | split)

    right = rate(wave, resonator(**split), tables)
    stiff = rate(wave, resonator(**split, scale_factor=0.55 * (1 + 1e-3)), tables)

    agree, apart = (summarise(found)["tables"] for found in (right, stiff))
    assert abs(agree["difference_mean_rad_s"]) < 2e-5  # the angle's noise over the run's 20 s
    shift = apart["difference_mean_rad_s"] - agree["difference_mean_rad_s"]
    assert shift == pytest.approx(1e-3 * right.rate_estimate_rad_s.mean(), abs=1e-5)
    assert np.abs(right.table_rate_rad_s - truth(right.time_s)).max() < 0.01
    assert rate(wave, resonator(**split)).table_rate_rad_s is None

    # a note on the run is no doubt about its rate: beside tables it was
    trusted = tables.replace(status="valid", status_reasons=())
    noted = wave.replace(status_reasons=("the residual is not white",))
    beside = rate(noted, resonator(**split), trusted)
    assert beside.status == rate(noted, resonator(**split)).status == "valid"
    assert any("not white" in reason for reason in beside.status_reasons)


@pytest.mark.parametrize("mode", ["free", "forced"])
def test_the_mean_of_a_rate_that_changes_is_over_time(mode):
    """A plain mean over the nodes, of which the first and the last stand for half as long as the others,
    was 200 to 350 σ off where the rate swings."""
    swing = dict(kind="sine", amplitude_rad_s=0.1, frequency_hz=0.08)
    wave = wave_of(dict(mode=mode), seconds=10.0, environment=dict(rate_rad_s=0.2, rate=swing))
    found = rate(wave, resonator())
    figures = summarise(found)
    time_s = np.asarray(found.time_s)
    begin, end = time_s[0], time_s[-1]
    # of 0.2 + 0.1 sin 2πft
    angular = 2 * np.pi * 0.08
    turned = 0.2 * (end - begin) + 0.1 * (np.cos(angular * begin) - np.cos(angular * end)) / angular
    mean = figures["mean_rate_rad_s"]
    assert abs(mean["value"] - turned / (end - begin)) < 4 * mean["std"]
    assert mean["std"] < 0.1 * abs(np.mean(found.rate_estimate_rad_s) - turned / (end - begin))
