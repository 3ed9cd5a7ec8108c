"""Diagnosis, the rest: an open search over terms of the envelope equation and the read-out times functions of t, θ, a, T and Ω.

u' += g·M u or u_m = u + g·M u, M one of damping −1, frequency j, their splits −R, jR, turning J, circular jJ; g a covariate's power,
a harmonic of the wave angle, a step in time or a tone in time. What is left over is described by the best such terms, blamed on nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
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
KEPT = 200
"""Terms kept for the second and later steps."""


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
        yield step_at(series, tau)
    for k in range(2, TONES + 2):
        yield tone_of(series, k / 2)


def step_at(series: Series, share: float) -> Covariate:
    """0 before and 1 after an instant, the same in every run; within a row its share of it."""
    span = float(series.time_s[series.weight > 0].max())
    width = max(float(np.median(series.step_s[series.step_s > 0])), 1e-12)
    rise = np.clip((series.time_s - share * span) / width + 0.5, 0, 1)
    return Covariate("time", f"step at t = {share * span:.5g} s", rise[None], instant=share)


def tone_of(series: Series, cycles: float) -> Covariate:
    """Cosine and sine of so many cycles over the longest run."""
    span = float(series.time_s[series.weight > 0].max())
    return Covariate("time", f"tone of {cycles / span:.5g} Hz", _pair(2 * np.pi * cycles * series.time_s / span), cycles=cycles)


def _pair(phase: Array) -> Array:
    return np.stack([np.cos(phase), np.sin(phase)])


def terms(fit: Fit) -> list[Term]:
    """Every term with its score beside the fit, best first; those that coincide with the base model are left out."""
    flow = fit.flow
    pairs = []
    for covariate, middle in zip(covariates(fit.series, flow.prediction.motion), covariates(flow.centre, flow.middle), strict=True):
        for place in PLACES:
            simple = place.name in ("damping", "frequency", "turning", "gain", "angle")
            if (covariate.everywhere or simple) and (covariate.formula != "1" or place.readout):
                pairs.append((place, covariate, middle))
    rows = len(fit.residual)
    out = [term for term in judged(fit, pairs, fit.residual, fit.basis) if term.score.visible]
    return sorted(out, key=lambda t: -evidence.criterion(t.score.gain, t.score.rank, rows))


def judged(fit: Fit, pairs: Sequence[tuple[Place, Covariate, Covariate]], residual: Array, Q: Array) -> list[Term]:
    """Terms with their scores: (place, covariate at the rows, at the middles); the motion of all is carried in one sweep."""
    flow = fit.flow
    moving = [pair for pair in pairs if not pair[0].readout]
    columns: dict[tuple[str, str], Array] = {}
    if moving:
        at_rows = [_at(place, covariate, flow.prediction.motion) for place, covariate, _ in moving]
        at_middle = [_at(place, middle, flow.middle) for place, _, middle in moving]
        seen = flat(fit.series, flow.seen(flow.carried(np.concatenate(at_rows, -1), np.concatenate(at_middle, -1))))
        ends = np.cumsum([a.shape[-1] for a in at_rows])[:-1]
        for (place, covariate, _), part in zip(moving, np.split(seen, ends, axis=1), strict=True):
            columns[place.name, covariate.formula] = part
    out = []
    for place, covariate, _ in pairs:
        if place.readout:
            direct = _at(place, covariate, flow.prediction.seen) * fit.series.weight[..., None, None]
            columns[place.name, covariate.formula] = flat(fit.series, direct)
        part = columns[place.name, covariate.formula]
        out.append(Term(place, covariate, evidence.score(f"{place.name} × {covariate.formula}", residual, part, Q), part))
    return out


def _at(place: Place, covariate: Covariate, u: Array) -> Array:
    return np.stack([real(g[..., None] * m) for g in covariate.values for m in matrices(place, u)], -1)


def refined(fit: Fit, term: Term, residual: Array, Q: Array) -> Term:
    """A step's instant or a tone's frequency to a fiftieth of the first grid."""
    make, value = (step_at, term.covariate.instant) if term.covariate.instant is not None else (tone_of, term.covariate.cycles)
    if value is None:
        return term
    width = 1 / (STEPS + 1) if make is step_at else 0.5
    for _ in range(2):
        trials = [make(fit.series, v) for v in value + width * np.linspace(-1, 1, 11)]
        middles = [make(fit.flow.centre, v) for v in value + width * np.linspace(-1, 1, 11)]
        found = judged(fit, [(term.place, c, m) for c, m in zip(trials, middles, strict=True)], residual, Q)
        best = max(found, key=lambda t: t.score.gain)
        if best.score.gain > term.score.gain:
            term = best
            value = best.covariate.instant if make is step_at else best.covariate.cycles
            assert value is not None
        width /= 5
    return term


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
        for term in all_terms[: KEPT if chosen else 1]:
            s = evidence.score(term.score.name, residual, term.columns, Q) if chosen else term.score
            if s.visible and (best is None or evidence.criterion(s.gain, s.rank, rows) > evidence.criterion(best.score.gain, best.score.rank, rows)):
                best = Term(term.place, term.covariate, s, term.columns)
        if best is None:
            break
        level = evidence.criterion(best.score.gain, best.score.rank, rows)
        if best.place.readout:
            # an error of the motion that is fast looks like one of the read-out; the motion comes first where both serve
            for term in all_terms[:KEPT]:
                s = evidence.score(term.score.name, residual, term.columns, Q) if chosen else term.score
                if not term.place.readout and s.visible and evidence.criterion(s.gain, s.rank, rows) > level - max(10.0, 0.03 * best.score.gain):
                    best = Term(term.place, term.covariate, s, term.columns)
                    break
        best = refined(fit, best, residual, Q)
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
