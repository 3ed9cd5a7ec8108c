"""Upper limits at 95 %: what was not found is not larger than they say, in ninety-five of a hundred
and not in all."""

import numpy as np
import pytest
from diagnosis_programme import programme, waves
from diagnosis_statistics import CYCLE, FORCED, base_of, measured, sized, table_for

from hrg_cli.effects import EFFECTS, find
from hrg_cli.fitting.causes import evidence
from hrg_cli.stages.diagnose import diagnose, summarise
from hrg_cli.stages.diagnosis.fits.variants import list_variants
from hrg_cli.stages.diagnosis.report import tested
from hrg_cli.stages.diagnosis.search.inquiry import STATED

PLAIN = [
    e.name
    for e in EFFECTS
    if e.name not in FORCED | CYCLE | {"saturation", "dropped_samples", "mains_tone", "ageing"}
]
OTHERS = {
    "clock_error",
    "table_rate_error",
    "centrifugal_stiffness",
    "dropped_samples",
    "mains_tone",
    "finite_quadrature_gain",
    "thermal_lag",
}
"""Hidden by the base model, in the waveform, or in need of another setting."""


def test_limits_of_one_parameter_hold_in_ninety_five_of_a_hundred():
    """Over draws of the noise at the fit: sizes of 2 and 3 σ are covered as often as is said,
    smaller ones always."""
    fit = base_of(waves(programme(5)))
    random = np.random.default_rng(5)
    draws, tried, held, small = 150, 0, 0, 0
    for variant in list_variants([find(name) for name in PLAIN], fit):
        if len(variant.steps) > 1:
            continue
        S = fit.find_sensitivities([variant.wanted])[0]
        unit = float(np.linalg.norm(fit.basis.project_out(fit.basis.project_out(S))))
        for size in (0.5, 2.0, 3.0):
            true = size / unit
            for _ in range(draws if evidence.score("", fit.residual, S, fit.basis).visible else 0):
                score = evidence.score(
                    variant.effect.name,
                    random.standard_normal(len(S)) + S[:, 0] * true,
                    S,
                    fit.basis,
                )
                inside = true <= tested._limit(score, STATED, variant)[0]
                small += inside and size < 1
                held += inside and size > 1
                tried += size > 1
    assert tried > 2000
    assert small == tried / 2
    assert held / tried == pytest.approx(0.95, abs=4 * np.sqrt(0.95 * 0.05 / tried))


def holds(name, seed):
    """Whether an effect of 0 … 3 σ by chance is named or lies below its limit."""
    table, random = table_for(name, seed)
    table["effects"] = {
        name: sized(find(name), base_of(measured(table, name)), float(random.uniform(0, 3)), random)
    }
    out = summarise(diagnose(measured(table, name)))
    row = next(t for t in out["tested"] if t["name"] == name)
    if row["upper_limit"] is None:
        return any(e["name"] == name for e in out["effects"])
    true = [
        abs(table["effects"][name][p.name] - p.neutral)
        for p in find(name).fitted()
        if p.units == row["units"]
    ]
    return max(true) <= row["upper_limit"]


@pytest.mark.parametrize("name", ("gain_mismatch", "saturation", "electrode_nonorthogonality"))
def test_a_faint_effect_lies_below_its_limit(name):
    assert holds(name, 1)


@pytest.mark.slow
def test_faint_effects_of_the_whole_catalogue_lie_below_their_limits():
    # what happens at an instant is tested only where the rows jump, and has no limit elsewhere
    names = [e.name for e in EFFECTS if e.name not in OTHERS and not (e.part_of or e.of_one_run)]
    held = [holds(name, seed) for seed in range(4) for name in names]
    # sizes below 1.6 σ are always covered, larger ones in ninety-five of a hundred
    assert np.mean(held) > 0.95 - 3 * np.sqrt(0.95 * 0.05 / len(held)), dict(
        zip(names * 4, held, strict=True)
    )
