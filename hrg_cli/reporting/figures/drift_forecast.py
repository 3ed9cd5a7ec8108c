"""Picture of a forecast from a resonator: the drift over the wave angle, the wave's way, and the
error between external fixes."""

from __future__ import annotations

import numpy as np

from ...stages.forecast import Forecast
from ...units import DEGREE, DEGREE_PER_HOUR
from ..text import number
from .drawing import INK, SERIES, Plot, labels, legend, log_axis, panels


def drift_forecast(made: Forecast) -> Plot:
    """D(θ) with its band and its two parts; θ(t) beside the tangent law; accumulated error against
    the time since a fix."""
    figure, axes = panels(1, 3, height=2.9, width=11.0)
    ax, drawn = axes[0, 0], made.map
    angle, total, std = (
        drawn["wave_angle_rad"] / DEGREE,
        drawn["drift_rad_s"] / DEGREE_PER_HOUR,
        drawn["drift_rad_s_std"] / DEGREE_PER_HOUR,
    )
    ax.fill_between(angle, total - 2 * std, total + 2 * std, color=SERIES[0], alpha=0.15, lw=0)
    ax.plot(angle, total, color=SERIES[0], label="D(θ)")
    ax.plot(
        angle,
        drawn["damping_part_rad_s"] / DEGREE_PER_HOUR,
        color=SERIES[1],
        ls="--",
        label="damping split, sin 4θ",
    )
    ax.plot(
        angle,
        drawn["split_part_rad_s"] / DEGREE_PER_HOUR,
        color=SERIES[2],
        ls=":",
        label="frequency split, sin 8θ",
    )
    ax.axhline(0, color=INK, lw=0.5)
    when = "after one time constant" if made.drive == "free" else f"{made.drive} drive"
    labels(ax, x="wave angle, °", y="drift of mθ, °/h", title=f"Drift, {when}")
    legend(ax)
    ax, table = axes[0, 1], made.table
    hours = table["time_s"]
    way, spread = table["wave_angle_rad"] / DEGREE, table["wave_angle_rad_std"] / DEGREE
    ax.fill_between(hours, way - 2 * spread, way + 2 * spread, color=SERIES[0], alpha=0.15, lw=0)
    ax.semilogx(hours, way, "o-", ms=2.5, color=SERIES[0], label="forecast")
    if np.isfinite(table["tangent_law_rad"]).all():
        ax.semilogx(
            hours, table["tangent_law_rad"] / DEGREE, color=SERIES[1], ls="--", label="tangent law"
        )
    labels(ax, x="time, s", y="wave angle, °", title="Way of the wave")
    log_axis(ax.xaxis)
    legend(ax)
    ax = axes[0, 2]
    for k, (name, said) in enumerate(
        (
            ("error_worst_rad", "worst start"),
            ("error_rms_rad", "rms"),
            ("left_rms_rad", "left after compensation"),
        )
    ):
        ax.loglog(
            hours,
            np.maximum(table[name] / DEGREE, 1e-12),
            "o-",
            ms=2.5,
            color=SERIES[k],
            label=said,
        )
    labels(
        ax, x="time since a fix, s", y="error of the input angle, °", title="Error between fixes"
    )
    ax.grid(True, which="both")
    log_axis(ax.xaxis)
    log_axis(ax.yaxis)
    legend(ax)
    told = np.flatnonzero(np.isfinite(table["error_worst_rad"]))
    last = int(told[-1]) if len(told) else -1
    worst, left = (
        float(table[name][last] / DEGREE) for name in ("error_worst_rad", "left_rms_rad")
    )
    words = (
        f"Drift up to {number(float(np.abs(total).max()), 3)} °/h; {number(float(hours[last]), 3)}"
        f" s after a fix the angle is wrong by {number(worst, 3)} ° at worst, {number(left, 2)} °"
        " rms after compensation with this resonator."
    )
    return Plot("drift-forecast", "Drift expected of this resonator", words, figure)
