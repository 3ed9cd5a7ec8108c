"""The page of a lot: who passed, who stands out, how every parameter is distributed; one HTML file
that needs no network.

The same rows give the same bytes. Links lead to the gyros' folders beside the page.
"""

from __future__ import annotations

import base64
import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import NormalDist, median
from typing import Any
from urllib.parse import quote

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from .. import __version__
from .figures.drawing import (
    INK,
    MUTED,
    SERIES,
    Plot,
    dots,
    labels,
    legend,
    note,
    panels,
    style,
    svg,
)
from .text import number, plain

FOLDER = Path(__file__).parent
NAMED = 12
"""Outliers that a figure names one by one."""
NARROW = 1e-3
"""Spread over median below which a figure shows the difference to the median."""
UNITS = (("_rad_s", "rad/s"), ("_1_s", "1/s"), ("_rad", "rad"), ("_hz", "Hz"), ("_ppm", "ppm"))
BARS = 200
"""Gyros up to which standard deviations are drawn."""
Row = Mapping[str, Any]


@dataclass(frozen=True)
class Cell:
    """A parameter of a gyro in the table: value, standard deviation, and the distance where it
    stands out."""

    value: str
    std: str
    far: str


def lot_page(report: Mapping[str, Any], folders: Mapping[str, str]) -> str:
    """The page of a lot's report (`hrg_cli.lots.batch.run_lot`); folders: the folder of each gyro,
    relative to the page."""
    rows: Sequence[Row] = report["rows"]
    names = parameters(rows)
    with style():
        pictures = [
            (plot, Markup(svg(plot, plot.key)))
            for plot in (distribution(rows, name) for name in names)
            if plot is not None
        ]
    script = (FOLDER / "page.js").read_text(encoding="utf-8")
    environment = Environment(
        loader=FileSystemLoader(FOLDER),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("lot.html").render(
        report=report,
        names=names,
        lines=[
            (row, _link(folders.get(row["gyro_id"])), [_cell(row, name) for name in names])
            for row in rows
        ],
        failed=[row for row in rows if not row["passed"]],
        outliers=[
            (row["gyro_id"], name, row[name], row[f"{name}_z"])
            for row in rows
            for name in row["outliers"].split()
        ],
        pictures=pictures,
        version=__version__,
        css=Markup((FOLDER / "page.css").read_text(encoding="utf-8")),
        script=Markup(script),
        script_hash=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
        plain=plain,
        number=_number,
    )


def parameters(rows: Sequence[Row]) -> list[str]:
    """Names of the figures that gyros were compared by, in the order of the table."""
    names = dict.fromkeys(key for row in rows for key in row if f"{key}_z" in row)
    return [name for name in names if any(row[name] is not None for row in rows)]


def distribution(rows: Sequence[Row], name: str) -> Plot | None:
    """The share of gyros at or below each value, with standard deviations, against a normal
    distribution of the same median and MAD."""
    known = sorted((row for row in rows if row.get(name) is not None), key=lambda row: row[name])
    if not known:
        return None
    value = np.array([row[name] for row in known], dtype=float)
    std = np.array([row[f"{name}_std"] or math.nan for row in known], dtype=float)
    far = np.array([name in row["outliers"].split() for row in known])
    share = 100 * (np.arange(len(value)) + 0.5) / len(value)
    middle = median(value)
    spread = 1.4826 * median(np.abs(value - middle))
    title, unit = _worded(name)
    digits = _digits(middle, spread)
    origin = float(f"{middle:.{digits}g}") if 0 < spread < NARROW * abs(middle) else 0.0
    figure, axes = panels(height=2.4)
    ax = axes[0, 0]
    if spread > 0:
        at = np.linspace(-3.5, 3.5, 60)
        expected = [100 * NormalDist().cdf(z) for z in at]
        ax.plot(
            middle - origin + spread * at,
            expected,
            color=MUTED,
            lw=0.9,
            ls="--",
            label="normal, same median and MAD",
        )
    off = value - origin
    if len(value) <= BARS:
        ax.errorbar(
            off,
            share,
            xerr=np.where(np.isfinite(std), std, 0.0),
            fmt="none",
            ecolor=MUTED,
            elinewidth=0.7,
        )
    dots(ax, off[~far], share[~far], 0, points=len(value), size=4.0, alpha=0.9)
    dots(ax, off[far], share[far], 1, points=len(value), size=6.0, alpha=1.0)
    ax.plot([], [], "o", color=SERIES[0], ms=3, label="gyro")
    if far.any():
        ax.plot([], [], "o", color=SERIES[1], ms=4, label="outlier")
    for row, x, y in [(r, x, y) for r, x, y, out in zip(known, off, share, far) if out][:NAMED]:
        left = x + origin < middle
        ax.annotate(
            plain(row["gyro_id"])[:24],
            (x, y),
            xytext=(4, 4) if left else (-4, 4),
            ha="left" if left else "right",
            textcoords="offset points",
            fontsize=8,
            color=INK,
        )
    ax.xaxis.set_major_formatter(lambda x, _: number(x, 6))
    from_where = f" less {number(origin, digits)}" if origin else ""
    labels(ax, f"{title}{from_where}, {unit or '1'}", "gyros at or below, %", title)
    said = f" {unit}" if unit else ""
    note(ax, f"median {number(middle, digits)}{said}, 1.4826·MAD {number(spread, 2)}{said}")
    legend(ax, loc="center right" if far.any() and value[far].max() < middle else "best")
    named = ", ".join(plain(row["gyro_id"]) for row, out in zip(known, far) if out)
    words = (
        f"{len(value)} gyros from {number(value[0], digits)} to {number(value[-1], digits)}{said},"
        f" median {number(middle, digits)}, robust spread {number(spread, 2)}; "
        + (
            f"{int(far.sum())} outlier{'s' if far.sum() > 1 else ''}: {named}."
            if far.any()
            else "no outlier."
        )
    )
    return Plot(name.replace("_", "-"), f"Distribution of {title}", words, figure)


def _worded(name: str) -> tuple[str, str]:
    """A figure's name in words, and its unit."""
    name, _, when = (
        name.partition("_rms_rad_s_") if "_rms_rad_s_" in name else name.partition("_rms_ppm_")
    )
    if when:
        return f"{name.replace('_', ' ')} rms {when.replace('_', ' ')}", (
            "ppm" if name.startswith("scale") else "rad/s"
        )
    suffix, unit = next(
        ((suffix, unit) for suffix, unit in UNITS if name.endswith(suffix)), ("", "")
    )
    return name.removesuffix(suffix).replace("_", " "), unit


def _cell(row: Row, name: str) -> Cell:
    std, far = row[f"{name}_std"], name in row["outliers"].split()
    value = _number(row[name], _digits(row[name], std))
    return Cell(value, "" if std is None else _number(std, 2), _z(row[f"{name}_z"]) if far else "")


def _digits(value: float | None, std: float | None) -> int:
    """Digits of a value down to the second one of its standard deviation."""
    if not value or not std or not math.isfinite(std):
        return 6
    return min(15, max(2, math.floor(math.log10(abs(value))) - math.floor(math.log10(std)) + 2))


def _z(value: float) -> str:
    return f"{value:+.1f}".replace("-", "−")


def _number(value: float | None, digits: int = 6) -> str:
    return "–" if value is None else number(float(value), digits)


def _link(folder: str | None) -> str | None:
    """A relative link that stays beside the page."""
    return None if folder is None else f"./{quote(folder)}/"
