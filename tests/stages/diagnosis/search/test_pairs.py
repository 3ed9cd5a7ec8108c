"""Two causes at once: what both take of a residual, and pairs that one cause after another misses."""

from types import SimpleNamespace

import numpy as np
import pytest
from diagnosis_programme import programme, verdict

from hrg_cli.fitting.causes.designs import Design, factor_design
from hrg_cli.fitting.causes.evidence import score_candidates
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
        both = [names.index(score.name) for score, _ in pair.both]
        design = np.column_stack([shared, *(columns[k] for k in both)])
        left = residual - design @ np.linalg.lstsq(design, residual, rcond=None)[0]
        gain = residual @ residual - left @ left
        rank = sum(columns[k].shape[1] for k in both)
        assert pair.promise == pytest.approx(gain - rank * np.log(ROWS), abs=1e-8)


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
