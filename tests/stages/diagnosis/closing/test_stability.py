"""The causes chosen again from half as many rows, and what it costs a list that they do not show."""

from dataclasses import replace

from hrg_cli.effects import find
from hrg_cli.stages.diagnosis.closing.stability import check_chosen_again, choose_again
from hrg_cli.stages.diagnosis.drawn_case import draw_found_case, draw_mismatched_fit
from hrg_cli.stages.diagnosis.fits.refits import adopt, loosen
from hrg_cli.stages.diagnosis.fits.scoring import score_effects
from hrg_cli.stages.diagnosis.fits.variants import list_variants


def named(name):
    """The case of runs with a gain mismatch in which this cause is named for it."""
    case, base = draw_found_case(), draw_mismatched_fit()
    ((score, variant),) = score_effects(base, list_variants([find(name)], base))
    final = loosen(adopt(base, score, variant))
    one = replace(case.search.found[0], variant=variant, score=score, rivals=())
    return replace(case, search=replace(case.search, final=final, found=(one,)))


def test_the_cause_that_is_there_is_chosen_again():
    again = choose_again(named("gain_mismatch"), draw_mismatched_fit)
    assert again.names == ("gain_mismatch",) and check_chosen_again(again).passed


def test_a_cause_in_the_place_of_another_is_not():
    """Five small causes in the place of one that the catalogue does not hold were "explained"; half
    as many rows showed other five, better by 70."""
    again = choose_again(named("damping_drift"), draw_mismatched_fit)
    assert again.gone == ("damping_drift",) and "gain_mismatch" in again.new
    failed = check_chosen_again(again)
    assert not failed.passed
    assert "gain_mismatch in the place of damping_drift" in failed.sentence


def test_a_rival_in_its_place_is_no_contradiction():
    case = named("damping_drift")
    (one,) = case.search.found
    search = replace(case.search, found=(one.add_rivals(["gain_mismatch"]),))
    again = choose_again(replace(case, search=search), draw_mismatched_fit)
    assert not again.gone and check_chosen_again(again).passed
