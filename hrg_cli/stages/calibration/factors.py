"""Further causes of drift beside the tables, each a set of columns of the joint fit: measured quadrature, phase, drive, thermal memory.

Signs: PHYSICS §0 and §4, checked against the exact slow model in the tests. r = a_B/a_A, ζ = 2m(θ − θ_ω).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...fitting.tables.fourier import node_weights
from ...fitting.tables.increments import Path
from ...fitting.tables.joint import Factor, Layout, Model
from ...records import Resonator

Array = np.ndarray


LEAST_FLATNESS = 0.1
"""Least 1 − r²: a nearly circular orbit has no wave angle, and no drift formula."""


def quadrature(path: Path) -> Array:
    """r/(1 − r²)·(cos 2mθ, sin 2mθ): seed A (11), exact in r: D = −2rδω cos ζ/(1 − r²); coefficients −2δω(cos 2mθ_ω, sin 2mθ_ω)."""
    ratio = path.middle(path.ratio)
    return np.asarray((ratio / np.maximum(1 - ratio**2, LEAST_FLATNESS))[:, None] * path.angle_basis(1)[:, 1:])


def ellipticity(path: Path) -> Array:
    """2r²/(1 − r²)·(cos 2mθ, sin 2mθ): what the damping anisotropy adds in an ellipse, νδμ sin χ·(1 + r²)/(1 − r²) (PHYSICS §4, (8))."""
    square = path.middle(path.ratio) ** 2
    return np.asarray((2 * square / np.maximum(1 - square, LEAST_FLATNESS))[:, None] * path.angle_basis(1)[:, 1:])


def phase(path: Path) -> Array:
    """−2r·dφ/dt: seed A (12), coefficient 1 when dφ/dt is taken against the mean frequency; here against the run's reference."""
    return np.asarray(-2 * path.middle(path.ratio) * 2 * np.pi * path.middle(path.frequency_hz))[:, None]


def mean_frequency(nodes: Array, axis: str, interpolation: str) -> Factor:
    """4πr·ψ_j(x): what the mean frequency f(T), Hz, adds to `phase` at each node."""

    def columns(path: Path) -> Array:
        x = path.middle(path.temperature_degc if axis == "temperature" else path.frequency_hz) if len(nodes) > 1 else np.zeros(len(path))
        weights = node_weights(x, nodes, "linear" if interpolation in ("linear", "monotone") else "cubic")
        return np.asarray(4 * np.pi * path.middle(path.ratio)[:, None] * weights)

    return columns


def quadrature_drive(path: Path) -> Array:
    """a_ΦB/a_A: phase error of the quadrature loop's force, D = −(a_ΦB/a_A)Δφ_B (PHYSICS C1); zero in free runs."""
    return _a_second(path, path.drive_quadrature)[:, None]


def main_drive(path: Path) -> Array:
    """a_ΦA/a_A·(1, cos 2mθ, sin 2mθ): the drive matrix, coefficients ρ, ε/2 and −g/2 (PHYSICS C5, C4, C3); zero in free runs."""
    return np.asarray(_a_second(path, path.drive_main)[:, None] * path.angle_basis(1))


def _a_second(path: Path, drive: Array | None) -> Array:
    """A drive's log against the amplitude, 1/s (n,); a free run needs none."""
    if drive is None or not path.forced:
        return np.zeros(len(path))
    return path.middle(np.divide(drive, path.main_amplitude, out=np.zeros(len(drive)), where=path.main_amplitude > 0))


def forced_only(path: Path) -> Array:
    """(1, cos 2mθ, sin 2mθ) in forced runs only: the drive matrix, told from the resonator by free runs."""
    return np.asarray(path.angle_basis(1) * float(path.forced))


def build(
    paths: Sequence[Path], nodes: Array, axis: str, interpolation: str, wanted: Sequence[str]
) -> tuple[dict[str, Factor], dict[str, int]]:
    """(factors, their widths) of the wanted names that these runs can carry."""
    available: dict[str, tuple[Factor, int]] = {
        "quadrature": (quadrature, 2),
        "drive_matrix": (forced_only, 3),
        "ellipticity": (ellipticity, 2),
    }
    if all(np.isfinite(p.frequency_hz).all() for p in paths):
        available |= {"phase": (phase, 1), "mean_frequency": (mean_frequency(nodes, axis, interpolation), len(nodes))}
    forced = [p for p in paths if p.forced]
    for name, logs, factor, width in (
        ("quadrature_drive", [p.drive_quadrature for p in forced], quadrature_drive, 1),
        ("main_drive", [p.drive_main for p in forced], main_drive, 3),
    ):
        if forced and all(log is not None and np.isfinite(log).all() for log in logs) and any(np.any(log) for log in logs):
            available[name] = (factor, width)
    chosen = {name: available[name] for name in wanted if name in available}
    return {name: f for name, (f, _) in chosen.items()}, {name: width for name, (_, width) in chosen.items()}


def variant(name: str, layout: Layout, drift_limit: int, scale_limit: int, resonator: Resonator | None = None) -> Model:
    """The models of seed A as linear models: table, parametric (10), quadrature (11), phase (12), physical."""
    scale = layout.part("scale", scale_limit)
    if name == "table":
        return Model(name, np.concatenate([layout.part("drift", drift_limit), scale], axis=1))
    anisotropy = layout.part("drift", 1, lowest=1)
    if name == "parametric":
        return Model(name, np.concatenate([anisotropy, scale], axis=1))
    if name == "quadrature":
        return Model(name, np.concatenate([anisotropy, scale, layout.of_factors("quadrature")], axis=1))
    start = np.zeros(layout.size)
    if name == "phase":
        start[layout.factor("phase")] = 1.0
        return Model(name, np.concatenate([anisotropy, scale, layout.of_factors("mean_frequency")], axis=1), start)
    assert resonator is not None
    for j in range(len(layout.nodes)):
        start[layout.drift(j)][:3] = physical_drift(resonator)
        start[layout.scale(j)][0] = resonator.get("scale_factor")
    start[layout.factor("quadrature")] = physical_quadrature(resonator)
    return Model(name, np.zeros((layout.size, 0)), start)


def physical_drift(resonator: Resonator) -> Array:
    """Constant, cos 2mθ, sin 2mθ of D = νδμ sin 2m(θ − θ_μ) (seed A (8))."""
    split, axis = resonator.get("damping_split_1_s"), 2 * resonator.mode_number * resonator.get("damping_axis_rad")
    return np.array([0.0, -split * np.sin(axis), split * np.cos(axis)])


def physical_quadrature(resonator: Resonator) -> Array:
    """Coefficients of r·(cos 2mθ, sin 2mθ) in D = −2rδω cos 2m(θ − θ_ω) (seed A (8))."""
    split, axis = resonator.get("frequency_split_rad_s"), 2 * resonator.mode_number * resonator.get("stiffness_axis_rad")
    return -2 * split * np.array([np.cos(axis), np.sin(axis)])


def physical_covariance(resonator: Resonator) -> tuple[Array, Array]:
    """Covariance of (drift constant, cos, sin, K) and of the two quadrature coefficients, from the resonator's by its Jacobian."""
    names = [str(n) for n in resonator.name]
    covariance = np.asarray(resonator.covariance, float)
    two_m = 2 * resonator.mode_number
    table, measured = np.zeros((4, len(names))), np.zeros((2, len(names)))
    split, axis = resonator.get("damping_split_1_s"), two_m * resonator.get("damping_axis_rad")
    table[1:3, names.index("damping_split_1_s")] = -np.sin(axis), np.cos(axis)
    table[1:3, names.index("damping_axis_rad")] = -two_m * split * np.cos(axis), -two_m * split * np.sin(axis)
    table[3, names.index("scale_factor")] = 1.0
    split, axis = resonator.get("frequency_split_rad_s"), two_m * resonator.get("stiffness_axis_rad")
    measured[:, names.index("frequency_split_rad_s")] = -2 * np.cos(axis), -2 * np.sin(axis)
    measured[:, names.index("stiffness_axis_rad")] = 2 * two_m * split * np.sin(axis), -2 * two_m * split * np.cos(axis)
    return table @ covariance @ table.T, measured @ covariance @ measured.T


def measured_details(name: str, layout: Layout, coefficients: Array, covariance: Array) -> dict[str, Any] | None:
    """What `compensate` needs to compute the measured part of the drift in operation."""
    if name in ("quadrature", "physical"):
        place = layout.factor("quadrature")
        return {
            "kind": "quadrature",
            "coefficients": coefficients[place].tolist(),
            "std": _std(covariance, place),
        }
    if name == "phase":
        place = layout.factor("mean_frequency")
        return {
            "kind": "phase",
            "mean_frequency_hz": coefficients[place].tolist(),
            "mean_frequency_hz_std": _std(covariance, place),
        }
    return None


def _std(covariance: Array, place: slice) -> list[float]:
    return [float(v) for v in np.sqrt(np.maximum(np.diag(covariance)[place], 0))]
