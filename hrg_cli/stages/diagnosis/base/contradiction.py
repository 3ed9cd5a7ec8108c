"""Diagnosis, before any cause: runs at frequencies too far apart are of different gyros."""

from __future__ import annotations

from ....fitting.causes.extended_fit import ExtendedFit
from ...one_gyro import find_two_gyros
from ..thresholds import CONTRADICTION


def find_strangers(base: ExtendedFit) -> str | None:
    """A sentence naming runs whose frequencies no one gyro has.

    Parameters
    ----------
    base
        The base model's fit.

    Returns
    -------
    str or None
        The runs on either side of the widest gap; None where one gyro may have them all.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.base.contradiction import find_strangers
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> find_strangers(draw_fit()) is None
    True
    """
    if base.chi2 / base.dof < CONTRADICTION:
        return None
    two = find_two_gyros(base.series.names, base.frequency_hz)
    return two and (
        f"{two}, and no model fits both (χ² per degree of freedom {base.chi2 / base.dof:.3g});"
        " diagnose them apart"
    )
