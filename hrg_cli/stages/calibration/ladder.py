"""Seed A's seven stages of accuracy: what drift and scale-factor error is left after each, on data
not used, and what each factor buys."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...fitting.tables.increments import AnglePath
from ...fitting.tables.joint import Fitted
from ...fitting.tables.table_layout import Model
from .accuracy_stages import LadderSettings, list_first_stages
from .column_spaces import measure_independence
from .factor_use import analyse_factors
from .folds import choose_folds, split_by_time
from .joint_runs import LEAST_INDEPENDENCE, LOOP_FACTORS, fit_jointly
from .residual_errors import gather_cells, predict_models, tabulate_model_figures

Array = np.ndarray
INSEPARABLE_QUADRATURE = (
    "the measured quadrature does not vary enough to be told from D(T, angle); its part stays in"
    " the table"
)
INSEPARABLE_LOOPS = (
    "the logged drives keep step with D(T, angle) and cannot be told from it; vary the amplitude or"
    " the loop gains"
)
NO_DRIVE = (
    "no drive is logged (drive_main, drive_quadrature): sensitivity to the loops cannot be told"
)
NO_FREE_RUN = (
    "no free run was given: the drive matrix cannot be told from the resonator; add free runs at"
    " several angles"
)


def climb(
    forced: Fitted,
    free: Sequence[AnglePath],
    folds: Array,
    settings: LadderSettings,
    penalty: Array | None,
) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """The seven stages of accuracy: what error each leaves on data not used, and what each factor
    buys.

    Parameters
    ----------
    forced
        The forced runs, with the factor quadrature and, where logged, the drives.
    free
        Free runs of the same gyro; the loops cannot be told without them.
    folds
        Fold of each piece (R, S), from 0.
    settings
        Of the ladder.
    penalty
        (size, size), added to the information; None: none.

    Returns
    -------
    tuple
        A row a stage, and the final analysis of every factor.

    Examples
    --------
    >>> from hrg_cli.stages.calibration.accuracy_stages import LadderSettings
    >>> from hrg_cli.stages.calibration.trials import add_loop_columns
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import Model, TableLayout
    >>> from hrg_cli.stages.calibration.ladder import climb
    >>> random, layout = (
    ...     np.random.default_rng(1),
    ...     TableLayout(np.array([20.0]), "temperature", 2, 1, 0),
    ... )
    >>> fitted = fit([draw_path(rate, random) for rate in (-0.2, -0.1, 0.1, 0.2)], layout)
    >>> folds = np.tile(np.arange(fitted.pieces.rows.shape[1]) % 2, (4, 1))
    >>> loops = add_loop_columns(fitted)
    >>> rows, _ = climb(loops, [], folds, LadderSettings(1, 0, 0.55, 99, 0), None)
    >>> len(rows), rows[4]["note"][:18]
    (7, 'no drive is logged')
    """
    models, accepted, notes = _grow_models(forced, settings)
    whole, held = predict_models(forced, models, folds, penalty)
    rows = tabulate_model_figures(
        [m.name for m in models],
        *gather_cells(forced, whole, held, folds),
        settings.scale_factor,
        settings.draws,
        settings.seed,
    )
    if free:
        joint, factors = fit_jointly(forced, free, settings)
        own_folds = split_by_time(joint)
    else:
        notes[6] = NO_FREE_RUN
        joint, factors, own_folds = forced, accepted, choose_folds(forced, 1)[0]
    final, analysis = analyse_factors(joint, factors, settings, own_folds, len(forced.paths))
    rows.append({**(final if free else rows[-1]), "stage": "6 internal calibration of the loops"})
    rows.append({**final, "stage": "7 final analysis"})
    for number, note in notes.items():
        rows[number - 1]["note"] = note
    return rows, analysis


def _grow_models(
    forced: Fitted, settings: LadderSettings
) -> tuple[list[Model], list[str], dict[int, str]]:
    """The models of stages 1 to 5, the factors that they hold, and notes on what they could not."""
    layout = forced.layout
    models = list_first_stages(layout, settings.drift_limit, settings.scale_limit)
    notes: dict[int, str] = {}
    seen = _choose_factors(forced, models[-1].matrix, ["quadrature"])
    if not seen:
        notes[4] = INSEPARABLE_QUADRATURE
    fourth = np.concatenate([models[-1].matrix, layout.build_factor_map(*seen)], axis=1)
    logged = [name for name in LOOP_FACTORS if name in layout.factors]
    loops = _choose_factors(forced, fourth, logged)
    if not loops:
        notes[5] = INSEPARABLE_LOOPS if logged else NO_DRIVE
    fifth = np.concatenate([fourth, layout.build_factor_map(*loops)], axis=1)
    models += [
        Model("4 calibrated and measured parts", fourth),
        Model("5 sensitivity to the control loops", fifth),
    ]
    return models, [*seen, *loops], notes


def _choose_factors(fitted: Fitted, base: Array, names: Sequence[str]) -> list[str]:
    """The factors whose columns the model's do not hold already."""
    return [
        name
        for name in names
        if measure_independence(fitted, base, fitted.layout.build_factor_map(name))
        > LEAST_INDEPENDENCE
    ]
