"""Tables whose coefficients moved alike at every node, with their covariance."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from ...fourier import harmonic_basis, node_weights
from ...records import Calibration
from .record import table_std

Array = np.ndarray


def weights_at(calibration: Calibration, x: float) -> Array:
    """Weights (J,) of the nodes at x."""
    kind = "linear" if calibration.interpolation in ("linear", "monotone") else "cubic"
    return np.asarray(node_weights(np.array([x]), np.asarray(calibration.node, float), kind)[0])


def places_of_level(calibration: Calibration) -> Array:
    """Places (J, 3) of K_DC, K_DS and K in the covariance."""
    first = calibration.drift_harmonics.shape[1]
    width = first + calibration.scale_factor_harmonics.shape[1]
    return np.arange(len(calibration.node))[:, None] * width + np.array([1, 2, first])


def move_tables(
    calibration: Calibration,
    change: Array,
    known: Array,
    new: Array,
    then: Array,
    by_reference: bool,
    weights: Array,
) -> Calibration:
    """The tables with `change` (5,) added at every node; weights (J,) of the nodes at the
    resonator's place.

    Covariance: told by a reference, c' = c + (new − then): both resonators' are added. Told from
    the tables, c'_j = c_j − Σw_k c_k + new: what the tables knew of the level is replaced, the
    differences between nodes stay.
    """
    drift, scale = (
        np.array(t, float)
        for t in (calibration.drift_harmonics, calibration.scale_factor_harmonics)
    )
    drift[:, 1:3] += change[:2]
    scale[:, 0] += change[2]
    further = new + then if by_reference else new
    told = 0.0 if by_reference else 1.0
    covariance = _move_covariance(calibration, known, further, told, weights)

    count, first = len(calibration.node), drift.shape[1]
    std = np.sqrt(np.maximum(np.diag(covariance), 0)).reshape(count, first + scale.shape[1])
    angles, m = np.asarray(calibration.wave_angle_rad), calibration.mode_number
    of_drift, of_scale = (harmonic_basis(angles, (t.shape[1] - 1) // 2, m) for t in (drift, scale))
    details = json.loads(calibration.details)
    measured = details.get("measured")
    if measured and measured["kind"] == "quadrature" and known[3:].all():
        details["measured"] = measured | _move_measured(measured, change, further, told, weights)
    return calibration.replace(
        drift_harmonics=drift,
        drift_harmonics_std=std[:, :first],
        scale_factor_harmonics=scale,
        scale_factor_harmonics_std=std[:, first:],
        drift_rad_s=drift @ of_drift.T,
        drift_rad_s_std=table_std(of_drift, covariance, count, 0),
        scale_factor=scale @ of_scale.T,
        scale_factor_std=table_std(of_scale, covariance, count, first),
        covariance=covariance,
        details=json.dumps(details),
    )


def _move_covariance(
    calibration: Calibration, known: Array, further: Array, told: float, weights: Array
) -> Array:
    """Covariance of the tables after a common change of K_DC, K_DS and K with that of `further`
    (5, 5); told: the part of the tables' own level that the change took away. What the resonator does
    not tell (`known` (5,)) stays as it was."""
    places, covariance = places_of_level(calibration), np.array(calibration.covariance, float)
    everywhere = np.zeros((len(covariance), 3))
    level = np.zeros((3, len(covariance)))
    for h in np.flatnonzero(known[:3]):
        everywhere[places[:, h], h] = 1.0
        level[h, places[:, h]] = weights
    # c' = (1 − E w) c + E·new: what the tables knew of their level is exchanged for what the
    # resonator knows.
    kept = np.eye(len(covariance)) - told * everywhere @ level
    return np.asarray(kept @ covariance @ kept.T + everywhere @ further[:3, :3] @ everywhere.T)


def _move_measured(
    measured: dict[str, Any], change: Array, further: Array, told: float, weights: Array
) -> dict[str, Any]:
    """The coefficients of the measured quadrature at every node, moved alike, with their σ."""
    count = len(weights)
    old, old_std = (
        np.broadcast_to(np.atleast_2d(measured[key]), (count, 2)) for key in ("coefficients", "std")
    )
    own = np.eye(count) - told * weights[None, :]
    return {
        "coefficients": (old + change[3:]).tolist(),
        "std": np.sqrt(own**2 @ old_std**2 + np.diag(further)[3:]).tolist(),
    }
