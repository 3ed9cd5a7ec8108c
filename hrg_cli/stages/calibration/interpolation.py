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
from ...fourier import build_harmonic_basis, compute_node_weights
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
    """Refuse temperatures (or frequencies) at which tables were not made.

    Parameters
    ----------
    calibration
        The tables.
    x
        Of a run (n,) [°C or Hz].
    where
        The run, for messages.

    Raises
    ------
    HrgError
        One is missing, or more than a fiftieth of the range outside of it.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.calibration.interpolation import need_range
    >>> tables = Told(axis="temperature", node_min=0.0, node_max=50.0)
    >>> need_range(tables, [0.5, 50.5], "run 1")
    >>> need_range(tables, [0.5, 70.0], "run 1")
    Traceback (most recent call last):
    ...
    hrg_cli.errors.HrgError: run 1: its temperature goes from 0.5 to 70 °C, ...
    """
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
    """Standard deviations of D and K of tables at any place and wave angle.

    Parameters
    ----------
    calibration
        The tables.
    x
        Temperatures [°C] or frequencies [Hz] (n,).
    wave_angle_rad
        (n,).

    Returns
    -------
    tuple of ndarray
        Of D [rad/s] and of K (n,): the noise of the fit, and what interpolation adds between nodes
        where it was estimated.

    Examples
    --------
    Midway between two nodes that are known equally well the noise is averaged:

    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.stages.calibration.interpolation import compute_standard_deviations
    >>> one = np.ones((2, 1))
    >>> tables = Told(
    ...     node=np.array([0.0, 40.0]), drift_harmonics=0 * one, scale_factor_harmonics=one,
    ...     covariance=np.eye(4), interpolation="linear", mode_number=2, details="{}",
    ... )
    >>> drift, scale = compute_standard_deviations(tables, np.array([0.0, 20.0]), np.zeros(2))
    >>> drift.round(4).tolist()
    [1.0, 0.7071]
    """
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
    """Derivatives of a·D + b·K by all coefficients of tables.

    Parameters
    ----------
    calibration
        The tables.
    x
        Temperatures [°C] or frequencies [Hz] (n,).
    wave_angle_rad
        (n,).
    weight
        a and b (2, n).

    Returns
    -------
    ndarray
        (n, P), in the order of the coefficients' covariance.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.stages.calibration.interpolation import build_coefficient_rows
    >>> one = np.ones((2, 1))
    >>> tables = Told(
    ...     node=np.array([0.0, 40.0]), drift_harmonics=0 * one, scale_factor_harmonics=one,
    ...     covariance=np.eye(4), interpolation="linear", mode_number=2,
    ... )
    >>> build_coefficient_rows(
    ...     tables, np.array([10.0]), np.zeros(1), np.array([[1.0], [-0.2]])
    ... ).tolist()
    [[0.75, -0.15..., 0.25, -0.05]]
    """
    out = np.zeros((len(x), len(np.asarray(calibration.covariance))))
    tables = _rows_of_tables(calibration, x, wave_angle_rad)
    for rows, own, factor in zip(tables, _places(calibration), weight, strict=True):
        out[:, own] = rows * factor[:, None]
    return out


def interpolate_doubt(calibration: Calibration, x: Array) -> Array:
    """Standard deviations that interpolation between nodes adds to D and K.

    Parameters
    ----------
    calibration
        The tables.
    x
        Temperatures [°C] or frequencies [Hz] (n,).

    Returns
    -------
    ndarray
        (n, 2), of D [rad/s] and K; 0 at nodes, and where it was not estimated.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.stages.calibration.interpolation import interpolate_doubt
    >>> details = '{"interpolation_std": {"drift_rad_s": 1e-6, "scale_factor": 2e-6}}'
    >>> tables = Told(details=details, node=[0.0, 40.0])
    >>> interpolate_doubt(tables, np.array([0.0, 20.0])).tolist()
    [[0.0, 0.0], [1e-06, 2e-06]]
    """
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
    weights = compute_node_weights(x, calibration.node, kind)

    def rows(table: Array) -> Array:
        order = (table.shape[1] - 1) // 2
        basis = build_harmonic_basis(wave_angle_rad, order, calibration.mode_number)
        return (weights[:, :, None] * basis[:, None, :]).reshape(len(basis), -1)

    return rows(calibration.drift_harmonics), rows(calibration.scale_factor_harmonics)


def read_interpolation_std(calibration: Calibration) -> dict[str, float]:
    """Standard deviation that interpolation adds midway between nodes, as tables tell it.

    Parameters
    ----------
    calibration
        The tables.

    Returns
    -------
    dict
        Of "drift_rad_s" and "scale_factor"; empty where it was not estimated.

    Raises
    ------
    HrgError
        It is there, but no number.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.calibration.interpolation import read_interpolation_std
    >>> read_interpolation_std(Told(details='{"interpolation_std": {"scale_factor": 2e-6}}'))
    {'scale_factor': 2e-06}
    >>> read_interpolation_std(Told(details="{}"))
    {}
    """
    doubt = json.loads(calibration.details).get("interpolation_std") or {}
    if not isinstance(doubt, dict) or not all(_is_number(v) for v in doubt.values()):
        raise HrgError(
            "the calibration's details are damaged (interpolation_std); make the calibration again"
        )
    return {name: float(value) for name, value in doubt.items()}


def check_between(calibration: Calibration) -> list[Check]:
    """The checks of what interpolation adds midway between nodes, against the standard deviation at
    them.

    Both are in every standard deviation: one that fails is a programme's, not an error's.

    Parameters
    ----------
    calibration
        The tables.

    Returns
    -------
    list of Check
        Of D and of K; empty where it was not estimated.

    Examples
    --------
    Tables that are known to 1 µrad/s at their nodes, and bend by 5 µrad/s between them:

    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.stages.calibration.interpolation import check_between
    >>> one = np.ones((2, 1))
    >>> tables = Told(
    ...     node=np.array([0.0, 40.0]), drift_harmonics=0 * one, scale_factor_harmonics=one,
    ...     covariance=1e-12 * np.eye(4), interpolation="linear", mode_number=2, axis="temperature",
    ...     details='{"interpolation_std": {"drift_rad_s": 5e-6}}',
    ... )
    >>> drift, scale = check_between(tables)
    >>> round(drift.value, 6), drift.passed, scale.passed
    (5.0, False, True)
    >>> drift.sentence[-21:]
    '; add dwells at 20 °C'
    """
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
    """Standard deviations of D [rad/s] and K at places x (n,), rms over these and the wave
    angle."""
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
    """The coefficients of the part of the drift that is computed from what is seen in operation.

    Files written before the formulas were exact in r, or with one pair for all nodes, are applied
    as they were fitted.

    Parameters
    ----------
    calibration
        The tables.
    x
        Temperatures [°C] or frequencies [Hz] (n,).

    Returns
    -------
    MeasuredDrift or None
        At x; None for a model without such a part.

    Examples
    --------
    Half-way between nodes whose quadrature coefficients are 0 and 1 rad/s:

    >>> import json
    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.stages.calibration.interpolation import interpolate_measured
    >>> measured = {"kind": "quadrature", "exact": True, "coefficients": [[0.0, 0.0], [1.0, 0.0]]}
    >>> tables = Told(
    ...     details=json.dumps({"measured": measured}), node=np.array([0.0, 40.0]),
    ...     drift_harmonics=np.zeros((2, 3)), interpolation="linear",
    ... )
    >>> interpolate_measured(tables, np.array([20.0])).quadrature.tolist()
    [[0.5, 0.0]]
    """
    part = read_measured_part(calibration)
    if part is None:
        return None
    kind = "linear" if calibration.interpolation in ("linear", "monotone") else "cubic"
    weights = compute_node_weights(np.asarray(x, float), np.asarray(calibration.node, float), kind)
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
    """Angle random walk of the gyro's rate as its calibration found it.

    Parameters
    ----------
    calibration
        The tables.

    Returns
    -------
    float
        rad/√s; 0 where none is told.

    Raises
    ------
    HrgError
        It is there, but no number.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.calibration.interpolation import read_angle_random_walk
    >>> read_angle_random_walk(Told(details='{"noise": {"angle_random_walk_rad_sqrt_s": 1e-6}}'))
    1e-06
    >>> read_angle_random_walk(Told(details='{"noise": "loud"}'))
    Traceback (most recent call last):
    ...
    hrg_cli.errors.HrgError: the calibration's details are damaged (noise); ...
    """
    noise = json.loads(calibration.details).get("noise") or {}
    walk = noise.get("angle_random_walk_rad_sqrt_s") if isinstance(noise, dict) else noise
    if walk is not None and not (_is_number(walk) and walk >= 0):
        raise HrgError("the calibration's details are damaged (noise); ...")
    return float(walk or 0.0)


def _is_number(value: Any) -> bool:
    return (
        isinstance(value, int | float) and not isinstance(value, bool) and bool(np.isfinite(value))
    )


def read_measured_part(calibration: Calibration) -> dict[str, Any] | None:
    """What of the drift is computed in operation, from the details of tables.

    Parameters
    ----------
    calibration
        The tables.

    Returns
    -------
    dict or None
        Kind ("quadrature", "phase"), and coefficients [rad/s] or mean frequencies [Hz]; None for a
        model without such a part.

    Raises
    ------
    HrgError
        It is there, but not as `hrg calibrate` writes it.

    Examples
    --------
    A mean frequency for each node is needed:

    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.calibration.interpolation import read_measured_part
    >>> details = '{"measured": {"kind": "phase", "mean_frequency_hz": [5000.0]}}'
    >>> read_measured_part(Told(details=details, node=[20.0]))["kind"]
    'phase'
    >>> read_measured_part(Told(details=details, node=[20.0, 60.0]))
    Traceback (most recent call last):
    ...
    hrg_cli.errors.HrgError: the calibration's details are damaged (measured); ...
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
    raise HrgError("the calibration's details are damaged (measured); ...")


def compute_corrections(calibration: Calibration, path: AnglePath) -> tuple[Array, Array]:
    """D and K along a run: those of the tables, and the part that the model measures.

    Parameters
    ----------
    calibration
        The tables.
    path
        The run.

    Returns
    -------
    tuple of ndarray
        D [rad/s] and K (n,) of its increments.

    Examples
    --------
    Tables that hold the same at all angles:

    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.stages.calibration.interpolation import compute_corrections
    >>> path = draw_path(blocks=3)
    >>> tables = Told(
    ...     axis="temperature", details="{}",
    ...     values_at=lambda x, angle, travel: (1e-6 * np.ones(len(x)), 0.55 * np.ones(len(x))),
    ... )
    >>> [column.tolist() for column in compute_corrections(tables, path)]
    [[1e-06, 1e-06], [0.55, 0.55]]
    """
    x = path.average_neighbours(path.find_abscissa(calibration.axis))
    drift, scale = calibration.values_at(x, path.middle_angle_rad, np.diff(path.angle_rad))
    return drift + compute_measured_drift(calibration, path), scale


def compute_measured_drift(calibration: Calibration, path: AnglePath) -> Array:
    """The part of the drift that is computed from what is seen in operation: seed A (11) or (12).

    (11) takes a_B/a_A, (12) a_B/a_A and dφ/dt.

    Parameters
    ----------
    calibration
        The tables.
    path
        The run.

    Returns
    -------
    ndarray
        (n,) of its increments [rad/s]; zeros for a model without such a part.

    Examples
    --------
    −2δω of 1 rad/s beside a quadrature of r = 0.6 at θ = 0 makes r/(1 − r²):

    >>> import json
    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.stages.calibration.interpolation import compute_measured_drift
    >>> path = draw_path(blocks=3, ratio=0.6)
    >>> measured = {"kind": "quadrature", "exact": True, "coefficients": [[1.0, 0.0]]}
    >>> tables = Told(
    ...     axis="temperature", details=json.dumps({"measured": measured}), node=np.array([20.0]),
    ...     drift_harmonics=np.zeros((1, 3)), interpolation="linear",
    ... )
    >>> compute_measured_drift(tables, path).round(9).tolist()
    [0.9375, 0.9375]
    """
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
