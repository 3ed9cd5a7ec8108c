"""The power of diagnosis: the arithmetic of powers and intervals, and one small study from raw
samples."""

import json

import numpy as np
import pytest

from hrg_cli.effects import EFFECTS, find
from hrg_cli.fitting.causes import scales, whitened_rows
from hrg_cli.studies import hidden, power
from hrg_cli.studies.diagnosis import assemble, diagnosis_study, draw_figure, tabulate


def test_the_ideal_detector_is_that_of_neyman_and_pearson():
    """Of shifted normal statistics at the same rate of false alarms the likelihood ratio sees as
    many as the formula says."""
    random = np.random.default_rng(1)
    noise, size, rate = random.standard_normal(200_000), 2.5, 0.01
    threshold = np.quantile(noise, 1 - rate)
    assert power.compute_ideal([size], rate)["chance"]["2.5"] == pytest.approx(
        np.mean(noise + size > threshold), abs=0.01
    )
    assert power.compute_ideal([], rate)["half"] == pytest.approx(threshold, abs=0.03)


def test_the_curve_finds_the_size_named_in_half_of_the_draws_and_its_interval_holds_it():
    random, inside, halves = np.random.default_rng(2), 0, []
    for _ in range(60):
        draws = [
            (s, bool(random.standard_normal() * 1.5 + s > 5.0))
            for s in (3, 4, 5, 6, 8)
            for _ in range(12)
        ]
        found = power.fit_curve(draws)
        halves.append(found["half"])
        inside += found["half_interval"][0] <= 5.0 <= (found["half_interval"][1] or np.inf)
    assert np.mean(halves) == pytest.approx(5.0, abs=0.15)
    assert inside >= 60 * 0.95 - 3 * np.sqrt(60 * 0.95 * 0.05)
    assert found["ninety"] > found["half"] + 1.28
    assert power.fit_curve([(4.0, False), (8.0, False)])["half"] is None


def test_intervals_of_shares_hold_the_truth_in_ninety_five_of_a_hundred():
    random = np.random.default_rng(3)
    for chance in (0.05, 0.5, 0.95):
        held = [
            low <= chance <= high
            for _, low, high, _ in (
                power.compute_share(int(k), 20) for k in random.binomial(20, chance, 400)
            )
        ]
        assert np.mean(held) > 0.95 - 3 * np.sqrt(0.95 * 0.05 / 400)


def test_a_size_is_what_an_ideal_detector_measures():
    """The sum of the data along the effect's own direction, over draws of the noise, stands `size`
    σ from zero."""
    size, found = 6.0, []
    one = hidden.hide("gain_mismatch", np.random.default_rng(4), 3e-4)
    for seed in range(8):
        fit = hidden.fit_base(one.measure(size, seed), None, {})
        step = scales.list_steps(one.effect, fit.series)
        direction = hidden._project_base(
            whitened_rows.find_sensitivity(fit.flow, one.effect, one.neutral, step), fit
        )[:, 0]
        found.append(
            np.sign(next(iter(one.direction.values())))
            * direction
            @ fit.residual
            / np.linalg.norm(direction)
        )
    assert np.mean(found) == pytest.approx(size, abs=4 / np.sqrt(8))
    assert np.std(found) == pytest.approx(1, abs=4 / np.sqrt(2 * 8))


def test_a_small_study_from_raw_samples(tmp_path):
    study = diagnosis_study(
        effects=["gain_mismatch", "dropped_samples"], sizes=[2.0, 15.0], draws=1, controls=0, seed=1
    )
    mismatch, dropped = study["effects"]["gain_mismatch"], study["effects"]["dropped_samples"]
    assert mismatch["named"]["15"][0] == 1 and dropped["named"]["any"][0] == 1
    assert mismatch["named"]["2"][3] == 1 and study["all"]["named"]["15"][3] == 1
    assert study["confusion"]["gain_mismatch"] == {"gain_mismatch": 1.0}
    assert abs(mismatch["error_rms"]) < 4
    json.dumps(study, allow_nan=False)
    heads, rows = tabulate(study)
    assert all(len(row) == len(heads) for row in rows) and rows[-1][0] == "ideal detector"
    draw_figure(study).savefig(tmp_path / "study.png")
    assert (tmp_path / "study.png").stat().st_size > 10_000


def test_rows_become_figures():
    """Groups share their count, wrong names and open terms are told apart, a limit below the truth
    is counted."""
    row = {
        "hidden": "ageing",
        "draw": 0,
        "size": 9.0,
        "group": [],
        "outcome": "nothing",
        "errors": {},
        "limit_holds": True,
    }
    rows = [
        row
        | {
            "group": ["ageing", "damping_drift"],
            "outcome": "named",
            "errors": {"slope": 1.0},
            "limit_holds": None,
        },
        row | {"group": ["table_wobble"], "outcome": "wrong"},
        row | {"outcome": "described"},
        row | {"limit_holds": False},
        {"clean": "plain", "named": [], "verdict": "adequate"},
        {"clean": "plain", "named": ["ageing"], "verdict": "explained"},
    ]
    study = assemble(rows, [9.0])
    assert study["confusion"]["ageing"] == {
        "ageing": 0.125,
        "damping_drift": 0.125,
        "table_wobble": 0.25,
        "described": 0.25,
        "nothing": 0.25,
    }
    figures = study["effects"]["ageing"]
    assert [figures[k][0] for k in ("wrong", "described")] == [0.25, 0.25] and figures[
        "limits_hold"
    ][0] == pytest.approx(2 / 3)
    assert study["controls"]["causes_named"][0] == 0.5


def test_what_an_effect_needs_beside_it_has_a_size():
    for effect in EFFECTS:
        for name, values in hidden.list_effects_beside(effect).items():
            assert find(name).fitted()[0].name in values


@pytest.mark.parametrize("name", ["momentum_kick", "gain_step"])
def test_what_happens_at_an_instant_is_hidden_inside_one_run(name):
    """At a run's start nothing tells it from another start, whatever its size."""
    one = hidden.hide(name, np.random.default_rng(7), 3e-4)
    values = one.choose_values(10.0)
    run, instant = int(values["run"]), values["time_s"]
    assert 0 <= run < len(hidden.RATES) and 0.2 <= instant / hidden.DURATION_S <= 0.8
    largest = max(abs(values[p.name]) for p in one.effect.fitted())
    assert 1e-5 < largest < 1e-2
    struck, plain = one.measure(10.0, 3), one.measure(None, 3)
    for k, (a, b) in enumerate(zip(struck, plain, strict=True)):
        changed = np.abs(a.main_amplitude - b.main_amplitude) > 1e-9
        assert changed.any() == (k == run)
        assert not changed[a.time_s < instant - 10 * a.window_s].any()
