"""The form of a damping that follows the amplitude, beside another cause many times as large."""

import pytest
from diagnosis_programme import programme, verdict

from hrg_cli.stages.diagnosis.search import form

TABLE = {"gain_mismatch": {"gain": 4e-3}, "nonlinear_damping": {"damping_1_s": 4e-3}}


@pytest.fixture
def sought(monkeypatch):
    """Every search for causes beside another form, counted."""
    calls, beside = [], form._take_beside

    def counted(*given):
        calls.append(given)
        return beside(*given)

    monkeypatch.setattr(form, "_take_beside", counted)
    return calls


def test_a_form_that_serves_beside_the_other_causes_is_not_sought_again_alone(sought):
    """Without the mismatch the catalogue's damping seems forbidden; that says nothing of its
    form, and the causes beside another form are the dearest part of a diagnosis."""
    _, out = verdict(programme(7, TABLE, runs=4, duration_s=1.5))
    assert {effect["name"] for effect in out["effects"]} == set(TABLE)
    assert out["verdict"] == "explained" and not sought
