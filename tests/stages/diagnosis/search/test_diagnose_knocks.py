"""What strikes one run by so little that the rows next to it do not show it: found by all that
follows, at its row, and nothing found where nothing struck."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from diagnosis_programme import programme, verdict, waves

from hrg_cli.effects import find
from hrg_cli.effects.effect import INSTANT, RUN
from hrg_cli.effects.envelope_jumps import find_jumps
from hrg_cli.fitting.causes import evidence
from hrg_cli.stages.diagnose import diagnose, summarise
from hrg_cli.stages.diagnosis.base.joint_fit import fit_base
from hrg_cli.stages.diagnosis.fits import places
from hrg_cli.stages.diagnosis.fits.variants import list_variants

RUNS, LENGTH_S, CLEAN = 4, 1.0, 5
PLAIN = {"scale_factor": None, "blocks": 120, "free_phase": False}


def fit_of(runs):
    return fit_base(runs, **PLAIN)


@pytest.fixture(scope="module")
def clean():
    return waves(programme(CLEAN, runs=RUNS, duration_s=LENGTH_S))


def anywhere(name, fit):
    (one,) = (v for v in list_variants([find(name)], fit) if v.anywhere)
    return one


def knock_of(seed, ideal, fit):
    """Parameters of a knock that stands so many σ beside the base model of these runs."""
    random = np.random.default_rng(100 + seed)
    angle = random.uniform(0, 2 * np.pi)
    unit = {
        "c_velocity_over_omega": np.cos(angle),
        "s_velocity_over_omega": np.sin(angle),
        "time_s": random.uniform(0.25, 0.75) * LENGTH_S,
        "run": float(random.integers(RUNS)),
    }
    effect = find("momentum_kick")
    names = [p.name for p in effect.fitted()]
    at = effect.values({INSTANT: unit["time_s"], RUN: unit["run"]})
    S = fit.find_sensitivities([(effect, at, dict.fromkeys(names, 1e-6))])[0]
    alone = float(
        np.linalg.norm(
            fit.basis.project_out(fit.basis.project_out(S)) @ [unit[name] for name in names]
        )
    )
    return unit | {name: unit[name] * ideal / alone for name in names}


def struck(seed, true):
    return programme(seed, {"momentum_kick": true}, runs=RUNS, duration_s=LENGTH_S)


def test_what_a_row_scores_is_the_score_of_what_follows_it(clean):
    """The sums from the end against the columns of one row after another, written out."""
    fit = fit_of(clean)
    for name in ("momentum_kick", "gain_step"):
        for run in (0, RUNS - 1):
            rows, _, _ = fit.design.own[run]
            S = places._own_columns(anywhere(name, fit), fit, run)
            gain, rank = places.compute_place_gains(S, fit, run)
            for row in (10, 60, 100):
                whole = np.zeros((len(fit.residual), S.shape[1]))
                whole[rows][4 * row :] = S[4 * row :]
                alone = evidence.score(name, fit.residual, whole, fit.basis)
                assert rank[row] == alone.rank
                assert gain[row] == pytest.approx(alone.gain, rel=1e-6, abs=1e-6)


def test_a_gain_step_has_the_columns_that_it_has_from_the_start_on(clean):
    """From its row on: what the catalogue's effect does when it strikes there."""
    fit, run, row = fit_of(clean), 1, 50
    one = anywhere("gain_step", fit)
    t = fit.series.time_s[run]
    between = {INSTANT: float(t[row - 1] + t[row]) / 2, RUN: float(run)}
    S = fit.find_sensitivities([(one.effect, {**one.values, **between}, one.steps)])[0]
    rows, _, _ = fit.design.own[run]
    masked = places._own_columns(one, fit, run)
    masked[: 4 * row] = 0
    assert np.allclose(S[rows], masked, atol=1e-9 * np.abs(S).max())
    others = np.delete(S, np.arange(rows.start, rows.stop), axis=0)
    assert not others.any()


def test_runs_that_nothing_struck_have_no_place(clean):
    fit = fit_of(clean)
    for name in ("momentum_kick", "gain_step"):
        assert places.place_cause(anywhere(name, fit), fit) == []


def assert_named(out, ideal):
    """The knock is named alone, as large as it was, and nothing is left."""
    assert out["verdict"] == "explained", out["checks"]
    (found,) = out["effects"]
    assert "momentum_kick" in (found["name"], *found["indistinguishable_from"])
    assert found["z"] == pytest.approx(ideal, abs=4)


def test_a_knock_that_its_neighbours_do_not_show_is_named(clean):
    true = knock_of(CLEAN, 13.0, fit_of(clean))
    runs = waves(struck(CLEAN, true))
    fit = fit_of(runs)
    assert find_jumps(fit.series) == []
    found = places.place_cause(anywhere("momentum_kick", fit), fit)
    row_s = float(np.median(np.diff(fit.series.time_s[0])))
    assert {v.values[RUN] for v in found} == {true[RUN]}
    assert abs(found[0].values[INSTANT] - true[INSTANT]) < 3 * row_s
    assert_named(summarise(diagnose(runs)), 13.0)


@pytest.mark.parametrize("name", ["momentum_kick", "gain_step"])
def test_what_strikes_all_runs_at_one_time_of_theirs_strikes_none(name):
    """A blow that the programme gives at half of every run is no knock of one of them; what strikes
    one run alone, or harder than all others there, still is."""
    series = side_by_side_at_rest()
    blow, later = series.time_s >= 0.5, series.time_s >= 0.75
    all_alike = series.envelope + 0.01 * blow[..., None]
    one_alone = all_alike.copy()
    one_alone[1] += 0.02j * later[1][:, None]
    one_harder = all_alike.copy()
    one_harder[2] += 0.05 * blow[2][:, None]
    for envelope, struck_runs in ((all_alike, []), (one_alone, [1]), (one_harder, [2])):
        seen = replace(series, envelope=envelope)
        assert len({jump.run for jump in find_jumps(seen)}) == RUNS
        assert [start[RUN] for start in find(name).starts(seen)] == struck_runs


def side_by_side_at_rest():
    """Runs whose envelopes stand still."""
    t = np.tile(np.linspace(0.0, LENGTH_S, 121), (RUNS, 1))
    random = np.random.default_rng(0)
    noise = random.standard_normal((2, *t.shape, 2)) * 1e-4
    return AtRest(t, np.ones((*t.shape, 2)) + noise[0] + 1j * noise[1], np.full(t.shape, 1e4))


@dataclass(frozen=True)
class AtRest:
    """As much of runs side by side as jumps are looked for in."""

    time_s: np.ndarray
    envelope: np.ndarray
    weight: np.ndarray
    reference_frequency_hz: float = 5000.0

    @property
    def table_turn_rad(self):
        return np.zeros(self.weight.shape)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_knocks_of_ten_sigma_are_named(seed):
    """Six programmes; one of 10 σ is missed where noise takes more than 2 of them away."""
    base = fit_of(waves(programme(seed, runs=RUNS, duration_s=LENGTH_S)))
    true = knock_of(seed, 10.0, base)
    _, out = verdict(struck(seed, true))
    assert_named(out, 10.0)
