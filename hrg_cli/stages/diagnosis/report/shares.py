"""Diagnosis, the shares: what each cause leaves in the runs where it is not taken in and everything
else is fitted anew.

With u the extended model's envelopes and u₋ those of the fit without one cause, the cause's share
is the difference of their waves: of m·θ (its slope over a quarter of a run is a drift), of ln a_A
and of the phase (its slope is a frequency). What the base model can take over of a cause is
therefore no part of its share, and the share does not depend on the order in which the causes were
found.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.causes.wave_frame import to_reals
from ....fitting.envelopes.coordinates import to_parameters
from ....physics import ellipse
from ....units import DEGREE_PER_HOUR
from ..fits.refits import leave_out

Array = np.ndarray
PIECES = 4
"""Pieces of a run, over each of which a difference of the angle is taken as a drift (as in the
held-out errors)."""
ALL_SUBSETS = 3
"""Causes up to which every combination is fitted."""
PPM = 1e6
ROUND = 0.7
"""Quadrature over main amplitude from which a wave has no angle worth the name."""


@dataclass(frozen=True)
class DriftDifference:
    """Of two motions, row by row: m·θ [rad], ln a_A, a_B/a_A and the phase [rad], each (k,)."""

    angle: Array
    amplitude: Array
    quadrature: Array
    phase: Array


def compute_difference(first: Array, second: Array) -> DriftDifference:
    """The difference of two motions, row by row.

    Of a circle neither angle nor phase is defined: their noise grows as 1/(1 − r²), r = a_B/a_A.

    Parameters
    ----------
    first, second
        Rows Re C0, Re S0, Im C0, Im S0, (k, 4).

    Returns
    -------
    DriftDifference
        First less second; angles between −π/2 and π/2, NaN where the wave is nearly a circle.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.report.shares import compute_difference
    >>> turned, still = np.array([[np.cos(0.1), np.sin(0.1), 0, 0]]), np.array([[1.0, 0, 0, 0]])
    >>> float(compute_difference(turned, still).angle[0].round(9))
    0.1
    """
    a, b = (
        ellipse.find_wave(rows[:, :2] + 1j * rows[:, 2:], 1)
        for rows in (np.asarray(first), np.asarray(second))
    )
    turns = np.round((a[2] - b[2]) / np.pi)
    phase = a[3] - b[3] + np.pi * turns
    with np.errstate(divide="ignore", invalid="ignore"):
        amplitude, quadrature = np.log(a[0] / b[0]), a[1] / a[0] - b[1] / b[0]
        flat = (np.abs(a[1]) < ROUND * a[0]) & (np.abs(b[1]) < ROUND * b[0])
    angle = np.where(flat, a[2] - b[2] - np.pi * turns, np.nan)
    return DriftDifference(
        angle, amplitude, quadrature, np.where(flat, np.angle(np.exp(1j * phase)), np.nan)
    )


def compute_departure_figures(
    departure: DriftDifference, run: Array, time_s: Array
) -> dict[str, float | None]:
    """Root mean squares of a difference over runs.

    Parameters
    ----------
    departure
        Of two motions, (k,).
    run
        Number of each row's run, (k,).
    time_s
        Of each row [s], (k,).

    Returns
    -------
    dict
        Drift m·dθ/dt in °/h, over quarters of each run; angle m·θ and amplitude in ppm; frequency
        in Hz. None where nothing shows it.

    Examples
    --------
    An angle that grows by 10⁻⁵ rad/s, two degrees an hour:

    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.report.shares import (
    ...     DriftDifference,
    ...     compute_departure_figures,
    ... )
    >>> t, zero = np.arange(40.0), np.zeros(40)
    >>> found = compute_departure_figures(DriftDifference(1e-5 * t, zero, zero, zero), zero, t)
    >>> round(found["drift_deg_h"], 3)
    2.063
    """
    drifts: list[float] = []
    frequencies: list[float] = []
    for k in np.unique(run):
        for piece in np.array_split(np.flatnonzero(run == k), PIECES):
            piece = piece[np.isfinite(departure.angle[piece])]
            t = time_s[piece] - time_s[piece].mean() if len(piece) > 2 else np.zeros(0)
            if t @ t > 0:
                drifts.append(float(t @ np.unwrap(departure.angle[piece], period=np.pi) / (t @ t)))
                frequencies.append(
                    float(t @ np.unwrap(departure.phase[piece]) / (t @ t) / (2 * np.pi))
                )
    return {
        "drift_deg_h": _rms(drifts, 1 / DEGREE_PER_HOUR),
        "angle_ppm": _rms(departure.angle, PPM),
        "amplitude_ppm": _rms(departure.amplitude, PPM),
        "frequency_hz": _rms(frequencies, 1.0),
    }


def _rms(values: Array | list[float], factor: float) -> float | None:
    squares = np.square(np.asarray(values, float))
    finite = squares[np.isfinite(squares)]
    return float(np.sqrt(finite.mean())) * factor if len(finite) else None


@dataclass(frozen=True)
class Shares:
    """Sets of causes left out, the rows of the model fitted without each set (k, 4, sets), and the
    figures of every single cause."""

    left_out: tuple[tuple[str, ...], ...]
    rows: Array
    figures: dict[str, dict[str, float | None]]


def list_sets_left_out(names: Sequence[str]) -> list[tuple[str, ...]]:
    """The sets of causes without which the model is fitted.

    Parameters
    ----------
    names
        Of the causes, in the order in which they were found.

    Returns
    -------
    list of tuple
        Every proper subset of a few causes; of many, each alone, and all but the first 1, 2, …
        found.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.report.shares import list_sets_left_out
    >>> list_sets_left_out(["gain_mismatch", "ageing"])
    [('gain_mismatch',), ('ageing',)]
    """
    if len(names) <= ALL_SUBSETS:
        return (
            [one for count in range(1, len(names)) for one in combinations(names, count)]
            if len(names) > 1
            else []
        )
    nested = [tuple(names[k:]) for k in range(len(names) - 1, 0, -1)]
    return list(dict.fromkeys([*((name,) for name in names), *nested]))


def compute_shares(base: ExtendedFit, fit: ExtendedFit) -> Shares:
    """Leave out sets of a model's causes and fit the rest.

    Parameters
    ----------
    base
        The fit without any cause.
    fit
        The extended model's.

    Returns
    -------
    Shares
        Rows with weight, in the order of the diagnosis' rows. A set without which the fit diverges
        is not told, and one without which it does not settle has no figures: they would be those of
        wherever it stopped.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.report.shares import compute_shares
    >>> found = compute_shares(draw_fit(), draw_fit())
    >>> found.left_out, found.rows.shape, found.figures
    ((), (150, 4, 0), {})
    """
    good = fit.series.weight > 0
    run = np.broadcast_to(np.arange(len(fit.series.names))[:, None], good.shape)[good]
    time_s, whole = fit.series.time_s[good], to_reals(fit.prediction.by_log[good])
    names = [effect.name for effect, _ in fit.point.active]
    rows = {tuple(names): to_reals(base.prediction.by_log[good])} if names else {}
    settled = {names[0]: rows[(names[0],)]} if len(names) == 1 else {}
    free, way_back = fit, None
    if np.isfinite(fit.freedom.offset_std):
        # a cause may have been found by the runs' frequencies alone, which the base model leaves
        # free
        free, way_back = replace(fit, freedom=replace(fit.freedom, offset_std=np.inf)), base
    for left_out in list_sets_left_out(names):
        refitted = leave_out(free, *left_out, base=way_back)
        if refitted is None:
            continue
        rows[left_out] = to_reals(refitted.prediction.by_log[good])
        if len(left_out) == 1 and refitted.converged:
            settled[left_out[0]] = rows[left_out]
    found = {
        name: compute_departure_figures(compute_difference(whole, without), run, time_s)
        for name, without in settled.items()
    }
    return Shares(
        tuple(rows),
        np.stack(list(rows.values()), axis=-1) if rows else np.zeros((len(whole), 4, 0)),
        found,
    )


def compute_base_covariance(fit: ExtendedFit, std: Array) -> Array:
    """Covariance of the base parameters beside the causes: Σ = G C Gᵀ, at stated standard
    deviations.

    G: slopes of the parameters against the fitted coordinates, C: the coordinates' covariance; the
    correlations are the fit's.

    Parameters
    ----------
    fit
        The extended model's.
    std
        That the report states, in the order of the resonator's file, (7,).

    Returns
    -------
    ndarray
        (7, 7), in the parameters' units.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.report.shares import compute_base_covariance
    >>> np.sqrt(np.diag(compute_base_covariance(draw_fit(), np.full(7, 1e-3)))).round(9).tolist()
    [0.001, 0.001, 0.001, 0.001, 0.001, 0.001, 0.001]
    """
    _, slopes = to_parameters(fit.point.p, fit.series.mode_number)
    out = np.zeros((7, 7))
    out[0, 0] = 1.0
    out[1:, 1:] = slopes @ fit.coordinate_covariance() @ slopes.T
    own = np.sqrt(np.maximum(np.diag(out), 0.0))
    scale = np.divide(std, own, out=np.zeros(7), where=own > 0)
    # what these runs do not show is assumed, and goes with nothing
    return out * np.outer(scale, scale) + np.diag(np.where(own > 0, 0.0, np.square(std)))


def report_shares(
    report: dict[str, Any], base: ExtendedFit, fit: ExtendedFit
) -> tuple[dict[str, Any], Shares]:
    """The report with each cause's share and the base parameters' covariance beside the causes.

    Parameters
    ----------
    report
        As JSON has it.
    base
        The fit without any cause.
    fit
        The extended model's.

    Returns
    -------
    tuple
        The report, and the rows of the models without some of the causes.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.report.shares import report_shares
    >>> report = {"effects": [], "values": 7 * [{"std": 1e-3}]}
    >>> told, shares = report_shares(report, draw_fit(), draw_fit())
    >>> len(told["covariance"]), shares.left_out
    (7, ())
    """
    found = compute_shares(base, fit)
    effects = [{**e, "share": found.figures.get(str(e["name"]))} for e in report["effects"]]
    covariance = compute_base_covariance(fit, np.array([v["std"] for v in report["values"]]))
    return report | {"effects": effects, "covariance": covariance.tolist()}, found
