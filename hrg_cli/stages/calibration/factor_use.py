"""Stage 7 of the ladder: what every group of coefficients buys: its significance, its own part, and
the drift and scale-factor error on data not used that comes back without it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np

from ...fitting.tables.joint import Fitted
from ...fitting.tables.normal_pieces import compute_held_out_chi_square, solve
from ...fitting.tables.table_layout import Model
from .accuracy_stages import LadderSettings, list_first_stages
from .column_spaces import find_correlated, leave_out, measure_independence, take_along_nodes
from .joint_runs import BESIDE
from .named_elements import name_loop_elements, name_readout_elements
from .prices import describe_need
from .residual_errors import gather_cells, predict_models, tabulate_model_figures

Array = np.ndarray
MEANING = {
    "quadrature": "measured quadrature, (11)",
    "quadrature_drive": "phase error of the quadrature loop",
    "main_drive": "drive matrix, by the drive's log",
    "drive_matrix": "drive matrix, forced runs against free ones",
    "loop_delay": "delay of the loops, by the drive's log",
    "drive_delay": "delay of the loops, forced runs against free ones",
}
SIGNIFICANT = 3.0
"""z above which a factor counts, if it also lowers the held-out χ²."""
FALSE_RATE = 1.35e-3
"""Part of absent factors that reach `SIGNIFICANT` by chance (upper tail of the normal
distribution)."""


def analyse_factors(
    joint: Fitted, factors: Sequence[str], settings: LadderSettings, folds: Array, runs: int
) -> tuple[dict[str, Any], dict[str, Any]]:
    """What every group of coefficients buys, and the loops and pick-offs that they tell of: stage
    7.

    Parameters
    ----------
    joint
        All runs.
    factors
        Names of those that were told.
    settings
        Of the ladder.
    folds
        Fold of each piece (R, S), from 0.
    runs
        How many of the first runs count in the errors, the forced ones.

    Returns
    -------
    tuple
        The final model's row of the ladder, and significance, independence and use of every factor.

    Examples
    --------
    A drift that is not there buys nothing:

    >>> from hrg_cli.stages.calibration.accuracy_stages import LadderSettings
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import Model, TableLayout
    >>> from hrg_cli.stages.calibration.factor_use import analyse_factors
    >>> random, layout = (
    ...     np.random.default_rng(1),
    ...     TableLayout(np.array([20.0]), "temperature", 2, 1, 0),
    ... )
    >>> fitted = fit([draw_path(rate, random) for rate in (-0.2, -0.1, 0.1, 0.2)], layout)
    >>> folds = np.tile(np.arange(fitted.pieces.rows.shape[1]) % 2, (4, 1))
    >>> _, analysis = analyse_factors(fitted, [], LadderSettings(1, 0, 0.55, 99, 0), folds, 4)
    >>> [row["name"] for row in analysis["factors"]], analysis["significant"]
    (['drift over angle'], [])
    """
    base = list_first_stages(joint.layout, settings.drift_limit, settings.scale_limit)[-1].matrix
    if BESIDE in joint.layout.factors:
        base = np.concatenate([base, joint.layout.build_factor_map(BESIDE)], axis=1)
    final = Model("final", np.concatenate([base, joint.layout.build_factor_map(*factors)], axis=1))
    groups = _group_columns(joint, settings, factors)
    A, b, _ = joint.pieces.sum()
    solution = solve(A, b, final)
    models = [
        final,
        *(Model(name, leave_out(final.matrix, columns)) for name, (columns, _) in groups.items()),
    ]
    whole, held = predict_models(joint, models, folds)
    used, unseen = gather_cells(joint, whole, held, folds, runs)
    # the first row is the whole model's; each other one lacks a group, and the difference is what
    # that group buys
    rows = tabulate_model_figures(
        [m.name for m in models], used, unseen, settings.scale_factor, settings.draws, settings.seed
    )
    covariance = solution.covariance * joint.chi2_per_dof
    table = []
    for row, model in zip(rows[1:], models[1:], strict=True):
        columns, kind = groups[model.name]
        table.append(
            {
                "name": model.name,
                "needs": describe_need(kind, joint.layout.axis),
                **_weigh_group(joint, final, model, folds),
                "independence": measure_independence(joint, model.matrix, columns),
                **_price_group(row, rows[0]),
                **_read_values(joint, kind, solution.coefficients, covariance),
            }
        )
    analysis = {
        "factors": table,
        "significant": [
            one["name"] for one in table if one["z"] > SIGNIFICANT and one["held_out_chi2_gain"] > 0
        ],
        "false_rate": FALSE_RATE,
        "correlated": find_correlated(joint, groups),
        "readout_matrix": name_readout_elements(joint, solution.coefficients, covariance),
        "loops": name_loop_elements(joint, factors, solution.coefficients, covariance),
    }
    return rows[0], analysis


def _weigh_group(joint: Fitted, final: Model, without: Model, folds: Array) -> dict[str, Any]:
    """How many coefficients a group has, by how much χ² rises without them as a normal deviate, and
    by how much on data not used."""
    A, b, _ = joint.pieces.sum()
    fewer, all_of_them = (
        joint.pieces.compute_chi_square(solve(A, b, model).coefficients)
        for model in (without, final)
    )
    freedom = final.free - without.free
    return {
        "coefficients": freedom,
        "z": _normal_deviate((fewer - all_of_them) / max(joint.chi2_per_dof, 1.0), freedom),
        "held_out_chi2_gain": compute_held_out_chi_square(joint.pieces, folds, without)
        - compute_held_out_chi_square(joint.pieces, folds, final),
    }


def _price_group(row: dict[str, Any], final: dict[str, Any]) -> dict[str, Any]:
    """The errors on data not used without a group, and what it takes off them."""
    return {
        "drift_without_rad_s": row["drift"]["value"],
        "scale_without_ppm": row["scale"]["value"],
        "drift_bought_rad_s": _subtract(row, final, "drift"),
        "scale_bought_ppm": _subtract(row, final, "scale"),
    }


def _read_values(
    joint: Fitted, kind: str, coefficients: Array, covariance: Array
) -> dict[str, list[float]]:
    """A factor's own coefficients with their standard deviations; nothing for a part of a table."""
    if kind not in joint.layout.factors:
        return {}
    place = joint.layout.factor(kind)
    return {
        "values": coefficients[place].tolist(),
        "std": np.sqrt(np.diag(covariance)[place]).tolist(),
    }


def _group_columns(
    joint: Fitted, settings: LadderSettings, factors: Sequence[str]
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
            groups[f"{word} over angle"] = (
                layout.build_part_map(kind, limit, lowest=1),
                kind + " angle",
            )
        if len(layout.nodes) > 1:
            groups[f"{word} over temperature"] = (
                take_along_nodes(
                    layout.build_part_map(kind, limit),
                    layout.build_part_map(kind, limit, one_node=True),
                ),
                kind + " nodes",
            )
    for name in factors:
        groups[MEANING.get(name, name)] = (layout.build_factor_map(name), name)
    return groups


def _subtract(row: dict[str, Any], reference: dict[str, Any], key: str) -> float | None:
    """The difference of two rows' errors; None where one of them could not be told."""
    one, other = row[key]["value"], reference[key]["value"]
    return None if one is None or other is None else one - other


def _normal_deviate(chi2: float, freedom: int) -> float:
    """Standard normal deviate with the tail probability of χ² at `freedom` degrees
    (Wilson–Hilferty)."""
    freedom = max(freedom, 1)
    return float(
        ((max(chi2, 0.0) / freedom) ** (1 / 3) - (1 - 2 / (9 * freedom)))
        / np.sqrt(2 / (9 * freedom))
    )
