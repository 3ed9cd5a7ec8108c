"""Picture of a diagnosis's forecast: errors over the part of the run that was predicted."""

from __future__ import annotations

from typing import Any

import numpy as np

from .. import answer_words
from ..json_text import list_entries, read_float, take_child
from ..text import clean_text, format_number
from .drawing import INK, SERIES, Plot, choose_time_unit, draw_legend, make_panels, note, set_labels

QUANTITIES = (
    ("amplitude_percent", "error of the amplitude, %"),
    ("angle_deg", "error of the wave angle, °"),
    ("quadrature_percent", "error of the quadrature, % of a"),
)


def plot_forecast(report: dict[str, Any]) -> list[Plot]:
    """Measured less predicted of data left out, for the linear and the extended model.

    Parameters
    ----------
    report
        Of a diagnosis.

    Returns
    -------
    list of Plot
        Against time, and the signals' error of both; empty where nothing was forecast.

    Examples
    --------
    >>> from hrg_cli.reporting.figures.forecast import plot_forecast
    >>> plot_forecast({"effects": []})
    []
    """
    forecast = take_child(report, "forecast")
    courses = list_entries(forecast, "course")
    if not courses:
        return []
    times = [_numbers(course.get("time_s")) for course in courses]
    factor, unit = choose_time_unit(
        max((float(np.nanmax(t)) for t in times if np.isfinite(t).any()), default=1.0)
    )
    figure, axes = make_panels(1, 4, height=2.5, width=10.0)
    for ax, (key, label) in zip(axes[0], QUANTITIES):
        for k, (t, course) in enumerate(zip(times, courses)):
            for when, colour, name in (("before", 1, "linear"), ("after", 0, "extended")):
                error = _numbers(take_child(course, when).get(key))
                if len(error) == len(t):
                    ax.plot(t * factor, error, color=SERIES[colour], label=name if k == 0 else None)
            std = _numbers(take_child(course, "after_std").get(key))
            if len(std) == len(t):
                ax.fill_between(
                    t * factor,
                    -2 * std,
                    2 * std,
                    color=SERIES[0],
                    alpha=0.15,
                    lw=0,
                    label="expected, 95 %" if k == 0 else None,
                )
        ax.axhline(0, color=INK, lw=0.5)
        set_labels(ax, x=f"time, {unit}", y=label)
    draw_legend(axes[0, 0])
    said = answer_words.say_forecast(report)
    ax = axes[0, 3]
    values = [read_float(forecast.get(when)) for when in ("before", "after")]
    ax.bar([0, 1], np.nan_to_num(values), color=[SERIES[1], SERIES[0]], width=0.55)
    ax.set_xticks([0, 1], ["linear", "extended"])
    set_labels(ax, y=f"error of the signals, {clean_text(forecast.get('unit', '1'))}")
    note(ax, f"{format_number(read_float(forecast.get('ratio')), 3)} times smaller")
    return [
        Plot(
            "forecast",
            "Forecast of what was not fitted",
            f"{said[:1].upper()}{said[1:]}.",
            figure,
        )
    ]


def _numbers(values: Any) -> np.ndarray:
    """The numbers of a JSON list; NaN for anything else in it."""
    return np.array(
        [read_float(v) for v in values] if isinstance(values, list) else [], dtype=float
    )
