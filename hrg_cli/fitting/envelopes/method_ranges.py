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


def measure_roundness(runs: Sequence[EnvelopeRun]) -> float:
    """Largest |a_B/a_A| of the runs, of each its 95 % quantile: 0 a straight line, 1 a circle.

    Parameters
    ----------
    runs
        Envelopes of each.

    Returns
    -------
    float
        0 to 1: of the roundest run. Single rows lost in noise do not count, as the largest would.

    Examples
    --------
    A wave along the first electrode with a hundredth of quadrature:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.method_ranges import measure_roundness
    >>> t = np.arange(20.0)
    >>> u = np.outer(np.exp(-0.1 * t), [1.0, 0.01j])
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-6, 0 * t, None, 5e3, 2, 1.0)
    >>> round(measure_roundness([run]), 9)
    0.01
    """
    worst = 0.0
    for run in runs:
        a, b, _, _ = ellipse.find_wave(run.envelope, 1)
        worst = max(worst, float(np.quantile(np.abs(b) / np.maximum(a, 1e-300), 0.95)))
    return worst


def measure_quadrature_significance(runs: Sequence[EnvelopeRun]) -> float:
    """Mean (a_B/σ)² above the 1 of pure noise, in its standard errors √(2/n).

    Parameters
    ----------
    runs
        Envelopes of each, with their σ.

    Returns
    -------
    float
        Of all rows together; from 3 on the quadrature is seen.

    Examples
    --------
    A quadrature of 2 σ in 200 rows: (4 − 1)/√(2/200).

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.method_ranges import measure_quadrature_significance
    >>> t = np.arange(200.0)
    >>> u = np.outer(np.ones(200), [1.0, 0.02j])
    >>> run = EnvelopeRun("", t, u, 0 * t + 0.01, 0 * t, None, 5e3, 2, 1.0)
    >>> round(measure_quadrature_significance([run]), 6)
    30.0
    """
    x = np.concatenate([ellipse.find_wave(r.envelope, 1)[1] / r.std for r in runs])
    return float((np.mean(x**2) - 1) * np.sqrt(len(x) / 2))


def measure_lost_share(runs: Sequence[EnvelopeRun]) -> float:
    """Part of all rows whose wave is not clear of its noise.

    Parameters
    ----------
    runs
        Envelopes of each, with their σ.

    Returns
    -------
    float
        0 to 1: rows whose amplitude is below `CLEAR_WAVE` times σ.

    Examples
    --------
    A decay by e in 10 s from 100 σ is below 10 σ after 10 ln 10 = 23 of 46 s:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.method_ranges import measure_lost_share
    >>> t = np.linspace(0.0, 20 * np.log(10), 1001)
    >>> u = np.outer(np.exp(-0.1 * t), [1.0, 0.0])
    >>> run = EnvelopeRun("", t, u, 0 * t + 0.01, 0 * t, None, 5e3, 2, 0.05)
    >>> round(measure_lost_share([run]), 2)
    0.5
    """
    return float(
        np.mean(
            np.concatenate([np.linalg.norm(r.envelope, axis=1) < CLEAR_WAVE * r.std for r in runs])
        )
    )


def find_refusal(runs: Sequence[EnvelopeRun], method: str) -> str:
    """Why a method cannot answer with these runs.

    Parameters
    ----------
    runs
        Envelopes of each.
    method
        Its name, as a user gives it.

    Returns
    -------
    str
        A clause with what to use instead; empty: it can answer.

    Examples
    --------
    A circle has no axes:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.method_ranges import find_refusal
    >>> t = np.arange(20.0)
    >>> u = np.outer(np.ones(20), [1.0, 1j])
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-6, 0 * t, None, 5e3, 2, 1.0)
    >>> find_refusal([run], "increments")
    'increments needs an elongated wave, |a_B/a_A| reaches 1; use stokes or likelihood'
    >>> find_refusal([run], "stokes")
    ''
    """
    r = measure_roundness(runs)
    if method in USES_AXES and r > CIRCULAR:
        return (
            f"{method} needs an elongated wave, |a_B/a_A| reaches {r:.2g}; use stokes or likelihood"
        )
    return ""


def list_warnings(runs: Sequence[EnvelopeRun], method: str, eliminate_rate: bool) -> list[str]:
    """Sentences about known biases of a method on these runs.

    Parameters
    ----------
    runs
        Envelopes of each.
    method
        Its name, as a user gives it.
    eliminate_rate
        Whether KΩ is replaced by −mθ̇, as published.

    Returns
    -------
    list of str
        One for each bias; empty where none is known.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.method_ranges import list_warnings
    >>> t = np.arange(20.0)
    >>> u = np.outer(np.ones(20), [1.0, 0.1j])
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-6, 0 * t, None, 5e3, 2, 1.0)
    >>> list_warnings([run], "moving-axes", False)
    []
    >>> list_warnings([run], "moving-axes-small-quadrature", False)[0][:60]
    'moving-axes-small-quadrature drops terms in a_B/a_A, which r'
    """
    out = []
    r = measure_roundness(runs)
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
        float(np.ptp(ellipse.unwrap(*ellipse.find_wave(run.envelope, 1)[2:], 1)[0])) for run in runs
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
    lost = measure_lost_share(runs)
    if lost > LOST_ROWS:
        out.append(
            f"in {lost:.0%} of the averaged rows the wave is below {CLEAR_WAVE:g} standard"
            f" deviations of its noise: {method} multiplies noisy values, so it is biased there;"
            " use likelihood, or cut the runs' ends"
        )
    if method in USES_AXES and measure_quadrature_significance(runs) < 3:
        out.append("the quadrature is lost in the noise: the frequency split is skipped")
    return out
