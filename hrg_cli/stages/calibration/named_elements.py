"""What a calibration says of loops and pick-offs in the catalogue's names: the drive matrix by what
it does to drift, the read-out matrix by what it does to the scale factor.

A rotation ρ, non-orthogonality ε and gain mismatch g of the drive turn the wave as
mθ' = a_ΦA/a_A·(ρ + ε/2·cos 2mθ − g/2·sin 2mθ), loops that act τ late as −a_ΦA/a_A·τ·mθ'; those of
the pick-offs make the scale factor K₁(θ) = K₀(1 − g cos 2mθ − ε sin 2mθ) (PHYSICS R1, R2).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...effects import (
    drive_gain_mismatch,
    drive_nonorthogonality,
    drive_rotation,
    quadrature_drive_phase_error,
)
from ...fitting.tables.increments import AnglePath
from ...fitting.tables.joint import Fitted

Array = np.ndarray
ELEMENTS = (
    (drive_rotation.EFFECT, 1.0),
    (drive_nonorthogonality.EFFECT, 2.0),
    (drive_gain_mismatch.EFFECT, -2.0),
)
"""What the three coefficients of the drive matrix are, by the catalogue's pages: ρ, ε/2, −g/2 of
a_ΦA/a_A·(1, cos 2mθ, sin 2mθ)."""


def name_loop_elements(
    joint: Fitted, factors: Sequence[str], coefficients: Array, covariance: Array
) -> list[dict[str, Any]]:
    """What is wrong with the loops, in the catalogue's names, and how late they act.

    The drive matrix is seen in the pick-off's axes: a read-out matrix that also feeds the loops
    adds its own elements to it. Without a log of the drive its elements come in rad/s and are
    divided by the damping rate, which the free runs show.

    Parameters
    ----------
    joint
        The runs.
    factors
        Names of those that were told.
    coefficients
        (size,).
    covariance
        (size, size).

    Returns
    -------
    list of dict
        Name, value, standard deviation, units and z (two-sided) of each element.

    Examples
    --------
    A main force that is turned by 2 mrad turns the wave by ρ·a_ΦA/a_A:

    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.table_layout import TableLayout
    >>> from hrg_cli.stages.calibration.named_elements import name_loop_elements
    >>> names = dict(factors={"main_drive": None}, factor_columns={"main_drive": 3})
    >>> joint = Told(layout=TableLayout(np.array([20.0]), "temperature", 2, 0, 0, **names))
    >>> value = np.array([0.0, 0.5, 2e-3, 0.0, 0.0])
    >>> found = name_loop_elements(joint, ["main_drive"], value, 1e-8 * np.eye(5))
    >>> [(row["name"], row["value"], round(row["z"], 9)) for row in found][0]
    ('drive_rotation', 0.002, 20.0)
    """
    std = np.sqrt(np.maximum(np.diag(covariance), 0))
    rows: list[dict[str, Any]] = []

    def tell(name: str, units: str, place: int, factor: float) -> None:
        value, sigma = factor * float(coefficients[place]), abs(factor) * float(std[place])
        z = value / sigma if sigma > 0 else 0.0
        rows.append({"name": name, "value": value, "std": sigma, "units": units, "z": z})

    if "quadrature_drive" in factors:
        effect = quadrature_drive_phase_error.EFFECT
        first = joint.layout.factor("quadrature_drive").start
        tell(effect.name, effect.parameters[0].units, first, -1.0)
    for name in (n for n in ("main_drive", "drive_matrix") if n in factors):
        damping = 1.0 if name == "main_drive" else _measure_damping(joint.paths)
        first = joint.layout.factor(name).start
        for k, (effect, factor) in enumerate(ELEMENTS):
            tell(effect.name, effect.parameters[0].units, first + k, factor / damping)
    for name in (n for n in ("loop_delay", "drive_delay") if n in factors):
        damping = 1.0 if name == "loop_delay" else _measure_damping(joint.paths)
        tell("loop_delay", "s", joint.layout.factor(name).start, 1 / damping)
    return rows


def _measure_damping(paths: Sequence[AnglePath]) -> float:
    """ν = −d ln a_A/dt of the free runs, 1/s."""
    slopes = [
        float(np.polyfit(p.time_s, np.log(np.maximum(p.main_amplitude, 1e-300)), 1)[0])
        for p in paths
        if not p.forced
    ]
    return max(-float(np.mean(slopes)), 1e-300)


def name_readout_elements(
    joint: Fitted, coefficients: Array, covariance: Array
) -> dict[str, float] | None:
    """Gain mismatch g and non-orthogonality ε of the pick-offs, as they make the scale factor.

    K(θ) = K₀(1 − g cos 2mθ − ε sin 2mθ): static angle errors turn with the wave (PHYSICS R1, R2).

    Parameters
    ----------
    joint
        The runs.
    coefficients
        Of the tables (size,).
    covariance
        (size, size).

    Returns
    -------
    dict or None
        Both with standard deviations; None where the scale factor holds no first harmonic, or is 0.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.table_layout import TableLayout
    >>> from hrg_cli.stages.calibration.named_elements import name_readout_elements
    >>> joint = Told(layout=TableLayout(np.array([20.0]), "temperature", 2, 0, 1))
    >>> found = name_readout_elements(joint, np.array([0.0, 0.5, -0.005, 0.0]), 1e-8 * np.eye(4))
    >>> found["gain_mismatch"], found["gain_mismatch_std"], found["electrode_nonorthogonality_rad"]
    (0.01, 0.0002, -0.0)
    """
    layout = joint.layout
    if layout.scale_harmonics < 1:
        return None
    starts = np.array([layout.scale(j).start for j in range(len(layout.nodes))])
    mean = np.zeros((3, layout.size))
    for h in range(3):
        mean[h, starts + h] = 1 / len(starts)
    k0, c, s = mean @ coefficients
    if k0 == 0:
        return None
    std = np.sqrt(np.diag(mean @ covariance @ mean.T)) / abs(k0)
    return {
        "gain_mismatch": float(-c / k0), "gain_mismatch_std": float(std[1]),
        "electrode_nonorthogonality_rad": float(-s / k0),
        "electrode_nonorthogonality_rad_std": float(std[2]),
    }  # fmt: skip
