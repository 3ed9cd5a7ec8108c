"""The same fit is not made twice: what a search asks for again, at another noise, stands already."""

from hrg_cli.stages.diagnosis.drawn_case import draw_found_case, draw_mismatched_fit
from hrg_cli.stages.diagnosis.fits.refits import leave_out
from hrg_cli.stages.diagnosis.search.remainder import add_term, find_best_term, score_terms


def test_a_fit_without_a_cause_is_made_once():
    fit = draw_found_case().search.final
    assert leave_out(fit, "gain_mismatch") is leave_out(fit, "gain_mismatch")


def test_a_fit_with_an_open_term_is_made_once():
    fit = draw_mismatched_fit()
    best, again = (find_best_term(fit, score_terms(fit, by_run=False)) for _ in range(2))
    first = add_term(fit, best, "open term 0")
    assert first is add_term(fit, again, "open term 0")
    assert first is not add_term(fit, again, "open term 1")
