"""A rate log that runs late, or early, against the samples: told from turns that follow it too
soon.

A log that is late by τ holds Ω_log(t) = Ω(t − τ), so the wave turns by
    m·dθ/dt = −KΩ_log(t + τ) + D = −KΩ_log − Kτ·dΩ_log/dt + D + O(τ²):
a column dΩ_log/dt beside the tables with the coefficient −Kτ. A τ that is shown is taken off the
logs, the runs are fitted again and what is left of it is found anew until it is within its noise.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...fitting.tables.increments import AnglePath
from ...fitting.tables.joint import Fitted, fit

Array = np.ndarray
LATE = "late_rate_log"
"""Name of the column."""
SHOWN = 6.0
"""Standard deviations from which a lateness is told and taken off."""
SETTLED, ROUNDS = 0.5, 5
"""Standard deviations of what is left of a lateness that ends the search, and its rounds."""
PARTS, MOVES = 8, 0.02
"""Parts of a run whose mean rates must differ by this part of the largest for a lateness to act."""


@dataclass(frozen=True)
class Lateness:
    """How late the rate logs are [s], negative: early, with its standard deviation; `taken_s` of it
    was taken off before the runs were fitted."""

    value_s: float
    std_s: float
    taken_s: float = 0.0

    @property
    def sentence(self) -> str:
        """What to say of it, and what to do."""
        way = "late" if self.value_s > 0 else "early"
        return (
            f"the rate logs are {1e3 * abs(self.value_s):.4g} ± {1e3 * self.std_s:.1g} ms {way}"
            " against the samples, as the waves' turns show; the tables are made with the logs set"
            " right, correct their times, or keep both on one clock"
        )

    def to_json(self) -> dict[str, float]:
        """For the JSON."""
        return {"late_s": self.value_s, "std_s": self.std_s, "taken_off_s": self.taken_s}


def compute_rate_slope(path: AnglePath) -> Array:
    """dΩ_log/dt of a run, the column of a log that is late: its coefficient is −Kτ.

    Parameters
    ----------
    path
        The run.

    Returns
    -------
    ndarray
        (n, 1) of its increments [rad/s²].

    Examples
    --------
    A rate that rises by 0.2 rad/s²:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.stages.calibration.late_log import compute_rate_slope
    >>> t = np.arange(4.0)
    >>> path = draw_path(blocks=4, rate_integral_rad=0.1 * t**2)
    >>> compute_rate_slope(path).round(9).ravel().tolist()
    [0.2, 0.2, 0.2]
    """
    return np.gradient(path.rate_rad_s, path.average_neighbours(path.time_s))[:, None]


def is_rate_moving(path: AnglePath) -> bool:
    """Whether the logged rate changes within a run, so that the log's time matters.

    Parameters
    ----------
    path
        The run.

    Returns
    -------
    bool
        False where an eighth of the run is too short to be averaged.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.stages.calibration.late_log import is_rate_moving
    >>> rising = draw_path(rate_integral_rad=0.01 * np.arange(600.0) ** 2)
    >>> is_rate_moving(draw_path(0.5)), is_rate_moving(rising)
    (False, True)
    """
    if len(path) < 2 * PARTS:
        return False
    means = [float(part.mean()) for part in np.array_split(path.rate_rad_s, PARTS)]
    return bool(np.ptp(means) > MOVES * np.abs(path.rate_rad_s).max())


def _estimate_lateness(fitted: Fitted) -> Lateness | None:
    """What the fit says of the logs; None where no rate moves, or it cannot say."""
    layout, solution = fitted.layout, fitted.solution
    if LATE not in layout.factors:
        return None
    place = layout.factor(LATE).start
    scale = layout.compute_mean_scale_factor(solution.coefficients)
    variance = float(solution.covariance[place, place]) * fitted.chi2_per_dof
    if not variance > 0 or scale == 0:
        return None
    # The column's coefficient is −Kτ.
    value_s, std_s = -float(solution.coefficients[place]) / scale, float(np.sqrt(variance)) / scale
    return Lateness(value_s, abs(std_s)) if np.isfinite([value_s, std_s]).all() else None


def set_right(path: AnglePath, late_s: float) -> AnglePath:
    """The path with the rate that was logged `late_s` later, where the log holds it.

    Parameters
    ----------
    path
        The run.
    late_s
        How late its log is [s].

    Returns
    -------
    AnglePath
        Without the increments that the log no longer reaches; the run as it is where fewer than two
        would be left.

    Examples
    --------
    A rate that rises by 0.2 rad/s², logged 1 s late:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.stages.calibration.late_log import set_right
    >>> path = draw_path(blocks=6, rate_integral_rad=0.1 * np.arange(6.0) ** 2)
    >>> moved = set_right(path, 1.0)
    >>> path.rate_rad_s[:3].round(9).tolist(), moved.rate_rad_s[:3].round(9).tolist()
    ([0.1, 0.3, 0.5], [0.3, 0.5, 0.7])
    """
    from scipy.interpolate import CubicSpline

    at = path.time_s + late_s
    held = np.flatnonzero((at >= path.time_s[0]) & (at <= path.time_s[-1]))
    if len(held) < 3:
        return path
    integral = CubicSpline(path.time_s, path.rate_integral_rad)(at)
    return replace(path, rate_integral_rad=integral).select_rows(slice(int(held[0]), int(held[-1])))


def follow(
    fitted: Fitted, others: Sequence[AnglePath]
) -> tuple[Fitted, list[AnglePath], Lateness | None]:
    """Runs with their rate logs set right in time, where a lateness is shown; else as they are.

    Parameters
    ----------
    fitted
        The runs, with the column of a late log.
    others
        Further runs of the same logs.

    Returns
    -------
    tuple
        The fit and the other runs, set right by what was found, and the lateness; None where no
        rate moves.

    Examples
    --------
    Constant rates do not show when they were logged:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import Model, TableLayout
    >>> from hrg_cli.stages.calibration.late_log import follow
    >>> random, layout = (
    ...     np.random.default_rng(1),
    ...     TableLayout(np.array([20.0]), "temperature", 2, 1, 0),
    ... )
    >>> fitted = fit([draw_path(rate, random) for rate in (-0.2, -0.1, 0.1, 0.2)], layout)
    >>> same, others, late = follow(fitted, [])
    >>> same is fitted, others, late
    (True, [], None)
    """
    late = _estimate_lateness(fitted)
    if late is None or abs(late.value_s) <= SHOWN * late.std_s:
        return fitted, list(others), late
    logged, taken = fitted.paths, 0.0
    for _ in range(ROUNDS):
        taken += late.value_s
        # From the logs as they were: a spline of a spline would smooth them at every round.
        fitted = fit([set_right(path, taken) for path in logged], fitted.layout)
        left = _estimate_lateness(fitted)
        if left is None:
            break
        late = left
        if abs(left.value_s) < SETTLED * left.std_s:
            break
    found = Lateness(taken + late.value_s, late.std_s, taken)
    return fitted, [set_right(path, taken) for path in others], found
