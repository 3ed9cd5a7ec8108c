"""Where a method of seed A leaves its range on given runs: why it refuses, and what it is known to
get wrong there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...physics import ellipse
from .envelope_runs import EnvelopeRun

USES_AXES = (
    "moving-axes",
    "moving-axes-small-quadrature",
    "frozen-axes",
    "increments",
    "rotation-integrals",
    "axis-crossings",
)
FROZEN = 0.1
"""Turn of mθ within a run up to which its axes may be taken as frozen: cos 2mθ and sin 2mθ are
wrong by up to that much."""
CIRCULAR = 0.9
"""|a_B/a_A| above which the axes of the ellipse are too ill-defined for a method that uses them."""

CLEAR_WAVE, LOST_ROWS = 10.0, 0.1
"""Amplitude over its noise below which products of noisy values matter, and the part of such rows
from which it is said."""


def roundness(runs: Sequence[EnvelopeRun]) -> float:
    """Largest median |a_B/a_A| of the runs."""
    worst = 0.0
    for run in runs:
        a, b, _, _ = ellipse.wave(run.envelope, 1)
        worst = max(worst, float(np.quantile(np.abs(b) / np.maximum(a, 1e-300), 0.95)))
    return worst


def quadrature_significance(runs: Sequence[EnvelopeRun]) -> float:
    """Mean (a_B/σ)² above the 1 of pure noise, in its standard errors."""
    x = np.concatenate([ellipse.wave(r.envelope, 1)[1] / r.std for r in runs])
    return float((np.mean(x**2) - 1) * np.sqrt(len(x) / 2))


def lost_in_noise(runs: Sequence[EnvelopeRun]) -> float:
    """Part of all rows whose wave is not clear of its noise."""
    return float(
        np.mean(
            np.concatenate([np.linalg.norm(r.envelope, axis=1) < CLEAR_WAVE * r.std for r in runs])
        )
    )


def out_of_range(runs: Sequence[EnvelopeRun], method: str) -> str:
    """Why a method cannot answer with these runs; empty: it can."""
    r = roundness(runs)
    if method in USES_AXES and r > CIRCULAR:
        return (
            f"{method} needs an elongated wave, |a_B/a_A| reaches {r:.2g}; use stokes or likelihood"
        )
    return ""


def list_warnings(runs: Sequence[EnvelopeRun], method: str, eliminate_rate: bool) -> list[str]:
    """Sentences about known biases of a method on these runs."""
    out = []
    r = roundness(runs)
    if method == "moving-axes-small-quadrature" and r > 0.03:
        out.append(
            f"moving-axes-small-quadrature drops terms in a_B/a_A, which reaches {r:.2g}: ν and the"
            " damping split are biased (seed A 14, 16)"
        )
    if eliminate_rate and method in ("fixed-axes", "fixed-axes-weighted", "products"):
        out.append(
            "the published elimination KΩ := −mθ̇ deletes the drift it seeks: the damping split"
            " comes out halved (with quadrature or rotation its axis is wrong as well); use the"
            " true rate"
        )
    turned = max(
        float(np.ptp(ellipse.unwrap(*ellipse.wave(run.envelope, 1)[2:], 1)[0])) for run in runs
    )
    if method == "frozen-axes" and turned > FROZEN:
        out.append(
            "frozen-axes takes the splits where the wave stands on average; it turns by"
            f" {turned:.2g} rad of mθ, use moving-axes"
        )
    if method == "fixed-axes-groups":
        out.append(
            "fixed-axes-groups drops the smaller of sin Δφ and cos Δφ: it is biased by up to a"
            " tenth of the other split's terms"
        )
    lost = lost_in_noise(runs)
    if lost > LOST_ROWS:
        out.append(
            f"in {lost:.0%} of the averaged rows the wave is below {CLEAR_WAVE:g} standard"
            f" deviations of its noise: {method} multiplies noisy values, so it is biased there;"
            " use likelihood, or cut the runs' ends"
        )
    if method in USES_AXES and quadrature_significance(runs) < 3:
        out.append("the quadrature is lost in the noise: the frequency split is skipped")
    return out
