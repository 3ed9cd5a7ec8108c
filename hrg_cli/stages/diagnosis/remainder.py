"""Diagnosis, the rest: an open search over terms of the envelope equation and the read-out times functions of t, θ, a, T and Ω.

u' += g·M u or u_m = u + g·M u, M one of damping −1, frequency j, their splits −R, jR, turning J, circular jJ; g a covariate's power,
a harmonic of the wave angle, a step in time or a tone in time. What is left over is described by the best such terms, blamed on nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from ...effects.effect import Effect, Parameter
from ...fitting.causes import evidence, extended_fit
from ...fitting.causes.evidence import Basis, Score
from ...fitting.causes.extended import Series
from ...fitting.causes.extended_fit import Fit, flat
from ...fitting.causes.sensitivities import spread
from ...fitting.causes.wave_frame import directions, real
from ...physics import ellipse

Array = np.ndarray
STEPS, TONES = 31, 48
HARMONICS = (1, 2, 3, 4, 6, 8)
SMOOTH = 6
FEW = 64
"""Columns of open terms, about, that are made at a time."""


@dataclass(frozen=True)
class Place:
    """Where a term acts: its columns M u, the symbol it changes and its unit; `readout`: on what is seen, not on the motion."""

    name: str
    symbol: str
    units: str
    readout: bool


PLACES = (
    Place("damping", "ν", "s-1", False),
    Place("frequency", "φ̇", "rad s-1", False),
    Place("damping split", "νδμ", "s-1", False),
    Place("frequency split", "δω", "rad s-1", False),
    Place("turning", "−mθ̇", "rad s-1", False),
    Place("circular", "ṙ", "s-1", False),
    Place("precession with quadrature", "φ̇ and −mθ̇·a_A/2a_B", "rad s-1", False),
    Place("gain", "a", "1", True),
    Place("gain split", "g/2", "1", True),
    Place("phase split", "ψ/2", "rad", True),
    Place("angle", "−mθ", "rad", True),
    Place("quadrature offset", "r", "1", True),
)


def _mirror(u: Array) -> Array:
    """(uᵀu) u*/u†u: what every isotropic nonlinearity has beside the part along u (PHYSICS §7)."""
    size = np.sum(np.abs(u) ** 2, axis=-1, keepdims=True)
    return np.sum(u**2, axis=-1, keepdims=True) * np.conj(u) / np.where(size > 0, size, 1.0)


Function = Callable[[Array, Any], Array]
"""(u (..., 2), series or slow state) -> values (c, ...)."""


@dataclass(frozen=True)
class Covariate:
    """A function of what is known along the runs, c parts of it, with its name and formula."""

    name: str
    formula: str
    function: Function
    harmonic: int = 0
    instant: float | None = None
    """Where a step is, as a share of the longest run."""
    cycles: float | None = None
    """Cycles of a tone in the longest run."""

    @property
    def everywhere(self) -> bool:
        """Steps and tones are looked for at the simple places only."""
        return self.instant is None and self.cycles is None


@dataclass(frozen=True)
class Term:
    """One term of the open search with its score beside the fit."""

    place: Place
    covariate: Covariate
    score: Score

    @property
    def size(self) -> float:
        """Magnitude of its coefficients."""
        return float(np.sqrt(np.nansum(self.score.estimate**2)))


def matrices(place: Place, u: Array) -> list[Array]:
    """M u of a place, one or two columns."""
    if place.name in ("damping", "gain", "frequency"):
        return [{"damping": -1, "gain": 1, "frequency": 1j}[place.name] * u]
    if place.name == "precession with quadrature":
        return [1j * _mirror(u)]
    c, s = u[..., 0], u[..., 1]
    if place.name in ("turning", "angle", "circular", "quadrature offset"):
        turned = np.stack([s, -c], -1)
        return [turned if place.name in ("turning", "angle") else 1j * turned]
    factor = {"damping split": -1, "gain split": 1, "frequency split": 1j, "phase split": 1j}[place.name]
    return [factor * np.stack([c, -s], -1), factor * np.stack([s, c], -1)]


def covariates(series: Series, u: Array) -> Iterator[Covariate]:
    """The functions looked through; their scales come from the motion u (R, n, 2) of the runs."""
    good = series.weight > 0
    a0 = float(np.sqrt((_amplitude(u)[good] ** 2).mean()))
    span = float(series.time_s[good].max())
    yield Covariate("none", "1", lambda u, s: np.ones((1, *u.shape[:-1])))
    yield Covariate("time", "t/T", lambda u, s: _one(u, s.time_s / span))
    yield Covariate("time", "(t/T)²", lambda u, s: _one(u, (s.time_s / span) ** 2))
    for power, formula in ((1, "a/a₀"), (2, "(a/a₀)²"), (3, "(a/a₀)³"), (4, "(a/a₀)⁴"), (-1, "a₀/a")):
        yield Covariate("amplitude", formula, _power(power, a0))
    warm = series.temperature_degc[good]
    if np.ptp(warm) > 0:
        mean, scale = float(warm.mean()), float(np.ptp(warm))
        yield Covariate("temperature", "(T − T₀)/ΔT", lambda u, s: _one(u, (s.temperature_degc - mean) / scale))
        yield Covariate("temperature", "((T − T₀)/ΔT)²", lambda u, s: _one(u, ((s.temperature_degc - mean) / scale) ** 2))
        steep = series.temperature_rate_degc_s[good]
        top = float(np.abs(steep).max())
        if np.ptp(steep) > 1e-6 * top:
            yield Covariate("temperature rate", "Ṫ/Ṫ₀", lambda u, s: _one(u, s.temperature_rate_degc_s / top))
    fastest = float(np.abs(series.rate_rad_s[good]).max())
    if fastest > 0:
        yield Covariate("rate", "Ω/Ω₀", lambda u, s: _one(u, s.rate_rad_s / fastest))
        yield Covariate("rate", "|Ω|/Ω₀", lambda u, s: _one(u, np.abs(s.rate_rad_s) / fastest))
        yield Covariate("rate", "(Ω/Ω₀)²", lambda u, s: _one(u, (s.rate_rad_s / fastest) ** 2))
        if np.ptp(series.table_angle_rad[good]) > 1:
            for n in (1, 2):
                yield Covariate(f"table angle × {n}", f"harmonic {n} of the table angle", _of_table(n), n)
    for n in HARMONICS:
        yield Covariate("wave angle", f"harmonic {n}mθ", _of_wave(n), n)
        if n in (2, 4):
            yield Covariate("wave angle and amplitude", f"harmonic {n}mθ × (a/a₀)²", _of_wave(n, a0), n)
    for share in np.linspace(0, 1, STEPS + 2)[1:-1]:
        yield step_at(series, share)
    for k in range(2, TONES + 2):
        yield tone_of(series, k / 2)


def _power(power: int, unit: float) -> Function:
    return lambda u, s: (_amplitude(u) / unit)[None] ** power


def _of_table(harmonic: int) -> Function:
    return lambda u, s: _pair(harmonic * s.table_angle_rad) * np.sign(np.abs(s.rate_rad_s))


def _of_wave(harmonic: int, unit: float | None = None) -> Function:
    """A harmonic of the wave angle, times (a/unit)² where a unit is given."""
    if unit is None:
        return lambda u, s: _pair(harmonic * _angle(u))
    return lambda u, s: _pair(harmonic * _angle(u)) * (_amplitude(u) / unit) ** 2


def _one(u: Array, values: Array) -> Array:
    return np.broadcast_to(values, u.shape[:-1])[None]


def _amplitude(u: Array) -> Array:
    return ellipse.wave(u, 1)[0]


def _angle(u: Array) -> Array:
    return ellipse.wave(u, 1)[2]


def _pair(phase: Array) -> Array:
    return np.stack([np.cos(phase), np.sin(phase)])


def step_at(series: Series, share: float) -> Covariate:
    """0 before and 1 after an instant, the same in every run; within a row its share of it."""
    span = float(series.time_s[series.weight > 0].max())
    width = max(float(np.median(series.step_s[series.step_s > 0])), 1e-12)
    return Covariate(
        "time",
        f"step at t = {share * span:.5g} s",
        lambda u, s: _one(u, np.clip((s.time_s - share * span) / width + 0.5, 0, 1)),
        instant=share,
    )


def tone_of(series: Series, cycles: float) -> Covariate:
    """Cosine and sine of so many cycles over the longest run."""
    span = float(series.time_s[series.weight > 0].max())
    omega = 2 * np.pi * cycles / span
    return Covariate(
        "time", f"tone of {cycles / span:.5g} Hz", lambda u, s: _pair(np.broadcast_to(omega * s.time_s, u.shape[:-1])), cycles=cycles
    )


def effect_of(place: Place, covariate: Covariate, number: int) -> Effect:
    """An open term as an effect of its own, so that the model can be fitted with it."""
    probe = np.ones((1, 2), complex)
    count = len(matrices(place, probe)) * (2 if "harmonic" in covariate.formula or covariate.cycles is not None else 1)
    names = [f"c{k}" for k in range(count)]

    def change(p: Any, u: Array, state: Any) -> Array:
        parts = [g[..., None] * m for g in covariate.function(u, state) for m in matrices(place, u)]
        return sum(p[name] * part for name, part in zip(names, parts, strict=True))

    parameters = tuple(Parameter(name, place.units, 1e-3, "coefficient") for name in names)
    common: dict[str, Any] = {"name": f"open term {number}", "family": "open", "page": covariate.formula, "parameters": parameters}
    if place.readout:
        return Effect(**common, slow_readout=lambda p, u, state: u + change(p, u, state))
    return Effect(**common, slow=change)


def terms(fit: Fit) -> list[Term]:
    """Every term with its score beside the fit, best first; those that coincide with the base model are left out."""
    flow = fit.flow
    pairs = []
    for covariate in covariates(fit.series, flow.prediction.motion):
        for place in PLACES:
            simple = place.name in ("damping", "frequency", "turning", "gain", "angle")
            if (covariate.everywhere or simple) and (covariate.formula != "1" or place.readout):
                pairs.append((place, covariate))
    rows = len(fit.residual)
    out = [term for term in judged(fit, pairs, fit.residual, fit.basis) if term.score.visible]
    return sorted(out, key=lambda t: -evidence.criterion(t.score.gain, t.score.rank, rows))


def judged(fit: Fit, pairs: Sequence[tuple[Place, Covariate]], residual: Array, Q: Basis) -> list[Term]:
    """Terms with their scores: (place, covariate)."""
    ledger, order = evidence.Ledger(residual, Q), list[int]()
    for numbers, columns, widths in columns_of(fit, pairs):
        ledger.enter(columns, widths)
        order += numbers
    names = [f"{pairs[k][0].name} × {pairs[k][1].formula}" for k in order]
    made = [partial(_alone, fit, pairs[k]) for k in order]
    found = dict(zip(order, ledger.scores(names, made), strict=True))
    return [Term(place, covariate, found[k]) for k, (place, covariate) in enumerate(pairs)]


def _alone(fit: Fit, pair: tuple[Place, Covariate]) -> Array:
    """The columns of one term."""
    ((_, columns, _),) = columns_of(fit, [pair])
    return columns


def columns_of(fit: Fit, pairs: Sequence[tuple[Place, Covariate]]) -> Iterator[tuple[list[int], Array, list[int]]]:
    """Numbers, sensitivities over σ side by side (N, Σ widths) and widths of some terms at a time; those of a place share its vectors."""
    flow, series = fit.flow, fit.series
    motion, seen = flow.prediction.motion, flow.prediction.seen
    by_place: dict[str, list[int]] = {}
    for k, (place, _) in enumerate(pairs):
        by_place.setdefault(place.name, []).append(k)
    known: dict[tuple[int, int], Array] = {}

    def values(numbers: list[int], u: Array, where: Series) -> list[Array]:
        for k in numbers:
            if (k_key := (id(pairs[k][1]), id(u))) not in known:
                known[k_key] = np.moveaxis(pairs[k][1].function(u, where), 0, -1)
        return [known[id(pairs[k][1]), id(u)] for k in numbers]

    for numbers in by_place.values():
        place = pairs[numbers[0]][0]
        at_rows = seen if place.readout else motion
        vectors = _vectors(place, at_rows)
        for some in _few(numbers, vectors.shape[-1]):
            parts = values(some, at_rows, series)
            g = np.concatenate(parts, axis=-1)
            if place.readout:
                wide = flow.prediction.judged(spread(vectors, g))
            else:
                g_middle = np.concatenate(values(some, flow.middle, flow.centre), axis=-1)
                wide = flow.seen(flow.carried_by(vectors, _vectors(place, flow.middle), g, g_middle))
            yield some, flat(series, wide), [part.shape[-1] * vectors.shape[-1] for part in parts]


def _vectors(place: Place, u: Array) -> Array:
    """M u of a place as reals, (…, 4, columns)."""
    return np.stack([real(m) for m in matrices(place, u)], -1)


def _few(numbers: list[int], columns: int) -> Iterator[list[int]]:
    """As many at a time as stay in the processor's cache together."""
    count = max(1, FEW // columns)
    for first in range(0, len(numbers), count):
        yield numbers[first : first + count]


def refined(fit: Fit, term: Term, residual: Array, Q: Basis) -> Term:
    """A step's instant or a tone's frequency to a fiftieth of the first grid."""
    make, value = (step_at, term.covariate.instant) if term.covariate.instant is not None else (tone_of, term.covariate.cycles)
    if value is None:
        return term
    width = 1 / (STEPS + 1) if make is step_at else 0.5
    for _ in range(2):
        trials = [make(fit.series, v) for v in value + width * np.linspace(-1, 1, 11)]
        found = judged(fit, [(term.place, c) for c in trials], residual, Q)
        best = max(found, key=lambda t: t.score.gain)
        if best.score.gain > term.score.gain:
            term = best
            value = best.covariate.instant if make is step_at else best.covariate.cycles
            assert value is not None
        width /= 5
    return term


@dataclass(frozen=True)
class Remainder:
    """What the open search says: accepted terms in order, the fit with them, their number of coefficients."""

    terms: tuple[Term, ...]
    fit: Fit
    tried: int
    rank: int

    @property
    def chi2(self) -> float:
        """χ² with the terms."""
        return self.fit.chi2


def describe(fit: Fit, noise_factor: float, most: int, significant: float) -> Remainder:
    """Forward selection of open terms with refit, stopped by corrected p and BIC."""
    rows = len(fit.residual)
    chosen: list[Term] = []
    start, tried = fit.basis.shape[1], 0
    for number in range(most):
        ranked = terms(fit)
        tried = tried or len(ranked)
        if not ranked:
            break
        best = ranked[0]
        level = evidence.criterion(best.score.gain, best.score.rank, rows)
        if best.place.readout:
            # a fast error of the motion looks like one of the read-out; the motion comes first where both serve
            near = (t for t in ranked if not t.place.readout and t.covariate.name == best.covariate.name)
            for term in near:
                if evidence.criterion(term.score.gain, term.score.rank, rows) > level - max(10.0, 0.03 * best.score.gain):
                    best = term
                break
        best = refined(fit, best, fit.residual, fit.basis)
        _, p = evidence.significance(best.score.gain / noise_factor, best.score.rank)
        if (
            evidence.corrected(p, len(ranked)) > significant
            or evidence.criterion(best.score.gain / noise_factor, best.score.rank, rows) < 10
        ):
            break
        effect = effect_of(best.place, best.covariate, number)
        values = {q.name: float(v) if np.isfinite(v) else 0.0 for q, v in zip(effect.parameters, best.score.estimate, strict=True)}
        try:
            again = extended_fit.fit(fit.series, extended_fit.with_effect(fit.point, effect, values), fit.freedom)
        except extended_fit.DivergedError:  # its linear gain is none
            break
        if not again.chi2 < fit.chi2 - 10 * noise_factor:
            break
        fitted = np.array([dict((e.name, v) for e, v in again.point.active)[effect.name][q.name] for q in effect.parameters])
        std = np.array([again.std(f"{effect.name}.{q.name}") for q in effect.parameters])
        chosen.append(replace(best, score=replace(best.score, estimate=fitted, std=std)))
        fit = again
    return Remainder(tuple(chosen), fit, tried, fit.basis.shape[1] - start)


def smooth_columns(fit: Fit) -> list[tuple[slice, Array]]:
    """Slow cosines in time of all four components of the wave, run by run: what a deterministic misfit would look like, (N_r, m) each."""
    series = fit.series
    frame = np.swapaxes(real(directions(fit.flow.prediction.seen)), -1, -2)
    good = series.weight > 0
    last, first = np.max(series.time_s, axis=1, where=good, initial=-np.inf), series.time_s[:, 0]
    x = (series.time_s - first[:, None]) / (last - first)[:, None]
    slow = np.cos(np.pi * np.arange(1, SMOOTH + 1) * x[..., None])
    out = (slow[:, :, None, :, None] * frame[:, :, :, None, :]).reshape(*series.weight.shape, 4, -1)
    if series.colour is not None:
        out = fit.flow.prediction.whitened(out * series.weight[..., None, None])
    blocks = fit.basis.own
    return [(rows, out[k][good[k]].reshape(-1, out.shape[-1])) for k, (rows, _) in enumerate(blocks)]


def adequacy(fit: Fit) -> tuple[float, float]:
    """(χ² a degree of freedom of the residual's smooth part, its p): 1 and not small when nothing is left but white noise."""
    from scipy.special import chdtrc

    power, rank = evidence.smooth_power(fit.residual, fit.basis, smooth_columns(fit))
    return (power / rank, float(chdtrc(rank, power))) if rank else (1.0, 1.0)
