"""Stage 6 of the ladder: forced and free runs fitted jointly, with a drive matrix in the forced
ones alone: what turns the wave without a drive is the resonator, what only a drive adds is the
loops."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...fitting.tables.increments import AnglePath
from ...fitting.tables.joint import Fitted, fit
from ...fitting.tables.table_layout import TableLayout
from .accuracy_stages import LadderSettings, list_first_stages
from .column_spaces import measure_independence
from .factors import build_factors

LOOP_FACTORS = ("quadrature_drive", "main_drive")
BESIDE = "ellipticity"
"""Fitted beside the tables where free runs with their larger quadrature take part, not a factor of
its own."""
LEAST_INDEPENDENCE = 0.02
"""A factor with a smaller part of its columns outside the others' span is not told from them."""
TURNING = 0.05
"""Part of the forced runs' fastest mean rate from which a free run turns: at rest it does not know
K, and a read-out's 4θ in K would pass for a delay."""


def _turn(free: Sequence[AnglePath], forced: Sequence[AnglePath]) -> bool:
    """Whether a free run turns, beside the forced ones."""
    of_free, of_forced = (
        max((abs(float(np.mean(path.rate_rad_s))) for path in paths), default=0.0)
        for paths in (free, forced)
    )
    return of_free > TURNING * of_forced > 0


def fit_jointly(
    forced: Fitted, free: Sequence[AnglePath], settings: LadderSettings
) -> tuple[Fitted, list[str]]:
    """Forced and free runs fitted together, with a drive matrix in the forced ones alone.

    Parameters
    ----------
    forced
        The forced runs.
    free
        Free runs of the same gyro.
    settings
        Of the ladder.

    Returns
    -------
    tuple
        The fit of all runs, and names of the factors that its other columns do not hold.

    Examples
    --------
    >>> from dataclasses import replace
    >>> from hrg_cli.stages.calibration.accuracy_stages import LadderSettings
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import Model, TableLayout
    >>> from hrg_cli.stages.calibration.joint_runs import fit_jointly
    >>> random, layout = (
    ...     np.random.default_rng(1),
    ...     TableLayout(np.array([20.0]), "temperature", 2, 1, 0),
    ... )
    >>> fitted = fit([draw_path(rate, random) for rate in (-0.2, -0.1, 0.1, 0.2)], layout)
    >>> free = [draw_path(rate, random, forced=False) for rate in (-0.2, 0.2)]
    >>> joint, factors = fit_jointly(fitted, free, LadderSettings(1, 0, 0.55, 99, 0))
    >>> len(joint.paths), "drive_matrix" in factors
    (6, True)
    """
    layout = forced.layout
    paths = [*forced.paths, *free]
    places = (layout.nodes, layout.axis, layout.interpolation)
    late = ("loop_delay", "drive_delay") if _turn(free, forced.paths) else ()
    made, widths = build_factors(paths, *places, ["quadrature", *LOOP_FACTORS, *late[:1], BESIDE])
    if "main_drive" not in made:
        unlogged = build_factors(paths, *places, ["drive_matrix", *late[1:]])
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
    joint = fit(paths, wide)
    base = list_first_stages(wide, settings.drift_limit, settings.scale_limit)[-1].matrix
    factors: list[str] = []
    for name in (n for n in made if n != BESIDE):
        others = np.concatenate([base, wide.build_factor_map(*factors)], axis=1)
        if measure_independence(joint, others, wide.build_factor_map(name)) > LEAST_INDEPENDENCE:
            factors.append(name)
    return joint, factors
