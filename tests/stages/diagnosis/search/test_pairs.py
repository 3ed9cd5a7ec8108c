"""Two causes at once: what both take of a residual, and pairs that one cause after another misses."""

from types import SimpleNamespace

import numpy as np
import pytest
from diagnosis_programme import programme, verdict

from hrg_cli.fitting.causes.designs import Design, factor_design
from hrg_cli.fitting.causes.evidence import price_numbers, score_candidates
from hrg_cli.stages.diagnosis.search.pairs import list_promising_pairs

ROWS, KNOWN = 200, 4


def causes_of(random, widths):
    """A residual beside a basis, and candidates with so many columns, correlated with each other."""
    shared = random.normal(size=(ROWS, KNOWN))
    basis = factor_design(Design.from_matrix(shared)).basis
    common = random.normal(size=(ROWS, 1))
    columns = [common + random.normal(size=(ROWS, width)) for width in widths]
    residual = basis.project_out(random.normal(size=ROWS) + 0.5 * common[:, 0])
    return shared, basis, columns, residual


def test_a_pair_promises_what_a_fit_of_both_takes_of_the_residual():
    random = np.random.default_rng(1)
    shared, basis, columns, residual = causes_of(random, (1, 2, 3, 1))
    names = ["a", "b", "c", "d"]
    found = score_candidates(names, residual, columns, basis)
    at_no_instant = SimpleNamespace(effect=SimpleNamespace(of_one_run=False))
    pairs = list_promising_pairs(
        SimpleNamespace(residual=residual), [(one, at_no_instant) for one in found]
    )
    assert len(pairs) == 6
    for pair in pairs:
        first, second = sorted(names.index(score.name) for score, _ in pair.both)
        alone, both = (
            residual @ residual - left @ left
            for some in ((first,), (first, second))
            for design in [np.column_stack([shared, *(columns[k] for k in some)])]
            for left in [residual - design @ np.linalg.lstsq(design, residual, rcond=None)[0]]
        )
        prices = [
            price_numbers(columns[k].shape[1], gain, ROWS)
            for k, gain in ((first, alone), (second, both - alone))
        ]
        assert pair.promise == pytest.approx(both - sum(prices), abs=1e-8)


@pytest.mark.parametrize("seed", (0, pytest.param(5, marks=pytest.mark.slow)))
def test_two_causes_that_a_third_outdoes_alone_are_both_found(seed):
    """Damping that grows with the amplitude and falls with a temperature that rises or falls in each
    run: a gain that follows temperature, or an offset, takes more than either of them alone, and
    beside it neither is worth its price."""
    random = np.random.default_rng(seed)
    effects = {
        "nonlinear_damping": {"damping_1_s": 6.2e-4 if seed == 0 else 7.7e-4},
        "thermal_damping": {
            "relative_1_k": -5.9e-4 if seed == 0 else -4.8e-4,
            "reference_temperature_degc": 22.0,
        },
    }
    table = programme(seed, effects, runs=4)
    for run in table["run"]:
        start, stop = 22 + 3 * random.random(2)
        run["environment"]["temperature"] = {
            "kind": "ramp",
            "start_degc": float(start),
            "stop_degc": float(stop),
        }
    _, out = verdict(table)
    assert out["verdict"] == "explained", out["checks"]
    assert {cause["name"] for cause in out["effects"]} == set(effects)
    for cause in out["effects"]:
        for name, number in cause["parameters"].items():
            true = effects[cause["name"]].get(name)
            if true is not None and number["std"]:
                assert abs(number["value"] - true) < 5 * number["std"]


def test_two_causes_that_hide_one_another_are_both_found():
    """A damping that grows with the amplitude and a friction that falls with it, 8 and 6 σ: beside a
    constant damping each takes back most of what the other did, and alone neither is worth its
    price ("adequate", the damping 33 of its σ off)."""
    hidden = {"nonlinear_damping": {"damping_1_s": 1.5e-4}, "dry_friction": {"slope_1_s": 6e-5}}
    table = programme(1, hidden, runs=4)
    record, out = verdict(table)
    assert record.verdict == "explained"
    assert {e["name"] for e in out["effects"]} == set(hidden)
    for effect in out["effects"]:
        for name, true in hidden[effect["name"]].items():
            found = effect["parameters"][name]
            assert abs(found["value"] - true) < 4 * found["std"]
    damping = next(row for row in out["values"] if row["name"] == "damping_rate_1_s")
    assert abs(damping["value"] - table["device"]["damping_rate_1_s"]) < 4 * damping["std"]
