"""Diagnosis, the rest: an open search over terms of the envelope equation and the read-out times functions of t, θ, a, T and Ω.

u' += g·M u or u_m = u + g·M u, M one of damping −1, frequency j, their splits −R, jR, turning J, circular jJ; g a covariate's power,
a harmonic of the wave angle, a step in time or a tone in time. What is left over is described by the best such terms, blamed on nothing.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ..fitting import evidence
from ..fitting.evidence import Score
from ..fitting.extended import Propagation, Series, real
from ..fitting.extended_fit import Fit, flat
from ..physics import ellipse

Array = np.ndarray
STEPS, TONES = 31, 48
HARMONICS = (1, 2, 3, 4, 6, 8)
SMOOTH = 6


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
    Place("gain", "a", "1", True),
    Place("gain split", "g/2", "1", True),
    Place("phase split", "ψ/2", "rad", True),
    Place("angle", "−mθ", "rad", True),
    Place("quadrature offset", "r", "1", True),
)


@dataclass(frozen=True)
class Covariate:
    """A function of what is known along the runs: values (c, R, n) of its c parts, its name and formula."""

    name: str
    formula: str
    values: Array
    harmonic: int = 0
    everywhere: bool = True
    """False: only at places a step or tone is looked for."""


@dataclass(frozen=True)
class Term:
    """One term of the open search with its score beside the fit."""

    place: Place
    covariate: Covariate
    score: Score
    columns: Array

    @property
    def size(self) -> float:
        """Magnitude of its coefficients."""
        return float(np.sqrt(np.nansum(self.score.estimate**2)))


def matrices(place: Place, u: Array) -> list[Array]:
    """M u of a place, one or two columns."""
    c, s = u[..., 0], u[..., 1]
    mirrored, swapped, turned = np.stack([c, -s], -1), np.stack([s, c], -1), np.stack([s, -c], -1)
    return {
        "damping": [-u],
        "frequency": [1j * u],
        "damping split": [-mirrored, -swapped],
        "frequency split": [1j * mirrored, 1j * swapped],
        "turning": [turned],
        "circular": [1j * turned],
        "gain": [u],
        "gain split": [mirrored, swapped],
        "phase split": [1j * mirrored, 1j * swapped],
        "angle": [turned],
        "quadrature offset": [1j * turned],
    }[place.name]


def covariates(series: Series, u: Array) -> Iterator[Covariate]:
    """The functions looked through, along the motion u (R, n, 2)."""
    a, _, angle, _ = ellipse.wave(u, 1)
    good = series.weight > 0
    a0 = float(np.sqrt((a[good] ** 2).mean()))
    span = float(series.time_s[good].max())
    t = series.time_s / span
    ones = np.ones_like(t)
    yield Covariate("none", "1", ones[None])
    yield Covariate("time", "t/T", t[None])
    yield Covariate("time", "(t/T)²", (t**2)[None])
    x = a / a0
    for power, formula in ((1, "a/a₀"), (2, "(a/a₀)²"), (3, "(a/a₀)³"), (4, "(a/a₀)⁴"), (-1, "a₀/a")):
        yield Covariate("amplitude", formula, (x**power)[None])
    warm = series.temperature_degc
    if np.ptp(warm[good]) > 0:
        d = warm - warm[good].mean()
        scale = np.ptp(warm[good])
        yield Covariate("temperature", "(T − T₀)/ΔT", (d / scale)[None])
        yield Covariate("temperature", "((T − T₀)/ΔT)²", ((d / scale) ** 2)[None])
        rate = series.temperature_rate_degc_s
        if np.ptp(rate[good]) > 1e-6 * np.abs(rate[good]).max():
            yield Covariate("temperature rate", "Ṫ/Ṫ₀", (rate / np.abs(rate[good]).max())[None])
    fast = series.rate_rad_s
    if np.abs(fast[good]).max() > 0:
        y = fast / np.abs(fast[good]).max()
        yield Covariate("rate", "Ω/Ω₀", y[None])
        yield Covariate("rate", "|Ω|/Ω₀", np.abs(y)[None])
        yield Covariate("rate", "(Ω/Ω₀)²", (y**2)[None])
        if np.ptp(series.table_angle_rad[good]) > 1:
            for n in (1, 2):
                yield Covariate(f"table angle × {n}", f"harmonic {n} of the table angle", _pair(n * series.table_angle_rad) * (y != 0))
    for n in HARMONICS:
        yield Covariate("wave angle", f"harmonic {n}mθ", _pair(n * angle), harmonic=n)
        if n in (2, 4):
            yield Covariate("wave angle and amplitude", f"harmonic {n}mθ × (a/a₀)²", _pair(n * angle) * x**2, harmonic=n)
    for tau in np.linspace(0, 1, STEPS + 2)[1:-1]:
        yield Covariate("time", f"step at t = {tau * span:.4g} s", (t > tau)[None].astype(float), everywhere=False)
    for k in range(1, TONES + 1):
        yield Covariate("time", f"tone of {k / 2 / span:.4g} Hz", _pair(np.pi * k * t), everywhere=False)


def _pair(phase: Array) -> Array:
    return np.stack([np.cos(phase), np.sin(phase)])


def terms(fit: Fit) -> list[Term]:
    """Every term with its score beside the fit, best first; those that coincide with the base model are left out."""
    flow = fit.flow
    series, u = fit.series, flow.prediction.motion
    rows, out = len(fit.residual), []
    centre = {(c.name, c.formula): c for c in covariates(flow.centre, flow.middle)}
    span_given = {c.formula: c for c in covariates(series, u)}
    for covariate in span_given.values():
        for place in PLACES:
            if not covariate.everywhere and place.name not in ("damping", "frequency", "turning", "gain", "angle"):
                continue
            if covariate.formula == "1" and not place.readout:
                continue
            mid = centre.get((covariate.name, covariate.formula)) or _halfway(covariate)
            columns = _columns(flow, place, covariate, mid)
            score = evidence.score(f"{place.name} × {covariate.formula}", fit.residual, columns, fit.basis)
            if score.visible:
                out.append(Term(place, covariate, score, columns))
    return sorted(out, key=lambda t: -evidence.criterion(t.score.gain, t.score.rank, rows))


def _halfway(covariate: Covariate) -> Covariate:
    v = covariate.values
    return Covariate(covariate.name, covariate.formula, (v[..., 1:] + v[..., :-1]) / 2, covariate.harmonic, covariate.everywhere)


def _columns(flow: Propagation, place: Place, covariate: Covariate, middle: Covariate) -> Array:
    series = flow.prediction.series
    u = flow.prediction.seen if place.readout else flow.prediction.motion
    at_rows = np.stack([real(g[..., None] * m) for g in covariate.values for m in matrices(place, u)], -1)
    if place.readout:
        return flat(series, at_rows * series.weight[..., None, None])
    at_middle = np.stack([real(g[..., None] * m) for g in middle.values for m in matrices(place, flow.middle)], -1)
    return flat(series, flow.seen(flow.carried(at_rows, at_middle)))


@dataclass(frozen=True)
class Remainder:
    """What the open search says: accepted terms in order, χ² after them."""

    terms: tuple[Term, ...]
    chi2: float
    tried: int

    @property
    def rank(self) -> int:
        """Numbers spent."""
        return sum(t.score.rank for t in self.terms)


def describe(fit: Fit, noise_factor: float, most: int, significant: float) -> Remainder:
    """Forward selection of open terms (linear), stopped by corrected p and BIC."""
    all_terms = terms(fit)
    residual, Q = fit.residual, fit.basis
    rows = len(residual)
    chosen: list[Term] = []
    for _ in range(most):
        best: Term | None = None
        for term in all_terms:
            s = evidence.score(term.score.name, residual, term.columns, Q) if chosen else term.score
            if s.visible and (best is None or evidence.criterion(s.gain, s.rank, rows) > evidence.criterion(best.score.gain, best.score.rank, rows)):
                best = Term(term.place, term.covariate, s, term.columns)
        if best is None:
            break
        _, p = evidence.significance(best.score.gain / noise_factor, best.score.rank)
        if evidence.corrected(p, len(all_terms)) > significant or evidence.criterion(best.score.gain / noise_factor, best.score.rank, rows) < 10:
            break
        chosen.append(best)
        Q = np.concatenate([Q, best.score.space], axis=1)
        residual = residual - best.score.space @ (best.score.space.T @ residual)
    return Remainder(tuple(chosen), float(residual @ residual), len(all_terms))


def smooth_columns(fit: Fit) -> Array:
    """Slow cosines in time of all four components of the wave, run by run: what a deterministic misfit would look like, (N, m)."""
    series = fit.series
    runs, n = series.weight.shape
    u = fit.flow.prediction.seen
    size = np.sqrt(np.sum(np.abs(u) ** 2, -1, keepdims=True))
    along = u / np.where(size > 0, size, 1.0)
    across = np.stack([-np.conj(along[..., 1]), np.conj(along[..., 0])], -1)
    out = np.zeros((runs, n, 4, runs * SMOOTH * 4))
    column = 0
    for k in range(runs):
        last = series.time_s[k][series.weight[k] > 0].max()
        first = series.time_s[k, 0]
        x = (series.time_s[k] - first) / (last - first)
        for j in range(1, SMOOTH + 1):
            g = np.cos(np.pi * j * x)[:, None]
            for vector in (along[k], 1j * along[k], across[k], 1j * across[k]):
                out[k, :, :, column] = real(g * vector)
                column += 1
    return flat(series, out)


def adequacy(fit: Fit, extra: Array | None = None) -> tuple[float, float]:
    """(χ² a degree of freedom of the residual's smooth part, its p): 1 and not small when nothing is left but white noise."""
    from scipy.special import chdtrc

    Q = fit.basis if extra is None else np.concatenate([fit.basis, extra], axis=1)
    residual = fit.residual if extra is None else fit.residual - extra @ (extra.T @ fit.residual)
    power, rank = evidence.smooth_power(residual, Q, smooth_columns(fit))
    return (power / rank, float(chdtrc(rank, power))) if rank else (1.0, 1.0)
