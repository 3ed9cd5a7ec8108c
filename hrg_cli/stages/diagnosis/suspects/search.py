"""The search for wrong runs: which run the others agree without, and which mistake, undone, lets it agree with them."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ....errors import HrgError
from ....fitting.causes import extended_fit
from ....fitting.causes.extended_fit import Fit
from ....records import Array, Wave
from ..search import Variant
from .logs import usual_scale_factor, wrong_logs
from .readings import Reading, of_a_knock, readings
from .rivals import catalogued
from .suspicion import Suspicion

Fitted = Callable[[Sequence[Wave]], Fit]

ODD = 1e3
"""Δχ² by which mistakes that leave a usual scale factor go before those that do not."""
GROSS = 10.0
"""χ² a degree of freedom from which a wrong run is looked for: a run that is wrong is not so by a little."""
REMOVED = 0.9
"""Part of the excess of χ² that the mistakes undone must remove together."""
STEP = 1.4
"""Times by which χ² must fall for one more run to be doubted."""
PRICE = 20.0
"""Δ(χ² + k ln N), at the noise that is left, by which a mistake with more freedom must beat one with less."""
RIVAL = 3.0
"""χ² a degree of freedom that causes of the catalogue may leave over that of the best mistake: then no run is blamed."""
CLEAR = 3.0
"""Times χ² a degree of freedom of the best runs without one, up to which leaving out another is as good."""
DOUBTED = 2
"""Runs whose mistakes are tried, those without which the others agree best."""
MOST_LEFT_OUT = 10
"""Runs left out one by one; of more, those that the base model misses most."""


@dataclass(frozen=True)
class Case:
    """One reading of one run with the fit it leaves."""

    run: int
    reading: Reading
    fit: Fit
    apart: Fit | None = None
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
    waves: Sequence[Wave], fitted: Fitted, base: Fit, candidates: Sequence[Variant] = (), *, gross: float = GROSS
) -> list[Suspicion]:
    """The runs that are not what they say they are, none where physics explains the runs as well.

    waves: as given, one a run; fitted: the base model's fit to waves; base: that of these; candidates: the catalogue beside `base`.
    """
    if base.chi2 / base.dof < gross:
        return wrong_logs(waves, base)
    cases, last = _greedy(waves, fitted, base)
    if last is None:
        return wrong_logs(waves, base)
    excess, left = base.chi2 / base.dof - 1, last.chi2 / last.dof - 1
    if left > (1 - REMOVED) * excess or (candidates and catalogued(base, candidates, RIVAL * max(1.0, last.chi2 / last.dof))):
        return wrong_logs(waves, base)
    return [*wrong_logs(waves, last.fit), *(_told(waves, case, beside, before) for case, beside, before in cases)]


Chosen = tuple[Case, tuple[Case, ...], float]
"""A case, those that explain as much, χ² a degree of freedom before it."""


def _greedy(waves: Sequence[Wave], fitted: Fitted, base: Fit) -> tuple[list[Chosen], Case | None]:
    """Cases taken one after another, fewer than half of the runs, and the last."""
    chosen: list[Chosen] = []
    pieces: list[tuple[Wave, ...]] = [(wave,) for wave in waves]
    level, open_runs = base, list(range(len(waves)))
    most = max(1, (len(waves) - 1) // 2)
    chi2, dof = base.chi2, base.dof
    last: Case | None = None
    while len(chosen) < most and chi2 / dof > 2.0:
        cases = list(_cases(pieces, open_runs, fitted, level))
        if not cases:
            break
        least = min(case.chi2 / case.dof for case in cases)
        noise = max(1.0, least)
        ranked = sorted(cases, key=lambda case: case.price(noise) + PRICE * case.reading.parameters)
        best = ranked[0]
        if best.chi2 / best.dof > chi2 / dof / STEP:
            break
        beside = tuple(c for c in ranked[1:] if c.price(noise) < best.price(noise) + PRICE)
        chosen.append((best, beside, chi2 / dof))
        chi2, dof, last = best.chi2, best.dof, best
        pieces[best.run] = best.reading.pieces
        open_runs.remove(best.run)
        if chi2 / dof > 2.0 and len(chosen) < most:
            again = _fit(_flat(pieces), fitted)
            if again is None:
                break
            level = again
    return chosen, last


def _cases(pieces: Sequence[tuple[Wave, ...]], open_runs: Sequence[int], fitted: Fitted, level: Fit) -> Iterator[Case]:
    """Every mistake of the runs that are doubted most."""
    if sum(map(len, pieces)) == 1:
        yield from _read(pieces, 0, of_a_knock(pieces[0][0]), fitted)
        return
    without = _without_each(pieces, open_runs, fitted, level)
    clear = CLEAR * max(1.0, min((fit.chi2 / fit.dof for _, fit in without), default=1.0))
    for run, others in [pair for pair in without if pair[1].chi2 / pair[1].dof < clear][:DOUBTED]:
        wave = pieces[run][0]
        yield from _read(pieces, run, readings(wave, others), fitted)
        alone = _fit([wave], fitted)
        if alone is not None:
            figures = f"alone it shows {_figures(alone)}, the others {_figures(others)}: with all of that its own"
            apart = Reading("another gyro", (wave,), 6, figures, "diagnose this run apart; look whose it is")
            yield Case(run, apart, others, alone)


def _read(pieces: Sequence[tuple[Wave, ...]], run: int, made: Iterator[Reading], fitted: Fitted) -> Iterator[Case]:
    for reading in made:
        fit = _fit([*_flat(pieces[:run]), *reading.pieces, *_flat(pieces[run + 1 :])], fitted)
        if fit is not None:
            yield Case(run, reading, fit)


def _without_each(pieces: Sequence[tuple[Wave, ...]], open_runs: Sequence[int], fitted: Fitted, level: Fit) -> list[tuple[int, Fit]]:
    """The fits without each of the runs, that which leaves the others agreeing best first."""
    missed = _misfits(level, [len(p) for p in pieces])
    out = []
    for run in sorted(open_runs, key=lambda k: -missed[k])[:MOST_LEFT_OUT]:
        fit = _fit(_flat([*pieces[:run], *pieces[run + 1 :]]), fitted)
        if fit is not None:
            out.append((run, fit))
    return sorted(out, key=lambda pair: pair[1].chi2 / pair[1].dof)


def _misfits(fit: Fit, counts: Sequence[int]) -> Array:
    """Mean squared residual of every wave's pieces."""
    square = np.bincount(fit.rows[:, 0], fit.residual**2, len(fit.series.names)) / np.maximum(
        np.bincount(fit.rows[:, 0], minlength=len(fit.series.names)), 1
    )
    ends = np.cumsum([0, *counts])
    return np.array([square[a:b].mean() for a, b in zip(ends[:-1], ends[1:], strict=True)])


def _flat(pieces: Sequence[tuple[Wave, ...]]) -> list[Wave]:
    return [wave for run in pieces for wave in run]


def _fit(waves: Sequence[Wave], fitted: Fitted) -> Fit | None:
    with contextlib.suppress(extended_fit.DivergedError, HrgError, np.linalg.LinAlgError):
        fit = fitted(waves)
        if np.isfinite(fit.chi2):
            return fit
    return None


def _figures(fit: Fit) -> str:
    damping, split = fit.point.p[0], float(np.hypot(fit.point.p[3], fit.point.p[4]))
    return f"{fit.frequency_hz.mean():.6g} Hz, damping {damping:.4g} 1/s, frequency split {split:.4g} rad/s"


def _told(waves: Sequence[Wave], case: Case, beside: Sequence[Case], before: float) -> Suspicion:
    """The case in words; runs and mistakes that explain as much are named."""
    evidence = f"{case.reading.found} χ² a degree of freedom falls from {before:.3g} to {case.chi2 / case.dof:.3g}"
    alike = [f"{waves[c.run].run_id}: {c.reading.what}" for c in beside if (c.run, c.reading.what) != (case.run, case.reading.what)]
    if alike:
        evidence += f"; as well explained by {', '.join(dict.fromkeys(alike))}"
    if any(c.run != case.run for c in beside) or len(waves) == 2:
        evidence += "; which of the runs is wrong these runs cannot tell"
    return Suspicion(waves[case.run].run_id, case.reading.what, evidence, case.reading.correction)
