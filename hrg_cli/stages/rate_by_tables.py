"""The rate by a calibration's tables beside that of the reference model: two ways from one wave, of
which neither knows the other's coefficients."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.interpolate import CubicSpline

from ..records import Calibration, Compensated, Wave, collect
from ..records.record import Status
from .compensate import compensate

Array = np.ndarray


@dataclass(frozen=True)
class TableRate:
    """What the tables say about each node (n,): their mean rate over its share of the run, NaN
    where they have no row there, and how far that is from the model's mean over the same time."""

    rate_rad_s: Array
    difference_rad_s: Array
    reasons: tuple[str, ...]
    status: Status
    """Whether the reasons are doubts or notes."""
    own_std_rad_s: float = 0.0
    """Standard deviation that the tables' own errors leave in any mean."""

    @property
    def mean_difference_rad_s(self) -> float | None:
        """Mean over the nodes that the tables reach; None where they reach none."""
        known = self.difference_rad_s[np.isfinite(self.difference_rad_s)]
        return float(known.mean()) if len(known) else None

    def to_json(self) -> dict[str, Any]:
        """For the JSON: means over the run, null where the tables have no row at all."""
        mean = self.mean_difference_rad_s
        square = np.square(self.difference_rad_s)
        return {
            "difference_mean_rad_s": mean,
            "difference_rms_rad_s": None if mean is None else float(np.sqrt(np.nanmean(square))),
        }


def rate_by_tables(
    wave: Wave, calibration: Calibration, time_s: Array, rate_rad_s: Array, *earth: Any
) -> TableRate:
    """The tables' rate about the nodes `time_s` (n,) of a model's rate (n,).

    A node's share of the run ends half way to its neighbours. Both rates are means over the rows in
    it: at the node itself a rate that bends is not its mean.

    Parameters
    ----------
    wave
        The run.
    calibration
        The tables.
    time_s, rate_rad_s
        Nodes [s] and the reference model's rate there [rad/s], (n,).
    earth
        The Earth's rate as `compensate` takes it: deg/h, latitude, tilt and azimuth of the axis in
        degrees.

    Returns
    -------
    TableRate
        The tables' mean rate about each node, and its difference from the model's.

    Raises
    ------
    HrgError
        As `compensate`: tables of another gyro, refused ones, a temperature outside them.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import calibrate, collect, demodulate, estimate, simulate
    >>> from hrg_cli.stages.rate_by_tables import rate_by_tables
    >>> config = {
    ...     "device": {"frequency_hz": 1000.0, "quality_factor": 20_000.0},
    ...     "control": {"mode": "forced"},
    ...     "readout": {"noise": 1e-5},
    ...     "recording": {"sample_rate_hz": 8000.0, "duration_s": 8.0},
    ...     "run": [
    ...         {"run_id": "left", "environment": {"rate_rad_s": 2.0}},
    ...         {"run_id": "right", "environment": {"rate_rad_s": -2.0}},
    ...     ],
    ... }
    >>> samples = [collect(simulate(config, model="slow", run=run)) for run in ("left", "right")]
    >>> waves = [collect(estimate(collect(demodulate(r, periods_per_window=50)))) for r in samples]
    >>> tables = calibrate(waves, harmonics=1, scale_factor_harmonics=0, model="table")
    >>> found = rate_by_tables(waves[0], tables, np.linspace(1.0, 7.0, 5), np.full(5, 2.0))
    >>> found.rate_rad_s.round(3).tolist(), abs(found.mean_difference_rad_s) < 1e-3
    ([2.0, 2.0, 2.0, 2.0, 2.0], True)
    """
    names = ("earth_rate_deg_h", "latitude_deg", "axis_tilt_deg", "axis_azimuth_deg")
    made: Compensated = collect(compensate(wave, calibration, **dict(zip(names, earth))))
    known = np.isfinite(made.rate_estimate_rad_s)
    at, tables = made.time_s[known], made.rate_estimate_rad_s[known]
    cell = np.searchsorted((time_s[1:] + time_s[:-1]) / 2, at)
    inside = (at >= time_s[0]) & (at <= time_s[-1])  # beyond the last nodes a spline runs away
    cell, at, tables = cell[inside], at[inside], tables[inside]
    count = np.bincount(cell, minlength=len(time_s))

    def mean(values: Array) -> Array:
        total = np.bincount(cell, values, len(time_s))
        return np.where(count > 0, total / np.maximum(count, 1), np.nan)

    table_rate = mean(tables)
    difference = table_rate - mean(CubicSpline(time_s, rate_rad_s)(at))
    reasons = tuple(f"by the tables: {reason}" for reason in made.status_reasons)
    spread = json.loads(made.details).get("rate_std_rad_s", {}).get("by_tables", 0.0)
    return TableRate(table_rate, difference, reasons, made.status, spread)
