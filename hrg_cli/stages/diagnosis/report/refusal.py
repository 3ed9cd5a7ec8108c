"""Diagnosis, the record where no cause may be named: a run is not what it says, or the search led
nowhere."""

from __future__ import annotations

from collections.abc import Sequence

from ....effects.effect import Effect
from ....fitting import checks
from ....fitting.causes.extended_fit import ExtendedFit
from ....records import Diagnosis, Resonator, Wave
from ..closing.sized import Sized
from ..fits.scoring import score_effects
from ..fits.variants import list_variants
from ..search.gain import predict_held_out
from ..search.inquiry import Inquiry
from ..search.search_case import Case
from ..search.selection import Search
from ..suspects import Suspicion
from .record import make_diagnosis_record
from .report import describe_in_words
from .report import report as report_of


def refuse(
    waves: Sequence[Wave],
    base: ExtendedFit,
    searched: Sequence[Effect],
    suspicions: Sequence[Suspicion],
    resonator: Resonator | None,
) -> Diagnosis:
    """The diagnosis of runs of which some are not what they say: these are named, and no physics is
    blamed.

    Parameters
    ----------
    waves
        Of the runs.
    base
        The base model's fit.
    searched
        Effects that would have been looked for.
    suspicions
        Of the runs.
    resonator
        The user's; None: there is none.

    Returns
    -------
    Diagnosis
        Refused.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves
    >>> from hrg_cli.stages.diagnosis.report.refusal import refuse
    >>> from hrg_cli.stages.suspicion import Suspicion
    >>> told = Suspicion("run 2", "channels exchanged", "it leans the other way", "exchange them")
    >>> refused = refuse(draw_waves(), draw_fit(), (), [told], None)
    >>> refused.status, refused.verdict
    ('refused', 'unexplained')
    """
    sentences = [one.sentence for one in suspicions]
    closing = checks.check_holds("runs_are_what_they_say", False, "; ".join(sentences))
    record = _unexplained(waves, base, searched, resonator, closing, suspicions)
    return record.judged(sentences, "refused")


def stop_search(
    waves: Sequence[Wave],
    base: ExtendedFit,
    searched: Sequence[Effect],
    resonator: Resonator | None,
    spent: str,
) -> Diagnosis:
    """The diagnosis of runs whose search was stopped: no cause that it had come to is named.

    Parameters
    ----------
    waves
        Of the runs.
    base
        The base model's fit.
    searched
        Effects that were looked for.
    resonator
        The user's; None: there is none.
    spent
        What was spent, as the beginning of a sentence.

    Returns
    -------
    Diagnosis
        Unexplained.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves
    >>> from hrg_cli.stages.diagnosis.report.refusal import stop_search
    >>> stopped = stop_search(draw_waves(), draw_fit(), (), None, "90 s were spent")
    >>> stopped.status_reasons[0].split(";")[0]
    'the verdict is "unexplained": 90 s were spent'
    """
    sentence = (
        f"{spent}; the base model leaves χ² {base.chi2 / base.dof:.3g} per degree of freedom and no"
        " cause settles beside it: look for jumps and damaged rows in the waves, and diagnose the"
        " runs one by one"
    )
    closing = checks.check_holds("search_finished", False, sentence)
    record = _unexplained(waves, base, searched, resonator, closing, ())
    return record.judged([f'the verdict is "unexplained": {sentence}'])


def _unexplained(
    waves: Sequence[Wave],
    base: ExtendedFit,
    searched: Sequence[Effect],
    resonator: Resonator | None,
    closing: checks.Check,
    suspicions: Sequence[Suspicion],
) -> Diagnosis:
    """The record of a diagnosis that names no cause, with the check that took the word away."""
    candidates = list_variants(searched, base)
    scores = tuple(s for s, _ in score_effects(base, candidates))
    search = Search(base, base, (), scores, scores)
    case = Case(Inquiry(tuple(candidates), 0), search)
    origin = list(range(len(waves)))
    gain = predict_held_out(base, base, origin, origin)
    report = report_of("unexplained", case, Sized.from_case(case), gain, resonator, base)
    report |= {
        "lines": [],
        "frequencies": {},
        "wander": [],
        "forecast": None,
        "checks": [closing.to_json()],
        "written_model": None,
        "suspect_runs": [one.to_json() for one in suspicions],
        "stability": [],
        "scores": None,
        "remainder": describe_in_words(closing.sentence),
    }
    return make_diagnosis_record(search, waves, "unexplained", report, "")
