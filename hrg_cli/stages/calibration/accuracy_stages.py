"""Models of growing detail: a constant scale factor, functions of the angle, functions of
temperature and angle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...fitting.tables.table_layout import Model, TableLayout


@dataclass(frozen=True)
class LadderSettings:
    """What the ladder needs to know of the calibration."""

    drift_limit: int
    scale_limit: int
    scale_factor: float
    draws: int
    seed: int


def list_first_stages(layout: TableLayout, drift_limit: int, scale_limit: int) -> list[Model]:
    """The models of stages 1 to 3, each holding the one before.

    Parameters
    ----------
    layout
        Of the tables.
    drift_limit, scale_limit
        Harmonics of 2mθ in the drift and in the scale factor.

    Returns
    -------
    list of Model
        A constant scale factor; functions of the angle; functions of temperature and angle.

    Examples
    --------
    Three nodes, drift with two harmonics of the angle, scale factor with none:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.table_layout import TableLayout
    >>> from hrg_cli.stages.calibration.accuracy_stages import list_first_stages
    >>> layout = TableLayout(np.array([0.0, 20.0, 40.0]), "temperature", 2, 2, 0)
    >>> [model.free for model in list_first_stages(layout, 2, 0)]
    [1, 6, 18]
    """
    constant, one_drift = (
        layout.build_part_map("scale", 0, one_node=True),
        layout.build_part_map("drift", drift_limit, one_node=True),
    )
    one_scale = layout.build_part_map("scale", scale_limit, one_node=True)
    return [
        Model("1 constant scale factor", constant),
        Model(
            "2 drift and scale factor over angle", np.concatenate([one_drift, one_scale], axis=1)
        ),
        Model(
            "3 drift and scale factor over temperature and angle",
            np.concatenate(
                [
                    layout.build_part_map("drift", drift_limit),
                    layout.build_part_map("scale", scale_limit),
                ],
                axis=1,
            ),
        ),
    ]
