"""Diagnosis, before any cause: runs at frequencies too far apart are of different gyros."""

from __future__ import annotations

import numpy as np

from ....errors import name_some
from ....fitting.causes.extended_fit import ExtendedFit
from ..thresholds import FREQUENCIES_APART

GROSS = 1e3
"""χ² a degree of freedom from which it is asked whether the runs are of one gyro."""


def find_strangers(base: ExtendedFit) -> str | None:
    """A sentence naming the runs on either side of the widest gap between the runs' frequencies,
    where no one gyro has both; else None."""
    if base.chi2 / base.dof < GROSS:
        return None
    order = np.argsort(base.frequency_hz)
    hz = base.frequency_hz[order]
    gaps = np.diff(hz) / hz[:-1]
    if not len(gaps) or gaps.max() < FREQUENCIES_APART:
        return None
    first = int(np.argmax(gaps)) + 1
    low, high = ([base.series.names[i] for i in part] for part in (order[:first], order[first:]))
    return (
        f"the runs are not of one gyro: {name_some(low, 30)} at {hz[:first].mean():.6g} Hz,"
        f" {name_some(high, 30)} at {hz[first:].mean():.6g} Hz, and no model fits both (χ² a degree of"
        f" freedom {base.chi2 / base.dof:.3g}); diagnose them apart"
    )
