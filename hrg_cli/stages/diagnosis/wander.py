"""Diagnosis, the wander: whether what the base model leaves over is partly a noise that wanders, which no cause or open term describes.

A residual is taken for wandering only where its quick part (a polynomial in time, run by run, taken off) is neither white nor explained
by the best few causes and open terms; it is then whitened by its own colour, so that slow causes are judged beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ...fitting.causes import colour, evidence, extended_fit
from ...fitting.causes.evidence import Basis
from ...fitting.causes.extended_fit import Fit, flat
from ...fitting.causes.wave_frame import directions, real
from .remainder import adequacy, columns_of, terms
from .search import Variant

Array = np.ndarray
ADEQUATE = 1e-4
QUICK = 1.5
"""χ² a degree of freedom of the quick part from which it is looked into, and above which the best terms must leave it."""
TRIED, TERMS = 12, 3
"""Terms that the quick part is fitted with one after the other, out of the best so many."""
HOUR = 3600.0


def wandering(fit: Fit, candidates: Sequence[Variant]) -> Fit:
    """The fit with its noise's colour where the residual wanders, else as it was."""
    if adequacy(fit)[1] > ADEQUATE:
        return fit
    series = fit.series
    Q = evidence.orthonormal(np.concatenate([fit.design, slow_columns(fit)], axis=1))
    quick = fit.residual - Q @ (Q.T @ fit.residual)
    spare = len(quick) - Q.shape[1]
    if spare < 40 or quick @ quick < QUICK * spare:
        return fit
    visible = terms(fit)
    columns: dict[str, Array] = {}
    for numbers, wide, widths in columns_of(fit, [(t.place, t.covariate) for t in visible]):
        parts = np.split(wide, np.cumsum(widths)[:-1], axis=1)
        columns |= {visible[k].score.name: part for k, part in zip(numbers, parts, strict=True)}
    catalogue = fit.sensitivities([v.wanted for v in candidates])
    columns |= {v.effect.name: own for v, own in zip(candidates, catalogue, strict=True)}
    names = list(columns)
    for number in range(TERMS):
        ranked = sorted(evidence.scores(names, quick, [columns[n] for n in names], Basis((), Q)), key=lambda s: -s.gain)
        if not ranked or not ranked[0].visible:
            break
        best = ranked[0].space
        quick = quick - best @ (best.T @ quick)
        Q = np.concatenate([Q, best], axis=1)
        names = [s.name for s in ranked[: TRIED if number == 0 else None] if s.visible]
    if quick @ quick < QUICK * (len(quick) - Q.shape[1]):
        return fit
    found = colour.coloured(series.time_s, series.weight, series.envelope, fit.prediction.residual())
    if found is None:
        return fit
    point = replace(fit.point, p=np.append(fit.point.p[:6], fit.freedom.mean[6]), start=series.envelope[:, 0].copy())
    return extended_fit.fit(replace(series, colour=found), point, fit.freedom)


def slow_columns(fit: Fit) -> Array:
    """A polynomial in time of every component of the wave in every run, over σ, (N, m)."""
    series, u = fit.series, fit.prediction.seen
    runs, n = series.weight.shape
    frame = np.swapaxes(real(directions(u)), -1, -2)
    out = np.zeros((runs, n, 4, runs, 4, colour.SMOOTH + 1))
    for k in range(runs):
        last = series.time_s[k][series.weight[k] > 0].max()
        x = np.clip(2 * series.time_s[k] / last - 1, -1, 1)
        out[k, :, :, k] = frame[k][..., None] * np.polynomial.legendre.legvander(x, colour.SMOOTH)[:, None, None]
    return flat(series, out.reshape(runs, n, 4, -1))


def said(fit: Fit) -> list[dict[str, Any]]:
    """The wander of every component: standard deviation after an hour, correlation time of its rate, white level over the stated σ."""
    if fit.series.colour is None:
        return []
    return [
        {
            "component": name,
            "after_one_hour": noise.after(HOUR) if noise.wander_1_s > 0 else 0.0,
            "units": "1" if name in ("amplitude", "ellipticity") else "rad",
            "correlation_s": noise.correlation_s,
            "white_over_stated": noise.white,
        }
        for name, noise in zip(colour.COMPONENTS, fit.series.colour.noises, strict=True)
    ]


def sentence(fit: Fit) -> str:
    """The wander in words."""
    parts = [f"{w['component']} {w['after_one_hour']:.1e}" for w in said(fit) if w["after_one_hour"] > 0]
    return f"beside any model the wave wanders, after one hour by ({', '.join(parts)}) relative or rad" if parts else ""
