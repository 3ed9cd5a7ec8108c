"""Diagnosis, before any cause: runs at frequencies too far apart are of different gyros."""

from __future__ import annotations

from ....fitting.causes.extended_fit import ExtendedFit
from ...one_gyro import find_two_gyros

GROSS = 1e3
"""χ² per degree of freedom from which it is asked whether the runs are of one gyro."""


def find_strangers(base: ExtendedFit) -> str | None:
    """A sentence naming the runs on either side of the widest gap between the runs' frequencies,
    where no one gyro has both; else None."""
    if base.chi2 / base.dof < GROSS:
        return None
    two = find_two_gyros(base.series.names, base.frequency_hz)
    return two and (
        f"{two}, and no model fits both (χ² per degree of freedom {base.chi2 / base.dof:.3g});"
        " diagnose them apart"
    )
