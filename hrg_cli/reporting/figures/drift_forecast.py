"""Picture of a forecast from a resonator: the drift over the wave angle, the wave's way, and the
error between external fixes."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...records import Array
from ...stages.forecast import Forecast
from ...units import DEGREE, DEGREE_PER_HOUR
from ..text import format_number
from .drawing import INK, SERIES, Plot, draw_legend, make_panels, set_labels, set_log_axis


def plot_drift_forecast(made: Forecast) -> Plot:
    """Drift over the wave angle, the angle's way over time, and the error since a fix.

    Parameters
    ----------
    made
        Made by `forecast`.

    Returns
    -------
    Plot
        Three panels.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Resonator
    >>> from hrg_cli.physics.resonator import PARAMETERS
    >>> from hrg_cli.reporting.figures.drift_forecast import plot_drift_forecast
    >>> from hrg_cli.stages.forecast import forecast
    >>> names, units = zip(*PARAMETERS)
    >>> value, std = np.array([5e3, 2e-3, 1e-4, 0.0, 0.02, 0.1, 0.55]), np.full(7, 1e-6)
    >>> known = dict(
    ...     name=np.array(names), units=np.array(units), std=std, covariance=np.diag(std**2)
    ... )
    >>> made = forecast(Resonator(value=value, **known), drive="free", duration_s=60.0)
    >>> plot_drift_forecast(made).words[:11]
    'Drift up to'
    """
    figure, axes = make_panels(1, 3, height=2.9, width=11.0)
    _draw_drift(axes[0, 0], made)
    _draw_way(axes[0, 1], made.table)
    _draw_error(axes[0, 2], made.table)
    table = made.table
    told = np.flatnonzero(np.isfinite(table["error_worst_rad"]))
    last = int(told[-1]) if len(told) else -1
    worst, left = (
        float(table[name][last] / DEGREE) for name in ("error_worst_rad", "left_rms_rad")
    )
    largest = float(np.abs(made.map["drift_rad_s"] / DEGREE_PER_HOUR).max())
    words = (
        f"Drift up to {format_number(largest, 3)} °/h;"
        f" {format_number(float(table['time_s'][last]), 3)} s after a fix the angle is wrong by"
        f" {format_number(worst, 3)} ° at worst, {format_number(left, 2)} ° rms after"
        " compensation with this resonator."
    )
    return Plot("drift-forecast", "Drift expected of this resonator", words, figure)


def _draw_drift(ax: Any, made: Forecast) -> None:
    """D(θ) with its band, and the parts of both splits."""
    angle, total, std = (
        made.map["wave_angle_rad"] / DEGREE,
        made.map["drift_rad_s"] / DEGREE_PER_HOUR,
        made.map["drift_rad_s_std"] / DEGREE_PER_HOUR,
    )
    ax.fill_between(angle, total - 2 * std, total + 2 * std, color=SERIES[0], alpha=0.15, lw=0)
    ax.plot(angle, total, color=SERIES[0], label="D(θ)")
    parts = (
        ("damping_part_rad_s", "--", "damping split, sin 4θ"),
        ("split_part_rad_s", ":", "frequency split, sin 8θ"),
    )
    for k, (name, dashes, said) in enumerate(parts, start=1):
        ax.plot(angle, made.map[name] / DEGREE_PER_HOUR, color=SERIES[k], ls=dashes, label=said)
    ax.axhline(0, color=INK, lw=0.5)
    when = "after one time constant" if made.drive == "free" else f"{made.drive} drive"
    set_labels(ax, x="wave angle, °", y="drift of mθ, °/h", title=f"Drift, {when}")
    draw_legend(ax)


def _draw_way(ax: Any, table: Mapping[str, Array]) -> None:
    """The wave's angle over time, and the tangent law where it holds."""
    time = table["time_s"]
    way, spread = table["wave_angle_rad"] / DEGREE, table["wave_angle_rad_std"] / DEGREE
    ax.fill_between(time, way - 2 * spread, way + 2 * spread, color=SERIES[0], alpha=0.15, lw=0)
    ax.semilogx(time, way, "o-", ms=2.5, color=SERIES[0], label="forecast")
    if np.isfinite(table["tangent_law_rad"]).all():
        ax.semilogx(
            time, table["tangent_law_rad"] / DEGREE, color=SERIES[1], ls="--", label="tangent law"
        )
    set_labels(ax, x="time, s", y="wave angle, °", title="Way of the wave")
    set_log_axis(ax.xaxis)
    draw_legend(ax)


def _draw_error(ax: Any, table: Mapping[str, Array]) -> None:
    """The input angle's error over the time since the last fix."""
    curves = (
        ("error_worst_rad", "worst start"),
        ("error_rms_rad", "rms"),
        ("left_rms_rad", "left after compensation"),
    )
    for k, (name, said) in enumerate(curves):
        error = np.maximum(table[name] / DEGREE, 1e-12)
        ax.loglog(table["time_s"], error, "o-", ms=2.5, color=SERIES[k], label=said)
    set_labels(
        ax, x="time since a fix, s", y="error of the input angle, °", title="Error between fixes"
    )
    ax.grid(True, which="both")
    set_log_axis(ax.xaxis)
    set_log_axis(ax.yaxis)
    draw_legend(ax)
