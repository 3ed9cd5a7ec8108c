"""First look at a diagnosis: ranking of the causes, what they gain, which of them look alike."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LinearSegmentedColormap, to_rgba
from matplotlib.ticker import MaxNLocator

from ...records import Array, Diagnosis
from ..answer_words import say_in_words
from ..diagnosis import score_left
from ..json_text import list_entries, parse_object, read_float, take_child
from ..text import format_number
from .departure import plot_departure
from .drawing import (
    MUTED,
    SERIES,
    Plot,
    make_panels,
    note,
    set_labels,
    set_log_axis,
    shorten_list,
)
from .forecast import plot_forecast

ALIKE = 0.9
"""Correlation from which two causes are named as alike."""


def plot_diagnosis(record: Diagnosis) -> list[Plot]:
    """Every figure of a diagnosis.

    Parameters
    ----------
    record
        The diagnosis.

    Returns
    -------
    list of Plot
        Causes by rank, gain, forecast, measured beside simulated, and what looks alike; without
        what is not told.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from hrg_cli.reporting.figures.diagnosis import plot_diagnosis
    >>> class Told(SimpleNamespace):
    ...     def __len__(self):
    ...         return 0
    >>> plot_diagnosis(Told(report="{}"))
    []
    """
    report = parse_object(record.report)
    found = []
    if list_entries(report, "effects") or list_entries(report, "tested"):
        found.append(_ranking(report))
    if isinstance(report.get("gain"), dict):
        found.append(_gain(report))
    found += plot_forecast(report)
    if len(record) and record.measured.shape[1] == 4:
        found += plot_departure(record, int(read_float(report.get("mode_number", 2))))
    names, matrix = (
        take_child(report, "correlations").get("names", []),
        take_child(report, "correlations").get("matrix", []),
    )
    if len(names) > 1 and np.shape(matrix) == (len(names), len(names)):
        found.append(_correlation_map(names, np.array(matrix, float)))
    return found


Score = tuple[str, float, int]
"""A cause, its |z|, the place of its colour."""


def _scores(report: dict[str, Any]) -> tuple[list[Score], list[Score]]:
    """The causes found, in the order found, and what scores of the others that these runs can show
    are left beside them, the strongest first."""
    found: list[Score] = [
        (say_in_words(str(e.get("name"))), abs(read_float(e.get("z"))), 0)
        for e in list_entries(report, "effects")
    ]
    named = {name for name, _, _ in found}
    tested: list[Score] = [
        (say_in_words(str(e.get("name"))), score_left(e), 5)
        for e in list_entries(report, "tested")
        if say_in_words(str(e.get("name"))) not in named and e.get("visible", True)
    ]
    tested = [score for score in tested if np.isfinite(score[1])]
    return found, sorted(tested, key=lambda e: -e[1])


def _say_ranking(report: dict[str, Any], found: list[Score], tested: list[Score]) -> str:
    said = f"Verdict: {report.get('verdict')}. "
    if found:
        said += "Found: " + ", ".join(f"{n} at {format_number(z, 3)} σ" for n, z, _ in found) + ". "
    else:
        said += "No cause was found. "
    if tested:
        scores = [f"{n} {format_number(z, 2)} σ" for n, z, _ in tested]
        said += f"Beside {'them' if found else 'nothing'}, not found: {shorten_list(scores, 8)}."
    return said


def _ranking(report: dict[str, Any]) -> Plot:
    effects, tested = _scores(report)
    rows = (effects + tested)[:24]
    figure, axes = make_panels(1, 1, height=0.8 + 0.24 * len(rows))
    ax = axes[0, 0]
    values = np.array([np.nan_to_num(z) for _, z, _ in rows])
    ax.barh(
        range(len(rows)),
        np.maximum(values, 1e-3),
        color=[SERIES[c] for _, _, c in rows],
        height=0.65,
    )
    if values.max(initial=1.0) > 50:
        ax.set_xscale("log")
        ax.set_xlim(0.3, values.max() * 3)
        set_log_axis(ax.xaxis)
    else:
        ax.set_xlim(0, max(5.0, values.max(initial=1.0)) * 1.15)
    for i, z in enumerate(values):
        ax.annotate(
            format_number(float(z), 3),
            (max(z, ax.get_xlim()[0]), i),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            fontsize=8,
        )
    ax.set_yticks(range(len(rows)), [name for name, _, _ in rows])
    ax.invert_yaxis()
    set_labels(ax, x="|z|, standard deviations")
    note(ax, "blue: found, in the order found; grey: what is left of the others beside them")
    words = _say_ranking(report, effects, tested)
    return Plot("ranking", "Causes by significance", words, figure)


def _gain(report: dict[str, Any]) -> Plot:
    gain = report["gain"]
    figure, axes = make_panels(1, 2, height=2.1, width=7.2)
    fitted = [
        read_float(take_child(report, part).get("chi2_per_dof")) for part in ("baseline", "after")
    ]
    held_out = [read_float(gain.get(part)) for part in ("before", "after")]
    held = f"residual on held-out {gain.get('held_out', 'data')}"
    said = [
        _draw_fall(axes[0, 0], fitted, "χ² per degree of freedom", SERIES[4]),
        _draw_fall(axes[0, 1], held_out, held, SERIES[2]),
    ]
    ratio, std = read_float(gain.get("ratio")), read_float(gain.get("std"))
    if np.isfinite(ratio):
        words = f"ratio {format_number(ratio, 3)} ± {format_number(std, 2)}"
        note(axes[0, 1], words)
        said.append(words)
    return Plot("gain", "Gain of the extended model", "; ".join(said) + ".", figure)


def _draw_fall(ax: Axes, values: list[float], label: str, colour: str) -> str:
    """A figure before and after as two bars; the same in words."""
    ax.bar([0, 1], np.nan_to_num(values), color=[MUTED, colour], width=0.55)
    ax.set_xticks([0, 1], ["before", "after"])
    top = float(np.nanmax(values)) if np.isfinite(values).any() else 1.0
    ax.set_ylim(0, top * 1.18 or 1.0)
    ax.yaxis.set_major_locator(MaxNLocator(5))
    for i, value in enumerate(values):
        ax.annotate(
            format_number(value),
            (i, np.nan_to_num(value)),
            xytext=(0, 3),
            textcoords="offset points",
            ha="center",
            fontsize=8.5,
        )
    set_labels(ax, y=label)
    return f"{label} {format_number(values[0])} before and {format_number(values[1])} after"


def _correlation_map(names: list[Any], matrix: Array) -> Plot:
    """How alike two causes are to these runs beside the base model, of those that can be seen at
    all."""
    count = len(names)
    shade = LinearSegmentedColormap.from_list(
        "alike", [to_rgba(SERIES[0], 0.0), to_rgba(SERIES[0], 1.0)]
    )
    figure, axes = make_panels(1, 1, height=1.5 + 0.2 * count, width=2.6 + 0.26 * count)
    ax = axes[0, 0]
    ax.pcolormesh(
        np.arange(count + 1), np.arange(count + 1), np.abs(matrix), cmap=shade, vmin=0, vmax=1
    )
    middle = np.arange(count) + 0.5
    names = [say_in_words(str(n)) for n in names]
    ax.set_xticks(middle, names, rotation=90)
    ax.set_yticks(middle, names)
    ax.grid(False)
    ax.invert_yaxis()
    note(ax, "blank: told apart; full: one cause to these runs")
    pairs = [(abs(matrix[i, j]), names[j], names[i]) for i in range(count) for j in range(i)]
    alike = [f"{a} and {b} {c:.3f}" for c, a, b in sorted(pairs, reverse=True) if c > ALIKE]
    words = (
        f"Correlations above {ALIKE}: {shorten_list(alike, 8)}."
        if alike
        else f"No two causes have a correlation above {ALIKE}."
    )
    return Plot("correlations", "Which causes look alike in these runs", words, figure)
