"""The statistics diagnosis is held to: every effect at a random size, clean programmes of every
kind, pairs of effects.

A few of each run always; all of them are `slow`.
"""

import numpy as np
import pytest
from diagnosis_programme import programme, waves
from diagnosis_statistics import (
    CYCLE,
    FORCED,
    IN_THE_WAVEFORM,
    base_of,
    clean_programme,
    errors,
    gain_without,
    hidden,
    measured,
    sized,
    stepped_programme,
    table_for,
    true_gain,
)

from hrg_cli.effects import EFFECTS, find
from hrg_cli.stages.diagnose import diagnose, summarise

INSEPARABLE = {"clock_error", "table_rate_error"}
"""Exactly the scale factor, or frequency, damping and scale factor together, in every
experiment."""
ALL = [e.name for e in EFFECTS if e.name not in INSEPARABLE]
SAMPLE = ("electrode_nonorthogonality", "coherent_offset", "nonlinear_damping")
ALONE = {
    *IN_THE_WAVEFORM,
    "saturation",
    "drive_feedthrough",
    "centrifugal_stiffness",
    "finite_quadrature_gain",
    "thermal_lag",
}
PAIRED = [name for name in ALL if name not in ALONE | {"thermal_gradient"}]
COMPANIONS = {"thermal_frequency_curvature": {"thermal_frequency"}}
"""What a cause is beside itself: a curvature about another temperature than the runs' own mean has a
slope there."""
TOO_ALIKE = {frozenset(("damping_drift", "thermal_damping"))}
"""Pairs that ramps of temperature hardly tell from one another."""


def check(name, seed):
    effects, runs = hidden(name, seed)
    out = summarise(diagnose(runs))
    beside = {*effects, *COMPANIONS.get(name, ())}
    entries = [e for e in out["effects"] if e["name"] not in beside or e["name"] == name]
    assert entries, f"{name} was not seen: {out['verdict']}"
    group = [entries[0]["name"], *entries[0]["indistinguishable_from"]]
    assert name in group and len(group) <= 3
    off = {k: v for k, v in errors(out, {name: effects[name]}).items()}
    assert all(abs(v) < 4 for v in off.values()), off
    wanted = (
        gain_without(runs, measured(table_for(name, seed)[0]))
        if name in IN_THE_WAVEFORM
        else true_gain(runs, effects)
    )
    # a run that alone holds a temperature is predicted worse by the truth, too: a gain below one;
    # and what driven runs' trackers may have done is known to no better than a thousandth
    assert out["gain"]["ratio"] ** 2 >= wanted - 0.15 * abs(wanted - 1) - 3e-3


@pytest.mark.parametrize("name", SAMPLE)
def test_a_hidden_effect_of_random_size_is_named_sized_and_worth_it(name):
    check(name, 1)


@pytest.mark.slow
@pytest.mark.parametrize("seed", (1, 2))
@pytest.mark.parametrize("name", ALL)
def test_every_hidden_effect_of_random_size_is_named_sized_and_worth_it(name, seed):
    check(name, seed)


def alarm(seed, programme_of=clean_programme):
    table, periods, logged = programme_of(seed)
    runs = waves(table, seed=seed, periods_per_window=periods)
    return (
        summarise(diagnose(runs if logged else [w.replace(temperature_degc=None) for w in runs]))[
            "verdict"
        ]
        != "adequate"
    )


def test_clean_programmes_of_every_kind_raise_no_alarm():
    assert not any(alarm(seed) for seed in range(4))


@pytest.mark.slow
def test_a_hundred_clean_programmes_raise_two_alarms_at_most():
    alarms = [seed for seed in range(100) if alarm(seed)]
    assert len(alarms) <= 2, alarms


@pytest.mark.parametrize("seed", (pytest.param(34, marks=pytest.mark.slow), 41))
def test_abrupt_steps_of_the_rate_raise_no_alarm(seed):
    """Within a step nobody knows the table's way; low noise and a frequency split make a quadrature
    of it."""
    assert not alarm(seed, stepped_programme)


@pytest.mark.slow
def test_programmes_with_steps_of_the_rate_raise_few_alarms():
    alarms = [seed for seed in range(60) if alarm(seed, stepped_programme)]
    assert len(alarms) <= 8, (
        alarms
    )  # 4 when written, at noise of 1e-5 … 1e-6 of the wave a row; of a rate of 7 % more come in one case of fifty


def pair(seed):
    """Two effects of 15 … 60 σ: (names, JSON)."""
    random = np.random.default_rng([seed, 99])
    while frozenset(names := tuple(map(str, random.choice(PAIRED, 2, replace=False)))) in TOO_ALIKE:
        pass
    table = programme(
        int(random.integers(1e6)),
        runs=8,
        noise=float(10 ** random.uniform(-4, -3)),
        forced=bool(set(names) & FORCED),
        quadrature_loop="finite" if "quadrature_drive_phase_error" in names else "off",
        cycle=bool(set(names) & (CYCLE | {"ageing", "thermal_damping"})),
    )
    base = base_of(waves(table))
    table["effects"] = {
        name: sized(find(name), base, float(random.uniform(15, 60)), random) for name in names
    }
    return names, summarise(diagnose(waves(table)))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_two_effects_at_once_are_both_found(seed):
    names, out = pair(seed)
    groups = [{e["name"], *e["indistinguishable_from"]} for e in out["effects"]]
    assert all(any(name in group for group in groups) for name in names), (names, groups)
