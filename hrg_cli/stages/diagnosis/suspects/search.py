"""The search for wrong runs: which run the others agree without, and which mistake, undone, lets it
agree with them."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ....errors import HrgError
from ....fitting.causes import extended_fit
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.envelopes.coordinates import COORDINATES, FREQUENCY_SPLIT
from ....records import Array, Wave
from ..thresholds import GROSS
from ..variants import Variant
from .laws import is_one_law
from .logs import usual_scale_factor, wrong_logs
from .readings import DAMPING, KNOCK, Maker, Reading, fit_held, of_a_knock, own_damping, readings
from .rivals import fit_catalogue, fit_warming
from .suspicion import Suspicion
from .thermometers import of_the_thermometer
from .transformations import undo_damping

Fitted = Callable[[Sequence[Wave]], ExtendedFit]

ODD = 1e3
"""Δχ² by which mistakes that leave a usual scale factor go before those that do not."""
REMOVED = 0.9
"""Part of the excess of χ² that the mistakes undone must remove together."""
STEP = 1.4
"""Times by which χ² must fall for one more run to be doubted."""
PRICE = 20.0
"""Δ(χ² + k ln N), at the noise that is left, by which a mistake with more freedom must beat one
with less."""
RIVAL = 3.0
"""χ² a degree of freedom that causes of the catalogue may leave over that of the best mistake: then
no run is blamed."""
CLEAR = 3.0
"""Times χ² a degree of freedom of the best runs without one, up to which leaving out another is as
good."""
DOUBTED = 2
"""Runs whose mistakes are tried, those without which the others agree best."""
LEAK_ROUNDS = 3
"""Dampings of the runs and the rest of the model, in turn."""
MOST_LEFT_OUT = 10
"""Runs left out one by one; of more, those that the base model misses most."""


@dataclass(frozen=True)
class SuspectCase:
    """One reading of one run with the fit it leaves."""

    run: int
    reading: Reading
    fit: ExtendedFit
    apart: ExtendedFit | None = None
    """The fit of the run alone, where it is none of the others'."""

    @property
    def chi2(self) -> float:
        """Of all runs."""
        return self.fit.chi2 + (self.apart.chi2 if self.apart else 0.0)

    @property
    def dof(self) -> int:
        """Of all runs."""
        return self.fit.dof + (self.apart.dof if self.apart else 0)

    def price(self, noise: float) -> float:
        """χ² at a noise, what its freedom costs, and a scale factor that no resonator has."""
        rows = len(self.fit.residual)
        odd = 0.0 if usual_scale_factor(self.fit) else ODD
        return self.chi2 / noise + self.reading.parameters * float(np.log(rows)) + odd


def suspect_runs(
    waves: Sequence[Wave],
    fitted: Fitted,
    base: ExtendedFit,
    candidates: Sequence[Variant] = (),
    *,
    gross: float = GROSS,
) -> list[Suspicion]:
    """The runs that are not what they say they are, none where physics explains the runs as well.

    waves: as given, one a run; fitted: the base model's fit to waves; base: that of these;
    candidates: the catalogue beside `base`.
    """
    if base.chi2 / base.dof < gross or (physics := fit_catalogue(base, candidates, RIVAL)) < RIVAL:
        return wrong_logs(waves, base)
    warm = fit_warming(fitted, candidates, base)
    found = (
        _wrong_runs(waves, fitted, base, readings)
        or _find_leaks(waves, fitted, base)
        or (_wrong_runs(waves, warm, warm(waves), of_the_thermometer) if warm is not None else None)
    )
    if found is None or physics < RIVAL * max(1.0, found.chi2_per_dof) or found.follow_a_law:
        return wrong_logs(waves, base)
    return [*wrong_logs(waves, found.fit), *found.suspicions]


@dataclass(frozen=True)
class SuspectFound:
    """What explains the runs: the suspicions, the numbers free in them, the fit before and the fit
    once they are undone, and what that leaves."""

    suspicions: tuple[Suspicion, ...]
    numbers: int
    before: ExtendedFit
    fit: ExtendedFit
    chi2_per_dof: float

    @property
    def follow_a_law(self) -> bool:
        """Whether the mistakes of several runs are one law of what is logged of these."""
        return len(self.suspicions) > 1 and is_one_law(
            self.before, self.chi2_per_dof, self.numbers, PRICE
        )


def _wrong_runs(
    waves: Sequence[Wave], fitted: Fitted, level: ExtendedFit, makers: Maker
) -> SuspectFound | None:
    """Fewer than half of the runs without which the others agree, and the mistake of each; None
    where there are none such."""
    before = level.chi2 / level.dof
    if before < GROSS:
        return None
    wrong, without = _find_culprits(waves, fitted, level)
    if not wrong:
        return None
    pieces: list[tuple[Wave, ...]] = [() if k in wrong else (wave,) for k, wave in enumerate(waves)]
    last: SuspectCase | None = None
    chosen = []
    for number, run in enumerate(wrong):
        if number + 1 == len(wrong) == 1:
            cases = [
                case
                for k, others in without
                for case in _cases(_fit_without(waves, k), waves[k], k, others, fitted, makers)
            ]
        else:
            others = _fit(_flat(pieces), fitted)
            cases = (
                [] if others is None else _cases(pieces, waves[run], run, others, fitted, makers)
            )
        if not cases:
            return None
        noise = max(1.0, min(case.chi2 / case.dof for case in cases))
        ranked = sorted(cases, key=lambda case: case.price(noise) + PRICE * case.reading.parameters)
        last = ranked[0]
        chosen.append(
            (last, tuple(c for c in ranked[1:] if c.price(noise) < last.price(noise) + PRICE))
        )
        if last.apart is None:
            pieces[last.run] = last.reading.pieces
    if last is None or last.chi2 / last.dof - 1 > (1 - REMOVED) * (before - 1):
        return None
    told = tuple(_describe_case(waves, case, beside, before) for case, beside in chosen)
    numbers = sum(case.reading.parameters for case, _ in chosen)
    return SuspectFound(told, numbers, level, last.fit, last.chi2 / last.dof)


def _find_culprits(
    waves: Sequence[Wave], fitted: Fitted, level: ExtendedFit
) -> tuple[list[int], list[tuple[int, ExtendedFit]]]:
    """Runs left out one after another until the others agree, and the fits without each run that is
    doubted as much as the first."""
    if len(waves) == 1:
        return [0], [(0, level)]
    before, left_out = level.chi2 / level.dof, list[int]()
    doubted: list[tuple[int, ExtendedFit]] = []
    while len(left_out) < max(1, (len(waves) - 1) // 2):
        without = _without_each(waves, left_out, fitted, level)
        if not without:
            return [], []
        best = without[0][1].chi2 / without[0][1].dof
        if not left_out:
            doubted = [
                pair for pair in without if pair[1].chi2 / pair[1].dof < CLEAR * max(1.0, best)
            ][:DOUBTED]
        if best > level.chi2 / level.dof / STEP:
            return [], []
        left_out.append(without[0][0])
        level = without[0][1]
        if best - 1 < (1 - REMOVED) * (before - 1) and (
            best < CLEAR or best - 1 < (1 - REMOVED) ** 2 * (before - 1)
        ):
            return left_out, doubted
    return [], []


def _cases(
    pieces: Sequence[tuple[Wave, ...]],
    wave: Wave,
    run: int,
    others: ExtendedFit,
    fitted: Fitted,
    makers: Maker,
) -> list[SuspectCase]:
    """Every mistake of one run beside the pieces of the others; last that it is none of theirs."""
    alone = len(_flat(pieces)) == 0
    out = list(_read(pieces, run, of_a_knock(wave) if alone else makers(wave, others), fitted))
    apart = None if alone else _fit([wave], lambda own: fit_held(own, others, COORDINATES[:-1]))
    if apart is not None:
        own = apart.chi2 / apart.dof < CLEAR * max(1.0, others.chi2 / others.dof)
        figures = (
            f"alone it shows {_figures(apart)}, the others {_figures(others)}: with all of that"
            " its own"
        )
        what = "another gyro" if own else "unlike the others"
        todo = (
            "diagnose this run apart; look whose it is"
            if own
            else "look at its samples, or leave the run out"
        )
        out.append(SuspectCase(run, Reading(what, (wave,), 6, figures, todo), others, apart))
    return out


def _find_leaks(waves: Sequence[Wave], fitted: Fitted, base: ExtendedFit) -> SuspectFound | None:
    """Dampings that differ from run to run and nothing else: gas. The runs with more damping than
    those of the least are named."""
    if len(waves) < 3 or any(wave.mode != "free" for wave in waves):
        return None
    fit, undone, less = base, list(waves), np.zeros(len(waves))
    for _ in range(LEAK_ROUNDS):
        dampings = [own_damping(wave, fit) for wave in undone]
        if any(one is None for one in dampings):
            return None
        less += np.array([one[0] - fit.coordinate(DAMPING) for one in dampings if one is not None])
        undone = [undo_damping(wave, d) for wave, d in zip(waves, less, strict=True)]
        again = _fit(undone, fitted)
        if again is None or again.chi2 > fit.chi2:
            return None
        fit = again
    before, after = base.chi2 / base.dof, fit.chi2 / fit.dof
    order = np.argsort(less)
    gaps = np.diff(less[order])
    high = order[int(np.argmax(gaps)) + 1 :]
    if after - 1 > (1 - REMOVED) * (before - 1) or gaps.max() < 0.5 * np.ptp(less):
        return None
    common = fit.coordinate(DAMPING) + float(less[order[0]])
    told = tuple(
        Suspicion(
            waves[k].run_id,
            "loss of pressure",
            f"its damping is {fit.coordinate(DAMPING) + less[k]:.5g} 1/s, the least of the runs"
            f" {common:.5g}: with a damping of its own in every run χ² a degree of freedom falls"
            f" from {before:.3g} to {after:.3g}",
            "check the vacuum between the runs: gas damping; calibrate these runs apart",
        )
        for k in sorted(high)
    )
    return SuspectFound(told, len(waves) - 1, base, fit, after)


def _read(
    pieces: Sequence[tuple[Wave, ...]], run: int, made: Iterator[Reading], fitted: Fitted
) -> Iterator[SuspectCase]:
    for reading in made:
        fit = _fit([*_flat(pieces[:run]), *reading.pieces, *_flat(pieces[run + 1 :])], fitted)
        if fit is not None:
            yield SuspectCase(run, reading, fit)


def _without_each(
    waves: Sequence[Wave], left_out: Sequence[int], fitted: Fitted, level: ExtendedFit
) -> list[tuple[int, ExtendedFit]]:
    """The fits without each of the runs beside those left out already, that which leaves the others
    agreeing best first."""
    there = [k for k in range(len(waves)) if k not in left_out]
    missed = dict(zip(there, _misfits(level), strict=True))
    out = []
    for run in sorted(there, key=lambda k: -missed[k])[:MOST_LEFT_OUT]:
        fit = _fit([waves[k] for k in there if k != run], fitted)
        if fit is not None:
            out.append((run, fit))
    return sorted(out, key=lambda pair: pair[1].chi2 / pair[1].dof)


def _fit_without(waves: Sequence[Wave], run: int) -> list[tuple[Wave, ...]]:
    return [() if k == run else (wave,) for k, wave in enumerate(waves)]


def _misfits(fit: ExtendedFit) -> Array:
    """Mean squared residual of every run."""
    runs = len(fit.series.names)
    return np.bincount(fit.rows[:, 0], fit.residual**2, runs) / np.maximum(
        np.bincount(fit.rows[:, 0], minlength=runs), 1
    )


def _flat(pieces: Sequence[tuple[Wave, ...]]) -> list[Wave]:
    return [wave for run in pieces for wave in run]


def _fit(waves: Sequence[Wave], fitted: Fitted) -> ExtendedFit | None:
    with contextlib.suppress(extended_fit.DivergedError, HrgError, np.linalg.LinAlgError):
        fit = fitted(waves)
        if np.isfinite(fit.chi2):
            return fit
    return None


def _figures(fit: ExtendedFit) -> str:
    damping, split = fit.coordinate(DAMPING), float(np.hypot(*fit.point.p[FREQUENCY_SPLIT]))
    return (
        f"{fit.frequency_hz.mean():.6g} Hz, damping {damping:.4g} 1/s, frequency split {split:.4g}"
        " rad/s"
    )


def _describe_case(
    waves: Sequence[Wave], case: SuspectCase, beside: Sequence[SuspectCase], before: float
) -> Suspicion:
    """The case in words; runs and mistakes that explain as much are named."""
    evidence = (
        f"{case.reading.found} χ² a degree of freedom falls from {before:.3g} to"
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
