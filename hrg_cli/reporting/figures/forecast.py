"""Picture of a diagnosis's forecast: errors over the part of the run that was predicted, and what every cause adds."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..json_text import as_float, child, entries
from ..text import number
from .drawing import INK, MUTED, SERIES, Plot, labels, legend, note, panels, time_unit

QUANTITIES = (
    ("amplitude_percent", "error of the amplitude, %"),
    ("angle_deg", "error of the wave angle, °"),
    ("quadrature_percent", "error of the quadrature, % of a"),
)


def forecast_plots(report: dict[str, Any]) -> list[Plot]:
    """Measured less predicted against time for the linear and the extended model, and the wave's error as the causes are added."""
    forecast = child(report, "forecast")
    courses = entries(forecast, "course")
    if not courses:
        return []
    times = [_numbers(course.get("time_s")) for course in courses]
    factor, unit = time_unit(max((float(np.nanmax(t)) for t in times if np.isfinite(t).any()), default=1.0))
    figure, axes = panels(1, 4, height=2.5, width=10.0)
    for ax, (key, label) in zip(axes[0], QUANTITIES):
        for k, (t, course) in enumerate(zip(times, courses)):
            for when, colour, name in (("before", 1, "linear"), ("after", 0, "extended")):
                error = _numbers(child(course, when).get(key))
                if len(error) == len(t):
                    ax.plot(t * factor, error, color=SERIES[colour], label=name if k == 0 else None)
            std = _numbers(child(course, "after_std").get(key))
            if len(std) == len(t):
                ax.fill_between(
                    t * factor, -2 * std, 2 * std, color=SERIES[0], alpha=0.15, lw=0, label="expected, 95 %" if k == 0 else None
                )
        ax.axhline(0, color=INK, lw=0.5)
        labels(ax, x=f"time, {unit}", y=label)
    legend(axes[0, 0])
    ax = axes[0, 3]
    rows = [("linear", child(forecast, "before"))] + [(f"+ {s.get('name')}", s) for s in entries(forecast, "steps")]
    rows += [(f"or {s.get('name')}", s) for s in entries(forecast, "alternatives")]
    values = [as_float(row.get("wave_percent")) for _, row in rows]
    taken = 1 + len(entries(forecast, "steps"))
    ax.barh(range(len(rows)), values, color=[SERIES[0] if k < taken else MUTED for k in range(len(rows))], height=0.6)
    ax.set_yticks(range(len(rows)), [name for name, _ in rows])
    ax.invert_yaxis()
    labels(ax, x="error of the wave, %")
    note(ax, f"ratio {number(as_float(forecast.get('ratio')), 3)}")
    return [Plot("forecast", "Forecast of what was not fitted", f"{forecast.get('sentence', '')}.", figure)]


def _numbers(values: Any) -> np.ndarray:
    """The numbers of a JSON list; NaN for anything else in it."""
    return np.array([as_float(v) for v in values] if isinstance(values, list) else [], dtype=float)
