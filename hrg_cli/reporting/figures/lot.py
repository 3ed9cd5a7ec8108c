"""Figures of a lot: the distribution of a parameter with its limits, the Pareto of causes, and a
common cause gyro by gyro."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from statistics import NormalDist, median
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from ...records import Array
from ..quantities import LABELS, RATE_OF_DECAY, choose_unit
from ..text import clean_text, format_number
from .drawing import INK, MUTED, SERIES, Plot, draw_dots, draw_legend, make_panels, note, set_labels

NAMED = 8
"""Outliers that a figure names one by one."""
NARROW = 1e-3
"""Spread over median below which a figure shows the difference to the median."""
BARS = 200
"""Gyros up to which standard deviations are drawn."""
ROOM = 1.5
"""Widths of the data beside them within which a limit is drawn; further off it is an arrow."""
SHOWN = 12
"""Causes that the Pareto names."""
SPREAD = 1.4826
"""σ of a normal distribution over its median absolute deviation."""
Row = Mapping[str, Any]
Limits = tuple[float | None, float | None]


def say_in_words(name: str) -> str:
    """A figure's name in words.

    Parameters
    ----------
    name
        Column of a lot's table.

    Returns
    -------
    str
        For a person.

    Examples
    --------
    >>> from hrg_cli.reporting.figures.lot import say_in_words
    >>> say_in_words("drift_rms_rad_s_after"), say_in_words("scale_factor")
    ('drift rms after', 'scale factor K')
    """
    if name in LABELS and name != "damping_rate_1_s":
        return LABELS[name]
    for part, words in (
        ("_rms_rad_s_", " rms "),
        ("_rms_ppm_", " rms "),
        ("damping_rate_1_s", RATE_OF_DECAY),
    ):
        name = name.replace(part, words)
    return name.replace("_", " ")


def choose_figure_unit(name: str, value: float) -> tuple[float, str]:
    """The unit in which people read a figure of a lot's table.

    Parameters
    ----------
    name
        Of its column.
    value
        In SI units; its size decides.

    Returns
    -------
    tuple
        Factor from the column's unit, and the unit; empty of a plain number.

    Examples
    --------
    >>> from hrg_cli.reporting.figures.lot import choose_figure_unit
    >>> (
    ...     choose_figure_unit("scale_factor_rms_ppm_after", 12.0),
    ...     choose_figure_unit("scale_factor", 0.5),
    ... )
    ((1.0, 'ppm'), (1.0, ''))
    """
    if name.startswith("scale_factor_rms"):
        return 1.0, "ppm"
    for end, units in (("_1_s", "s-1"), ("_hz", "Hz"), ("axis_rad", "rad")):
        if name.endswith(end):
            return choose_unit(name, value, units)
    if "_rad_s" in name or name == "damping_split_1_s":
        return choose_unit(name, value, "rad s-1")
    return 1.0, ""


def _say_outliers(far: Sequence[Row]) -> str:
    if not far:
        return "no outlier."
    named = ", ".join(clean_text(row["gyro_id"]) for row in far)
    return f"{len(far)} outlier{'s' if len(far) > 1 else ''}: {named}."


def _say_limits(limits: str, value: Array, low: float | None, high: float | None) -> str:
    if not limits:
        return " No limit is set."
    outside = int(np.sum(value < low) if low is not None else 0)
    outside += int(np.sum(value > high) if high is not None else 0)
    return f" {limits}: {outside or 'none'} outside."


def _name_outliers(ax: Any, outliers: list[tuple[Row, float, float]], middle: float) -> None:
    """Each outlier's name on the side where there is room: towards the median."""
    for row, x, y in _choose_apart(outliers):
        left = x < middle
        ax.annotate(
            clean_text(row["gyro_id"])[:24],
            (x, y),
            xytext=(6, 0) if left else (-6, 0),
            ha="left" if left else "right",
            va="center",
            textcoords="offset points",
            fontsize=8,
            color=INK,
        )


def _draw_normal(ax: Axes, middle: float, spread: float) -> None:
    """Where the dots of a normal distribution would lie."""
    at = np.linspace(-3.5, 3.5, 60)
    expected = [100 * NormalDist().cdf(z) for z in at]
    ax.plot(
        middle + spread * at,
        expected,
        color=MUTED,
        lw=0.9,
        ls="--",
        label="normal, same median and MAD",
    )


def plot_distribution(rows: Sequence[Row], name: str, limits: Limits = (None, None)) -> Plot | None:
    """The share of gyros at or below each value of a figure.

    Parameters
    ----------
    rows
        Of a lot's report.
    name
        Of the figure's column.
    limits
        Minimum and maximum in its unit; None: there is none.

    Returns
    -------
    Plot or None
        With standard deviations and limits, against a normal distribution of the same median and
        MAD; None where no gyro has it.

    Examples
    --------
    >>> from hrg_cli.reporting.figures.lot import plot_distribution
    >>> plot_distribution([{"gyro_id": "SN-1", "scale_factor": None}], "scale_factor") is None
    True
    >>> rows = [
    ...     {"gyro_id": str(k), "scale_factor": 0.55 + 1e-3 * k, "outliers": ""} for k in range(9)
    ... ]
    >>> "no outlier" in plot_distribution(rows, "scale_factor").words
    True
    """
    known = sorted((row for row in rows if row.get(name) is not None), key=lambda row: row[name])
    if not known:
        return None
    factor, unit = choose_figure_unit(name, median(row[name] for row in known))
    value = factor * np.array([row[name] for row in known], dtype=float)
    std = abs(factor) * np.array([row.get(f"{name}_std") or math.nan for row in known], dtype=float)
    low, high = (None if limit is None else factor * limit for limit in limits)
    far = np.array([name in row["outliers"].split() for row in known])
    share = 100 * (np.arange(len(value)) + 0.5) / len(value)
    middle = median(value)
    spread = SPREAD * median(np.abs(value - middle))
    digits = _digits(middle, spread)
    origin = float(f"{middle:.{digits}g}") if 0 < spread < NARROW * abs(middle) else 0.0
    figure, axes = make_panels(height=2.4)
    ax = axes[0, 0]
    if spread > 0:
        _draw_normal(ax, middle - origin, spread)
    off = value - origin
    if len(value) <= BARS:
        bars = np.where(np.isfinite(std), std, 0.0)
        ax.errorbar(off, share, xerr=bars, fmt="none", ecolor=MUTED, elinewidth=0.7)
    draw_dots(ax, off[~far], share[~far], 0, points=len(value), size=4.0, alpha=0.9)
    draw_dots(ax, off[far], share[far], 1, points=len(value), size=6.0, alpha=1.0)
    ax.plot([], [], "o", color=SERIES[0], ms=3, label="gyro")
    if far.any():
        ax.plot([], [], "o", color=SERIES[1], ms=4, label="outlier")
    outliers = [(r, x, y) for r, x, y, out in zip(known, off, share, far) if out]
    _name_outliers(ax, outliers, middle - origin)
    said_limits = _limits(ax, origin, low, high, unit)
    ax.xaxis.set_major_formatter(lambda x, _: format_number(x, 6))
    from_where = f" less {format_number(origin, digits)}" if origin else ""
    title = say_in_words(name)
    set_labels(ax, f"{title}{from_where}, {unit}".removesuffix(", "), "gyros at or below, %", title)
    said = f" {unit}" if unit else ""
    centre, width = format_number(middle, digits), format_number(spread, 2)
    note(ax, f"median {centre}{said}, 1.4826·MAD {width}{said}")
    draw_legend(ax, loc="center right" if far.any() and value[far].max() < middle else "best")
    words = (
        f"{len(value)} gyros from {format_number(value[0], digits)} to"
        f" {format_number(value[-1], digits)}{said}, median {centre}, robust spread {width}; "
        + _say_outliers([row for row, out in zip(known, far) if out])
        + _say_limits(said_limits, value, low, high)
        + " Good: dots along the dashed line. Bad: dots far to one side, or a step."
    )
    return Plot(name.replace("_", "-"), f"Distribution of {title}", words, figure)


def _choose_apart(points: Sequence[tuple[Row, float, float]]) -> list[tuple[Row, float, float]]:
    """A few points whose names do not lie over one another."""
    kept: list[tuple[Row, float, float]] = []
    for point in points:
        if all(abs(point[2] - other[2]) > 6 for other in kept) and len(kept) < NAMED:
            kept.append(point)
    return kept


def _limits(ax: Axes, origin: float, low: float | None, high: float | None, unit: str) -> str:
    """Lines at the limits, arrows where they lie far beyond the data; the words for them."""
    first, last = ax.get_xlim()
    width = last - first
    said = []
    for limit, sign, side in ((low, "≥", "left"), (high, "≤", "right")):
        if limit is None:
            continue
        words = f"{sign} {format_number(limit, 5)} {unit}".strip()
        said.append(words)
        at = limit - origin
        if first - ROOM * width <= at <= last + ROOM * width:
            ax.axvline(at, color=SERIES[3], lw=1.4, ls=(0, (6, 2)), label=f"limit {words}")
            first, last = min(first, at - 0.03 * width), max(last, at + 0.03 * width)
        else:
            arrow = f"← limit {words}" if side == "left" else f"limit {words} →"
            ax.plot([], [], color=SERIES[3], lw=0, label=arrow)
    ax.set_xlim(first, last)
    return f"Limit {' and '.join(said)}" if said else ""


def _digits(value: float, std: float) -> int:
    """Digits of a value down to the second one of its spread."""
    if not value or not std or not math.isfinite(std):
        return 6
    return min(15, max(2, math.floor(math.log10(abs(value))) - math.floor(math.log10(std)) + 2))


def plot_pareto(counts: Sequence[tuple[str, int]], gyros: int) -> Plot | None:
    """Gyros a cause, most frequent first.

    Parameters
    ----------
    counts
        Causes with how many gyros have them, in this order.
    gyros
        Of the lot.

    Returns
    -------
    Plot or None
        None without a cause.

    Examples
    --------
    >>> from hrg_cli.reporting.figures.lot import plot_pareto
    >>> plot_pareto([("gain mismatch", 3), ("drift", 1)], 10).words[:60]
    'gain mismatch is the most frequent, in 3 of 10 gyros; a gyro'
    """
    if not counts:
        return None
    shown = list(counts[:SHOWN])
    rest = sum(count for _, count in counts[SHOWN:])
    if rest:
        shown.append(("others", rest))
    total = sum(count for _, count in counts)
    figure, axes = make_panels(height=max(1.5, 0.34 * len(shown) + 0.6))
    ax = axes[0, 0]
    at = np.arange(len(shown))
    ax.barh(at, [count for _, count in shown], color=SERIES[0], height=0.62)
    ax.set_yticks(at, [clean_text(name)[:40] for name, _ in shown])
    ax.invert_yaxis()
    ax.grid(False, axis="y")
    ax.set_xlim(0, max(count for _, count in shown) * 1.35)
    ax.xaxis.get_major_locator().set_params(integer=True)
    running = 0
    for k, (_, count) in enumerate(shown):
        running += count
        ax.annotate(
            f"{count} ({100 * running / total:.0f} % so far)",
            (count, k),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            fontsize=8.5,
        )
    set_labels(ax, "gyros", title="Causes by the gyros that have them")
    words = (
        f"{clean_text(shown[0][0])} is the most frequent, in {shown[0][1]} of {gyros} gyros; a"
        " gyro with two causes counts for both. In brackets: the share of all causes down to"
        " this one."
    )
    return Plot("pareto", "Pareto of causes", words, figure)


def plot_caterpillar(cause: Mapping[str, Any], key: str) -> Plot | None:
    """A common cause as every gyro's own diagnosis sees it.

    Parameters
    ----------
    cause
        Of a lot's report.
    key
        Of the figure.

    Returns
    -------
    Plot or None
        Those of the group apart, with the common value; None without an estimate.

    Examples
    --------
    >>> from hrg_cli.reporting.figures.lot import plot_caterpillar
    >>> plot_caterpillar({"estimates": []}, "common-1") is None
    True
    """
    rows = list(cause["estimates"])
    if not rows:
        return None
    rows.sort(key=lambda row: (not row["in_group"], row["day"], row["gyro_id"]))
    factor, unit = choose_unit(cause["parameter"], cause["value"], cause["units"])
    value = factor * np.array([row["value"] for row in rows])
    std = abs(factor) * np.array([row["std"] for row in rows])
    inside = np.array([row["in_group"] for row in rows])
    place = np.arange(1, len(rows) + 1)
    figure, axes = make_panels(height=2.5)
    ax = axes[0, 0]
    for own, colour, label in ((inside, 0, "gyro of the group"), (~inside, 2, "other gyro")):
        if own.any():
            ax.errorbar(
                place[own], value[own], std[own], fmt="none", ecolor=SERIES[colour], elinewidth=0.8
            )
            draw_dots(ax, place[own], value[own], colour, points=len(rows), size=4.0, alpha=1.0)
            ax.plot([], [], "o", color=SERIES[colour], ms=3, label=label)
    mean, error = factor * cause["value"], abs(factor) * cause["std"]
    ends = [place[inside].min() - 0.5, place[inside].max() + 0.5]
    ax.fill_between(ends, mean - error, mean + error, color=SERIES[1], alpha=0.35, lw=0)
    ax.plot(ends, [mean, mean], color=SERIES[1], lw=1.4, label="common value ± σ")
    ax.axhline(0, color=INK, lw=0.6)
    centre = np.concatenate([value[inside], [0.0, mean]])
    reach = 6 * float(np.median(std)) + float(np.ptp([*np.percentile(centre, [2, 98]), 0.0]))
    ax.set_ylim(
        max(float((value - std).min()), -reach) - 0.05 * reach,
        min(float((value + std).max()), reach) + 0.05 * reach,
    )
    title = clean_text(f"{cause['name']}".replace("_", " "))
    ax.xaxis.set_major_locator(MaxNLocator(integer=True))
    set_labels(ax, "gyros, by day and name", f"{title}, {unit}".removesuffix(", "), title)
    draw_legend(ax, loc="best")
    sure = abs(cause["value"]) / float(np.median(std[inside]) / abs(factor))
    words = (
        f"{clean_text(cause['sentence'])}; {format_number(sure, 2)} σ in one gyro;"
        f" that {cause['gyros']} of them"
        f" have it in common is as sure as {format_number(abs(cause['z']), 3)} σ."
        " Bars: σ of one gyro's own runs. Good: bars that cover zero."
        " Bad: a group that lies beside it as a whole."
    )
    return Plot(key, f"Common cause: {title}", words, figure)
