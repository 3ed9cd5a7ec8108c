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
    """The style in which all figures are made and saved.

    Returns
    -------
    context manager
        Outside of it matplotlib is as it was.

    Examples
    --------
    >>> import matplotlib
    >>> from hrg_cli.reporting.figures.drawing import use_style
    >>> before = matplotlib.rcParams["font.size"]
    >>> with use_style():
    ...     pass
    >>> matplotlib.rcParams["font.size"] == before
    True
    """
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
    """A figure of rows × columns axes.

    Parameters
    ----------
    rows, columns
        How many.
    height
        Of a row [inch].
    width
        Of the figure [inch].
    sharex, sharey
        As matplotlib takes it.

    Returns
    -------
    tuple
        The figure, and its axes (rows, columns), always of two dimensions.

    Examples
    --------
    >>> from hrg_cli.reporting.figures.drawing import make_panels
    >>> figure, axes = make_panels(2, 1, height=2.0)
    >>> axes.shape, figure.get_size_inches().tolist()
    ((2, 1), [7.2, 4.25])
    """
    figure = Figure(figsize=(width, height * rows + 0.25), layout="constrained")
    axes = figure.subplots(rows, columns, squeeze=False, sharex=sharex, sharey=sharey)
    return figure, axes


def choose_time_unit(duration_s: float) -> tuple[float, str]:
    """The unit in which a person reads a duration.

    Parameters
    ----------
    duration_s
        [s]

    Returns
    -------
    tuple
        Factor from seconds, and the unit: four of it at least.

    Examples
    --------
    >>> from hrg_cli.reporting.figures.drawing import choose_time_unit
    >>> choose_time_unit(100.0), choose_time_unit(0.05), choose_time_unit(8 * 3600.0)[1]
    ((1.0, 's'), (1000.0, 'ms'), 'h')
    """
    for factor, unit in ((86400.0, "d"), (3600.0, "h"), (60.0, "min")):
        if duration_s >= 4 * factor:
            return 1 / factor, unit
    return (1.0, "s") if duration_s >= 0.1 else (1e3, "ms")


def thin_envelope(x: Array, y: Array, points: int = POINTS) -> tuple[Array, Array]:
    """A line of fewer points that looks the same: the lowest and highest of each bin, in their
    order.

    Parameters
    ----------
    x, y
        The line (n,); NaN breaks it.
    points
        How many are left, about.

    Returns
    -------
    tuple of ndarray
        x and y of what is left; of a line that is short enough, all.

    Examples
    --------
    A single spike among a thousand points is kept:

    >>> import numpy as np
    >>> from hrg_cli.reporting.figures.drawing import thin_envelope
    >>> y = np.zeros(1000)
    >>> y[123] = 1.0
    >>> x, thin = thin_envelope(np.arange(1000.0), y, points=20)
    >>> len(thin), float(thin.max()), float(x[thin.argmax()])
    (20, 1.0, 123.0)
    """
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
    """Draw a thinned line in a colour of the palette.

    Parameters
    ----------
    ax
        Where.
    x, y
        The line (n,).
    colour
        Its place in the palette.
    label
        For the legend; None: none.
    points
        How many are drawn, about.
    more
        As matplotlib's `plot` takes it.

    Examples
    --------
    What moves by no more than its rounding stays still, in axes of a tenth of its size:

    >>> import numpy as np
    >>> from hrg_cli.reporting.figures.drawing import draw_line, make_panels
    >>> _, axes = make_panels()
    >>> draw_line(axes[0, 0], np.arange(9.0), 5e3 + 1e-12 * np.arange(9.0))
    >>> [round(float(end)) for end in axes[0, 0].get_ylim()]
    [4750, 5250]
    """
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
    """Draw dots as one path, a tenth of the bytes of a scatter.

    Parameters
    ----------
    ax
        Where.
    x, y
        The dots (n,); those that are not finite are left out.
    colour
        Their place in the palette.
    points
        How many are drawn at most, evenly picked.
    size
        Of a dot [pt].
    alpha
        How much they cover.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.reporting.figures.drawing import draw_dots, make_panels
    >>> _, axes = make_panels()
    >>> draw_dots(axes[0, 0], np.arange(1000.0), np.zeros(1000), points=100)
    >>> len(axes[0, 0].patches), len(axes[0, 0].patches[0].get_path().vertices) // 2
    (1, 100)
    """
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
    """Mean of y and its standard error in equal bins of x.

    Parameters
    ----------
    x, y
        (n,).
    bins
        Over the range of x.

    Returns
    -------
    tuple of ndarray
        Centre, mean and standard error of the bins of three values or more; NaN where more than two
        bins are empty, so that a line breaks off there.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.reporting.figures.drawing import average_bins
    >>> x = np.repeat([0.0, 1.0], 4)
    >>> centre, mean, error = average_bins(x, 2 * x, bins=2)
    >>> centre.tolist(), mean.tolist(), error.tolist()
    ([0.0, 1.0], [0.0, 2.0], [0.0, 0.0])
    """
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
    """Draw dots behind, and the mean of bins with its standard error in front.

    Parameters
    ----------
    ax
        Where.
    x, y
        The dots (n,).
    colour
        Their place in the palette.
    label
        Of the mean; None: none.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.reporting.figures.drawing import draw_scatter_with_mean, make_panels
    >>> _, axes = make_panels()
    >>> draw_scatter_with_mean(axes[0, 0], np.arange(1000.0), np.zeros(1000), label="mean")
    >>> axes[0, 0].get_legend_handles_labels()[1]
    ['mean']
    """
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
    """Write a small remark above the upper right corner of axes.

    Parameters
    ----------
    ax
        Where.
    text
        The remark.

    Examples
    --------
    >>> from hrg_cli.reporting.figures.drawing import make_panels, note
    >>> _, axes = make_panels()
    >>> note(axes[0, 0], "4 runs")
    >>> axes[0, 0].get_title(loc="right")
    '4 runs'
    """
    ax.set_title(text, loc="right", fontsize=8.0, fontweight="normal", color=MUTED)


def draw_legend(ax: Axes, *, above: bool = False, **more: Any) -> None:
    """Draw a legend where there is something to tell apart.

    Parameters
    ----------
    ax
        Where.
    above
        Over the frame, right of the title.
    more
        As matplotlib's `legend` takes it.

    Examples
    --------
    >>> from hrg_cli.reporting.figures.drawing import draw_legend, make_panels
    >>> _, axes = make_panels()
    >>> _ = axes[0, 0].plot([0, 1], label="one")
    >>> draw_legend(axes[0, 0])
    >>> axes[0, 0].get_legend() is None
    True
    """
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
    """A figure as one <svg> element, for a page.

    Parameters
    ----------
    plot
        The figure.
    prefix
        With which its ids begin, so that those of two figures differ.

    Returns
    -------
    str
        Without a date, with colours as CSS variables; its role is img, its words its name.

    Examples
    --------
    >>> from hrg_cli.reporting.figures.drawing import Plot, make_panels, use_style, write_svg
    >>> with use_style():
    ...     figure, axes = make_panels()
    ...     text = write_svg(Plot("k", "Drift", "It is small.", figure), "f0")
    >>> text[:14], 'id="f0-' in text, "<metadata>" in text
    ('<svg role="img', True, False)
    """
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
    """Write a figure as an SVG file of its own, on white and without a date.

    Parameters
    ----------
    plot
        The figure.
    path
        The file.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from hrg_cli.reporting.figures.drawing import Plot, make_panels, write_standalone_svg
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "drift.svg"
    ...     write_standalone_svg(Plot("k", "Drift", "It is small.", make_panels()[0]), path)
    ...     "<svg" in path.read_text()
    True
    """
    with use_style():
        _settle(plot.figure)
        plot.figure.savefig(
            path,
            format="svg",
            facecolor="white",
            metadata={"Date": None, "Creator": None, "Title": plot.title},
        )


def write_png(plot: Plot, path: Path) -> None:
    r"""Write a figure as PNG, on white and without a date.

    Parameters
    ----------
    plot
        The figure.
    path
        The file.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from hrg_cli.reporting.figures.drawing import Plot, make_panels, write_png
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "drift.png"
    ...     write_png(Plot("k", "Drift", "It is small.", make_panels()[0]), path)
    ...     path.read_bytes()[:4]
    b'\x89PNG'
    """
    with use_style():
        _settle(plot.figure)
        plot.figure.savefig(
            path, format="png", dpi=150, facecolor="white", metadata={"Software": None}
        )


def set_log_axis(axis: Axis) -> None:
    """Name the decades of a logarithmic axis as 0.01 … 1000, or as raised powers, without math
    text.

    Parameters
    ----------
    axis
        Of axes.

    Examples
    --------
    >>> from hrg_cli.reporting.figures.drawing import make_panels, set_log_axis
    >>> _, axes = make_panels()
    >>> set_log_axis(axes[0, 0].yaxis)
    >>> name = axes[0, 0].yaxis.get_major_formatter()
    >>> name(0.01), name(1e6), name(3.0)
    ('0.01', '10⁶', '')
    """

    def name(value: float, _: int | None = None) -> str:
        power = np.log10(value) if value > 0 else np.nan
        if abs(power - round(power)) > 1e-6:
            return ""
        return f"{value:g}" if -3 < power < 5 else format_power_of_ten(round(power))

    axis.set_major_formatter(FuncFormatter(name))
    axis.set_minor_formatter(NullFormatter())


def say_spread(values: Array) -> str:
    """Lowest to highest of values, for words.

    Parameters
    ----------
    values
        (n,); those that are not finite are left out.

    Returns
    -------
    str
        For a person.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.reporting.figures.drawing import say_spread
    >>> say_spread(np.array([2.0, np.nan, -1.0]))
    '−1 to 2'
    """
    finite = np.asarray(values)[np.isfinite(values)]
    return (
        f"{format_number(finite.min())} to {format_number(finite.max())}"
        if len(finite)
        else "no finite values"
    )


def set_labels(ax: Axes, x: str = "", y: str = "", title: str = "") -> None:
    """Set labels and title of axes.

    Parameters
    ----------
    ax
        Where.
    x, y
        Of the axes, with units.
    title
        Above; empty: none.

    Examples
    --------
    >>> from hrg_cli.reporting.figures.drawing import make_panels, set_labels
    >>> _, axes = make_panels()
    >>> set_labels(axes[0, 0], "time, s", "drift D, °/h")
    >>> axes[0, 0].get_ylabel()
    'drift D, °/h'
    """
    ax.set_xlabel(x)
    ax.set_ylabel(y)
    if title:
        ax.set_title(title)


def shorten_list(names: Sequence[str], limit: int) -> str:
    """A list of names, cut for words.

    Parameters
    ----------
    names
        All of them.
    limit
        How many are named.

    Returns
    -------
    str
        For a person.

    Examples
    --------
    >>> from hrg_cli.reporting.figures.drawing import shorten_list
    >>> shorten_list(["a", "b", "c"], 2)
    'a, b and 1 more'
    """
    return ", ".join(names[:limit]) + (
        f" and {len(names) - limit} more" if len(names) > limit else ""
    )
