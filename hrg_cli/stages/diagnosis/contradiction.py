"""Diagnosis, before any cause: what contradicts the motion grossly is no effect.

Runs at frequencies too far apart are of different gyros; runs whose logged rate is wrong (sign turned, log missing) are a fault of the log.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from ...fitting.causes.extended_fit import Fit
from ...records import Wave
from .suspects import wrong_rates

GROSS = 1e3
"""χ² a degree of freedom from which the logs themselves are doubted."""
FALL = 100.0
"""Times by which χ² must fall once the doubted rates are replaced."""
APART = 0.02
"""Relative distance of two runs' frequencies that no temperature makes: fused silica's 90 ppm/K over 200 K."""


def strangers(base: Fit) -> str | None:
    """A sentence naming the runs on either side of the widest gap between the runs' frequencies, where no one gyro has both; else None."""
    if base.chi2 / base.dof < GROSS:
        return None
    order = np.argsort(base.frequency_hz)
    hz = base.frequency_hz[order]
    gaps = np.diff(hz) / hz[:-1]
    if not len(gaps) or gaps.max() < APART:
        return None
    first = int(np.argmax(gaps)) + 1
    low, high = ([base.series.names[i] for i in part] for part in (order[:first], order[first:]))
    return (
        f"the runs are not of one gyro: {', '.join(low)} at {hz[:first].mean():.6g} Hz, {', '.join(high)} at {hz[first:].mean():.6g} Hz, "
        f"and no model fits both (χ² a degree of freedom {base.chi2 / base.dof:.3g}); diagnose them apart"
    )


def contradicting_logs(waves: Sequence[Wave], base: Fit, fitted: Callable[[Sequence[Wave]], Fit]) -> str | None:
    """A sentence naming the fewer than half of the runs whose rate logs, undone, let χ² fall `FALL` times; else None."""
    level = base.chi2 / base.dof
    if level < GROSS or len(waves) < 3:
        return None
    found, left = wrong_rates(waves, fitted, base)
    if not found or left > min(level / FALL, GROSS):
        return None
    runs = "; ".join(f"{one.run_id}: {one.evidence}" for one in found)
    return f"the logged rate contradicts the motion ({runs}); {found[0].correction}; or leave the run out"
