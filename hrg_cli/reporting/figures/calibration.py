"""First look at a calibration: maps of drift and scale factor, harmonics with σ, ladder."""

from __future__ import annotations

from textwrap import fill
from typing import Any

import numpy as np

from ...records import Array, Calibration
from ...units import DEGREE_PER_HOUR
from ..json_text import list_entries, parse_object, read_figure_of_merit
from ..quantities import round_with_std
from ..text import format_number
from .drawing import (
    INK,
    MUTED,
    SERIES,
    Plot,
    draw_legend,
    make_panels,
    say_spread,
    set_labels,
    set_log_axis,
)


def plot_calibration(record: Calibration, first_only: bool = False) -> list[Plot]:
    """Maps of D and K, their harmonics with σ, and the ladder.

    Parameters
    ----------
    record
        The tables.
    first_only
        The map of D alone.

    Returns
    -------
    list of Plot
        In the order of the page.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.rate_table import rate_table
    >>> from hrg_cli.reporting.figures.calibration import plot_calibration
    >>> rate = np.tile(np.linspace(-1.0, 1.0, 11), 20)
    >>> output = 2.0 * rate + 1e-4 * np.random.default_rng(0).standard_normal(220)
    >>> tables = rate_table(
    ...     {"out": output, "rate": rate}, output="out", rate="rate", nominal_scale=2.0
    ... )
    >>> len(plot_calibration(tables, first_only=True))
    1
    """
    mean = float(np.nanmean(record.scale_factor_harmonics[:, 0])) or 1.0
    drift = _draw_map(
        record,
        record.drift_rad_s / DEGREE_PER_HOUR,
        record.drift_rad_s_std / DEGREE_PER_HOUR,
        "D",
        "drift D, °/h",
        "drift-map",
    )
    if first_only:
        return [drift]
    found = [
        drift,
        _draw_map(
            record,
            (record.scale_factor / mean - 1) * 1e6,
            record.scale_factor_std / abs(mean) * 1e6,
            "K",
            f"K/{format_number(mean, 6)} − 1, ppm",
            "scale-factor-map",
        ),
        _harmonics(record, mean),
    ]
    ladder = list_entries(parse_object(record.details), "ladder")
    if ladder:
        found.append(_ladder(ladder))
    return found


def _node_axis(record: Calibration) -> str:
    return "temperature, °C" if record.axis == "temperature" else "frequency, Hz"


def _at_nodes(record: Calibration, label: str) -> str:
    """What a table holds and at which nodes, as the beginning of a sentence."""
    node = np.asarray(record.node, float)
    unit = "°C" if record.axis == "temperature" else "Hz"
    nodes = (
        f"{len(node)} nodes from {say_spread(node)}"
        if len(node) > 1
        else format_number(float(node[0]))
    )
    return f"{label[:1].upper()}{label[1:]}, at {nodes} {unit}"


def _draw_over_nodes(
    record: Calibration, values: Array, deviation: Array, symbol: str, label: str, key: str
) -> Plot:
    """Of a gyro without a wave angle bias and scale factor stand over the nodes."""
    figure, axes = make_panels(1, 1, height=2.9, width=7.2)
    ax = axes[0, 0]
    ax.errorbar(
        np.asarray(record.node),
        values,
        deviation,
        fmt="o-",
        ms=3.2,
        lw=1.1,
        capsize=2,
        color=SERIES[0],
    )
    set_labels(ax, x=_node_axis(record), y=label, title=f"{symbol} with ±σ")
    return Plot(
        key,
        f"{'Bias' if symbol == 'D' else 'Scale factor'} {symbol} against {record.axis}",
        f"{_at_nodes(record, label)}: {say_spread(values)}.",
        figure,
    )


def _shade_map(ax: Any, node: Array, angle: Array, values: Array) -> Any:
    """Values (nodes, angles) as a shade about their median, even on both sides of it."""
    ax.grid(False)
    order = np.argsort(node)
    rows = np.linspace(node.min(), node.max(), 81)
    columns = np.linspace(angle.min(), angle.max(), 121)
    smooth = np.stack([np.interp(columns, angle, row) for row in values[order]])
    smooth = np.stack([np.interp(rows, node[order], column) for column in smooth.T], 1)
    centre = float(np.nanmedian(values))
    span = float(np.nanmax(np.abs(values - centre))) or 1.0
    mesh = ax.imshow(
        smooth,
        cmap="RdBu_r",
        vmin=centre - span,
        vmax=centre + span,
        origin="lower",
        aspect="auto",
        interpolation="bilinear",
        extent=(columns[0], columns[-1], rows[0], rows[-1]),
    )
    ax.plot(np.full(len(node), angle[0]), node, "_", color=MUTED, ms=6, clip_on=False)
    return mesh


def _draw_map(
    record: Calibration, values: Array, deviation: Array, symbol: str, label: str, key: str
) -> Plot:
    """A table over wave angle and node: curves with ±σ, and beside them the map."""
    if len(record.wave_angle_rad) == 1:
        return _draw_over_nodes(record, values[:, 0], deviation[:, 0], symbol, label, key)
    node, angle = np.asarray(record.node), np.degrees(np.asarray(record.wave_angle_rad))
    unit, several = "°C" if record.axis == "temperature" else "Hz", len(node) > 1
    figure, axes = make_panels(1, 2 if several else 1, height=2.9, width=8.2 if several else 7.2)
    ax = axes[0, 0]
    picked = np.unique(np.linspace(0, len(node) - 1, min(5, len(node))).round().astype(int))
    for k, i in enumerate(picked):
        colour = SERIES[k % len(SERIES)]
        named = f"{format_number(float(node[i]), 6)} {unit}"
        ax.plot(angle, values[i], color=colour, label=named)
        ax.fill_between(
            angle, values[i] - deviation[i], values[i] + deviation[i], color=colour, alpha=0.2, lw=0
        )
    set_labels(ax, x="wave angle θ, °", y=label, title=f"{symbol} against θ with ±σ")
    low_end, high_end = ax.get_ylim()
    ax.set_ylim(low_end, high_end + 0.3 * (high_end - low_end))
    draw_legend(ax, loc="upper center", ncols=3, fontsize=7.5)
    if several:
        mesh = _shade_map(axes[0, 1], node, angle, values)
        figure.colorbar(mesh, ax=axes[0, 1], label=label)
        set_labels(axes[0, 1], x="wave angle θ, °", y=_node_axis(record), title=f"Map of {symbol}")
    low, high = (
        np.unravel_index(np.nanargmin(values), values.shape),
        np.unravel_index(np.nanargmax(values), values.shape),
    )
    words = (
        f"{_at_nodes(record, label)} and {len(angle)} angles: lowest"
        f" {format_number(float(values[low]))} at {format_number(float(angle[low[1]]), 3)}°,"
        f" highest {format_number(float(values[high]))} at"
        f" {format_number(float(angle[high[1]]), 3)}°; median σ"
        f" {format_number(float(np.nanmedian(deviation)), 2)}."
    )
    return Plot(
        key,
        f"{'Drift' if symbol == 'D' else 'Scale factor'} {symbol} against wave angle and"
        f" {record.axis}",
        words,
        figure,
    )


def _errors_a_harmonic(ax: Any, values: Array, deviation: Array, node: Array) -> None:
    """Each harmonic with ±σ at five nodes at most, side by side."""
    shown = np.unique(np.linspace(0, len(values) - 1, min(5, len(values))).round().astype(int))
    for k, i in enumerate(shown):
        ax.errorbar(
            np.arange(values.shape[1]) + (k - (len(shown) - 1) / 2) * 0.13,
            values[i],
            deviation[i],
            fmt="o",
            ms=3.2,
            lw=1.1,
            capsize=2,
            color=SERIES[k % len(SERIES)],
            label=format_number(float(node[i]), 6),
        )


def _harmonics(record: Calibration, mean: float) -> Plot:
    figure, axes = make_panels(2, 1, height=2.3)
    said = []
    scale = record.scale_factor_harmonics - mean * (
        np.arange(record.scale_factor_harmonics.shape[1]) == 0
    )
    parts = (
        (
            record.drift_harmonics / DEGREE_PER_HOUR,
            record.drift_harmonics_std / DEGREE_PER_HOUR,
            "D, °/h",
            0,
        ),
        (scale / mean * 1e6, record.scale_factor_harmonics_std / abs(mean) * 1e6, "K, ppm", 1),
    )
    for ax, (values, deviation, label, first) in zip(axes[:, 0], parts):
        names = _harmonic_names(values.shape[1], record.mode_number)
        less = f" less {format_number(mean, 6)}" if first else ""  # of the constant, in the title
        _errors_a_harmonic(ax, values, deviation, np.asarray(record.node))
        ax.axhline(0, color=INK, lw=0.5)
        ax.set_xticks(range(len(names)), names)
        set_labels(ax, y=label, title=f"Harmonics of {label[0]}{less} with ±σ")
        middle = values[len(values) // 2]
        sigma = deviation[len(values) // 2]
        said.append(
            f"{label}{less}: "
            + ", ".join(
                f"{n} {round_with_std(float(v), float(s))}" for n, v, s in zip(names, middle, sigma)
            )
        )
    if len(record.node) > 1:
        axes[0, 0].legend(
            title=_node_axis(record),
            title_fontsize=8,
            fontsize=7.5,
            loc="center left",
            bbox_to_anchor=(1.0, 0.5),
        )
    return Plot("harmonics", "Harmonics with σ", f"At the middle node: {'; '.join(said)}.", figure)


def _harmonic_names(count: int, mode: int) -> list[str]:
    return ["constant"] + [
        f"{'cos' if k % 2 else 'sin'} {2 * mode * ((k + 1) // 2)}θ" for k in range(1, count)
    ]


def _ladder(steps: list[dict[str, Any]]) -> Plot:
    names = [fill(str(step.get("stage", i + 1)), 30) for i, step in enumerate(steps)]
    figure, axes = make_panels(1, 2, height=0.9 + 0.3 * len(steps), width=8.2, sharey=True)
    columns = (
        ("drift_rms_rad_s", "drift", "drift left, °/h rms", 1 / DEGREE_PER_HOUR),
        ("scale_factor_rms_ppm", "scale", "scale factor left, ppm rms", 1.0),
    )
    said = []
    for ax, (key, short, label, factor), colour in zip(axes[0], columns, SERIES):
        found = [read_figure_of_merit(step.get(key, step.get(short))) for step in steps]
        values, low, high = (np.array(found) * factor).T
        shown = np.nan_to_num(values)
        finite = shown[shown > 0]
        wide = len(finite) > 0 and finite.max() > 20 * finite.min()
        if wide:
            ax.set_xscale("log")
            set_log_axis(ax.xaxis)
            ax.set_xlim(finite.min() / 3, finite.max() * 6)
        else:
            ax.set_xlim(0, (finite.max() if len(finite) else 1) * 1.3)
        ax.barh(range(len(steps)), shown, color=colour, height=0.6)
        reach = np.nan_to_num(np.stack([values - low, high - values])).clip(0)
        ax.errorbar(shown, range(len(steps)), xerr=reach, fmt="none", ecolor=INK, elinewidth=1.0)
        start = ax.get_xlim()[0]
        for i, value in enumerate(values):
            end = np.nanmax([shown[i], high[i], start])
            ax.annotate(
                format_number(float(value), 3),
                (end, i),
                xytext=(4, 0),
                textcoords="offset points",
                va="center",
                fontsize=8,
            )
        set_labels(ax, x=label)
        said.append(
            f"{label}: "
            + ", ".join(f"{n} {format_number(float(v), 3)}" for n, v in zip(names, values))
        )
    axes[0, 0].set_yticks(range(len(steps)), names)
    axes[0, 0].invert_yaxis()
    return Plot(
        "ladder", "Ladder: what each step of the calibration leaves", ". ".join(said) + ".", figure
    )
