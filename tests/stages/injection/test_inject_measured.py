"""Injection into measured pendulums: what is hidden does there what its law says, and leaves the
rest as it was measured."""

import csv
import os
from pathlib import Path

import numpy as np
import pytest

from hrg_cli.effects import EFFECTS
from hrg_cli.errors import HrgError
from hrg_cli.records import Recording, Resonator, collect
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.estimate import estimate
from hrg_cli.stages.inject import inject

pytestmark = pytest.mark.slow
FLORENCE = ("foucault_florence", "2021_09_17_14_57_N.csv")
YVERDON = ("foucault_yverdon", "oscillation4.csv")
RATE_RAD_S = {FLORENCE: -5.047e-5, YVERDON: 5.31e-5}


def pendulum(name):
    folder = os.environ.get("HRG_MEASURED_DATA")
    if not folder:
        pytest.skip("set HRG_MEASURED_DATA to the folder of measured data")
    with (Path(folder) / name[0] / name[1]).open() as file:
        if name is FLORENCE:
            t, x, y = np.array(
                [[float(v) for v in row] for row in list(csv.reader(file, delimiter=";"))[1:]]
            ).T
        else:
            rows = [row for row in csv.reader(file) if row]
            x, y = np.array([[float(v) for v in row[:2]] for row in rows]).T
            t = np.array(
                [
                    sum(float(p) * u for p, u in zip(row[2].split(":"), (3600, 60, 1), strict=True))
                    for row in rows
                ]
            )
    keep = np.concatenate([[True], np.diff(t) > 0])
    t = (t - t[0])[keep]
    return Recording(
        c=x[keep], s=y[keep], time_s=t, mode="free", mode_number=1, run_id=name[0],
        auxiliary_time_s=t[[0, -1]], rate_rad_s=np.full(2, RATE_RAD_S[name]),
    )  # fmt: skip


def wave(recording):
    return collect(estimate(collect(demodulate(recording, periods_per_window=5.0))))


@pytest.fixture(scope="module", params=[FLORENCE, YVERDON], ids=lambda name: name[0])
def measured(request):
    recording = pendulum(request.param)
    return recording, wave(recording)


def both(measured, effects, resonator=None):
    """Waves before and after, at the windows that both show."""
    recording, before = measured
    after = wave(collect(inject(recording, resonator, effects=effects)))
    count = min(len(before), len(after))
    good = before.good()[:count] & after.good()[:count]
    assert good.mean() > 0.9
    return before.rows(0, count), after.rows(0, count), good


def test_a_gain_is_one_about_the_mean_position(measured):
    recording, _ = measured
    made = collect(inject(recording, effects={"gain_mismatch": {"gain": 0.02}}))
    c, s = (np.asarray(v) for v in (recording.c, recording.s))
    assert np.polyfit(c, made.c, 1)[0] == pytest.approx(1.01, abs=1e-12) and np.polyfit(
        s, made.s, 1
    )[0] == pytest.approx(0.99, abs=1e-12)
    assert abs(np.mean(made.c) - np.mean(c)) < 0.01 * np.std(c)


def test_a_drift_of_the_damping_is_an_amplitude_quadratic_in_time(measured):
    slope = 2 * 0.05 / measured[0].time_s[-1] ** 2  # five per cent lost at the end
    before, after, good = both(measured, {"damping_drift": {"slope_1_s2": slope}})
    ratio = np.log(after.main_amplitude / before.main_amplitude)[good]
    assert ratio == pytest.approx(-slope * before.time_s[good] ** 2 / 2, abs=5e-4)
    assert np.abs(np.sin(after.wave_angle_rad - before.wave_angle_rad)[good]).max() < 2e-3
    assert np.median(after.residual_rms[good]) == pytest.approx(
        np.median(before.residual_rms[good]), rel=0.05
    )


def test_a_rate_bias_turns_the_wave_of_a_resonator_without_splits(measured):
    bias = 0.05 / measured[0].time_s[-1]
    names = np.array(["frequency_hz", "damping_rate_1_s", "scale_factor"], dtype=object)
    resonator = Resonator(
        name=names, value=np.array([measured[1].reference_frequency_hz, 1e-4, 1.0]), std=np.zeros(3), mode_number=1,
        units=np.array(["Hz", "s-1", "1"], dtype=object), covariance=np.zeros((3, 3)), method="known",
    )  # fmt: skip
    before, after, good = both(measured, {"rate_bias": {"rate_rad_s": bias}}, resonator)
    turned = (after.wave_angle_rad - before.wave_angle_rad)[good]
    turned = turned - np.pi * np.round(turned[0] / np.pi)
    assert np.polyfit(before.time_s[good], turned, 1)[0] == pytest.approx(-bias, rel=0.02)


def test_a_frequency_that_follows_the_amplitude_pulls_the_phase(measured):
    recording, plain = measured
    size = float(np.median(plain.main_amplitude[plain.good()]))
    pull = 0.5 / recording.time_s[-1] / size**2
    before, after, good = both(measured, {"cubic_stiffness": {"pull_rad_s": pull}})
    shift = (
        2
        * np.pi
        * (after.reference_frequency_hz - before.reference_frequency_hz)
        * before.time_s[good]
    )
    phase = np.unwrap((after.phase_rad - before.phase_rad)[good] + shift, period=np.pi)
    t, a = before.time_s[good], before.main_amplitude[good]
    wanted = np.concatenate([[0], np.cumsum(np.diff(t) * (pull * a**2)[1:])])
    assert phase - phase[0] == pytest.approx(wanted, abs=0.05 * wanted[-1])


def test_a_knock_changes_nothing_before_and_the_velocity_after(measured):
    recording, plain = measured
    size, omega = (
        0.05 * float(np.median(plain.main_amplitude[plain.good()])),
        2 * np.pi * plain.reference_frequency_hz,
    )
    at = 0.4 * recording.time_s[-1]
    made = collect(
        inject(recording, effects={"momentum_kick": {"c_velocity_over_omega": size, "time_s": at}})
    )
    change = np.asarray(made.c) - np.asarray(recording.c)
    t = np.asarray(recording.time_s)
    period = 2 * np.pi / omega
    assert np.abs(change[t < at]).max() < 1e-3 * size
    near = (t > at) & (t < at + 3 * period)
    assert change[near] == pytest.approx(size * np.sin(omega * (t[near] - at)), abs=0.1 * size)


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda e: e.name)
def test_every_effect_goes_in_or_is_refused_in_words(measured, effect):
    recording, plain = measured
    size, frequency = (
        float(np.median(plain.main_amplitude[plain.good()])),
        plain.reference_frequency_hz,
    )
    from hrg_cli.fitting.causes.scales import find_typical_size

    given = {p.name: p.neutral + find_typical_size(p, size, frequency) for p in effect.fitted()}
    given |= {"time_s": 300.0} if any(p.name == "time_s" for p in effect.parameters) else {}
    given |= {"lost_s": 1.0} if effect.whole_samples else {}
    try:
        made = collect(inject(recording, effects={effect.name: given}))
    except HrgError as error:
        says = (
            "has no temperature log"
            if effect.follows_temperature or "temperature cycle" in effect.shown_by
            else "do nothing in it"
        )
        assert says in str(error) and (effect.shown_by or effect.follows_temperature)
        return
    assert np.all(np.isfinite(np.asarray(made.c))) and made.status == "valid"
    assert len(made.c) == len(recording.c) - (
        np.sum((recording.time_s >= 300) & (recording.time_s < 301)) if effect.whole_samples else 0
    )
