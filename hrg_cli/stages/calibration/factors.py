"""Further causes of drift beside the tables, each a set of columns of the joint fit: measured
quadrature, phase, drive, thermal memory.

Signs: PHYSICS §0 and §4, checked against the exact slow model in the tests. r = a_B/a_A, ζ = 2m(θ −
θ_ω).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...fitting.least_squares import fit_columns
from ...fitting.tables.increments import AnglePath
from ...fitting.tables.table_layout import Factor
from ...fourier import compute_node_weights
from .late_log import LATE, compute_rate_slope, is_rate_moving

Array = np.ndarray


LEAST_FLATNESS = 0.1
"""Least 1 − r²: a nearly circular orbit has no wave angle, and no drift formula."""
FEWEST_RATES = 4
"""Different mean rates from which a square and a cube of the rate are told from the tables."""


def build_quadrature(path: AnglePath) -> Array:
    """The drift's columns by the quadrature that is measured, exact in r: seed A (11).

    r/(1 − r²)·(cos 2mθ, sin 2mθ), of D = −2rδω cos ζ/(1 − r²); the coefficients are −2δω(cos 2mθ_ω,
    sin 2mθ_ω) [rad/s].

    Parameters
    ----------
    path
        A run, r = a_B/a_A its ratio.

    Returns
    -------
    ndarray
        (n, 2) of its n increments.

    Examples
    --------
    r = 0.6 at θ = 0:

    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.stages.calibration.factors import build_quadrature
    >>> path = draw_path(blocks=3, ratio=0.6)
    >>> build_quadrature(path).round(9).tolist()
    [[0.9375, 0.0], [0.9375, 0.0]]
    """
    ratio = path.average_neighbours(path.ratio)
    return np.asarray(
        (ratio / np.maximum(1 - ratio**2, LEAST_FLATNESS))[:, None]
        * path.build_angle_basis(1)[:, 1:]
    )


def build_ellipticity(path: AnglePath) -> Array:
    """What the damping anisotropy adds to the drift in an ellipse (PHYSICS §4, (8)).

    2r²/(1 − r²)·(cos 2mθ, sin 2mθ), beside the table's own first harmonic: together νδμ sin χ·(1 +
    r²)/(1 − r²).

    Parameters
    ----------
    path
        A run, r = a_B/a_A its ratio.

    Returns
    -------
    ndarray
        (n, 2) of its n increments.

    Examples
    --------
    r = 0.6 at θ = 0, where (1 + r²)/(1 − r²) = 2.125:

    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.stages.calibration.factors import build_ellipticity
    >>> path = draw_path(blocks=3, ratio=0.6)
    >>> 1 + build_ellipticity(path)[0].round(9)
    array([2.125, 1.   ])
    """
    square = path.average_neighbours(path.ratio) ** 2
    return np.asarray(
        (2 * square / np.maximum(1 - square, LEAST_FLATNESS))[:, None]
        * path.build_angle_basis(1)[:, 1:]
    )


def spread_over_nodes(factor: Factor, nodes: Array, axis: str, interpolation: str) -> Factor:
    """A factor whose coefficients are interpolated between the nodes.

    Parameters
    ----------
    factor
        Columns (n, q) of a run.
    nodes
        Of the tables (J,).
    axis
        "temperature" or "frequency".
    interpolation
        Between the nodes.

    Returns
    -------
    callable
        Columns ψ_j(x)·factor (n, J·q) of a run, node by node.

    Examples
    --------
    Halfway between two nodes each has half of it:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.stages.calibration.factors import build_quadrature, spread_over_nodes
    >>> path, nodes = draw_path(blocks=3, ratio=0.6), np.array([10.0, 30.0])
    >>> columns = spread_over_nodes(build_quadrature, nodes, "temperature", "linear")
    >>> columns(path)[0].round(9).tolist()
    [0.46875, 0.0, 0.46875, 0.0]
    """

    def columns(path: AnglePath) -> Array:
        own = factor(path)
        return np.asarray(
            (
                _find_node_weights(path, nodes, axis, interpolation)[:, :, None] * own[:, None, :]
            ).reshape(len(own), -1)
        )

    return columns


def _find_node_weights(path: AnglePath, nodes: Array, axis: str, interpolation: str) -> Array:
    """Weights ψ_j (n, J) of the nodes at the increments' temperature or frequency."""
    if len(nodes) == 1:
        return np.ones((len(path), 1))
    x = path.average_neighbours(path.find_abscissa(axis))
    return compute_node_weights(
        x, nodes, "linear" if interpolation in ("linear", "monotone") else "cubic"
    )


def compute_phase_ratio(path: AnglePath) -> Array:
    """What dφ/dt is multiplied with in the drift by the measured frequency, exact in r: seed A
    (12).

    −2r/(1 + r²) (PHYSICS §4, after (7)).

    Parameters
    ----------
    path
        A run, r = a_B/a_A its ratio.

    Returns
    -------
    ndarray
        (n,) of its increments.

    Examples
    --------
    It is largest, −1, where the wave is a circle:

    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.stages.calibration.factors import compute_phase_ratio
    >>> path = draw_path(blocks=3, ratio=1.0)
    >>> compute_phase_ratio(path).tolist()
    [-1.0, -1.0]
    """
    ratio = path.average_neighbours(path.ratio)
    return np.asarray(-2 * ratio / (1 + ratio**2))


def build_flattening(path: AnglePath) -> Array:
    """What an ellipse takes from the damping anisotropy's drift in (12).

    −2r²/(1 + r²)·(cos 2mθ, sin 2mθ), beside the table's own first harmonic: together νδμ sin χ·(1 −
    r²)/(1 + r²).

    Parameters
    ----------
    path
        A run, r = a_B/a_A its ratio.

    Returns
    -------
    ndarray
        (n, 2) of its n increments.

    Examples
    --------
    In a circle nothing is left of it:

    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.stages.calibration.factors import build_flattening
    >>> path = draw_path(blocks=3, ratio=1.0)
    >>> (1 + build_flattening(path)[:, 0]).tolist()
    [0.0, 0.0]
    """
    square = path.average_neighbours(path.ratio) ** 2
    return np.asarray((-2 * square / (1 + square))[:, None] * path.build_angle_basis(1)[:, 1:])


def choose_reference_hz(paths: Sequence[AnglePath]) -> float:
    """A frequency near those of all runs.

    The columns of `phase` and `mean_frequency` are taken against it: beside 5000 Hz a mean
    frequency's change of millihertz would be lost, and both columns be one.

    Parameters
    ----------
    paths
        The runs.

    Returns
    -------
    float
        Mean of the runs' mean frequencies [Hz].

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.calibration.factors import choose_reference_hz
    >>> choose_reference_hz([Told(frequency_hz=[5000.0, 5000.2]), Told(frequency_hz=[5001.0])])
    5000.55
    """
    return float(np.mean([np.mean(path.frequency_hz) for path in paths]))


def _make_phase_factor(reference: float) -> Factor:
    """−2r/(1 + r²)·dφ/dt: seed A (12), coefficient 1 when dφ/dt is taken against the mean
    frequency; here against `reference`, Hz."""

    def columns(path: AnglePath) -> Array:
        return np.asarray(
            compute_phase_ratio(path)
            * 2
            * np.pi
            * (path.average_neighbours(path.frequency_hz) - reference)
        )[:, None]

    return columns


def _build_mean_frequency(path: AnglePath) -> Array:
    """4πr/(1 + r²) (n, 1): what a hertz of the mean frequency f(T) adds to `phase`."""
    return np.asarray(-2 * np.pi * compute_phase_ratio(path))[:, None]


def _build_rate_powers(fastest: float) -> Factor:
    """((Ω/Ω_max)², (Ω/Ω_max)³): a drift that moves with the rate itself."""

    def columns(path: AnglePath) -> Array:
        return np.stack([(path.rate_rad_s / fastest) ** k for k in (2, 3)], axis=1)

    return columns


def _build_quadrature_drive(path: AnglePath) -> Array:
    """a_ΦB/a_A: phase error of the quadrature loop's force, D = −(a_ΦB/a_A)Δφ_B (PHYSICS C1); zero
    in free runs."""
    return _a_second(path, path.drive_quadrature)[:, None]


def _build_main_drive(path: AnglePath) -> Array:
    """a_ΦA/a_A·(1, cos 2mθ, sin 2mθ): the drive matrix, coefficients ρ, ε/2 and −g/2 (PHYSICS C5,
    C4, C3); zero in free runs."""
    return np.asarray(_a_second(path, path.drive_main)[:, None] * path.build_angle_basis(1))


def _a_second(path: AnglePath, drive: Array | None) -> Array:
    """A drive's log against the amplitude, 1/s (n,); a free run needs none."""
    if drive is None or not path.forced:
        return np.zeros(len(path))
    return path.average_neighbours(
        np.divide(
            drive, path.main_amplitude, out=np.zeros(len(drive)), where=path.main_amplitude > 0
        )
    )


def _build_late_force(path: AnglePath) -> Array:
    """−a_ΦA/a_A·mθ' (n, 1): a main force that stands τ behind the wave turns it back, coefficient
    τ [s] (`loop_delay`); zero in free runs."""
    return np.asarray(-_a_second(path, path.drive_main) * _carry_turn(path))[:, None]


def _build_late_unlogged_force(path: AnglePath) -> Array:
    """The same of a drive without a log: −mθ' in forced runs only, coefficient ντ."""
    return np.asarray(-float(path.forced) * _carry_turn(path))[:, None]


def _carry_turn(path: AnglePath) -> Array:
    """mθ' of a run's increments (n,) as a scale factor and a first harmonic of its own carry it:
    the measured increments would put their noise into a column."""
    columns = np.column_stack([path.rotation, path.build_angle_basis(1) * path.interval_s[:, None]])
    own = fit_columns(columns, path.turn)
    return np.asarray(columns @ own / path.interval_s)


def _build_forced_only(path: AnglePath) -> Array:
    """(1, cos 2mθ, sin 2mθ) in forced runs only: the drive matrix, told from the resonator by free
    runs."""
    return np.asarray(path.build_angle_basis(1) * float(path.forced))


def build_factors(
    paths: Sequence[AnglePath], nodes: Array, axis: str, interpolation: str, wanted: Sequence[str]
) -> tuple[dict[str, Factor], dict[str, int]]:
    """The factors of wanted names that runs can carry.

    Parameters
    ----------
    paths
        The runs.
    nodes
        Of the tables (J,), over which some factors follow the temperature or the frequency.
    axis
        "temperature" or "frequency".
    interpolation
        Between the nodes.
    wanted
        Names.

    Returns
    -------
    tuple of dict
        Name -> columns of a run, and name -> how many; what a run does not log, or does not vary,
        is left out.

    Examples
    --------
    Free runs without a quadrature, at one rate, carry no measured part:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.stages.calibration.factors import build_factors
    >>> path = draw_path(blocks=3, forced=False)
    >>> names = ["drive_matrix", "quadrature_course", "rate", "main_drive"]
    >>> build_factors([path], np.array([20.0]), "temperature", "linear", names)[1]
    {'drive_matrix': 3}
    """
    at_nodes = nodes, axis, interpolation
    count = len(nodes)
    available: dict[str, tuple[Factor, int]] = {
        "quadrature": (build_quadrature, 2),
        "drive_matrix": (_build_forced_only, 3),
        "drive_delay": (_build_late_unlogged_force, 1),
        "ellipticity": (build_ellipticity, 2),
    }
    if any(np.any(p.ratio) for p in paths):
        available |= {
            "quadrature_course": (spread_over_nodes(build_quadrature, *at_nodes), 2 * count),
            "ellipticity_course": (spread_over_nodes(build_ellipticity, *at_nodes), 2 * count),
        }
        if all(np.isfinite(p.frequency_hz).all() for p in paths):
            available |= {
                "phase": (_make_phase_factor(choose_reference_hz(paths)), 1),
                "mean_frequency": (spread_over_nodes(_build_mean_frequency, *at_nodes), count),
                "flattening_course": (spread_over_nodes(build_flattening, *at_nodes), 2 * count),
            }
    fastest = max(float(np.abs(p.rate_rad_s).max(initial=0.0)) for p in paths)
    means = np.array([float(np.mean(p.rate_rad_s)) for p in paths])
    if fastest > 0 and len(np.unique(np.round(means / fastest, 2))) >= FEWEST_RATES:
        available["rate"] = (_build_rate_powers(fastest), 2)
    if any(is_rate_moving(p) for p in paths):
        available[LATE] = (compute_rate_slope, 1)
    forced = [p for p in paths if p.forced]
    for name, logs, factor, width in (
        ("quadrature_drive", [p.drive_quadrature for p in forced], _build_quadrature_drive, 1),
        ("main_drive", [p.drive_main for p in forced], _build_main_drive, 3),
        ("loop_delay", [p.drive_main for p in forced], _build_late_force, 1),
    ):
        if (
            forced
            and all(log is not None and np.isfinite(log).all() for log in logs)
            and any(np.any(log) for log in logs)
        ):
            available[name] = (factor, width)
    chosen = {name: available[name] for name in wanted if name in available}
    return {name: f for name, (f, _) in chosen.items()}, {
        name: width for name, (_, width) in chosen.items()
    }
