"""Diagnosis, the forecast: the last part of every run predicted from the first, by the base model and with the causes added one by one.

A phase that wanders says nothing of the dynamics: judged are the wave angle, the main amplitude and the quadrature over it, each apart,
and together as the wave's error √(δ(ln a)² + δ(mθ)² + δr²). The terms stand in the order of what each adds; the interval of a gain is
that of a bootstrap over blocks of the part predicted; what another first part would have taught is not in it.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ...fitting.causes import colour, extended_fit
from ...fitting.causes.extended import Series
from ...fitting.causes.extended_fit import Fit
from ...physics import ellipse
from .form import NAME as DAMPING
from .form import Form, refitted
from .search import Search, Variant, adopted, scored

Array = np.ndarray
TRAIN = 0.7
BLOCKS, DRAWS = 8, 400
FEWEST_ROWS = 40
COURSE_POINTS = 60
MOST_ALTERNATIVES = 4
ANGLE, AMPLITUDE, QUADRATURE = "angle_deg", "amplitude_percent", "quadrature_percent"


@dataclass(frozen=True)
class Errors:
    """Errors of one forecast at the rows predicted: run (k,), time (k,), δmθ [rad], δ ln a, δr (k, 3)."""

    run: Array
    time_s: Array
    parts: Array

    @property
    def square(self) -> Array:
        """The wave's squared error, (k,)."""
        return np.sum(self.parts**2, axis=1)

    def figures(self, mode_number: int) -> dict[str, float]:
        """Root mean squares: degrees of the wave angle, amplitude and quadrature in per cent of the amplitude, all together."""
        rms = np.sqrt(np.mean(self.parts**2, axis=0))
        return {
            ANGLE: float(np.degrees(rms[0]) / mode_number),
            AMPLITUDE: float(100 * rms[1]),
            QUADRATURE: float(100 * rms[2]),
            "wave_percent": float(100 * np.sqrt(self.square.mean())),
        }


def forecast(search: Search, form: Form | None, candidates: Sequence[Variant], seed: int = 0) -> dict[str, Any] | None:
    """{"train_fraction", "before", "after", "steps", "alternatives", "course"}; None where the runs are driven or too short.

    Whatever is fitted, the noise's colour too, is fitted to the first part alone.
    """
    series = search.base.series
    train = None if np.any(series.forced) else _first_part(series)
    linear = None if train is None else _linear(train, search.base)
    if train is None or linear is None:
        return None
    trained = _Trained(linear, form, {v.effect.name: v for v in reversed(candidates)})
    before = _errors(linear, series, train)
    named = [f.variant.effect.name for f in search.found]
    rng = np.random.default_rng(seed)
    chosen: tuple[str, ...] = ()
    now, steps = before, []
    while len(chosen) < len(named):
        fits = {name: trained.with_causes((*chosen, name)) for name in named if name not in chosen}
        trials = {name: _errors(fit, series, train) for name, fit in fits.items() if fit is not None}
        if not trials:
            break
        name = min(trials, key=lambda n: float(trials[n].square.mean()))
        steps.append({"name": name, **trials[name].figures(series.mode_number), **_gain(now, trials[name], rng)})
        chosen, now = (*chosen, name), trials[name]
    alternatives = []
    for one, rival in [(f.variant.effect.name, r) for f in search.found for r in f.rivals if r not in named][:MOST_ALTERNATIVES]:
        fit = trained.with_causes([*(n for n in chosen if n != one), rival]) if rival in trained.variants else None
        if fit is not None:
            there = _errors(fit, series, train)
            alternatives.append({"name": rival, "instead_of": one, **there.figures(series.mode_number), **_gain(before, there, rng)})
    found = {
        "train_fraction": TRAIN,
        "before": before.figures(series.mode_number),
        "after": now.figures(series.mode_number),
        **_gain(before, now, rng),
        "steps": steps,
        "alternatives": alternatives,
        "course": _course(before, now, series),
    }
    return found | {"sentence": sentence(found)}


@dataclass(frozen=True)
class _Trained:
    """The first part's linear fit, and what it takes to add causes to it from nothing but their scores there."""

    linear: Fit
    form: Form | None
    variants: Mapping[str, Variant]
    known: dict[tuple[str, ...], Fit | None] = field(default_factory=dict)

    def with_causes(self, names: Sequence[str]) -> Fit | None:
        """The first part fitted with these causes, one after the other; a damping whose form is known stands first, in that form."""
        order = tuple(sorted(names, key=lambda n: n != DAMPING))
        if not order:
            return self.linear
        if order not in self.known:
            before = self.with_causes(order[:-1])
            self.known[order] = None if before is None else self._added(before, order[-1])
        return self.known[order]

    def _added(self, fit: Fit, name: str) -> Fit | None:
        score = next((s for s, _ in scored(fit, [self.variants[name]]) if s.visible), None)
        if score is None:
            return None
        try:
            again: Fit | None = adopted(fit, score, self.variants[name])
            if again is not None and name == DAMPING and self.form is not None:
                again = refitted(again, self.form)
        except extended_fit.DivergedError:
            return None
        return again if again is not None and np.all(np.isfinite(again.prediction.seen)) else None


def _linear(train: Series, base: Fit) -> Fit | None:
    """The base model on the first part, with the colour that its own residual has there."""
    point = replace(base.point, start=train.envelope[:, 0].copy())
    with contextlib.suppress(extended_fit.DivergedError):
        fit = extended_fit.fit(replace(train, colour=None), point, base.freedom)
        found = None
        if base.series.colour is not None:
            found = colour.coloured(train.time_s, train.weight, train.envelope, fit.prediction.residual())
        fit = fit if found is None else extended_fit.fit(replace(train, colour=found), point, base.freedom)
        return fit if np.all(np.isfinite(fit.prediction.seen)) else None
    return None


def _first_part(series: Series) -> Series | None:
    """The runs up to `TRAIN` of their length, padded as before."""
    good = series.weight > 0
    end = np.array([t[g][-1] for t, g in zip(series.time_s, good, strict=True)])
    start = series.time_s[:, 0]
    keep = good & (series.time_s <= (start + TRAIN * (end - start))[:, None])
    if keep.sum(axis=1).min() < FEWEST_ROWS or (good & ~keep).sum() < BLOCKS:
        return None
    return replace(series, weight=np.where(keep, series.weight, 0.0))


def _errors(fit: Fit, series: Series, train: Series) -> Errors:
    """Measured less predicted where the fit has not seen the runs."""
    rows = np.argwhere((series.weight > 0) & (train.weight == 0))
    run, row = rows.T
    motion = fit.prediction.seen[run, row]
    a, b, angle, _ = ellipse.wave(series.envelope[run, row], series.mode_number)
    a_said, b_said, said, _ = ellipse.wave(motion, series.mode_number)
    turn = series.mode_number * (angle - said)
    parts = np.stack([(turn + np.pi / 2) % np.pi - np.pi / 2, np.log(a / a_said), b / a - b_said / a_said], axis=1)
    return Errors(run, series.time_s[run, row], parts)


def _gain(before: Errors, after: Errors, rng: np.random.Generator) -> dict[str, Any]:
    """Ratio of the wave's errors with its standard deviation and 95 % interval, blocks drawn with replacement."""
    blocks = np.array_split(np.arange(len(before.run)), min(BLOCKS, len(before.run)))
    sums = np.array([[before.square[b].sum(), after.square[b].sum()] for b in blocks])
    drawn = sums[rng.integers(0, len(sums), (DRAWS, len(sums)))].sum(axis=1)
    ratios = np.sqrt(drawn[:, 0] / np.maximum(drawn[:, 1], 1e-300))
    low, high = np.quantile(ratios, [0.025, 0.975])
    ratio = float(np.sqrt(before.square.sum() / max(after.square.sum(), 1e-300)))
    return {"ratio": ratio, "std": float(ratios.std(ddof=1)), "interval": [float(low), float(high)]}


def _course(before: Errors, after: Errors, series: Series) -> list[dict[str, Any]]:
    """Errors against time of every run, for a picture."""
    out = []
    for k in np.unique(before.run):
        rows = np.flatnonzero(before.run == k)
        rows = rows[np.unique(np.linspace(0, len(rows) - 1, COURSE_POINTS).astype(int))]

        def parts(errors: Errors, rows: Array = rows) -> dict[str, list[float]]:
            angle = np.degrees(errors.parts[rows, 0]) / series.mode_number
            values = {ANGLE: angle, AMPLITUDE: 100 * errors.parts[rows, 1], QUADRATURE: 100 * errors.parts[rows, 2]}
            return {name: np.round(v, 6).tolist() for name, v in values.items()}

        time_s = np.round(before.time_s[rows], 3).tolist()
        out.append({"run": series.names[int(k)], "time_s": time_s, "before": parts(before), "after": parts(after)})
    return out


def sentence(report: Mapping[str, Any]) -> str:
    """The forecast in one line."""
    b, a = report["before"], report["after"]
    return (
        f"last {100 * (1 - report['train_fraction']):.0f} % of the run from the first: "
        f"wave angle {b[ANGLE]:.3g}° → {a[ANGLE]:.3g}°, amplitude {b[AMPLITUDE]:.3g} → {a[AMPLITUDE]:.3g} %, "
        f"quadrature {b[QUADRATURE]:.3g} → {a[QUADRATURE]:.3g} % of the amplitude"
    )
