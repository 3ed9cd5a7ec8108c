"""A temperature that swings is followed as it bends: what it does has the right size, and nothing
else is blamed; a noisy thermometer's course is told from its noise."""

import numpy as np
import pytest
from diagnosis_programme import programme, waves

from hrg_cli.stages.diagnose import diagnose, summarise
from hrg_cli.stages.diagnosis.base.data import _smoothed

AT = {"reference_temperature_degc": 22.5}


def swung(name, size, seed, thermometer_k=0.0):
    """A diagnosis of one cause in runs whose temperature swings by 0.5 K, twice a run at most; what
    it found of the cause."""
    rng = np.random.default_rng(seed)
    recorded = waves(programme(seed, {name: size | AT}, runs=4, noise=3e-5, cycle=True))
    logged = [
        w.replace(temperature_degc=w.temperature_degc + thermometer_k * rng.standard_normal(len(w)))
        for w in recorded
    ]
    out = summarise(diagnose(logged))
    assert [effect["name"] for effect in out["effects"]] == [name], out["remainder"]
    assert out["verdict"] == "explained"
    return out["effects"][0]["parameters"]


@pytest.mark.parametrize(
    ("name", "size"),
    [
        ("thermal_damping", {"relative_1_k": 5e-3}),
        ("thermal_frequency", {"relative_1_k": 3e-7}),
        ("split_temperature", {"cos_rad_s_k": 4e-3, "sin_rad_s_k": -7e-3}),
    ],
)
def test_what_a_swinging_temperature_does_has_its_size_and_nothing_beside(name, size):
    """Its bends were taken for a thermometer's noise and laid straight between means: 5 to 15 σ, a
    pressure or a knock beside."""
    found = swung(name, size, seed=61)
    for key, true in size.items():
        assert abs(found[key]["value"] - true) < 4 * found[key]["std"], (key, found[key])


def test_a_noisy_thermometer_bends_no_size():
    """4 mK a window beside a swing of 0.5 K."""
    found = swung("thermal_frequency", {"relative_1_k": 3e-7}, seed=62, thermometer_k=0.004)
    assert abs(found["relative_1_k"]["value"] - 3e-7) < 4 * found["relative_1_k"]["std"]


def test_bends_stay_and_noise_goes():
    """White noise of a sine's course falls to that of some twenty numbers; a course without noise
    is as it was."""
    t = np.linspace(0, 10, 400)
    course = 20 + 1.5 * np.sin(1.3 * t)
    assert np.array_equal(_smoothed(t, course), course)
    noise = 0.02 * np.random.default_rng(1).standard_normal(400)
    left = np.std(_smoothed(t, course + noise) - course)
    assert left < 0.02 * np.sqrt(40 / 400), left


@pytest.mark.parametrize("scale", [1e-6, 1e6])
@pytest.mark.parametrize("periods", [1, 5, 20])
@pytest.mark.parametrize("rows", [120, 1500])
def test_a_log_is_never_made_worse_whatever_its_unit_of_time(rows, periods, scale):
    """Twenty swings within 120 rows are more than rows can tell of: left as they are."""
    t = np.linspace(0, 1, rows)
    course = 20 + np.sin(2 * np.pi * periods * t + 1)
    logged = course + 0.02 * np.random.default_rng(1).standard_normal(rows)
    smooth = _smoothed(scale * t, logged)
    assert np.std(smooth - course) < 1.05 * np.std(logged - course)
    assert np.allclose(smooth, _smoothed(t, logged), rtol=0, atol=1e-9)


def test_a_corner_beside_noise_stays_one():
    """Ramps between dwells, in noise of 20 mK: nowhere off by more than a tenth of the step."""
    t = np.linspace(0, 10, 120)
    course = 20 + 2 * (np.clip(t - 3, 0, 1) - np.clip(t - 6, 0, 0.5))
    logged = course + 0.02 * np.random.default_rng(2).standard_normal(120)
    assert np.max(np.abs(_smoothed(t, logged) - course)) < 0.2
