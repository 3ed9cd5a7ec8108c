"""Tables of resonator files are rehearsed with the resonator files: every one is identified again,
and the tables made of them held against the first ones."""

import numpy as np
import pytest

from hrg_cli import settings
from hrg_cli.errors import HrgError
from hrg_cli.records import collect
from hrg_cli.stages.calibrate import calibrate
from hrg_cli.stages.calibration import resonators
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.estimate import estimate
from hrg_cli.stages.identify import identify
from hrg_cli.stages.rehearse import rehearse
from hrg_cli.stages.rehearsing.repeat import make_wave
from hrg_cli.stages.rehearsing.twin import make_twin
from hrg_cli.stages.rehearsing.twin_physical import Identified
from hrg_cli.stages.rehearsing.twin_run import Measured
from hrg_cli.stages.simulate import simulate

RATE_HZ = 2000.0
WINDOWS = {"periods_per_window": 5.0}
TEMPERATURES = (10.0, 40.0)
DEVICE = {
    "frequency_hz": 500.0, "time_constant_s": 2.0, "damping_split": 0.02, "damping_axis_rad": 0.35, "frequency_split_hz": 0.01,
    "stiffness_axis_rad": 0.9, "scale_factor": 0.554,
}  # fmt: skip
CONTROL = {
    "mode": "forced",
    "amplitude": 1.0,
    "quadrature_loop": "finite",
    "quadrature_gain_1_s": 20.0,
}
FREE = {"a": (4.0, 0.1), "b": (-4.0, 0.6)}
FORCED = {"up": (3.0, 0.3), "down": (-3.0, 0.3)}
BETWEEN = 25.0
ASKED = {"model": "physical", "bootstrap": 0, "ladder": False}


def config_of(temperature, control=None):
    """Two free runs of one temperature, or two forced ones."""
    runs = [
        {
            "run_id": f"{name}{temperature:g}",
            "environment": {"rate_rad_s": rate, "temperature_degc": temperature},
            "start": {"wave_angle_rad": angle},
        }
        for name, (rate, angle) in (FORCED if control else FREE).items()
    ]
    config = {
        "device": DEVICE,
        "readout": {"noise": 3e-4},
        "recording": {"sample_rate_hz": RATE_HZ, "duration_s": 2.0},
        "run": runs,
    }
    return config | ({"control": control} if control else {})


def measured(config, seed):
    return [
        Measured(
            collect(
                estimate(
                    collect(
                        demodulate(
                            collect(simulate(config, run=run["run_id"], seed=seed)), **WINDOWS
                        )
                    )
                )
            ),
            RATE_HZ,
            None,
            dict(WINDOWS),
        )
        for run in config["run"]
    ]


@pytest.fixture(scope="module")
def programme():
    """(forced inputs, resonator files with their inputs, tables): resonators at two temperatures,
    tables between them."""
    identified = []
    for number, temperature in enumerate(TEMPERATURES):
        free = measured(config_of(temperature), 10 + number)
        resonator = identify([m.wave for m in free])
        assert resonator.status == "valid", resonator.status_reasons
        identified.append(Identified(resonator, free, settings.check_settings(identify, {})))
    forced = measured(config_of(BETWEEN, CONTROL), 3)
    tables = calibrate([m.wave for m in forced], [i.resonator for i in identified], **ASKED)
    assert tables.model == "physical"
    return forced, identified, tables


def test_right_tables_of_resonator_files_stay_as_they_are(programme):
    forced, identified, tables = programme
    assert len(tables.status_reasons) == 1 and "one node" in tables.status_reasons[0]
    told = rehearse(
        tables, forced, settings.check_settings(calibrate, ASKED), None, identified, times=3
    )
    assert told.status == "valid" and told.failed == 0, told.reasons
    names = {f.name for f in told.figures}
    assert names == {
        f"{what} at {BETWEEN:g} °C"
        for what in ("drift cos 1·2mθ", "drift sin 1·2mθ", "scale_factor constant")
    }
    assert 0.5 < np.sqrt(np.mean([f.error_over_std_rms**2 for f in told.figures])) < 1.6


def test_tables_that_trust_their_resonator_files_too_much_become_suspect(programme, monkeypatch):
    """Coefficients taken with a fifth of their standard deviations: identified again they scatter
    by five."""
    true = resonators.compute_coefficients
    monkeypatch.setattr(resonators, "compute_coefficients", lambda r: (true(r)[0], true(r)[1] / 25))
    forced, identified, _ = programme
    bold = calibrate([m.wave for m in forced], [i.resonator for i in identified], **ASKED)
    told = rehearse(
        bold, forced, settings.check_settings(calibrate, ASKED), None, identified, times=3
    )
    assert told.status == "suspect", told.figures


def test_the_twin_drifts_as_the_resonators_say(programme):
    """Forced runs of the twin show the drift of the same device: their tables, fitted to them
    alone, are those of the resonator files."""
    forced, identified, tables = programme
    twin = make_twin(tables, forced, settings.check_settings(calibrate, ASKED), None, identified)
    waves = [make_wave(twin, number, 5) for number in range(len(forced))]
    alone = calibrate(waves, model="parametric", bootstrap=0)
    for k in (1, 2):
        error = alone.drift_harmonics[:, k] - tables.drift_harmonics[:, k]
        std = np.hypot(alone.drift_harmonics_std[:, k], tables.drift_harmonics_std[:, k])
        assert np.all(np.abs(error) < 4 * std), (error, std)


def test_without_its_resonator_files_it_is_refused_with_a_sentence(programme):
    forced, _, tables = programme
    with pytest.raises(HrgError, match="name the resonator files"):
        rehearse(tables, forced, settings.check_settings(calibrate, ASKED), times=2)
