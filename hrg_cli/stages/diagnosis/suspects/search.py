"""The search for wrong runs: which run the others agree without, and which mistake, undone, lets it
agree with them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.envelopes.coordinates import COORDINATES
from ....records import Array, Wave
from ...suspicion import Suspicion
from ..base.data import is_coarse
from ..fits.scoring import is_gross
from ..fits.variants import Variant, list_variants
from ..thresholds import (
    AS_GOOD_WITHOUT,
    CLOCKS_APART,
    FREQUENCIES_APART,
    FREQUENCY_RIVAL,
    GROSS,
    MISTAKE_PRICE,
    MISTAKES_REMOVE,
    NEARLY_ALL,
    ONE_MORE_RUN,
    PHYSICS_RIVAL,
    UNLIKE_RIVAL,
)
from .cases import (
    Fitted,
    SuspectCase,
    SuspectFound,
    describe_gyro,
    fit_or_none,
    is_any_logged,
)
from .common_clock import find_common_lateness
from .leaks import find_leaks
from .logs import find_wrong_logs, has_usual_scale_factor
from .mistakes import Maker, find_every_mistake, find_mistakes
from .readings import (
    CLOCK,
    KNOCK,
    Reading,
    find_knock_mistakes,
    find_time_mistakes,
    fit_held,
    is_log_stuck,
)
from .rivals import add_causes_to_fit, fit_catalogue, fit_nearest, fit_warming
from .two_gyros import find_second_gyro
from .unlogged_rates import find_unlogged_rates

Without = tuple[int, ExtendedFit]
"""A run's number and the fit to the others."""
UNLIKE = "unlike the others"
"""A run of which no mistake is found."""
DOUBTED = 2
"""Runs whose mistakes are tried, those without which the others agree best."""
FINALISTS = 3
"""Mistakes of a run, first among quick fits, that are fitted in full."""
MOST_LEFT_OUT = 10
"""Runs left out one by one; of more, those that the base model misses most."""


def suspect_runs(
    waves: Sequence[Wave],
    fitted: Fitted,
    base: ExtendedFit,
    candidates: Sequence[Variant] = (),
) -> list[Suspicion]:
    """The runs that are not what they say they are, none where physics explains the runs as well.

    Parameters
    ----------
    waves
        As given, one a run.
    fitted
        The base model's fit to waves.
    base
        That of these waves.
    candidates
        Causes of the catalogue beside `base`, as they may stand.

    Returns
    -------
    list of Suspicion
        What the logs show on their own first.

    Examples
    --------
    Every run's rate is logged in °/s:

    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves, fit_waves
    >>> from hrg_cli.stages.diagnosis.suspects.search import suspect_runs
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import scale_rate
    >>> waves = [scale_rate(wave, 180 / np.pi) for wave in draw_waves()]
    >>> [(one.run_id, one.what) for one in suspect_runs(waves, fit_waves, fit_waves(waves))]
    [('all runs', 'rate log in °/s')]
    """
    apart = _find_runs_apart(waves, fitted, base, candidates)
    if apart is not None and not is_gross(apart.fit):
        return [*find_wrong_logs(waves, apart.fit), *apart.suspicions]
    if not base.is_adequate and (strange := _find_strange_frequencies(base, CLOCKS_APART)):
        # temperatures part frequencies so far as well, but mend nothing else of a run with them
        clocks = _strange_runs(waves, fitted, base, strange)
        if (
            clocks is not None
            and all(one.what == CLOCK for one in clocks.suspicions)
            and clocks.fit.is_adequate
        ):
            return [*find_wrong_logs(waves, clocks.fit), *clocks.suspicions]
    found = _find_blamed_runs(waves, fitted, base, candidates)
    # where much is left beside strange frequencies another run may be wrong as well
    if apart is not None and (
        found is None or apart.chi2_per_dof < ONE_MORE_RUN * found.chi2_per_dof
    ):
        found = apart
    if found is None:
        return find_wrong_logs(waves, base)
    return [*find_wrong_logs(waves, found.fit), *found.suspicions]


def _find_runs_apart(
    waves: Sequence[Wave], fitted: Fitted, base: ExtendedFit, candidates: Sequence[Variant]
) -> SuspectFound | None:
    """The runs that oscillate far beside the others; none where the catalogue explains as much: a
    frequency that follows the amplitude does so within each run too."""
    strange = _find_strange_frequencies(base, FREQUENCIES_APART)
    found = _strange_runs(waves, fitted, base, strange) if strange else None
    if (
        found is None
        or fit_catalogue(base, candidates, 1.0) <= found.chi2_per_dof / FREQUENCY_RIVAL
    ):
        return None
    return found


def _find_blamed_runs(
    waves: Sequence[Wave], fitted: Fitted, base: ExtendedFit, candidates: Sequence[Variant]
) -> SuspectFound | None:
    """The runs to blame for a gross misfit; None where physics explains it as well."""
    if (
        base.chi2 / base.dof < GROSS
        or (physics := fit_catalogue(base, candidates, PHYSICS_RIVAL)) < PHYSICS_RIVAL
    ):
        return None
    found = (
        find_unlogged_rates(waves, fitted, base)
        or find_common_lateness(waves, fitted, base)
        or find_second_gyro(waves, fitted, base)
    )
    if found is None or found.chi2_per_dof > PHYSICS_RIVAL:
        own = _find_mistakes_of_runs(waves, fitted, base, candidates)
        found = min(filter(None, (found, own)), key=lambda f: f.chi2_per_dof, default=None)
    if found is None or found.follow_a_law or _is_cleared(found, base, candidates, physics):
        return None
    return found


def _find_mistakes_of_runs(
    waves: Sequence[Wave], fitted: Fitted, base: ExtendedFit, candidates: Sequence[Variant]
) -> SuspectFound | None:
    """The runs without which the others agree, as they are or beside what else they show, or whose
    dampings do not."""
    without = fit_without_each(waves, [], fitted, base) if len(waves) > 1 else []
    cold = _wrong_runs(waves, fitted, base, find_mistakes, without) or find_leaks(
        waves, fitted, base
    )
    if cold is not None and (cold.chi2_per_dof < PHYSICS_RIVAL or _is_sure(cold, base)):
        return cold
    beside = fit_warming(fitted, candidates, base) or _fit_beside_causes(
        without, fitted, base, candidates
    )
    level = None if beside is None else fit_or_none(waves, beside)
    if beside is None or level is None:
        return cold
    found = _wrong_runs(waves, beside, level, find_every_mistake)
    if cold is None or (
        found is not None and found.chi2_per_dof * ONE_MORE_RUN < cold.chi2_per_dof
    ):
        return found
    return cold


def _is_sure(found: SuspectFound, base: ExtendedFit) -> bool:
    """Whether mistakes without a free number, which what else the runs show could bend, explain all
    but a hundredth of the misfit."""
    left, before = found.chi2_per_dof, base.chi2 / base.dof
    return not found.numbers and left - 1 < (1 - MISTAKES_REMOVE) ** 2 * (before - 1)


def _fit_beside_causes(
    without: Sequence[Without], fitted: Fitted, base: ExtendedFit, candidates: Sequence[Variant]
) -> Fitted | None:
    """The fit with the few causes that the others show without the run that is doubted most; None
    where they agree without one, or show none. `without`: the fits without each run.

    A wrong run hides what else the runs show, and without that the others do not agree. Of causes
    that go with the phase none is asked: a run whose sign is not yet found would be the wrong one.
    """
    if not without or not is_gross(without[0][1]):
        return None
    others = without[0][1]
    if others.chi2 / others.dof > base.chi2 / base.dof / ONE_MORE_RUN:
        return None
    effects = list(dict.fromkeys(one.effect for one in candidates if not one.effect.coherent))
    nearest = fit_nearest(others, list_variants(effects, others), PHYSICS_RIVAL)
    causes = [(effect, nearest.values(effect.name)) for effect, _ in nearest.point.active]
    return add_causes_to_fit(fitted, causes) if causes else None


def _is_cleared(
    found: SuspectFound, base: ExtendedFit, candidates: Sequence[Variant], physics: float
) -> bool:
    """Whether the runs are not shown to be wrong: the catalogue leaves hardly more, `physics`, than
    the mistakes undone.

    A run of which no mistake is found, merely left out, is blamed on harder terms: what nobody
    understands bends one run more than the others.
    """
    left = found.chi2_per_dof
    if all(one.what != UNLIKE for one in found.suspicions):
        return physics < PHYSICS_RIVAL * max(1.0, left)
    if physics < UNLIKE_RIVAL * max(1.0, left):
        return True
    if left < GROSS or base.chi2 / base.dof > NEARLY_ALL * left:
        return False
    # a gross misfit stays: the catalogue has to explain what is left, as it would of a sound lot
    effects = list(dict.fromkeys(one.effect for one in candidates))
    return fit_catalogue(found.fit, list_variants(effects, found.fit), PHYSICS_RIVAL) > GROSS


def _find_strange_frequencies(fit: ExtendedFit, apart: float) -> list[int]:
    """The runs that oscillate beside what most of them do, by that part; none where no two are far
    apart, or no more than half are together: then no run tells which of the others is wrong."""
    hz = np.asarray(fit.frequency_hz, float)
    near = np.abs(hz[:, None] / hz - 1) < apart
    most = near[int(np.argmax(near.sum(axis=1)))]
    if 2 * most.sum() <= len(hz):
        return []
    return [int(k) for k in np.flatnonzero(~most)]


def _find_any_clock(wave: Wave, others: ExtendedFit) -> Iterator[Reading]:
    """The mistake of a run's clock, of any size that its frequency shows."""
    return find_time_mistakes(wave, others, CLOCKS_APART)


def _strange_runs(
    waves: Sequence[Wave], fitted: Fitted, base: ExtendedFit, strange: Sequence[int]
) -> SuspectFound | None:
    """The mistake of every run that oscillates beside the others; None where the others alone find
    no fit."""
    before = base.chi2 / base.dof
    pieces: list[tuple[Wave, ...]] = [
        () if k in strange else (wave,) for k, wave in enumerate(waves)
    ]
    others = fit_or_none(_flat(pieces), fitted)
    if others is None:
        return None
    told, fit, numbers = [], others, 0
    for run in strange:
        cases = find_cases(pieces, waves[run], run, others, fitted, _find_any_clock)
        if not cases:
            return None
        case, beside = choose_case(cases)
        told.append(describe_case(waves, case, beside, before))
        fit, numbers = case.fit, numbers + case.reading.parameters
    return SuspectFound(tuple(told), numbers, base, fit, fit.chi2 / fit.dof)


def _wrong_runs(
    waves: Sequence[Wave],
    fitted: Fitted,
    level: ExtendedFit,
    makers: Maker,
    without: Sequence[Without] = (),
) -> SuspectFound | None:
    """Fewer than half of the runs without which the others agree, and the mistake of each; None
    where there are none such. `without`: the fits without each run, where they are made."""
    before = level.chi2 / level.dof
    if before < GROSS:
        return None
    wrong, doubted = _find_culprits(waves, fitted, level, without)
    if not wrong:
        return None
    pieces: list[tuple[Wave, ...]] = [() if k in wrong else (wave,) for k, wave in enumerate(waves)]
    last: SuspectCase | None = None
    chosen = []
    for number, run in enumerate(wrong):
        if number + 1 == len(wrong) == 1:
            cases = [
                case
                for k, others in doubted
                for case in find_cases(leave_out(waves, k), waves[k], k, others, fitted, makers)
            ]
        else:
            others = fit_or_none(_flat(pieces), fitted)
            cases = (
                []
                if others is None
                else find_cases(pieces, waves[run], run, others, fitted, makers)
            )
        if not cases:
            return None
        last, beside = choose_case(cases)
        chosen.append((last, beside))
        if last.apart is None:
            pieces[last.run] = last.reading.pieces
    if last is None or last.chi2 / last.dof - 1 > (1 - MISTAKES_REMOVE) * (before - 1):
        return None
    # what rounding to few codes leaves of a run a number of its own takes too, but not all of it
    coarse = {k for k, wave in enumerate(waves) if is_coarse(wave)}
    if is_gross(last.fit) and coarse & {case.run for case, _ in chosen}:
        return None
    told = tuple(describe_case(waves, case, beside, before) for case, beside in chosen)
    numbers = sum(case.reading.parameters for case, _ in chosen)
    return SuspectFound(told, numbers, level, last.fit, last.chi2 / last.dof)


def choose_case(cases: Sequence[SuspectCase]) -> tuple[SuspectCase, tuple[SuspectCase, ...]]:
    """The reading that explains most for what it costs, and those that explain as much.

    Of as many numbers first the one with the temperature nearest to the other runs'.

    Parameters
    ----------
    cases
        Mistakes of runs, each with its fit.

    Returns
    -------
    tuple
        The first, and those beside it.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves, draw_wrong_waves, fit_waves
    >>> from hrg_cli.stages.diagnosis.suspects.readings import find_rate_mistakes
    >>> from hrg_cli.stages.diagnosis.suspects.search import choose_case, find_cases, leave_out
    >>> waves, others = draw_wrong_waves(), fit_waves(draw_waves()[:2])
    >>> made = leave_out(waves, 2), waves[2], 2, others, fit_waves, find_rate_mistakes
    >>> first, beside = choose_case(find_cases(*made))
    >>> first.reading.what, [case.reading.what for case in beside]
    ('rate log of wrong sign', ['rate log of wrong scale'])
    """
    noise = max(1.0, min(case.chi2 / case.dof for case in cases))
    ranked = sorted(
        cases,
        key=lambda case: case.compute_price(noise) + MISTAKE_PRICE * case.reading.parameters,
    )
    if noise > GROSS:
        ranked = _put_simpler_first(ranked)
    limit = ranked[0].compute_price(noise) + MISTAKE_PRICE
    alike = [c for c in ranked if c is ranked[0] or c.compute_price(noise) < limit]

    def name_rivals(case: SuspectCase) -> tuple[int, int, bool]:
        reading = case.reading
        return case.run, reading.parameters, bool(np.isfinite(reading.degc_apart))

    as_simple = [c for c in alike if name_rivals(c) == name_rivals(ranked[0])]
    first = min(as_simple, key=lambda case: case.reading.degc_apart)
    return first, tuple(c for c in alike if c is not first)


def _put_simpler_first(ranked: Sequence[SuspectCase]) -> list[SuspectCase]:
    """A reading with fewer numbers that leaves hardly more before the first: beside a gross misfit
    a number takes up what others cause, by which an inversion is a lateness of nearly half a
    period."""
    first = ranked[0]
    simpler = [
        case
        for case in ranked
        if case.run == first.run
        and case.reading.parameters < first.reading.parameters
        and case.chi2 / case.dof < ONE_MORE_RUN * first.chi2 / first.dof
    ]
    chosen = min(simpler, key=lambda case: case.reading.parameters, default=first)
    return [chosen, *(case for case in ranked if case is not chosen)]


def _find_culprits(
    waves: Sequence[Wave], fitted: Fitted, level: ExtendedFit, without: Sequence[Without] = ()
) -> tuple[list[int], list[Without]]:
    """Runs left out one after another until the others agree, and the fits without each run that is
    doubted as much as the first."""
    if len(waves) == 1:
        return [0], [(0, level)]
    before, left_out = level.chi2 / level.dof, list[int]()
    doubted: list[Without] = []
    while len(left_out) < max(1, (len(waves) - 1) // 2):
        if left_out or not without:
            without = fit_without_each(waves, left_out, fitted, level)
        if not without:
            return [], []
        best = without[0][1].chi2 / without[0][1].dof
        if not left_out:
            doubted = [
                pair
                for pair in without
                if pair[1].chi2 / pair[1].dof < AS_GOOD_WITHOUT * max(1.0, best)
            ][:DOUBTED]
        if best > level.chi2 / level.dof / ONE_MORE_RUN:
            return [], []
        left_out.append(without[0][0])
        level = without[0][1]
        if best - 1 < (1 - MISTAKES_REMOVE) * (before - 1) and (
            best < AS_GOOD_WITHOUT or best - 1 < (1 - MISTAKES_REMOVE) ** 2 * (before - 1)
        ):
            return left_out, doubted
    return [], []


def find_cases(
    pieces: Sequence[tuple[Wave, ...]],
    wave: Wave,
    run: int,
    others: ExtendedFit,
    fitted: Fitted,
    makers: Maker,
) -> list[SuspectCase]:
    """Every mistake of one run beside the pieces of the others; last that it is none of theirs,
    where its scale factor is a gyro's.

    Parameters
    ----------
    pieces
        Of every run, none of the doubted one.
    wave
        Of the run that is doubted.
    run
        Its number.
    others
        The fit to the others' pieces.
    fitted
        The base model's fit to waves.
    makers
        The mistakes that are tried.

    Returns
    -------
    list of SuspectCase
        Each with the fit that it leaves; where any leaves no gross misfit, those alone.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves, draw_wrong_waves, fit_waves
    >>> from hrg_cli.stages.diagnosis.suspects.readings import find_rate_mistakes
    >>> from hrg_cli.stages.diagnosis.suspects.search import find_cases, leave_out
    >>> waves, others = draw_wrong_waves(), fit_waves(draw_waves()[:2])
    >>> made = leave_out(waves, 2), waves[2], 2, others, fit_waves, find_rate_mistakes
    >>> [(case.reading.what, bool(case.chi2 / case.dof < 1.5)) for case in find_cases(*made)][:2]
    [('rate log of wrong sign', True), ('rate log of wrong scale', True)]
    """
    alone = len(_flat(pieces)) == 0
    made = find_knock_mistakes(wave) if alone else makers(wave, others)
    out = _read(pieces, run, list(made), fitted)
    apart = None if alone else _fit_apart(wave, others, fitted)
    # no gyro has a scale factor of the other sign: with one of its own the run is read otherwise
    if apart is not None and (not out or has_usual_scale_factor(apart)):
        own = apart.chi2 / apart.dof < AS_GOOD_WITHOUT * max(1.0, others.chi2 / others.dof)
        figures = (
            f"alone it shows {describe_gyro(apart)}, the others {describe_gyro(others)}: with all"
            " of that its own"
        )
        what = "another gyro" if own else UNLIKE
        todo = (
            "diagnose this run apart; look whose it is"
            if own
            else "look at its samples, or leave the run out"
        )
        out.append(SuspectCase(run, Reading(what, (wave,), 6, figures, todo), others, apart))
        if is_gross(apart) and is_log_stuck(wave, _flat(pieces)):
            out.append(SuspectCase(run, _read_stuck_log(wave, apart), others))
    # a mistake that, undone, leaves the run as far from the others is not the one
    return [case for case in out if case.chi2 < GROSS * case.dof] or out


def _read_stuck_log(wave: Wave, apart: ExtendedFit) -> Reading:
    """The run left out for a log that holds one value while its wave turned otherwise."""
    rate = float(np.nanmedian(np.asarray(wave.rate_rad_s, float)))
    return Reading(
        "rate log stuck",
        (),
        KNOCK,
        f"its log holds {rate:.4g} rad/s throughout, the others' change, and alone it turns as at"
        f" no constant rate (χ² per degree of freedom {apart.chi2 / apart.dof:.3g}): without it",
        "import the run with the rate of the table",
    )


def _fit_apart(wave: Wave, others: ExtendedFit, fitted: Fitted) -> ExtendedFit | None:
    """The run alone, beside the others' causes: from where the others stand, or, of a gyro that is
    too far from them for that, from where it stands itself."""
    near = fit_or_none(
        [wave], lambda own: fit_held(own, others, COORDINATES[:-1], causes_free=True)
    )
    if near is not None and not is_gross(near):
        return near
    own = fit_or_none([wave], fitted, quick=is_any_logged([wave]))
    both = [fit for fit in (near, own) if fit is not None]
    return min(both, key=lambda fit: fit.chi2 / fit.dof, default=None)


def _read(
    pieces: Sequence[tuple[Wave, ...]], run: int, made: Sequence[Reading], fitted: Fitted
) -> list[SuspectCase]:
    """A run's mistakes fitted in its place, of many those alone that come first when fitted
    quickly."""

    def fit_all(made: Sequence[Reading], quick: bool) -> list[SuspectCase]:
        out = []
        for reading in made:
            waves = [*_flat(pieces[:run]), *reading.pieces, *_flat(pieces[run + 1 :])]
            fit = fit_or_none(waves, fitted, quick)
            if fit is not None:
                out.append(SuspectCase(run, reading, fit))
        return out

    if len(made) > FINALISTS:
        quickly = fit_all(made, quick=True)
        noise = max(1.0, min((case.chi2 / case.dof for case in quickly), default=1.0))
        ranked = sorted(quickly, key=lambda case: case.compute_price(noise))
        made = [case.reading for case in ranked[:FINALISTS]]
    return fit_all(made, quick=False)


def fit_without_each(
    waves: Sequence[Wave], left_out: Sequence[int], fitted: Fitted, level: ExtendedFit
) -> list[Without]:
    """The fits without each of the runs beside those left out already, that which leaves the others
    agreeing best first.

    Of driven runs those alone that come first when fitted quickly.

    Parameters
    ----------
    waves
        As given, one a run.
    left_out
        Numbers of the runs that are out already.
    fitted
        The base model's fit to waves.
    level
        The fit to those that are in.

    Returns
    -------
    list of tuple
        The number of the run left out, and the fit to the others.

    Examples
    --------
    Without either of the runs that turn the others agree:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_wrong_waves, fit_waves
    >>> from hrg_cli.stages.diagnosis.suspects.search import fit_without_each
    >>> waves = draw_wrong_waves()
    >>> without = fit_without_each(waves, [], fit_waves, fit_waves(waves))
    >>> [(run, bool(fit.chi2 / fit.dof < 1.5)) for run, fit in without]
    [(1, True), (2, True), (0, False)]
    """
    there = [k for k in range(len(waves)) if k not in left_out]
    missed = dict(zip(there, _misfits(level), strict=True))

    def fit_all(runs: Sequence[int], quick: bool) -> list[Without]:
        fits = [(k, fit_or_none([waves[j] for j in there if j != k], fitted, quick)) for k in runs]
        found = [(k, fit) for k, fit in fits if fit is not None]
        return sorted(found, key=lambda pair: pair[1].chi2 / pair[1].dof)

    runs = sorted(there, key=lambda k: -missed[k])[:MOST_LEFT_OUT]
    if len(runs) > DOUBTED and is_any_logged(waves):
        runs = [k for k, _ in fit_all(runs, quick=True)[:DOUBTED]]
    return fit_all(runs, quick=False)


def leave_out(waves: Sequence[Wave], run: int) -> list[tuple[Wave, ...]]:
    """The pieces of all runs but one, which has none.

    Parameters
    ----------
    waves
        As given, one a run.
    run
        The number of the one.

    Returns
    -------
    list of tuple of Wave
        One of each run.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.search import leave_out
    >>> [len(pieces) for pieces in leave_out(draw_waves(), 1)]
    [1, 0, 1]
    """
    return [() if k == run else (wave,) for k, wave in enumerate(waves)]


def _misfits(fit: ExtendedFit) -> Array:
    """Mean squared residual of every run."""
    runs = len(fit.series.names)
    return np.bincount(fit.rows[:, 0], fit.residual**2, runs) / np.maximum(
        np.bincount(fit.rows[:, 0], minlength=runs), 1
    )


def _flat(pieces: Sequence[tuple[Wave, ...]]) -> list[Wave]:
    return [wave for run in pieces for wave in run]


def describe_case(
    waves: Sequence[Wave], case: SuspectCase, beside: Sequence[SuspectCase], before: float
) -> Suspicion:
    """The case in words, with the runs and mistakes that explain as much.

    Parameters
    ----------
    waves
        As given, one a run.
    case
        The mistake chosen.
    beside
        Those that explain as much.
    before
        χ² per degree of freedom of the runs as they are.

    Returns
    -------
    Suspicion
        Of the run.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves, draw_wrong_waves, fit_waves
    >>> from hrg_cli.stages.diagnosis.suspects.readings import find_rate_mistakes
    >>> from hrg_cli.stages.diagnosis.suspects.search import describe_case, find_cases, leave_out
    >>> waves, others = draw_wrong_waves(), fit_waves(draw_waves()[:2])
    >>> made = leave_out(waves, 2), waves[2], 2, others, fit_waves, find_rate_mistakes
    >>> described = describe_case(waves, find_cases(*made)[0], (), before=28288.0)
    >>> described.run_id, described.evidence[-53:]
    ('third', 'χ² per degree of freedom falls from 2.83e+04 to 0.955')
    """
    evidence = (
        f"{case.reading.found} χ² per degree of freedom falls from {before:.3g} to"
        f" {case.chi2 / case.dof:.3g}"
    )
    alike = [
        f"{waves[c.run].run_id}: {c.reading.what}"
        for c in beside
        if (c.run, c.reading.what) != (case.run, case.reading.what)
    ]
    if alike:
        evidence += f"; as well explained by {', '.join(dict.fromkeys(alike))}"
    if any(c.run != case.run for c in beside) or (
        len(waves) == 2 and case.reading.parameters < KNOCK
    ):
        evidence += "; which of the runs is wrong these runs cannot tell"
    return Suspicion(waves[case.run].run_id, case.reading.what, evidence, case.reading.correction)
