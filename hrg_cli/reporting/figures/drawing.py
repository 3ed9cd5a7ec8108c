"""What every figure shares: one palette for both modes, panels with units, decimation, and SVG that
follows the page's colours.

Figures are drawn with the colours of the light page. In SVG each of these becomes a CSS variable,
so that one drawing serves the light and the dark page; the text stays text. Identical data give
identical bytes.
"""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch
from matplotlib.path import Path as Outline
from matplotlib.ticker import FuncFormatter, NullFormatter

from ...records import Array
from ..text import format_number, format_power_of_ten
from .good_and_bad import explain_reading

INK, MUTED, GRID, PAPER = "#1a2028", "#5b6673", "#d9dee4", "#fdfefe"
SERIES = ("#0067a5", "#c8500a", "#00806a", "#a3418f", "#8a6d00", "#47617d")
"""Colours that stay apart for colour-blind readers; in order of use."""

VARIABLES = {INK: "--ink", MUTED: "--muted", GRID: "--grid", PAPER: "--paper"} | {
    colour: f"--series-{i + 1}" for i, colour in enumerate(SERIES)
}
"""Colour of the light page -> CSS variable of the page."""

POINTS = 1200
"""Points of a line that a figure keeps."""

STYLE: Any = {
    "font.family": ["DejaVu Sans"],
    "font.size": 9.0,
    "axes.titlesize": 9.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "axes.labelsize": 9.0,
    "axes.edgecolor": MUTED,
    "axes.labelcolor": INK,
    "axes.titlecolor": INK,
    "axes.linewidth": 0.7,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "axes.facecolor": "none",
    "axes.formatter.use_mathtext": False,
    "axes.formatter.limits": (-4, 5),
    "axes.unicode_minus": True,
    "grid.color": GRID,
    "grid.linewidth": 0.6,
    "xtick.color": MUTED,
    "ytick.color": MUTED,
    "xtick.labelcolor": INK,
    "ytick.labelcolor": INK,
    "text.color": INK,
    "lines.linewidth": 1.1,
    "lines.solid_joinstyle": "round",
    "legend.frameon": False,
    "legend.fontsize": 8.5,
    "figure.facecolor": "none",
    "savefig.facecolor": "none",
    "svg.fonttype": "none",
    "svg.hashsalt": "hrg",
    "path.simplify": True,
    "text.parse_math": False,
    "figure.constrained_layout.h_pad": 0.06,
    "figure.constrained_layout.w_pad": 0.07,
}


_ROUND = re.compile(r"(\d\.\d\d)\d+")
"""Coordinates of paths keep hundredths of a point."""


ROUNDING = 1e-9
"""Part of a value's size below which its course is that of the last digits."""


@dataclass(frozen=True)
class Plot:
    """One figure: `key` names its file, `title` its caption, `words` say the numbers to whoever
    cannot see it."""

    key: str
    title: str
    words: str
    figure: Figure

    @property
    def caption(self) -> str:
        """The words, and what good and bad look like."""
        return f"{self.words} {explain_reading(self.key)}".strip()


def use_style() -> Any:
    """Context in which figures are made and saved."""
    return mpl.rc_context(STYLE)


def make_panels(
    rows: int = 1,
    columns: int = 1,
    *,
    height: float = 2.6,
    width: float = 7.2,
    sharex: bool | Literal["row", "col"] = False,
    sharey: bool | Literal["row", "col"] = False,
) -> tuple[Figure, Array]:
    """A figure of rows × columns axes (always a 2-D array); `height` is in inches a row."""
    figure = Figure(figsize=(width, height * rows + 0.25), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, sharex=sharex, sharey=sharey)
    return figure, axes


def choose_time_unit(duration_s: float) -> tuple[float, str]:
    """Factor and unit a person reads a duration in."""
    for factor, unit in ((86400.0, "d"), (3600.0, "h"), (60.0, "min")):
        if duration_s >= 4 * factor:
            return 1 / factor, unit
    return (1.0, "s") if duration_s >= 0.1 else (1e3, "ms")


def thin_envelope(x: Array, y: Array, points: int = POINTS) -> tuple[Array, Array]:
    """At most about `points` of a line that look the same: the lowest and highest of each bin, in
    their order; NaN breaks it."""
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    if len(y) <= points:
        return x, y
    bins = max(1, points // 2)
    size = -(-len(y) // bins)
    padding = size * -(-len(y) // size) - len(y)
    block = np.pad(y, (0, padding), constant_values=np.nan).reshape(-1, size)
    low = np.where(np.isfinite(block), block, np.inf).argmin(1)
    high = np.where(np.isfinite(block), block, -np.inf).argmax(1)
    start = np.arange(len(block)) * size
    pick = np.minimum(
        np.stack([start + np.minimum(low, high), start + np.maximum(low, high)], 1).ravel(),
        len(y) - 1,
    )
    return x[pick], y[pick]


def draw_line(
    ax: Axes,
    x: Array,
    y: Array,
    colour: int = 0,
    label: str | None = None,
    points: int = POINTS,
    **more: Any,
) -> None:
    """A decimated line in a colour of the palette; what moves by no more than its rounding stays
    still."""
    ax.plot(*thin_envelope(x, y, points), color=SERIES[colour % len(SERIES)], label=label, **more)
    known = y[np.isfinite(y)]
    size = float(np.abs(known).max(initial=0.0))
    if size and 0 < float(np.ptp(known)) < ROUNDING * size:
        middle = float(np.median(known))
        ax.set_ylim(middle - 0.05 * size, middle + 0.05 * size)


def _dash_length(ax: Axes, x: Array) -> float:
    """Length of the dash that is a dot: too short to be seen beside these values or, for one value,
    beside what the axes hold."""
    held = ax.dataLim.width
    span = float(np.ptp(x)) or (held if np.isfinite(held) and held > 0 else 0.0)
    return 1e-3 * span or 4 * float(np.spacing(np.abs(x).max()))


def draw_dots(
    ax: Axes,
    x: Array,
    y: Array,
    colour: int = 0,
    points: int = 400,
    size: float = 2.0,
    alpha: float = 0.45,
) -> None:
    """At most `points` dots, evenly picked, as one path (a tenth of the bytes of a scatter)."""
    keep = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    if not len(keep):
        return
    if len(keep) > points:
        keep = keep[np.linspace(0, len(keep) - 1, points).round().astype(int)]
    at = np.stack([np.asarray(x, dtype=float)[keep], np.asarray(y, dtype=float)[keep]], 1)
    nudge = np.array([_dash_length(ax, at[:, 0]), 0.0])
    outline = Outline(
        np.stack([at, at + nudge], 1).reshape(-1, 2),
        np.tile([Outline.MOVETO, Outline.LINETO], len(at)),
    )
    outline.should_simplify = False
    ax.add_patch(
        PathPatch(
            outline,
            fill=False,
            edgecolor=SERIES[colour % len(SERIES)],
            lw=size,
            alpha=alpha,
            capstyle="round",
        )
    )
    ax.autoscale_view()


BRIDGED = 2
"""Empty bins across which a line of means is drawn."""


def average_bins(x: Array, y: Array, bins: int = 36) -> tuple[Array, Array, Array]:
    """Mean of y and its standard error in equal bins of x; only bins with three values or more. Where
    more than `BRIDGED` bins are empty a NaN stands, so that a line breaks off there."""
    keep = np.isfinite(x) & np.isfinite(y)
    x, y = np.asarray(x)[keep], np.asarray(y)[keep]
    if len(x) < 3 or np.ptp(x) <= 0:
        return np.empty(0), np.empty(0), np.empty(0)
    index = np.minimum(((x - x.min()) / np.ptp(x) * bins).astype(int), bins - 1)
    count = np.bincount(index, minlength=bins)
    used = count >= 3
    size = count[used]
    centre = np.bincount(index, x, bins)[used] / size
    mean = np.bincount(index, y, bins)[used] / size
    spread = np.bincount(index, y**2, bins)[used] / size - mean**2
    error = np.sqrt(np.maximum(spread, 0) / size)
    holes = np.flatnonzero(np.diff(np.flatnonzero(used)) > BRIDGED + 1) + 1
    broken_x, broken_mean, broken_error = (
        np.insert(values, holes, np.nan) for values in (centre, mean, error)
    )
    return broken_x, broken_mean, broken_error


def draw_scatter_with_mean(
    ax: Axes, x: Array, y: Array, colour: int = 0, label: str | None = None
) -> None:
    """Dots behind, the mean of bins with its standard error in front; the range is that of 99 % of
    the dots."""
    draw_dots(ax, x, y, colour, alpha=0.3, size=1.6, points=300)
    centre, mean, error = average_bins(x, y)
    ax.errorbar(
        centre,
        mean,
        error,
        color=SERIES[colour % len(SERIES)],
        fmt="o-",
        ms=2.6,
        lw=1.0,
        elinewidth=0.9,
        label=label,
    )


def note(ax: Axes, text: str) -> None:
    """A small remark in the upper right corner of an axes, above the frame."""
    ax.set_title(text, loc="right", fontsize=8.0, fontweight="normal", color=MUTED)


def draw_legend(ax: Axes, *, above: bool = False, **more: Any) -> None:
    """A legend where there is something to tell apart; `above` puts it over the frame, right of the
    title."""
    options: dict[str, Any] = {"loc": "best", "borderaxespad": 0.3, "handlelength": 1.6}
    if above:
        options |= {
            "loc": "lower right",
            "bbox_to_anchor": (1.0, 1.0),
            "ncols": 4,
            "borderaxespad": 0.1,
        }
    if len(ax.get_legend_handles_labels()[1]) > 1:
        ax.legend(**(options | more))


def _settle(figure: Figure) -> None:
    """Lay the panels out once, not again at every save."""
    engine = figure.get_layout_engine()
    if engine is not None:
        engine.execute(figure)
        figure.set_layout_engine(None)


def write_svg(plot: Plot, prefix: str) -> str:
    """The figure as one <svg> element: no date, ids that start with `prefix`, colours as CSS
    variables, role img with its words."""
    buffer = io.StringIO()
    with use_style():
        _settle(plot.figure)
        plot.figure.savefig(
            buffer,
            format="svg",
            metadata={"Date": None, "Creator": None, "Format": None, "Type": None},
            dpi=130,
        )
    text = buffer.getvalue()
    text = text[text.index("<svg") :]
    text = re.sub(r"\s*<metadata>.*?</metadata>", "", text, flags=re.S)
    text = re.sub(r"<!--.*?-->\n?\s*", "", text, flags=re.S)
    text = re.sub(r"\s*<defs>\s*<style.*?</style>\s*</defs>", "", text, flags=re.S)
    text = re.sub(r'<g id="[^"]*"', "<g", text)
    text = re.sub(r'\bid="', f'id="{prefix}-', text)
    text = text.replace("url(#", f"url(#{prefix}-").replace(
        'xlink:href="#', f'xlink:href="#{prefix}-'
    )
    text = re.sub("|".join(VARIABLES), lambda match: f"var({VARIABLES[match[0]]})", text)
    text = text.replace("'DejaVu Sans'", "var(--figure-font)").replace(
        "DejaVu Sans", "var(--figure-font)"
    )
    text = re.sub(r'(?<= d=")[^"]*', lambda match: _ROUND.sub(r"\1", match[0]), text)
    text = re.sub(r"\n\s*", "\n", text)
    return text.replace(
        "<svg ", f'<svg role="img" aria-labelledby="{prefix}-title" focusable="false" ', 1
    )


def write_standalone_svg(plot: Plot, path: Path) -> None:
    """The figure as an SVG file of its own on white, without a date."""
    with use_style():
        _settle(plot.figure)
        plot.figure.savefig(
            path,
            format="svg",
            facecolor="white",
            metadata={"Date": None, "Creator": None, "Title": plot.title},
        )


def write_png(plot: Plot, path: Path) -> None:
    """The figure as PNG on white, without a date."""
    with use_style():
        _settle(plot.figure)
        plot.figure.savefig(
            path, format="png", dpi=150, facecolor="white", metadata={"Software": None}
        )


def set_log_axis(axis: Axis) -> None:
    """Decades named as 0.01 … 1000 or as raised powers, without math text."""

    def name(value: float, _: int | None = None) -> str:
        power = np.log10(value) if value > 0 else np.nan
        if abs(power - round(power)) > 1e-6:
            return ""
        return f"{value:g}" if -3 < power < 5 else format_power_of_ten(round(power))

    axis.set_major_formatter(FuncFormatter(name))
    axis.set_minor_formatter(NullFormatter())


def say_spread(values: Array) -> str:
    """Lowest to highest, for words."""
    finite = np.asarray(values)[np.isfinite(values)]
    return (
        f"{format_number(finite.min())} to {format_number(finite.max())}"
        if len(finite)
        else "no finite values"
    )


def set_labels(ax: Axes, x: str = "", y: str = "", title: str = "") -> None:
    """Labels and title of an axes."""
    ax.set_xlabel(x)
    ax.set_ylabel(y)
    if title:
        ax.set_title(title)


def shorten_list(names: Sequence[str], limit: int) -> str:
    """A list cut for words."""
    return ", ".join(names[:limit]) + (
        f" and {len(names) - limit} more" if len(names) > limit else ""
    )
