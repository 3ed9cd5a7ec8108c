"""The open search's vocabulary: a term and the effect it becomes are one thing, and its size is
what changes at most."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from diagnosis_programme import programme, waves
from diagnosis_statistics import base_of

from hrg_cli.fitting.causes import scales, whitened_rows
from hrg_cli.stages.diagnosis.fits.open_terms import (
    PLACES,
    list_covariates,
    make_decay,
    make_open_effect,
    make_step,
    make_tone,
)
from hrg_cli.stages.diagnosis.search.remainder import Term, compute_term_columns, find_peaks


@pytest.fixture(scope="module")
def fit():
    return base_of(waves(programme(21, runs=2, duration_s=1.0)))


def test_a_terms_columns_are_the_sensitivities_of_the_effect_it_becomes(fit):
    """Products of a place's vectors and a covariate against differences of the effect's own
    formula."""
    some = {c.formula: c for c in list_covariates(fit.series, fit.flow.prediction.motion)}
    for name in ("√(t/T)", "a₀/a", "(T − T₀)/ΔT", "harmonic 4θ × (a/a₀)²"):
        for place in PLACES:
            ((_, columns, _),) = compute_term_columns(fit.flow, [(place, some[name])])
            effect = make_open_effect(place, some[name], "open")
            steps = scales.list_steps(effect, fit.series)
            own = whitened_rows.find_sensitivity(fit.flow, effect, effect.values(), steps)
            assert np.allclose(columns, own, rtol=0, atol=1e-3 * np.abs(columns).max()), (
                place.name,
                name,
            )


def test_the_size_is_the_greatest_change():
    turning = SimpleNamespace(parts=2)
    for estimate, size in (
        ([3e-3, 0.0, 0.0, 3e-3], 3e-3),  # a vector that turns with the angle
        ([3e-3, 0.0, 0.0, -3e-3], 3e-3),  # the same backwards
        ([3e-3, 4e-3, 0.0, 0.0], 5e-3),  # along one direction
        ([3e-3, 4e-3], 5e-3),  # a number: cosine and sine
    ):
        assert Term(
            PLACES[0], turning, SimpleNamespace(estimate=np.array(estimate))
        ).size == pytest.approx(size)


@pytest.mark.parametrize(
    ("make", "value"), ((make_step, 0.37), (make_decay, -1.2), (make_tone, 3.3))
)
def test_a_shape_is_made_again_from_its_number(fit, make, value):
    one = make(fit.series, value)
    again = one.shape.make(fit.series, one.shape.value)
    u = fit.flow.prediction.motion
    assert one.shape.value == value and one.formula == again.formula
    assert np.array_equal(one.function(u, fit.series), again.function(u, fit.series))


def test_a_ripple_of_the_residual_is_among_the_tones_looked_for(fit):
    span = float(fit.series.time_s[fit.series.weight > 0].max())
    time = np.broadcast_to(fit.series.time_s[..., None], (*fit.series.weight.shape, 4))[
        tuple(fit.rows.T)
    ]
    rippling = replace(fit, residual=fit.residual + np.cos(2 * np.pi * 7.3 * time / span))
    assert min(abs(cycles - 7.3) for cycles in find_peaks(rippling)) < 0.3


def test_a_term_of_several_envelopes_is_that_of_each(fit):
    """A march asks for many envelopes beside the same rows at once; parts of a term come first."""
    series = fit.series
    u = series.envelope * np.exp(0.1j * np.arange(3))[:, None, None, None]
    named = set()
    for covariate in list_covariates(series, series.envelope, [3.0]):
        named.add(covariate.name)
        at_once = covariate.function(u, series)
        for k, one in enumerate(u):
            for whole, alone in zip(at_once, covariate.function(one, series), strict=True):
                np.testing.assert_allclose(
                    np.broadcast_to(whole, u.shape[:-1])[k], np.broadcast_to(alone, one.shape[:-1])
                )
    assert "run" in named
