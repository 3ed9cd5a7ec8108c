"""What the measured frequency tells of what a variant of the drift takes from the motion: the
frequency split, and the mean frequency.

    dφ/dt = 2πf + [δω cos ζ (1 + r²) − 2rνδμ sin χ]/(1 − r²)   (PHYSICS §4, (8))

The split moves the frequency by itself, and the drift by −2r of itself only: of a quadrature of a
percent the same runs' frequency knows it a hundred times better than their drift does.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...fitting.least_squares import (
    fit_columns,
    invert_scaled,
    measure_columns,
    take_off_columns,
)
from ...fitting.tables.increments import AnglePath
from ...fitting.tables.joint import Fitted
from ...fitting.tables.normal_pieces import LEAST_SEEN, PIECES, number_pieces
from ...fitting.tables.table_layout import TableLayout
from ...fourier import build_harmonic_basis
from .factors import LEAST_FLATNESS, choose_reference_hz, spread_over_nodes

Array = np.ndarray
OWN = 2
"""Coefficients of each run's own frequency: its mean and its slope."""
LEAST_SPARE = 2
"""Pieces of time, or runs, more than coefficients that their scatter is told by, at least."""


@dataclass(frozen=True)
class KnownCoefficients:
    """What is known of a factor's coefficients without the drift: values (q,) and covariance
    (q, q)."""

    values: Array
    covariance: Array


def find_in_frequency(fitted: Fitted) -> dict[str, KnownCoefficients]:
    """The frequency split and the mean frequency at the nodes, from the runs' frequency.

    Each run has a frequency and a slope of its own, since no thermometer knows millihertz. What is
    left follows slow temperatures and is no white noise: it is counted by whole pieces of time
    (Liang and Zeger's covariance).

    Parameters
    ----------
    fitted
        The runs, whose drift tells the damping's part of the frequency.

    Returns
    -------
    dict
        Of "quadrature_course" [rad/s] and "mean_frequency" [Hz against the runs' mean], what they
        tell; empty where no frequency was measured.

    Examples
    --------
    A split of 0.01 rad/s along θ = 0 moves the frequency by 0.01 cos 4θ; the drift's coefficient
    is twice that, turned round:

    >>> from dataclasses import replace
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import TableLayout
    >>> from hrg_cli.stages.calibration.factors import build_factors
    >>> from hrg_cli.stages.calibration.frequency_split import find_in_frequency
    >>> random, paths = np.random.default_rng(1), []
    >>> for rate in (-0.2, -0.1, 0.1, 0.2):
    ...     path = draw_path(rate, random, ratio=0.01)
    ...     moved = 0.01 * np.cos(4 * path.angle_rad) / (2 * np.pi)
    ...     paths.append(replace(path, frequency_hz=5000 + moved))
    >>> nodes, names = np.array([20.0]), ["quadrature_course", "mean_frequency"]
    >>> factors = build_factors(paths, nodes, "temperature", "linear", names)
    >>> layout = TableLayout(nodes, "temperature", 2, 1, 0, "linear", *factors)
    >>> find_in_frequency(fit(paths, layout))["quadrature_course"].values.round(4).tolist()
    [-0.02, 0.0]
    """
    layout = fitted.layout
    measured = [np.ptp(path.frequency_hz) > 0 for path in fitted.paths]
    if not {"quadrature_course", "mean_frequency"} <= set(layout.factors) or not all(measured):
        return {}
    split, offsets = _fit_split(fitted)
    found = {"quadrature_course": split, "mean_frequency": _average(layout, fitted.paths, offsets)}
    return {name: known for name, known in found.items() if known is not None}


def _fit_split(fitted: Fitted) -> tuple[KnownCoefficients | None, Array]:
    """Coefficients of the measured quadrature, −2δω(cos 2mθ_ω, sin 2mθ_ω) at the nodes (None: not
    told, or by too few pieces of time), and each run's frequency against the reference [Hz]."""
    layout, paths = fitted.layout, fitted.paths
    of_split = spread_over_nodes(_build_stretched, layout.nodes, layout.axis, layout.interpolation)
    columns, speeds = [of_split(path) for path in paths], _find_speeds(fitted)
    freed = [_take_off_own(np.column_stack([c, y])) for c, y in zip(columns, speeds)]
    X, y = np.concatenate([f[:, :-1] for f in freed]), np.concatenate([f[:, -1] for f in freed])
    found = fit_columns(X, y)
    offsets = [np.mean(y - c @ found) / (2 * np.pi) for c, y in zip(columns, speeds)]
    piece = np.concatenate([PIECES * run + number_pieces(len(p)) for run, p in enumerate(paths)])
    left = invert_scaled(X) * (y - X @ found)
    sums = np.stack([left[:, piece == one].sum(axis=1) for one in np.unique(piece)])
    spare = len(sums) - X.shape[1] - OWN * len(paths)
    if not _is_told(X) or spare < LEAST_SPARE:
        return None, np.array(offsets)
    spread = sums.T @ sums * len(sums) / spare
    return KnownCoefficients(-2 * found, 4 * spread), np.array(offsets)


def _is_told(X: Array) -> bool:
    """Whether columns tell every coefficient: what was never seen would come out as 0 ± 0."""
    unit = X / measure_columns(X)
    return bool(np.linalg.eigvalsh(unit.T @ unit).min() > LEAST_SEEN)


def _take_off_own(columns: Array) -> Array:
    """Columns of a run (n, k) without what a frequency and a slope of its own would take up."""
    return take_off_columns(columns, np.vander(np.linspace(-1, 1, len(columns)), OWN))


def _find_speeds(fitted: Fitted) -> list[Array]:
    """dφ/dt of each run's increments against the reference, less −2rνδμ sin χ/(1 − r²) as the fit
    with everything free has it: 2πf and the split's part are left."""
    layout, reference = fitted.layout, choose_reference_hz(fitted.paths)
    first = [np.arange(layout.size)[layout.drift(j)][1:3] for j in range(len(layout.nodes))]
    damping = fitted.solution.coefficients[np.concatenate(first)]
    quadrature = layout.factors["quadrature_course"]
    return [
        2 * np.pi * (path.average_neighbours(path.frequency_hz) - reference)
        + 2 * quadrature(path) @ damping
        for path in fitted.paths
    ]


def _average(
    layout: TableLayout, paths: Sequence[AnglePath], offsets: Array
) -> KnownCoefficients | None:
    """Mean frequency at the nodes from that of each run, as well as the runs agree; None where
    they are too few to say that."""
    weight = spread_over_nodes(_build_ones, layout.nodes, layout.axis, layout.interpolation)
    X = np.stack([weight(path).mean(axis=0) for path in paths])
    spare = len(X) - X.shape[1]
    if not _is_told(X) or spare < LEAST_SPARE:
        return None
    found, inverse = fit_columns(X, offsets), invert_scaled(X)
    scatter = float(np.sum((offsets - X @ found) ** 2)) / spare
    return KnownCoefficients(found, inverse @ inverse.T * scatter)


def _build_stretched(path: AnglePath) -> Array:
    """(1 + r²)/(1 − r²)·(cos 2mθ, sin 2mθ), as neighbouring blocks' mean frequency has it."""
    travel = np.gradient(path.angle_rad, path.time_s) * path.width_s
    basis = build_harmonic_basis(path.angle_rad, 1, path.mode_number, travel)[:, 1:]
    square = path.ratio**2
    stretch = (1 + square) / np.maximum(1 - square, LEAST_FLATNESS)
    return path.average_neighbours(stretch[:, None] * basis)


def _build_ones(path: AnglePath) -> Array:
    return np.ones((len(path), 1))
