"""Units, orders and directions are no physics: the same runs told otherwise get the same causes of
the same size."""

from dataclasses import replace

import numpy as np
import pytest
from diagnosis_programme import programme, waves

from hrg_cli.stages.diagnose import diagnose, summarise

PULL = 0.02
IN_TIME = ("time_s",)
RATES = ("rate_rad_s", "drive_main", "drive_quadrature", "frequency_hz", "reference_frequency_hz")
SIZES = (
    "main_amplitude",
    "quadrature_amplitude",
    "main_amplitude_std",
    "quadrature_amplitude_std",
    "signal_std",
    "residual_rms",
)


@pytest.fixture(scope="module")
def runs():
    table = programme(3, {"cubic_stiffness": {"pull_rad_s": PULL}}, runs=4, duration_s=1.0)
    return [
        w.replace(spectrum_frequency_hz=None, spectrum_line_frequency_hz=None) for w in waves(table)
    ]


@pytest.fixture(scope="module")
def found(runs):
    return named(runs)


def named(runs):
    report = summarise(diagnose(runs))
    return report["verdict"], {
        e["name"]: {k: (p["value"], p["std"]) for k, p in e["parameters"].items()}
        for e in report["effects"]
    }


def scaled(wave, names, factor):
    return wave.replace(
        **{name: getattr(wave, name) * factor for name in names if getattr(wave, name) is not None}
    )


def in_units(runs, time=1.0, amplitude=1.0):
    """The runs with a second that is `time` seconds long and an amplitude unit of 1/amplitude."""
    out = [scaled(w, IN_TIME, 1 / time) for w in runs]
    out = [scaled(w, RATES, time) for w in out]
    out = [replace(w, window_s=w.window_s / time) for w in out]
    return [scaled(w, SIZES, amplitude) for w in out]


def same(found, other, factor=1.0, sigma=0.02):
    assert other[0] == found[0] and list(other[1]) == list(found[1])
    value, std = found[1]["cubic_stiffness"]["pull_rad_s"]
    again, its = other[1]["cubic_stiffness"]["pull_rad_s"]
    assert abs(again / factor - value) < sigma * std
    assert its / factor == pytest.approx(std, rel=0.05)


def test_the_cause_is_found(found):
    assert found[0] == "explained" and list(found[1]) == ["cubic_stiffness"]
    value, std = found[1]["cubic_stiffness"]["pull_rad_s"]
    assert abs(value - PULL) < 4 * std


@pytest.mark.parametrize("factor", [1e-3, pytest.param(1e3, marks=pytest.mark.slow)])
def test_the_unit_of_time_does_not_matter(runs, found, factor):
    same(found, named(in_units(runs, time=factor)), factor)


@pytest.mark.parametrize("unit", [pytest.param(1e-4, marks=pytest.mark.slow), 2e4])
def test_counts_do_not_widen_the_size_of_a_damping_by_a_power(unit):
    """ν₂ of 10 σ in counts of a converter: what another power would be at an amplitude of one count
    is no error of it."""
    table = programme(5, {"nonlinear_damping": {"damping_1_s": 2e-4}}, runs=4)
    report = summarise(diagnose([scaled(w, SIZES, unit) for w in waves(table)]))
    assert report["verdict"] == "explained", report["checks"]
    (one,) = report["effects"]
    size = one["parameters"]["damping_1_s"]
    assert abs(size["value"] * unit**2 - 2e-4) < 4 * size["std"] * unit**2
    assert size["std"] * one["z"] == pytest.approx(size["value"], rel=0.1)


@pytest.mark.parametrize("factor", [pytest.param(1e-6, marks=pytest.mark.slow), 1e6])
def test_the_unit_of_amplitude_does_not_matter(runs, found, factor):
    same(found, named(in_units(runs, amplitude=factor)), factor**-2)


def test_what_a_run_s_clock_shows_when_it_begins_does_not_matter(runs, found):
    """Samples at times t₀ + n/f_s, another t₀ in each run: the windows' times and the phase against
    the reference's e^{jωt}, as demodulation gives them."""
    same(found, named([begun_at(w, 40.0 + 1e3 * k) for k, w in enumerate(runs)]), sigma=1e-3)


def begun_at(wave, late_s):
    turned = 2 * np.pi * wave.reference_frequency_hz * late_s
    return wave.replace(time_s=wave.time_s + late_s, phase_rad=wave.phase_rad - turned)


def test_a_knock_is_told_by_the_recording_s_clock():
    knock = {"c_velocity_over_omega": 3e-3, "s_velocity_over_omega": -2e-3, "time_s": 0.61}
    table = programme(3, runs=4, duration_s=1.0)
    table["run"][1]["effects"] = {"momentum_kick": knock}
    late_s = [0.0, 77.0, 500.0, 0.0]
    runs = [begun_at(w, late) for w, late in zip(waves(table), late_s, strict=True)]
    found = diagnose(runs)
    assert found.verdict == "explained", found.status_reasons
    (one,) = found.told("effects")
    assert one["name"] == "momentum_kick" and one["held"]["run"]["value"] == 1
    assert one["held"]["time_s"]["value"] == pytest.approx(77.61, abs=0.01)
    for run, (wave, late) in enumerate(zip(runs, late_s, strict=True)):
        own = found.time_s[found.run == run]
        assert late <= own.min() and own.max() <= wave.time_s[-1]
    assert any("begin at 77 to 500 s" in told for told in found.status_reasons)


@pytest.mark.slow
def test_the_order_of_the_runs_does_not_matter(runs, found):
    same(found, named(runs[::-1]))


def test_channels_turned_by_any_angle_do_not_matter(runs, found):
    same(found, named([w.replace(wave_angle_rad=w.wave_angle_rad + 0.3) for w in runs]), sigma=0.1)


def test_channels_swapped_in_all_runs_do_not_matter(runs, found):
    """S for C turns the sense of everything: of the angle, of the quadrature, and of the rate as
    the channels see it."""
    mirrored = [
        w.replace(
            wave_angle_rad=np.pi / 4 - w.wave_angle_rad,
            quadrature_amplitude=-w.quadrature_amplitude,
            rate_rad_s=-w.rate_rad_s,
        )
        for w in runs
    ]
    same(found, named(mirrored), sigma=0.1)
