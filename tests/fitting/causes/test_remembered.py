"""What is remembered beside fits: freed with them, and of what is large the latest alone."""

import gc
import weakref

import numpy as np
import pytest

from hrg_cli.effects import find
from hrg_cli.fitting.causes import extended_fit, remembered, sensitivities
from hrg_cli.stages.diagnosis.drawn_case import draw_mismatched_fit
from hrg_cli.stages.diagnosis.fits.variants import list_variants
from hrg_cli.stages.diagnosis.search.remainder import score_terms

NAMES = ("rate_bias", "gain_mismatch", "electrode_nonorthogonality")


@pytest.fixture
def fit():
    drawn = draw_mismatched_fit()
    return extended_fit.fit(drawn.series, drawn.point, drawn.freedom)


@pytest.fixture
def wanted(fit):
    return [one.wanted for one in list_variants([find(name) for name in NAMES], fit)]


def test_a_fit_is_freed_with_its_last_user(fit):
    """Its arrays are large: no ring of the fit and what it remembers may wait for the collector."""
    own = extended_fit.fit(fit.series, fit.point, fit.freedom)
    assert score_terms(own, by_run=True)
    freed = weakref.ref(own)
    gc.disable()
    try:
        del own
        assert freed() is None
    finally:
        gc.enable()


def test_what_is_forgotten_is_made_again_alike(fit, wanted, monkeypatch):
    monkeypatch.setattr(remembered, "MOST_NUMBERS", 1)
    first = fit.find_sensitivities(wanted)
    kept = sum(isinstance(one, np.ndarray) for one in fit._known.values.values())
    again = fit.find_sensitivities(wanted)
    assert kept == 1 < len(wanted)
    assert all(np.array_equal(one, other) for one, other in zip(first, again, strict=True))


def test_the_latest_is_kept():
    one, other = remembered.Remembered(), remembered.Remembered()
    part = remembered.MOST_NUMBERS // 2 - 1
    one["a"], other["b"] = np.zeros(part), np.zeros(part)
    assert one["a"].size == part
    one["c"], one["word"] = np.zeros(part), "small"
    assert "a" in one and "b" not in other and "c" in one and "word" in one


def test_columns_made_together_are_those_made_one_by_one(fit, wanted, monkeypatch):
    together = sensitivities.find_effect_sensitivities(fit.flow, wanted)
    monkeypatch.setattr(sensitivities, "AT_A_TIME", 1)
    alone = sensitivities.find_effect_sensitivities(fit.flow, wanted)
    assert all(
        np.allclose(one, other, rtol=1e-12) for one, other in zip(together, alone, strict=True)
    )
