"""A run whose thermometer is a little off, or stands still, is named by its own frequency, where that
matters to the tables."""

import numpy as np
import pytest
from forced_runs import Truth, forced_run, programme

from hrg_cli.stages.calibrate import calibrate

PLAN = {"temperatures": (-20, 20, 60), "rates": (0.3, -0.3, 0.15, -0.15), "duration": 30.0}
ODD = 9
"""Number of the run that is wrong: at 60 °C and -0.3 rad/s."""


def make_runs(seed, scatter_hz=2e-3, bend_hz=0.0):
    """Twelve runs; each oscillates a little beside its thermometer, and the frequency's course may
    bend."""
    random = np.random.default_rng(seed)
    out = []
    for wave in programme(Truth(seed), **PLAN, noise=1e-6, seed=seed):
        x = (np.asarray(wave.temperature_degc) - 20) / 40
        beside = scatter_hz * random.normal() + bend_hz * (x**2 + 0.2 * x**3)
        out.append(wave.replace(frequency_hz=wave.frequency_hz + beside))
    return out


def colder(wave):
    return wave.replace(temperature_degc=wave.temperature_degc - 1.5)


def standing(wave):
    """The gyro warms by three degrees, and its log stands."""
    warmer = 3.0 * wave.time_s / wave.time_s[-1]
    true = forced_run(
        Truth(3), lambda t: 60 + t / 10, -0.3, 30.0, 5, noise=1e-6, run_id=wave.run_id
    )
    return wave.replace(
        wave_angle_rad=true.wave_angle_rad, frequency_hz=wave.frequency_hz + 0.4 * warmer
    )


@pytest.mark.parametrize(
    ("change", "what"), [(colder, "thermometer wrong"), (standing, "thermometer does not follow")]
)
def test_a_thermometer_that_is_a_little_off_is_named(change, what):
    """Of the one "a cause is missing" was said, the tables of the other were valid."""
    waves = make_runs(3)
    waves[ODD] = change(waves[ODD])
    record = calibrate(waves, bootstrap=0)
    assert record.status == "suspect"
    assert any(why.startswith(f"{waves[ODD].run_id}: {what} (") for why in record.status_reasons)


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("bend_hz", [0.0, 3.0])
def test_clean_runs_have_no_odd_thermometer(seed, bend_hz):
    record = calibrate(make_runs(seed, bend_hz=bend_hz), bootstrap=0)
    assert record.status == "valid", record.status_reasons


def test_a_thermometer_that_moves_nothing_is_left_in_peace():
    """A hundredth of a degree, thrice as far off as runs that scatter by ten times less allow."""
    waves = make_runs(3, scatter_hz=1e-4)
    waves[ODD] = waves[ODD].replace(temperature_degc=waves[ODD].temperature_degc - 0.01)
    assert calibrate(waves, bootstrap=0).status == "valid"


def test_a_run_alone_at_its_temperature_is_told_by_its_frequency():
    """Logged ten degrees too warm it was a programme without a second rate there."""
    waves = make_runs(4)
    waves[5] = waves[5].replace(temperature_degc=waves[5].temperature_degc + 10)
    record = calibrate(waves, bootstrap=0)
    assert record.status == "refused"
    said = record.status_reasons[0]
    assert said.startswith(f"{waves[5].run_id}: thermometer wrong (it is logged at 30 °C")
    assert "as the others do at 20 °C" in said


def test_a_lone_temperature_of_a_frequency_that_bends_is_not_blamed():
    """Between three dwells a course of the third order stands beside the parabola through them."""
    waves = make_runs(4, bend_hz=3.0)
    for rate in (0.3, -0.3):
        wave = forced_run(Truth(4), 40, rate, 30.0, 77, noise=1e-6, run_id=f"lone {rate:g}")
        waves.append(wave.replace(frequency_hz=wave.frequency_hz + 3.0 * (0.25 + 0.2 / 8)))
    assert not any("thermometer" in why for why in calibrate(waves, bootstrap=0).status_reasons)
