"""Seed A's seven stages of accuracy: what drift and scale-factor error is left after each, on data
not used, and what each factor buys."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from ...effects import (
    drive_gain_mismatch,
    drive_nonorthogonality,
    drive_rotation,
    quadrature_drive_phase_error,
)
from ...effects.effect import Effect
from ...fitting.tables.increments import Path
from ...fitting.tables.joint import (
    Fitted,
    Model,
    TableLayout,
    chi_square,
    fit,
    held_out_chi_square,
    solve,
)
from .factors import build
from .figures import cells, figure_rows, of_runs, predictions
from .folds import choose_folds, time_folds
from .prices import need

Array = np.ndarray
LOOP_FACTORS = ("quadrature_drive", "main_drive")
MEANING = {
    "quadrature": "measured quadrature, (11)",
    "quadrature_drive": "phase error of the quadrature loop",
    "main_drive": "drive matrix, by the drive's log",
    "drive_matrix": "drive matrix, forced runs against free ones",
}
ELEMENTS = (
    (drive_rotation.EFFECT, 1.0),
    (drive_nonorthogonality.EFFECT, 2.0),
    (drive_gain_mismatch.EFFECT, -2.0),
)
"""What the three coefficients of the drive matrix are, by the catalogue's pages: ρ, ε/2, −g/2 of
a_ΦA/a_A·(1, cos 2mθ, sin 2mθ)."""
BESIDE = "ellipticity"
"""Fitted beside the tables where free runs with their larger quadrature take part, not a factor of
its own."""
LEAST_INDEPENDENCE = 0.02
"""A factor with a smaller part of its columns outside the others' span is not told from them."""
SIGNIFICANT = 3.0
"""z above which a factor counts, if it also lowers the held-out χ²."""
FALSE_RATE = 1.35e-3
"""Part of absent factors that reach `SIGNIFICANT` by chance (upper tail of the normal
distribution)."""


@dataclass(frozen=True)
class Settings:
    """What the ladder needs to know of the calibration."""

    drift_limit: int
    scale_limit: int
    scale_factor: float
    draws: int
    seed: int


def first_stages(layout: TableLayout, drift_limit: int, scale_limit: int) -> list[Model]:
    """Stages 1 to 3: constant scale factor; functions of the angle; functions of temperature and
    angle."""
    constant, one_drift = (
        layout.part("scale", 0, one_node=True),
        layout.part("drift", drift_limit, one_node=True),
    )
    one_scale = layout.part("scale", scale_limit, one_node=True)
    return [
        Model("1 constant scale factor", constant),
        Model(
            "2 drift and scale factor over angle", np.concatenate([one_drift, one_scale], axis=1)
        ),
        Model(
            "3 drift and scale factor over temperature and angle",
            np.concatenate(
                [layout.part("drift", drift_limit), layout.part("scale", scale_limit)], axis=1
            ),
        ),
    ]


def climb(
    forced: Fitted, free: Sequence[Path], folds: Array, settings: Settings, penalty: Array | None
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """(rows of all seven stages, the final analysis). `forced` holds the factors quadrature and,
    where logged, the drives."""
    layout = forced.layout
    models = first_stages(layout, settings.drift_limit, settings.scale_limit)
    notes: dict[int, str] = {}
    table = models[-1].matrix
    seen = [
        name
        for name in ("quadrature",)
        if _independence(forced, table, layout.of_factors(name)) > LEAST_INDEPENDENCE
    ]
    if not seen:
        notes[4] = (
            "the measured quadrature does not vary enough to be told from D(T, angle); its part"
            " stays in the table"
        )
    fourth = np.concatenate([table, layout.of_factors(*seen)], axis=1)
    models.append(Model("4 calibrated and measured parts", fourth))
    loops = [
        n
        for n in LOOP_FACTORS
        if n in layout.factors
        and _independence(forced, fourth, layout.of_factors(n)) > LEAST_INDEPENDENCE
    ]
    if not loops:
        logged = [n for n in LOOP_FACTORS if n in layout.factors]
        notes[5] = (
            "the logged drives keep step with D(T, angle) and cannot be told from it; vary the"
            " amplitude or the loop gains"
            if logged
            else (
                "no drive is logged (drive_main, drive_quadrature): sensitivity to the loops cannot"
                " be told"
            )
        )
    models.append(
        Model(
            "5 sensitivity to the control loops",
            np.concatenate([fourth, layout.of_factors(*loops)], axis=1),
        )
    )
    whole, held = predictions(forced, models, folds, penalty)
    rows = figure_rows(
        [m.name for m in models],
        *cells(forced, whole, held, folds),
        settings.scale_factor,
        settings.draws,
        settings.seed,
    )
    sixth, analysis = _with_free_runs(forced, free, settings, [*seen, *loops])
    if sixth is None:
        notes[6] = (
            "no free run was given: the drive matrix cannot be told from the resonator; add free"
            " runs at several angles"
        )
        sixth = {**rows[-1], "stage": ""}
    sixth["stage"] = "6 internal calibration of the loops"
    rows.append(sixth)
    seventh = analysis.pop("row")
    seventh["stage"] = "7 final analysis"
    rows.append(seventh)
    for number, note in notes.items():
        rows[number - 1]["note"] = note
    return rows, analysis


def _independence(fitted: Fitted, base: Array, extra: Array) -> float:
    """Smallest part of the factor's columns that lies outside the span of the base model, 0…1; 0
    when they are empty."""
    A = fitted.pieces.sum()[0]
    own = np.diag(extra.T @ A @ extra)
    if extra.shape[1] == 0 or not (own > 0).all():
        return 0.0
    scale = np.sqrt(own)
    rest = extra.T @ A @ extra - extra.T @ A @ solve_columns(A, base, A @ extra)
    return float(np.sqrt(max(np.linalg.eigvalsh(rest / np.outer(scale, scale)).min(), 0.0)))


def solve_columns(A: Array, base: Array, targets: Array) -> Array:
    """base·(baseᵀ A base)⁺ baseᵀ·targets."""
    return np.stack(
        [solve(A, column, Model("", base)).coefficients for column in targets.T], axis=1
    )


def _with_free_runs(
    forced: Fitted, free: Sequence[Path], settings: Settings, accepted: Sequence[str]
) -> tuple[dict[str, Any] | None, dict[str, Any]]:
    """Stage 6, all runs jointly with a drive matrix in the forced ones; stage 7, significance,
    independence and use of every factor."""
    layout, joint = forced.layout, forced
    factors = list(accepted)
    if free:
        names = ["quadrature", *LOOP_FACTORS, BESIDE]
        made, widths = build(
            [*forced.paths, *free], layout.nodes, layout.axis, layout.interpolation, names
        )
        if "main_drive" not in made:
            unlogged = build(
                [*forced.paths, *free],
                layout.nodes,
                layout.axis,
                layout.interpolation,
                ["drive_matrix"],
            )
            made, widths = made | unlogged[0], widths | unlogged[1]
        wide = TableLayout(
            layout.nodes,
            layout.axis,
            layout.mode_number,
            settings.drift_limit,
            settings.scale_limit,
            layout.interpolation,
            made,
            widths,
        )
        joint = fit([*forced.paths, *free], wide)
        tables = first_stages(wide, settings.drift_limit, settings.scale_limit)[-1].matrix
        factors = []
        for name in (n for n in made if n != BESIDE):
            if (
                _independence(
                    joint,
                    np.concatenate([tables, wide.of_factors(*factors)], axis=1),
                    wide.of_factors(name),
                )
                > LEAST_INDEPENDENCE
            ):
                factors.append(name)
    base = first_stages(joint.layout, settings.drift_limit, settings.scale_limit)[-1].matrix
    if BESIDE in joint.layout.factors:
        base = np.concatenate([base, joint.layout.of_factors(BESIDE)], axis=1)
    final = Model("final", np.concatenate([base, joint.layout.of_factors(*factors)], axis=1))
    folds = time_folds(joint) if free else choose_folds(joint, 1)[0]
    groups = _groups(joint, settings, factors)
    A, b, _, _ = joint.pieces.sum()
    solution = solve(A, b, final)
    models = [
        final,
        *(Model(name, _without(final.matrix, columns)) for name, (columns, _) in groups.items()),
    ]
    whole, held = predictions(joint, models, folds)
    used, unseen = (of_runs(c, len(forced.paths)) for c in cells(joint, whole, held, folds))
    rows = figure_rows(
        [m.name for m in models], used, unseen, settings.scale_factor, settings.draws, settings.seed
    )
    table, significant = [], []
    reference = held_out_chi_square(joint.pieces, folds, final)
    for row, model in zip(rows[1:], models[1:]):
        lost = chi_square(*joint.pieces.sum()[:3], solve(A, b, model).coefficients) - chi_square(
            *joint.pieces.sum()[:3], solution.coefficients
        )
        freedom = final.free - model.free
        gain = held_out_chi_square(joint.pieces, folds, model) - reference
        z = _z(lost / max(joint.chi2_per_dof, 1.0), freedom)
        columns, kind = groups[model.name]
        entry = {
            "name": model.name, "needs": need(kind, joint.layout.axis), "coefficients": freedom, "z": z, "held_out_chi2_gain": gain,
            "independence": _independence(joint, model.matrix, columns),
            "drift_without_rad_s": row["drift"]["value"], "scale_without_ppm": row["scale"]["value"],
            "drift_bought_rad_s": _difference(row, rows[0], "drift"), "scale_bought_ppm": _difference(row, rows[0], "scale"),
        }  # fmt: skip
        if kind in joint.layout.factors:
            place = joint.layout.factor(kind)
            entry["values"] = solution.coefficients[place].tolist()
            entry["std"] = np.sqrt(
                np.diag(solution.covariance)[place] * joint.chi2_per_dof
            ).tolist()
        table.append(entry)
        if z > SIGNIFICANT and gain > 0:
            significant.append(model.name)
    analysis = {
        "factors": table,
        "significant": significant,
        "false_rate": FALSE_RATE,
        "correlated": _correlated(joint, groups),
        "readout_matrix": _readout(
            joint, solution.coefficients, solution.covariance * joint.chi2_per_dof
        ),
        "loops": _loops(
            joint, factors, solution.coefficients, solution.covariance * joint.chi2_per_dof
        ),
        "row": rows[0],
    }
    return ({**rows[0]} if free else None), analysis


def _loops(
    joint: Fitted, factors: Sequence[str], coefficients: Array, covariance: Array
) -> list[dict[str, Any]]:
    """What is wrong with the loops, in the catalogue's names: value, standard deviation, z
    (two-sided) of each element.

    The drive matrix is seen in the pick-off's axes: a read-out matrix that also feeds the loops
    adds its own elements to it. Without a log of the drive its elements come in rad/s and are
    divided by the damping rate, which the free runs show.
    """
    rows: list[tuple[Effect, float, float]] = []
    std = np.sqrt(np.maximum(np.diag(covariance), 0))
    if "quadrature_drive" in factors:
        place = joint.layout.factor("quadrature_drive").start
        rows.append((quadrature_drive_phase_error.EFFECT, -coefficients[place], std[place]))
    for name in ("main_drive", "drive_matrix"):
        if name in factors:
            damping = 1.0 if name == "main_drive" else _damping_rate(joint.paths)
            first = joint.layout.factor(name).start
            for k, (effect, factor) in enumerate(ELEMENTS):
                rows.append(
                    (
                        effect,
                        factor * coefficients[first + k] / damping,
                        abs(factor) * std[first + k] / damping,
                    )
                )
    return [
        {
            "name": effect.name,
            "value": float(value),
            "std": float(sigma),
            "units": effect.parameters[0].units,
            "z": float(value / sigma) if sigma > 0 else 0.0,
        }
        for effect, value, sigma in rows
    ]


def _damping_rate(paths: Sequence[Path]) -> float:
    """ν = −d ln a_A/dt of the free runs, 1/s."""
    slopes = [
        float(np.polyfit(p.time_s, np.log(np.maximum(p.main_amplitude, 1e-300)), 1)[0])
        for p in paths
        if not p.forced
    ]
    return max(-float(np.mean(slopes)), 1e-300)


def _groups(
    joint: Fitted, settings: Settings, factors: Sequence[str]
) -> dict[str, tuple[Array, str]]:
    """Name of each group of coefficients -> (its columns as variations, kind)."""
    layout, groups = joint.layout, {}
    limits: tuple[tuple[Literal["drift", "scale"], int], ...] = (
        ("drift", settings.drift_limit),
        ("scale", settings.scale_limit),
    )
    for kind, limit in limits:
        word = "drift" if kind == "drift" else "scale factor"
        if limit:
            groups[f"{word} over angle"] = (layout.part(kind, limit, lowest=1), kind + " angle")
        if len(layout.nodes) > 1:
            groups[f"{word} over temperature"] = (
                _along_nodes(layout.part(kind, limit), layout.part(kind, limit, one_node=True)),
                kind + " nodes",
            )
    for name in factors:
        groups[MEANING.get(name, name)] = (layout.of_factors(name), name)
    return groups


def _along_nodes(all_nodes: Array, common: Array) -> Array:
    """The part of a model's space that differs between nodes."""
    rest = all_nodes - common @ np.linalg.pinv(common) @ all_nodes
    u, s, _ = np.linalg.svd(rest, full_matrices=False)
    return np.asarray(u[:, s > 1e-9])


def _without(matrix: Array, columns: Array) -> Array:
    """The model's space with a group of directions taken out."""
    rest = matrix - columns @ np.linalg.pinv(columns) @ matrix
    u, s, _ = np.linalg.svd(rest, full_matrices=False)
    return np.asarray(u[:, s > 1e-9])


def _difference(row: dict[str, Any], reference: dict[str, Any], key: str) -> float | None:
    one, other = row[key]["value"], reference[key]["value"]
    return None if one is None or other is None else one - other


def _z(chi2: float, freedom: int) -> float:
    """Standard normal deviate with the tail probability of χ² at `freedom` degrees
    (Wilson–Hilferty)."""
    freedom = max(freedom, 1)
    return float(
        ((max(chi2, 0.0) / freedom) ** (1 / 3) - (1 - 2 / (9 * freedom)))
        / np.sqrt(2 / (9 * freedom))
    )


def _correlated(joint: Fitted, groups: dict[str, tuple[Array, str]]) -> list[list[Any]]:
    """Pairs of groups whose columns share most of a direction: [name, name, largest canonical
    correlation]."""
    A = joint.pieces.sum()[0]
    half: dict[str, Array] = {}
    for name, (columns, _) in groups.items():
        G = columns.T @ A @ columns
        values, vectors = np.linalg.eigh(G / max(np.trace(G), 1e-300))
        keep = values > 1e-10
        half[name] = columns @ (vectors[:, keep] / np.sqrt(values[keep] * max(np.trace(G), 1e-300)))
    names = list(groups)
    pairs = []
    for i, one in enumerate(names):
        for other in names[i + 1 :]:
            if one.split(" over ")[0] == other.split(" over ")[0]:
                continue  # parts of one table share coefficients by construction
            value = (
                float(np.linalg.norm(half[one].T @ A @ half[other], 2))
                if half[one].size and half[other].size
                else 0.0
            )
            if value > 0.9:
                pairs.append([one, other, round(min(value, 1.0), 4)])
    return pairs


def _readout(joint: Fitted, coefficients: Array, covariance: Array) -> dict[str, float] | None:
    """Gain mismatch g and non-orthogonality ε of the pick-offs (PHYSICS R1, R2).

    K₁(θ) = K₀(1 − g cos 2mθ − ε sin 2mθ): static angle errors turn with the wave.
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
        "electrode_nonorthogonality_rad": float(-s / k0), "electrode_nonorthogonality_rad_std": float(std[2]),
    }  # fmt: skip
