"""Diagnosis, the forecast: the last part of every run predicted from the first, by the base model and with the causes added one by one.

A phase that wanders says nothing of the dynamics: judged are the wave angle, the main amplitude and the quadrature over it, each apart,
and together as the wave's error √(δ(ln a)² + δ(mθ)² + δr²). The terms stand in the order of what each adds. The interval of a gain is that
of a bootstrap over blocks of the part predicted and, together with it, over what another first part would have taught.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...fitting.causes import colour, extended_fit
from ...fitting.causes.extended import Series
from ...fitting.causes.extended_fit import Fit
from .outlook import AMPLITUDE, ANGLE, QUADRATURE, Errors, outlook
from .search import Search, Variant, adopted, scored
from .shapes import NAME as DAMPING
from .shapes import Shape, in_shape

Array = np.ndarray
TRAIN = 0.7
BLOCKS, DRAWS = 8, 400
FEWEST_ROWS = 40
COURSE_POINTS = 60
MOST_ALTERNATIVES = 4
OUTSIDE = 2.0
"""Root mean square errors over their σ from which a component counts as not predicted."""
WORDS = {ANGLE: "wave angle", AMPLITUDE: "amplitude", QUADRATURE: "quadrature"}


def forecast(trained: Trained, search: Search, shape: Shape | None, others: Sequence[Shape], seed: int = 0) -> dict[str, Any] | None:
    """{"train_fraction", "before", "after", "steps", "alternatives", "course", "open"}; None where the runs are driven or too short.

    shape: the damping's, where it is not the catalogue's; others: shapes that might stand in its place.
    """
    series, mode = search.base.series, search.base.series.mode_number
    before = trained.errors((), None)
    if before is None:
        return None
    named = [f.variant.effect.name for f in search.found]
    rng = np.random.default_rng(seed)
    chosen: tuple[str, ...] = ()
    now, steps = before, []
    while len(chosen) < len(named):
        trials = {name: trained.errors((*chosen, name), shape) for name in named if name not in chosen}
        there = {name: errors for name, errors in trials.items() if errors is not None}
        if not there:
            break
        name = min(there, key=lambda n: float(there[n].square.mean()))
        steps.append({"name": name, **there[name].figures(mode), **_gain(now, there[name], rng), **_by_component(now, there[name], mode)})
        chosen, now = (*chosen, name), there[name]
    alternatives = []
    instead = [(other.words, DAMPING, trained.errors(chosen, other)) for other in others if DAMPING in chosen]
    for one, rival in [(f.variant.effect.name, r) for f in search.found for r in f.rivals if r not in named][:MOST_ALTERNATIVES]:
        if rival in trained.variants:
            instead.append((rival, one, trained.errors([*(n for n in chosen if n != one), rival], shape)))
    for name, one, errors in instead:
        if errors is not None:
            alternatives.append({"name": name, "instead_of": one, **errors.figures(mode), **_gain(before, errors, rng)})
    found = {
        "train_fraction": TRAIN,
        "before": before.figures(mode),
        "after": now.figures(mode),
        **_gain(before, now, rng),
        **_by_component(before, now, mode),
        "steps": steps,
        "alternatives": alternatives,
        "course": _course(before, now, series),
        "open": _outside(now, mode),
    }
    return found | {"sentence": sentence(found)}


@dataclass(frozen=True)
class Trained:
    """The first part of the base fit's runs, and what it takes to add causes to it; all that is fitted is fitted to it alone."""

    base: Fit
    candidates: Sequence[Variant]
    known: dict[tuple[tuple[str, ...], Shape | None], Fit | None] = field(default_factory=dict)

    @cached_property
    def linear(self) -> Fit | None:
        """The base model, with the colour its own residual has there; None where the runs are driven or too short."""
        first = None if np.any(self.base.series.forced) else _first_part(self.base.series)
        return None if first is None else _linear(first, self.base)

    @cached_property
    def variants(self) -> dict[str, Variant]:
        """The candidates by name."""
        return {v.effect.name: v for v in reversed(self.candidates)}

    def errors(self, names: Sequence[str], shape: Shape | None) -> Errors | None:
        """What the causes' fit of the first part misses in the last."""
        fit = self.with_causes(names, shape)
        return None if fit is None else outlook(fit, self.base.series)

    def with_causes(self, names: Sequence[str], shape: Shape | None) -> Fit | None:
        """The first part fitted with these causes, one after the other; a damping, in its shape, stands first."""
        order = tuple(sorted(names, key=lambda n: n != DAMPING))
        if not order:
            return self.linear
        key = (order, shape if DAMPING in order else None)
        if key not in self.known:
            before = self.with_causes(order[:-1], shape)
            self.known[key] = None if before is None else self._added(before, order[-1], shape)
        return self.known[key]

    def _added(self, fit: Fit, name: str, shape: Shape | None) -> Fit | None:
        if name == DAMPING and shape is not None:
            square = self.with_causes((DAMPING,), None)
            return None if square is None else in_shape(square, shape)
        score = next((s for s, _ in scored(fit, [self.variants[name]]) if s.visible), None)
        if score is None:
            return None
        with contextlib.suppress(extended_fit.DivergedError):
            again = adopted(fit, score, self.variants[name])
            return again if np.all(np.isfinite(again.prediction.seen)) else None
        return None


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
    return replace(series, weight=np.where(keep, series.weight, 0.0), unsettled=None)


def _gain(before: Errors, after: Errors, rng: np.random.Generator) -> dict[str, Any]:
    """Ratio of the wave's errors with its standard deviation and 95 % interval: blocks drawn with replacement, each its own teaching."""
    blocks = np.array_split(np.arange(len(before.run)), min(BLOCKS, len(before.run)))
    drawn = rng.multinomial(len(blocks), np.full(len(blocks), 1 / len(blocks)), DRAWS)
    sums = [np.stack([one[b].sum(axis=0) for b in blocks]) for one in (_taught(before, rng), _taught(after, rng))]
    left = [np.sum(drawn * s.T, axis=1) for s in sums]
    ratios = np.sqrt(left[0] / np.maximum(left[1], 1e-300))
    low, high = np.quantile(ratios, [0.025, 0.975])
    ratio = float(np.sqrt(before.square.sum() / max(after.square.sum(), 1e-300)))
    return {"ratio": ratio, "std": float(ratios.std(ddof=1)), "interval": [float(low), float(high)]}


def _taught(errors: Errors, rng: np.random.Generator) -> Array:
    """Squared errors (k, DRAWS) had the first part taught something else within its own uncertainty."""
    other = errors.learned.reshape(-1, errors.learned.shape[-1]) @ rng.standard_normal((errors.learned.shape[-1], DRAWS))
    return np.sum((errors.parts[..., None] + other.reshape(*errors.parts.shape, DRAWS)) ** 2, axis=1)


def _by_component(before: Errors, after: Errors, mode_number: int) -> dict[str, list[str]]:
    """{"better", "worse"}: the components that are predicted better, and those that are not."""
    old, new = before.figures(mode_number), after.figures(mode_number)
    return {
        "better": [name for name in WORDS if new[name] < old[name]],
        "worse": [name for name in WORDS if new[name] >= old[name]],
    }


def _outside(errors: Errors, mode_number: int) -> list[str]:
    """Components whose error exceeds what the fit of the first part and the noise that wanders on allow."""
    found = errors.figures(mode_number)
    return [name for name in WORDS if found[name] > OUTSIDE * found["expected"][name]]


def _course(before: Errors, after: Errors, series: Series) -> list[dict[str, Any]]:
    """Errors against time of every run, for a picture."""
    out = []
    for k in np.unique(before.run):
        rows = np.flatnonzero(before.run == k)
        rows = rows[np.unique(np.linspace(0, len(rows) - 1, COURSE_POINTS).astype(int))]

        def parts(values: Array, rows: Array = rows) -> dict[str, list[float]]:
            units = (np.degrees(1) / series.mode_number, 100.0, 100.0)
            return {name: np.round(unit * values[rows, c], 6).tolist() for c, (name, unit) in enumerate(zip(WORDS, units, strict=True))}

        one = {"run": series.names[int(k)], "time_s": np.round(before.time_s[rows], 3).tolist()}
        out.append(one | {"before": parts(before.parts), "after": parts(after.parts), "after_std": parts(after.std)})
    return out


def sentence(report: Mapping[str, Any]) -> str:
    """The forecast in one line."""
    b, a = report["before"], report["after"]
    said = a["expected"]
    missed = [WORDS[name] for name in report["open"]]
    return (
        f"last {100 * (1 - report['train_fraction']):.0f} % of the run from the first: "
        f"wave angle {b[ANGLE]:.3g}° → {a[ANGLE]:.3g}° (expected {said[ANGLE]:.2g}°), "
        f"amplitude {b[AMPLITUDE]:.3g} → {a[AMPLITUDE]:.3g} % ({said[AMPLITUDE]:.2g} %), "
        f"quadrature {b[QUADRATURE]:.3g} → {a[QUADRATURE]:.3g} % ({said[QUADRATURE]:.2g} %) of the amplitude"
        + (f"; beyond what was expected: {', '.join(missed)}" if missed else "")
    )
