"""The mistake of one run that causes of the catalogue stood in for: asked last, of what they
explain.

A misfit of a few σ is sooner physics than a mistake, so much is asked of a mistake here: the other
runs agree without that run at the stated noise, all agree once it is undone, and it is a cheaper
account of the runs than the causes were.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ....errors import name_some
from ....fitting.causes import evidence
from ....fitting.causes.extended_fit import ExtendedFit
from ....records import Wave
from ...suspicion import Suspicion
from ..fits.scoring import compute_worth, score_effects
from ..fits.variants import Variant
from ..search.remainder import judge_adequacy, measure_smooth_part
from ..thresholds import CLEARLY, GROSS, INADEQUATE, INSTEAD_OF_CAUSES, MISTAKES_REMOVE, WORTH
from .cases import Fitted, SuspectCase, SuspectFound, fit_or_none, is_any_logged
from .common_clock import find_common_lateness
from .laws import is_one_law
from .leaks import find_leaks
from .mistakes import find_every_mistake
from .own_numbers import find_gain_of_lateness, find_largest_gain
from .rivals import add_causes_to_fit, fit_warming
from .search import (
    DOUBTED,
    choose_case,
    describe_case,
    find_cases,
    fit_without_each,
    leave_out,
)

FEWEST_RUNS = 4
"""Runs from which one is doubted: three others must agree without it."""


@dataclass(frozen=True)
class QuietMistake:
    """A mistake of one run, or a leak of several, that stands in for causes, these by name; surely:
    whether the runs would sooner have made it than show the causes, or cannot tell."""

    suspicions: tuple[Suspicion, ...]
    causes: tuple[str, ...]
    surely: bool

    def to_json(self) -> dict[str, Any]:
        """As an entry of what the runs cannot tell apart."""
        runs = name_some(one.run_id for one in self.suspicions)
        return {
            "effects": list(self.causes),
            "base": f"{runs}: {self.suspicions[0].what}, which leaves as little",
            "next_experiment": f"look at {runs}'s log, or repeat that run",
        }


def suspect_quiet_run(
    waves: Sequence[Wave],
    fitted: Fitted,
    base: ExtendedFit,
    final: ExtendedFit,
    candidates: Sequence[Variant] = (),
    *,
    failed: bool,
) -> QuietMistake | None:
    """The run that is not what it says: one mistake of it, undone, leaves the stated noise, in
    place of all causes, of one of them, or beside them.

    Parameters
    ----------
    waves
        As given, one a run.
    fitted
        The base model's fit to waves.
    base
        That of these waves, without the causes found.
    final
        With them.
    candidates
        Causes of the catalogue beside `base`, as they may stand.
    failed
        Whether the closing checks have taken the word from these, so that every mistake is tried;
        of causes that pass, mistakes that promise as much are.

    Returns
    -------
    QuietMistake or None
        None of runs that agree.

    Examples
    --------
    A rate log 50 ms late, of which no cause tells:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_swing, draw_waves, fit_waves
    >>> from hrg_cli.stages.diagnosis.suspects.quiet import suspect_quiet_run
    >>> waves = draw_waves()[0], draw_swing(late_s=0.05)
    >>> fit = fit_waves(waves)
    >>> mistake = suspect_quiet_run(waves, fit_waves, fit, fit, failed=True)
    >>> mistake.suspicions[0].run_id, mistake.suspicions[0].what, mistake.surely
    ('swing', 'rate log late', True)
    """
    if is_any_logged(waves) and not _worth_asking(base):
        return None
    if (late := _find_late_logs(waves, fitted, base, final, failed)) is not None:
        return late
    if len(waves) < FEWEST_RUNS:
        return None
    if failed and (leak := _find_leak(waves, fitted, base, final)) is not None:
        return leak
    doubtful = None
    for level in _levels(waves, fitted, base, final, candidates, failed=failed):
        if level.before is None or not (
            (failed and level.asked_of_failed) or _promises(level.before, final)
        ):
            continue
        found = _find_mistake(waves, level.fitted, level.before)
        if found is None:
            continue
        case, beside, others = found
        chosen = case.reading.parameters * float(np.log(len(case.fit.residual)))
        gained = min(_price(final), _price(level.before)) - _price(case.fit) - chosen
        if gained < -WORTH or _follows_a_law(case, level.before, others):
            continue
        before = level.before.chi2 / level.before.dof
        kept = {effect.name for effect, _ in level.before.point.active}
        mistake = QuietMistake(
            (describe_case(waves, case, beside, before),),
            tuple(e.name for e, _ in final.point.active if e.name not in kept),
            surely=gained > WORTH,
        )
        if mistake.surely:
            return mistake
        doubtful = doubtful or mistake
    return doubtful if doubtful is not None and doubtful.causes else None


def _follows_a_law(case: SuspectCase, before: ExtendedFit, others: ExtendedFit) -> bool:
    """Whether what bends one run is clearly a law of what is logged of all: a scale factor that
    goes with the temperature's square bends the coldest run most."""
    left, numbers = case.chi2 / case.dof, case.reading.parameters
    return is_one_law(before, left, numbers, WORTH, margin=CLEARLY, terms=2, others=others)


def suspect_plain_run(
    waves: Sequence[Wave], fitted: Fitted, base: ExtendedFit, candidates: Sequence[Variant]
) -> tuple[Suspicion, ...]:
    """What one run did where a number of its own promises nearly all of the misfit, and clearly
    more than any cause: told before causes are looked for, which takes long beside it.

    Parameters
    ----------
    waves
        As given, one a run.
    fitted
        The base model's fit to waves.
    base
        That of these waves.
    candidates
        Ways in which causes may stand.

    Returns
    -------
    tuple of Suspicion
        None where no number of one run stands out so, or no mistake of it leaves the noise.

    Examples
    --------
    Runs that agree:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_case, draw_fit, draw_waves, fit_waves
    >>> from hrg_cli.stages.diagnosis.suspects.quiet import suspect_plain_run
    >>> suspect_plain_run(draw_waves(), fit_waves, draw_fit(), draw_case().inquiry.candidates)
    ()
    """
    if is_any_logged(waves):
        return ()
    promised = find_largest_gain(base)
    if promised < max(INSTEAD_OF_CAUSES * (base.chi2 - base.dof), 2 * CLEARLY):
        return ()
    # a step at a run's first rows is that run's own number, spelled with more of them and an
    # instant; one that is worth as much for all of these happened within the run
    causes = (
        compute_worth(score, variant, base)
        for score, variant in score_effects(base, candidates)
        if score.visible
    )
    own = evidence.find_bic_gain(promised, 1, len(base.residual))
    if own - max(causes, default=0.0) < CLEARLY:
        return ()
    mistake = suspect_quiet_run(waves, fitted, base, base, failed=True)
    return mistake.suspicions if mistake is not None and mistake.surely else ()


def _find_leak(
    waves: Sequence[Wave], fitted: Fitted, base: ExtendedFit, final: ExtendedFit
) -> QuietMistake | None:
    """Dampings of the runs' own that leave the stated noise in place of the causes, for less, and
    are no law of what the runs' logs hold."""
    leak = find_leaks(waves, fitted, base)
    if leak is None or leak.follow_a_law:
        return None
    return _stand_in(leak, base, final)


def _find_late_logs(
    waves: Sequence[Wave], fitted: Fitted, base: ExtendedFit, final: ExtendedFit, failed: bool
) -> QuietMistake | None:
    """One lateness of all rate logs that leaves the stated noise, in place of all causes or beside
    those that are no one run's."""
    done = _excess(base) - _excess(final)
    if failed or (done > WORTH and find_gain_of_lateness(base) > INSTEAD_OF_CAUSES * done):
        late = find_common_lateness(waves, fitted, base)
        if late is not None and (mistake := _stand_in(late, base, final)) is not None:
            return mistake
    common = [(e, values) for e, values in final.point.active if not e.of_one_run]
    if not (failed and common) or is_any_logged(waves):
        return None
    beside = add_causes_to_fit(fitted, common)
    before = fit_or_none(waves, beside)
    late = None if before is None else find_common_lateness(waves, beside, before)
    return None if late is None else _stand_in(late, base, final)


def _stand_in(found: SuspectFound, base: ExtendedFit, final: ExtendedFit) -> QuietMistake | None:
    """The mistakes that leave the stated noise for less than the causes that they do without, and
    than the base model; None where they do not."""
    if not found.fit.is_adequate:
        return None
    own = found.numbers * float(np.log(len(base.residual)))
    gained = min(_price(final), _price(base)) - _price(found.fit) - own
    if gained < WORTH:
        return None
    kept = {effect.name for effect, _ in found.fit.point.active}
    causes = tuple(e.name for e, _ in final.point.active if e.name not in kept)
    return QuietMistake(found.suspicions, causes, surely=True)


def _worth_asking(driven: ExtendedFit) -> bool:
    """Whether driven runs, whose fits take long, are asked: those grossly misfitted were so before,
    and of those with none no mistake can be seen beside what the drive's log may miss."""
    return driven.chi2 / driven.dof < GROSS and not driven.is_adequate


@dataclass(frozen=True)
class _Level:
    """A model beside which a mistake is looked for: its fit of waves, and that of the runs as they
    are (None: there is none)."""

    fitted: Fitted
    before: ExtendedFit | None
    asked_of_failed: bool = True


def _levels(
    waves: Sequence[Wave],
    fitted: Fitted,
    base: ExtendedFit,
    final: ExtendedFit,
    candidates: Sequence[Variant],
    *,
    failed: bool,
) -> Iterator[_Level]:
    """The base model; then it with all but one of the causes found, and with all that are no one
    run's; and as it follows the temperature, where no cause does and where causes that pass have
    done more than that would leave of what they did: beside a thermometer that is wrong in one run,
    what all runs do at one time of theirs is the better account."""
    yield _Level(fitted, base)
    common = [(e, values) for e, values in final.point.active if not e.of_one_run]
    if is_any_logged(waves):
        return
    if len(final.point.active) > 1:
        for effect, _ in final.point.active:
            others = add_causes_to_fit(
                fitted, [pair for pair in common if pair[0].name != effect.name]
            )
            yield _Level(others, fit_or_none(waves, others), asked_of_failed=False)
    if common:
        beside_all = add_causes_to_fit(fitted, common)
        yield _Level(beside_all, fit_or_none(waves, beside_all))
    asked = failed or _excess(base) - CLEARLY - _excess(final) > WORTH
    if asked and not any(effect.scales for effect, _ in final.point.active):
        warm = fit_warming(fitted, candidates, base, 1 - CLEARLY / base.chi2)
        if warm is not None:
            yield _Level(warm, fit_or_none(waves, warm))


def _promises(before: ExtendedFit, final: ExtendedFit) -> bool:
    """Whether a number of one run's own may do what the causes did that stand in `final` alone."""
    done = _excess(before) - _excess(final)
    return done > WORTH and find_largest_gain(before) > INSTEAD_OF_CAUSES * done


def _price(fit: ExtendedFit) -> float:
    """Excess of χ², and k ln N for the k numbers fitted."""
    rows = len(fit.residual)
    return _excess(fit) + (rows - fit.dof) * float(np.log(rows))


def _excess(fit: ExtendedFit) -> float:
    """χ² over one a row: of fits whose rows differ."""
    return fit.chi2 - len(fit.residual)


def _find_mistake(
    waves: Sequence[Wave], fitted: Fitted, before: ExtendedFit
) -> tuple[SuspectCase, tuple[SuspectCase, ...], ExtendedFit] | None:
    """The mistake of one run that leaves the stated noise, those as good, and the fit of the other
    runs; None where there is none, or where a run is merely unlike the others."""
    agreeing = [pair for pair in fit_without_each(waves, [], fitted, before) if pair[1].is_adequate]
    cases = [
        case
        for run, others in agreeing[:DOUBTED]
        for case in find_cases(
            leave_out(waves, run), waves[run], run, others, fitted, find_every_mistake
        )
    ]
    if not cases:
        return None
    case, beside = choose_case(cases)
    if case.apart is not None or not _mends(case.fit, before):
        return None
    return case, beside, dict(agreeing)[case.run]


def _mends(fit: ExtendedFit, before: ExtendedFit) -> bool:
    """Whether a fit with mistakes undone leaves the stated noise, and of what is smooth in the
    residual no more than a number found to some digits may: beside a small misfit χ² alone lets a
    mistake stand that takes a quarter of it."""
    if not fit.is_adequate:
        return False
    if judge_adequacy(fit)[1] > INADEQUATE:
        return True
    power, rank = measure_smooth_part(fit)
    taken = before.chi2 - fit.chi2
    return taken > MISTAKES_REMOVE * (taken + power - rank)
