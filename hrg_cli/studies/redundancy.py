"""Which channel defects the eight equations of seed B (1) reveal, and which are exactly invisible
to them.

Eight signals and five unknowns leave three redundant equations: |z_C⁺| = |z_C⁻|, |z_S⁺| = |z_S⁻|,
arg z_C⁺z_C⁻* = arg z_S⁺z_S⁻*. A defect that acts on the displacement before the carrier multiplies
it changes both sidebands alike and stays within the model, whatever it does to the wave angle; only
a defect that treats the sidebands or their carrier phases differently leaves a residual (PHYSICS
§3).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from ..fitting.ellipse.closed_form import solve_closed_form
from ..physics.signals import find_sidebands, from_sidebands, make_signals

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = np.ndarray
DIFFERENCE = np.array([0.5, -0.5])
"""A mismatch e: +e/2 in channel C, −e/2 in channel S."""
CHANNEL_C = np.array([1.0, 0.0])

Defect = Callable[[Array, Array, float], tuple[Array, Array]]
DEFECTS: tuple[tuple[str, str, Defect], ...] = (
    (
        "sideband_gain",
        "sum sideband (1 + e/2), difference sideband (1 − e/2)",
        lambda lo, up, e: (lo * (1 - e / 2), up * (1 + e / 2)),
    ),
    (
        "carrier_phase_mismatch",
        "carrier phase ψ + e/2 in channel C, ψ − e/2 in channel S",
        lambda lo, up, e: (lo * np.exp(-1j * e * DIFFERENCE), up * np.exp(1j * e * DIFFERENCE)),
    ),
    (
        "signal_offset",
        "e added to one of the eight signals",
        lambda lo, up, e: (lo + 1j * e * CHANNEL_C, up),
    ),
    (
        "gain_mismatch",
        "channel C (1 + e/2), channel S (1 − e/2)",
        lambda lo, up, e: (lo * (1 + e * DIFFERENCE), up * (1 + e * DIFFERENCE)),
    ),
    (
        "phase_mismatch",
        "signal phase φ + e/2 in channel C, φ − e/2 in channel S",
        lambda lo, up, e: (lo * np.exp(1j * e * DIFFERENCE), up * np.exp(1j * e * DIFFERENCE)),
    ),
    (
        "electrode_nonorthogonality",
        "e/2 of each channel added to the other",
        lambda lo, up, e: (lo + e / 2 * lo[..., ::-1], up + e / 2 * up[..., ::-1]),
    ),
    (
        "quadrature_crosstalk",
        "j e/2 of each channel added to the other",
        lambda lo, up, e: (lo + 0.5j * e * lo[..., ::-1], up + 0.5j * e * up[..., ::-1]),
    ),
    (
        "envelope_cubic",
        "each channel (1 + e |C0|²)",
        lambda lo, up, e: (lo * (1 + e * np.abs(lo) ** 2), up * (1 + e * np.abs(up) ** 2)),
    ),
)
VISIBLE = 1e-6
"""Residual a unit of defect above which a defect shows; the invisible ones stay at rounding."""


def redundancy_study(
    *,
    vectors: Annotated[int, Field(ge=1, description="random waves a defect")] = 100_000,
    defect: Annotated[float, Field(gt=0, le=0.1, description="size e of every defect")] = 1e-3,
    seed: Annotated[int, Field(ge=0, description="seed of the random numbers")] = 2022,
) -> dict[str, Any]:
    """Which defects of the channels the eight equations of seed B reveal, and which they cannot
    see.

    The residual √(Σr²/8) is averaged (rms) over the waves of seed B's first experiment; the angle
    error over nearly linear waves (A = 1, B in ± 0.1), as a working gyro has. Expected: sideband
    gain ¼√⟨A²+B²⟩ = 0.204; offset √(3/64) = 0.217 (three of the eight directions are redundant).

    Parameters
    ----------
    vectors
        Random waves a defect.
    defect
        Size e of every defect.
    seed
        Of the random numbers.

    Returns
    -------
    dict
        For every defect its residual rms and its error of the wave angle (electrical, rad), each
        per unit of defect, and whether it is visible.

    Examples
    --------
    >>> from hrg_cli.studies.redundancy import redundancy_study
    >>> found = redundancy_study(vectors=20_000, seed=1)
    >>> round(found["defects"][0]["residual_rms_per_unit"], 2)
    0.2
    """
    generator = np.random.default_rng(seed)
    anyhow = np.column_stack(
        [generator.uniform(-1, 1, (vectors, 2)), generator.uniform(0, 2 * np.pi, (vectors, 3))]
    )
    working = np.column_stack(
        [
            np.ones(vectors),
            generator.uniform(-0.1, 0.1, vectors),
            generator.uniform(0, 2 * np.pi, (vectors, 3)),
        ]
    )
    rows = []
    for name, meaning, apply in DEFECTS:
        misfit = solve_closed_form(_with_defect(anyhow, apply, defect))[1]
        found = solve_closed_form(_with_defect(working, apply, defect))[0]
        error = found[:, 2] - working[:, 2]
        error -= np.pi * np.round(error / np.pi)
        residual = float(np.sqrt(np.mean(misfit**2))) / defect
        rows.append(
            {
                "defect": name,
                "meaning": meaning,
                "residual_rms_per_unit": residual,
                "wave_angle_error_rms_per_unit": float(np.sqrt(np.mean(error**2))) / defect,
                "visible": residual > VISIBLE,
            }
        )
    return {"vectors": vectors, "seed": seed, "defect_size": defect, "defects": rows}


def _with_defect(x: Array, apply: Defect, size: float) -> Array:
    return from_sidebands(*apply(*find_sidebands(make_signals(x)), size))


def tabulate(study: dict[str, Any]) -> tuple[tuple[str, ...], list[tuple[Any, ...]]]:
    """The study as a table for a person.

    Parameters
    ----------
    study
        Of `redundancy_study`.

    Returns
    -------
    tuple
        Headings, and a row a defect.

    Examples
    --------
    A gain mismatch between the channels changes the angle, and no redundant equation sees it:

    >>> from hrg_cli.studies.redundancy import redundancy_study, tabulate
    >>> rows = tabulate(redundancy_study(vectors=500, seed=1))[1]
    >>> [(row[0], row[-1]) for row in rows if row[0].endswith("gain") or row[0].startswith("gain")]
    [('sideband_gain', 'yes'), ('gain_mismatch', 'no')]
    """
    rows = [
        (
            r["defect"],
            r["meaning"],
            f"{r['residual_rms_per_unit']:.3f}",
            f"{r['wave_angle_error_rms_per_unit']:.3f}",
            "yes" if r["visible"] else "no",
        )
        for r in study["defects"]
    ]
    return ("defect e", "meaning", "residual rms / e", "wave angle error / e, rad", "visible"), rows


def draw_figure(study: dict[str, Any]) -> Figure:
    """Residual and wave angle error of every defect side by side: what is seen against what it
    does.

    Parameters
    ----------
    study
        Of `redundancy_study`.

    Returns
    -------
    matplotlib.figure.Figure
        One panel.

    Examples
    --------
    >>> from hrg_cli.studies.redundancy import draw_figure, redundancy_study
    >>> len(draw_figure(redundancy_study(vectors=500, seed=1)).axes)
    1
    """
    from matplotlib.figure import Figure

    drawing = Figure(figsize=(9, 5), layout="constrained")
    axis = drawing.subplots()
    rows = study["defects"][::-1]
    place = np.arange(len(rows))
    axis.barh(
        place + 0.2,
        [r["residual_rms_per_unit"] for r in rows],
        0.4,
        color="C0",
        label="residual of the redundant equations",
    )
    axis.barh(
        place - 0.2,
        [r["wave_angle_error_rms_per_unit"] for r in rows],
        0.4,
        color="C1",
        label="error of the wave angle mθ, rad",
    )
    for y, row in zip(place, rows, strict=True):
        axis.text(
            row["residual_rms_per_unit"] + 0.004,
            y + 0.2,
            f"{row['residual_rms_per_unit']:.3f}",
            va="center",
            fontsize=8,
        )
    axis.set_yticks(place, [r["defect"].replace("_", " ") for r in rows])
    axis.set(
        xlabel="rms a unit of defect",
        title="what the eight equations of the carrier read-out reveal",
    )
    axis.legend(loc="lower right")
    return drawing
