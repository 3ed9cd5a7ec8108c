"""The same fit is not made twice: what a search asks for again, at another noise, stands already."""

from hrg_cli.effects import find
from hrg_cli.stages.diagnosis.drawn_case import (
    draw_case,
    draw_fit,
    draw_found_case,
    draw_mismatched_fit,
    draw_waves,
    fit_waves,
)
from hrg_cli.stages.diagnosis.fits import refits, variants
from hrg_cli.stages.diagnosis.fits.refits import leave_out
from hrg_cli.stages.diagnosis.search.remainder import add_term, find_best_term, score_terms
from hrg_cli.stages.diagnosis.suspects import quiet


def never(*_):
    raise AssertionError("made again")


def test_a_fit_without_a_cause_is_made_once():
    fit = draw_found_case().search.final
    assert leave_out(fit, "gain_mismatch") is leave_out(fit, "gain_mismatch")


def test_a_fit_with_an_open_term_is_made_once():
    fit = draw_mismatched_fit()
    best, again = (find_best_term(fit, score_terms(fit, by_run=False)) for _ in range(2))
    first = add_term(fit, best, "open term 0")
    assert first is add_term(fit, again, "open term 0")
    assert first is not add_term(fit, again, "open term 1")


def test_the_ways_causes_may_stand_are_listed_once(monkeypatch):
    fit, effects = draw_mismatched_fit(), [find("gain_mismatch"), find("momentum_kick")]
    first = variants.list_variants(effects, fit)
    monkeypatch.setattr(variants, "_list_beside", never)
    assert variants.list_variants(effects, fit) == first
    assert variants.list_variants(effects, fit) is not first


def test_no_fit_is_made_of_a_second_order_that_promises_nothing(monkeypatch):
    fit = draw_fit()
    monkeypatch.setattr(refits, "fit_at_second_order", never)
    assert refits.take_plain_averaging(fit, []) is None


def test_no_fit_follows_the_temperature_where_there_is_nothing_to_take(monkeypatch):
    monkeypatch.setattr(quiet, "fit_warming", never)
    fit, candidates = draw_fit(), draw_case().inquiry.candidates
    levels = quiet._levels(draw_waves(), fit_waves, fit, fit, candidates, failed=False)
    assert [level.before for level in levels] == [fit]
