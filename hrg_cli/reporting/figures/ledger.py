"""Figures of the ledger: a figure's measurements as a chart of individuals with what changes from
one to the next, and the capability of all figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.ticker import MaxNLocator

from ...ledger.charts import BEYOND, FEWEST_POINTS, Chart
from ...ledger.overview import FigureReport
from ...ledger.series import DAY_S
from ...ledger.times import format_time
from ...records import Array
from ..quantities import choose_unit, format_quantity
from ..text import clean_text, format_number
from .drawing import (
    INK,
    MUTED,
    SERIES,
    Plot,
    draw_dots,
    make_panels,
    note,
    set_labels,
    shorten_list,
)

BARS = 200
"""Points up to which standard deviations are drawn."""
NAMED = 6
"""Points out of control that a figure names."""
NARROW = 1e-2
"""Reach over middle below which a figure shows the difference to the middle."""
ROOM = 1.0
"""Heights of the data beside them within which a limit is drawn; further off it is told."""
CAPABLE = 4 / 3
"""Cpk that is asked for as a rule (limits 4 σ from the mean)."""
Bounds = tuple[float | None, float | None]


@dataclass(frozen=True)
class ChartedFigure:
    """Measurements (n,) of one figure in the order of time: values and σ (NaN where unknown) in
    units, seconds since 1970, who or where each point is; `own`: all of one gyro, whose changes are
    held against their own σ."""

    key: str
    title: str
    name: str
    units: str
    times: Array
    values: Array
    stds: Array
    points: Sequence[str]
    bounds: Bounds
    chart: Chart | None
    own: bool


def draw_course(course: ChartedFigure) -> Plot:
    """A figure in the order of time with its chart's limits and those that are set.

    Parameters
    ----------
    course
        The figure.

    Returns
    -------
    Plot
        Below, the change from one to the next: in σ of both for one gyro, else the moving range
        with its limit.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.reporting.figures.ledger import ChartedFigure, draw_course
    >>> values, none = np.array([0.55, 0.56]), np.full(2, np.nan)
    >>> course = ChartedFigure(
    ...     "k", "scale factor", "scale_factor", "1", np.array([0.0, 86_400.0]), values, none,
    ...     ["SN-1", "SN-2"], (0.5, None), None, False,
    ... )
    >>> len(draw_course(course).figure.axes)
    2
    """
    values = np.asarray(course.values, float)
    middle = float(np.median(values)) if course.chart is None else course.chart.centre
    factor, unit = choose_unit(course.name, middle, course.units)
    two = len(values) > 1
    figure, axes = make_panels(rows=2 if two else 1, height=2.1, sharex=True)
    at, said = _abscissa(course)
    origin = _origin(values * factor)
    _individuals(axes[0, 0], course, at, factor, origin, unit)
    if two:
        _changes(axes[1, 0], course, at, factor, unit)
    axes[-1, 0].set_xlabel(said)
    if axes[0, 0].get_legend_handles_labels()[1]:
        figure.legend(loc="outside lower center", ncols=3)
    for ax in axes[:, 0]:
        if course.own:
            ax.xaxis.set_major_locator(MaxNLocator(7))
        else:
            ax.xaxis.set_major_locator(MaxNLocator(7, integer=True))
    return Plot(course.key, course.title, _words(course, middle), figure)


def _abscissa(course: ChartedFigure) -> tuple[Array, str]:
    """Days since the first for one gyro; else the place in time, as a chart of individuals has
    it."""
    first = format_time(float(course.times[0]))[:10]
    if course.own:
        return (course.times - course.times[0]) / DAY_S, f"days since {first}"
    return np.arange(1, len(course.values) + 1), f"gyros in the order of time, from {first}"


def _origin(values: Array) -> float:
    """What is taken off the axis where the values hardly differ."""
    middle, reach = float(np.median(values)), float(np.ptp(values))
    if not 0 < reach < NARROW * abs(middle):
        return 0.0
    digits = int(np.ceil(np.log10(abs(middle) / reach))) + 1
    return float(f"{middle:.{digits}g}")


def _individuals(
    ax: Axes, course: ChartedFigure, at: Array, factor: float, origin: float, unit: str
) -> None:
    y = course.values * factor - origin
    std = np.nan_to_num(np.abs(course.stds * factor))
    if len(y) <= BARS:
        ax.errorbar(at, y, yerr=std, fmt="none", ecolor=MUTED, elinewidth=0.8)
    ax.plot(at, y, color=SERIES[0], lw=0.7, alpha=0.6)
    rules: dict[int, set[str]] = {}
    for one in course.chart.violations if course.chart is not None else ():
        rules.setdefault(one.point, set()).add(one.rule)
    beyond = np.array([BEYOND in rules.get(k, ()) for k in range(len(y))])
    warned = np.array([k in rules for k in range(len(y))]) & ~beyond
    kinds = ((~beyond & ~warned, 0, ""), (warned, 4, "warned of"), (beyond, 1, BEYOND))
    for which, colour, label in kinds:
        draw_dots(ax, at[which], y[which], colour, points=len(y), size=4.5, alpha=1.0)
        if label and which.any():
            ax.plot([], [], "o", color=SERIES[colour], ms=4, label=label)
    for k in np.flatnonzero(beyond)[:NAMED] if not course.own else ():
        left = at[k] < (at[0] + at[-1]) / 2
        ax.annotate(
            clean_text(course.points[k])[:24],
            (at[k], y[k]),
            xytext=(6 if left else -6, 0),
            ha="left" if left else "right",
            va="center",
            textcoords="offset points",
            fontsize=8,
            color=INK,
        )
    if course.chart is not None:
        ax.axhline(course.chart.centre * factor - origin, color=MUTED, lw=0.9)
        for edge in (course.chart.lower, course.chart.upper):
            ax.axhline(edge * factor - origin, color=MUTED, lw=0.9, ls="--")
        ax.plot([], [], color=MUTED, lw=0.9, ls="--", label="mean ± 3 σ between neighbours")
    _draw_limits(ax, course, factor, origin)
    less = f" less {format_number(origin, 12)}" if origin else ""
    set_labels(ax, "", f"{unit}{less}".strip(), "Individuals")


def _draw_limits(ax: Axes, course: ChartedFigure, factor: float, origin: float) -> None:
    """Lines at the limits that are set, a remark where they lie far beyond the data."""
    first, last = ax.get_ylim()
    height = last - first
    for limit, sign in zip(course.bounds, ("≥", "≤"), strict=True):
        if limit is None:
            continue
        words = f"limit {sign} {format_quantity(course.name, limit, None, course.units)}"
        at = limit * factor - origin
        if first - ROOM * height <= at <= last + ROOM * height:
            ax.axhline(at, color=SERIES[3], lw=1.4, ls=(0, (6, 2)), label=words)
            first, last = min(first, at - 0.05 * height), max(last, at + 0.05 * height)
        else:
            ax.plot([], [], color=SERIES[3], lw=0, label=f"{words} is beyond the frame")
    ax.set_ylim(first, last)


def _changes(ax: Axes, course: ChartedFigure, at: Array, factor: float, unit: str) -> None:
    """The change from each to the next."""
    change = np.diff(course.values)
    both = np.hypot(course.stds[1:], course.stds[:-1])
    if course.own and np.all(both > 0):
        y, name = change / both, "change, σ of both"
        for edge in (-3.0, 3.0):
            ax.axhline(edge, color=MUTED, lw=0.9, ls="--")
        note(ax, "dashed: 3 σ")
        far = np.abs(y) > 3
        ax.axhline(0, color=MUTED, lw=0.7)
    else:
        y, name = np.abs(change * factor), f"moving range, {unit}".removesuffix(", ")
        top = np.inf if course.chart is None else course.chart.range_upper * abs(factor)
        far = y > top
        highest = float(y.max())
        if course.chart is not None:
            ax.axhline(top, color=MUTED, lw=0.9, ls="--")
            note(ax, "dashed: upper limit of the range")
            highest = max(highest, top)
        ax.set_ylim(0, 1.1 * highest or 1.0)
    ax.vlines(at[1:], 0, y, color=SERIES[0], lw=0.9, alpha=0.7)
    draw_dots(ax, at[1:][~far], y[~far], 0, points=len(y), size=3.5, alpha=1.0)
    draw_dots(ax, at[1:][far], y[far], 1, points=len(y), size=4.5, alpha=1.0)
    set_labels(ax, "", name, "Against the one before")


def _words(course: ChartedFigure, middle: float) -> str:
    """The numbers of a chart, what good and bad look like."""
    count = len(course.values)
    one, several = (
        ("measurement", "measurements") if course.own else ("gyro", "gyros, one value each")
    )
    what = one if count == 1 else several
    shown = format_quantity(course.name, middle, _std(course), course.units)
    words = f"{count} {what}, middle {shown}."
    if course.chart is None:
        words += (
            f" No control limits: they take {FEWEST_POINTS} points that differ."
            if count < FEWEST_POINTS
            else " No control limits: neighbours do not differ."
        )
    else:
        words += f" {_say_control(course, course.chart)}"
    good = "Good: dots between the dashed lines, scattered without a pattern."
    return f"{words} {good} Bad: a dot beyond them, a slow climb, a step."


def _std(course: ChartedFigure) -> float | None:
    known = course.stds[np.isfinite(course.stds)]
    return float(np.median(known)) if len(known) else None


def _say_control(course: ChartedFigure, found: Chart) -> str:
    beyond = [v.point for v in found.violations if v.rule == BEYOND]
    warned = len({v.point for v in found.violations} - set(beyond))
    said = f"{len(beyond) or 'None'} beyond 3 σ"
    if beyond:
        said += f" ({shorten_list([clean_text(course.points[k]) for k in beyond], NAMED)})"
    return f"{said}, {warned or 'none'} warned of by the other rules."


def draw_capability(figures: Sequence[FigureReport], names: Sequence[str]) -> Plot | None:
    """Cpk of every figure that has limits, with its 95 % interval.

    Parameters
    ----------
    figures
        Over the gyros.
    names
        Of the figures, in words.

    Returns
    -------
    Plot or None
        None without limits.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.reporting.figures.ledger import draw_capability
    >>> draw_capability([Told(capability=None)], ["scale factor"]) is None
    True
    """
    rows = [(n, f.capability) for n, f in zip(names, figures, strict=True) if f.capability]
    if not rows:
        return None
    cpk = np.array([found.cpk for _, found in rows])
    low, high = np.array([found.cpk_interval for _, found in rows]).T
    figure, axes = make_panels(height=0.34 * len(rows) + 0.9)
    ax = axes[0, 0]
    place = np.arange(len(rows))
    poor = cpk < CAPABLE
    for which, colour in ((~poor, 0), (poor, 1)):
        if not which.any():
            continue
        bars = [(cpk - low)[which], (high - cpk)[which]]
        ax.errorbar(
            cpk[which], place[which], xerr=bars, fmt="o", ms=4, color=SERIES[colour], lw=1.2
        )
    ax.axvline(1, color=MUTED, lw=0.9, ls="--")
    ax.axvline(CAPABLE, color=MUTED, lw=0.9)
    ax.set_yticks(place, [clean_text(name)[:40] for name, _ in rows])
    ax.set_ylim(len(rows) - 0.5, -0.5)
    ax.grid(False, axis="y")
    ax.set_xlim(right=max(float(high.max()) * 1.05, 1.5))
    set_labels(ax, "Cpk", title="Capability against the limits")
    note(ax, "bars: 95 %; dashed 1, full 1.33")
    worst = int(np.argmin(cpk))
    words = (
        f"Cpk, the distance from the mean to the nearer limit over 3 spreads; the lowest is"
        f" {clean_text(rows[worst][0])} with {format_number(cpk[worst], 3)}"
        f" ({format_number(low[worst], 3)} to {format_number(high[worst], 3)} at 95 %), of"
        f" {rows[worst][1].gyros} gyros. Good: bars right of 1.33. Bad: bars that reach below 1."
    )
    return Plot("capability", "Capability", words, figure)
