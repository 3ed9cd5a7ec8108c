"""Drift and scale factor of a calibration record at any temperature (or frequency) and wave angle,
with their standard deviations."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import compress
from typing import Any

import numpy as np

from ...errors import HrgError
from ...fitting.checks import Check, check_at_most
from ...fitting.tables.increments import AnglePath
from ...fourier import harmonic_basis, node_weights
from ...records import Calibration
from .between_nodes import make_bump
from .factors import build_ellipticity, build_flattening, build_quadrature, compute_phase_ratio

Array = np.ndarray
TABLES = ("drift_rad_s", "scale_factor")
"""What the details call the doubt that interpolation adds to D and K."""
FEW_NODES = 4
"""Nodes up to which none can be left out to see how well the others predict it."""
TOLD = 3.0
"""Times the standard deviation at the nodes from which the one midway between them is told."""
ANGLES = 24
"""Wave angles over which a standard deviation at the nodes is averaged."""


def need_range(calibration: Calibration, x: Array, where: str) -> None:
    """HrgError when x leaves the range the table was made for, or is missing."""
    name, unit = ("temperature", "°C") if calibration.axis == "temperature" else ("frequency", "Hz")
    if not np.isfinite([calibration.node_min, calibration.node_max]).all():
        return
    x = np.asarray(x, float)
    if not np.isfinite(x).all():
        raise HrgError(f"{where}: its {name} is missing, the tables need it; log it")
    low, high = float(x.min()), float(x.max())
    slack = 0.02 * (calibration.node_max - calibration.node_min)
    if low < calibration.node_min - slack or high > calibration.node_max + slack:
        raise HrgError(
            f"{where}: its {name} goes from {low:.6g} to {high:.6g} {unit}, the tables hold from"
            f" {calibration.node_min:.6g} to {calibration.node_max:.6g}; calibrate over the wider"
            " range"
        )


def compute_standard_deviations(
    calibration: Calibration, x: Array, wave_angle_rad: Array
) -> tuple[Array, Array]:
    """Standard deviations (n,) of D and K at (x, θ): noise of the fit, and of the interpolation
    between nodes where it was estimated."""
    places = _places(calibration)
    between = interpolate_doubt(calibration, x)
    out = []
    for rows, own, doubt in zip(
        _rows_of_tables(calibration, x, wave_angle_rad), places, between.T, strict=True
    ):
        block = np.asarray(calibration.covariance)[np.ix_(own, own)]
        variance = np.sum((rows @ block) * rows, axis=1) + doubt**2
        out.append(np.sqrt(np.maximum(variance, 0)))
    return out[0], out[1]


def build_coefficient_rows(
    calibration: Calibration, x: Array, wave_angle_rad: Array, weight: Array
) -> Array:
    """Derivatives (n, P) by all coefficients, in the order of their covariance, of weight[0] D +
    weight[1] K at (x, θ); weight (2, n)."""
    out = np.zeros((len(x), len(np.asarray(calibration.covariance))))
    tables = _rows_of_tables(calibration, x, wave_angle_rad)
    for rows, own, factor in zip(tables, _places(calibration), weight, strict=True):
        out[:, own] = rows * factor[:, None]
    return out


def interpolate_doubt(calibration: Calibration, x: Array) -> Array:
    """Standard deviations (n, 2) that interpolation between nodes adds to D and K at x; 0 where it
    was not estimated."""
    doubt = read_interpolation_std(calibration)
    shape = make_bump(x, np.asarray(calibration.node, float))
    return np.stack([float(doubt.get(key, 0.0)) * shape for key in TABLES], axis=1)


def _places(calibration: Calibration) -> tuple[Array, Array]:
    """Where the coefficients of D and those of K stand in their covariance."""
    drift, scale = (
        table.shape[1]
        for table in (calibration.drift_harmonics, calibration.scale_factor_harmonics)
    )
    node = np.arange(len(calibration.node))[:, None] * (drift + scale)
    return (node + np.arange(drift)).ravel(), (node + drift + np.arange(scale)).ravel()


def _rows_of_tables(
    calibration: Calibration, x: Array, wave_angle_rad: Array
) -> tuple[Array, Array]:
    """Derivatives of D and of K (n, nodes · harmonics) by their own coefficients."""
    kind = "linear" if calibration.interpolation in ("linear", "monotone") else "cubic"
    weights = node_weights(x, calibration.node, kind)

    def rows(table: Array) -> Array:
        order = (table.shape[1] - 1) // 2
        basis = harmonic_basis(wave_angle_rad, order, calibration.mode_number)
        return (weights[:, :, None] * basis[:, None, :]).reshape(len(basis), -1)

    return rows(calibration.drift_harmonics), rows(calibration.scale_factor_harmonics)


def read_interpolation_std(calibration: Calibration) -> dict[str, float]:
    """Standard deviation that interpolation adds to D and K midway between nodes, by table; empty
    where it was not estimated.

    HrgError: it is there, but no number.
    """
    doubt = json.loads(calibration.details).get("interpolation_std") or {}
    if not isinstance(doubt, dict) or not all(_is_number(v) for v in doubt.values()):
        raise HrgError(
            "the calibration's details are damaged (interpolation_std); make the calibration again"
        )
    return {name: float(value) for name, value in doubt.items()}


def check_between(calibration: Calibration) -> list[Check]:
    """What interpolation adds midway between nodes over the standard deviation at them, of D and of
    K; none where it was not estimated. Both are in every standard deviation: one that fails is a
    programme's, not an error's."""
    nodes = np.asarray(calibration.node, float)
    doubt = read_interpolation_std(calibration)
    if not doubt:
        return []
    at_nodes = _average_std(calibration, nodes)
    midway = _average_std(calibration, (nodes[1:] + nodes[:-1]) / 2)
    added = [float(doubt.get(key, 0.0)) for key in TABLES]
    bent = [more > TOLD * std for more, std in zip(added, at_nodes, strict=True)]
    sentence = _say_between(calibration, midway, at_nodes, bent) if any(bent) else ""
    return [
        check_at_most(f"{key}_between_nodes", more / max(std, 1e-300), TOLD, sentence)
        for key, more, std in zip(("drift", "scale_factor"), added, at_nodes, strict=True)
    ]


def _average_std(calibration: Calibration, x: Array) -> list[float]:
    """Standard deviations of D [rad/s] and K at places x (n,), rms over these and the wave angle."""
    angle = np.linspace(0, np.pi / calibration.mode_number, ANGLES, endpoint=False)
    stds = compute_standard_deviations(calibration, np.repeat(x, ANGLES), np.tile(angle, len(x)))
    return [float(np.sqrt(np.mean(std**2))) for std in stds]


def _say_between(
    calibration: Calibration,
    midway: Sequence[float],
    at_nodes: Sequence[float],
    bent: Sequence[bool],
) -> str:
    """The sentence of the standard deviations midway and at the nodes, of those of D and K that may
    bend, and what to do."""
    nodes = np.asarray(calibration.node, float)
    stds = (
        (f"D to {np.degrees(drift) * 3600:.2g} °/h", f"K to {1e6 * scale:.2g} ppm")
        for drift, scale in (midway, at_nodes)
    )
    said, known = (" and ".join(compress(words, bent)) for words in stds)
    told = f"midway they give {said} (at the nodes {known})"
    if len(nodes) > FEW_NODES:
        return f"the tables bend between their {len(nodes)} nodes: {told}; add nodes between them"
    unit = "°C" if calibration.axis == "temperature" else "Hz"
    digits = 1 - int(np.floor(np.log10(np.diff(nodes).min())))  # a tenth of the least distance
    places = " and ".join(f"{np.round(x, digits):.10g}" for x in (nodes[1:] + nodes[:-1]) / 2)
    return (
        f"no run shows how the tables bend between their {len(nodes)} nodes: {told}; add dwells at"
        f" {places} {unit}"
    )


@dataclass(frozen=True)
class MeasuredDrift:
    """Coefficients (n, …) of the part of the drift that is computed from what is seen in operation;
    `exact` in r, or to first order.

    kind "quadrature", seed A (11): D = r/(1 − r²)·(cos, sin)·quadrature + 2r²/(1 − r²)·(cos,
    sin)·damping kind "phase", seed A (12): D = −2r/(1 + r²)·2π(f − mean_frequency) − 2r²/(1 +
    r²)·(cos, sin)·damping
    """

    kind: str
    exact: bool
    damping: Array
    quadrature: Array | None = None
    mean_frequency_hz: Array | None = None


def interpolate_measured(calibration: Calibration, x: Array) -> MeasuredDrift | None:
    """The measured part's coefficients at temperatures or frequencies x (n,); None for a model
    without one.

    Files written before the formulas were exact in r, or with one pair for all nodes, are applied
    as they were fitted.
    """
    part = read_measured_part(calibration)
    if part is None:
        return None
    kind = "linear" if calibration.interpolation in ("linear", "monotone") else "cubic"
    weights = node_weights(np.asarray(x, float), np.asarray(calibration.node, float), kind)
    damping = weights @ np.asarray(calibration.drift_harmonics)[:, 1:3]
    if part["kind"] == "phase":
        return MeasuredDrift(
            "phase",
            bool(part.get("exact")),
            damping,
            mean_frequency_hz=weights @ np.array(part["mean_frequency_hz"]),
        )
    coefficients = np.atleast_2d(np.array(part["coefficients"], float))
    if len(coefficients) == 1:
        coefficients = np.repeat(coefficients, len(calibration.node), axis=0)
    return MeasuredDrift(
        "quadrature", bool(part.get("exact")), damping, quadrature=weights @ coefficients
    )


def read_angle_random_walk(calibration: Calibration) -> float:
    """Angle random walk of the gyro's rate as its calibration found it, rad/√s; 0 where it says
    none.

    HrgError: it is there, but no number.
    """
    noise = json.loads(calibration.details).get("noise") or {}
    walk = noise.get("angle_random_walk_rad_sqrt_s") if isinstance(noise, dict) else noise
    if walk is not None and not (_is_number(walk) and walk >= 0):
        raise HrgError("the calibration's details are damaged (noise); make the calibration again")
    return float(walk or 0.0)


def _is_number(value: Any) -> bool:
    return (
        isinstance(value, int | float) and not isinstance(value, bool) and bool(np.isfinite(value))
    )


def read_measured_part(calibration: Calibration) -> dict[str, Any] | None:
    """What of the drift is computed in operation, from the calibration's details: {kind,
    coefficients or mean_frequency_hz}; or None.

    HrgError: it is there, but not as `hrg calibrate` writes it.
    """
    part = json.loads(calibration.details).get("measured")
    if not part:
        return None
    kind = str(part.get("kind")) if isinstance(part, dict) else ""
    key = {"quadrature": "coefficients", "phase": "mean_frequency_hz"}.get(kind)
    if key is not None:
        try:
            numbers = np.array(part.get(key), float)
        except (TypeError, ValueError):
            numbers = np.array([np.nan])
        nodes = len(calibration.node)
        shapes = ((2,), (1, 2), (nodes, 2)) if key == "coefficients" else ((nodes,),)
        if numbers.shape in shapes and np.all(np.isfinite(numbers)):
            return dict(part)
    raise HrgError("the calibration's details are damaged (measured); make the calibration again")


def compute_corrections(calibration: Calibration, path: AnglePath) -> tuple[Array, Array]:
    """(D [rad/s], K) (n,) of a run's increments: the tables, and the part that the model measures."""
    x = path.average_neighbours(path.find_abscissa(calibration.axis))
    drift, scale = calibration.values_at(
        x, path.average_neighbours(path.angle_rad), np.diff(path.angle_rad)
    )
    return drift + compute_measured_drift(calibration, path), scale


def compute_measured_drift(calibration: Calibration, path: AnglePath) -> Array:
    """The part of the drift (n,) that seed A (11) or (12) computes from a_B/a_A and dφ/dt seen in
    operation; zeros otherwise."""
    x = path.average_neighbours(path.find_abscissa(calibration.axis))
    part = interpolate_measured(calibration, x)
    if part is None:
        return np.zeros(len(path))
    if part.kind == "quadrature":
        drift = (build_quadrature(path) * part.quadrature).sum(axis=1)
        return np.asarray(
            drift + (build_ellipticity(path) * part.damping).sum(axis=1) if part.exact else drift
        )
    speed = (
        2
        * np.pi
        * (path.average_neighbours(path.frequency_hz) - np.asarray(part.mean_frequency_hz))
    )
    if not part.exact:
        return np.asarray(-2 * path.average_neighbours(path.ratio) * speed)
    return np.asarray(
        compute_phase_ratio(path) * speed + (build_flattening(path) * part.damping).sum(axis=1)
    )
