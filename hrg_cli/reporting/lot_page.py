"""The page of a lot: what it says as a whole, the worst gyros and why, every gyro in a table that
sorts and filters, causes, distributions; one HTML file that needs no network.

The same rows give the same bytes. Links lead to the gyros' pages beside it.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any
from urllib.parse import quote

from markupsafe import Markup

from ..limit_values import spell_whole_names
from ..limits import read_bounds
from ..lots.groups import GROUPED_BY
from .figures.drawing import Plot, use_style, write_svg
from .figures.lot import (
    Limits,
    choose_figure_unit,
    plot_caterpillar,
    plot_distribution,
    plot_pareto,
    say_in_words,
)
from .lot_words import WORST, make_sentence
from .page import SHADES
from .quantities import choose_unit, round_with_std
from .templates import render_page
from .text import clean_text, format_number, format_signed

LONGEST = 220
"""Characters of a reason before it is folded."""
Row = Mapping[str, Any]


@dataclass(frozen=True)
class Cell:
    """A parameter of a gyro in the table: value with σ as people read it, the number it sorts by,
    and the distance where it stands out."""

    text: str
    value: str
    far: str


@dataclass(frozen=True)
class GyroLine:
    """A gyro in the table."""

    row: Row
    link: str | None
    shade: str
    result: str
    health: str
    cause: str
    size: str
    share: str
    rest: str
    """The reason less the cause, which has columns of its own."""
    groups: list[str]
    cells: list[Cell]


def make_lot_page(
    report: Mapping[str, Any],
    pages: Mapping[str, str],
    limits: Mapping[str, Any] | None = None,
) -> str:
    """The page of a lot.

    Parameters
    ----------
    report
        As `hrg_cli.lots.batch.run_lot` gives it.
    pages
        Gyro -> its page, relative to this one.
    limits
        Kind of file -> limits of its figures; None: there are none.

    Returns
    -------
    str
        HTML that needs no other file.

    Examples
    --------
    >>> from hrg_cli.reporting.lot_page import make_lot_page
    >>> counts = {"passed": 0, "recordings": 0, "recordings_failed": 0, "outlier_rate": None}
    >>> report = counts | {"rows": [], "outliers": [], "lot_id": "L-7", "status": "valid"}
    >>> "Lot L-7: 0 of 0 gyros passed" in make_lot_page(report, {})
    True
    """
    rows: Sequence[Row] = report["rows"]
    names = list_parameters(rows)
    keys = [key for key in (*GROUPED_BY, "day") if any(row.get(key) for row in rows)]
    lines = [_line(row, pages.get(row["gyro_id"]), names, keys) for row in rows]
    lines.sort(key=lambda line: line.row["rank"])
    causes = _causes(rows)
    gyros = sum(bool(row["gyro_id"]) for row in rows)
    common = report.get("lot_causes", [])
    with use_style():
        drawn = [plot_distribution(rows, name, find_limits(name, limits or {})) for name in names]
        pictures = [(plot, _svg(plot)) for plot in drawn if plot is not None]
        bars = plot_pareto([(name, count) for name, count, _ in causes], gyros)
        whole = [plot_caterpillar(one, f"common-{k}") for k, one in enumerate(common, start=1)]
        shown = [
            (one, plot, None if plot is None else _svg(plot)) for one, plot in zip(common, whole)
        ]
        pareto_picture = None if bars is None else (bars, _svg(bars))
    return render_page(
        "lot.html",
        ("page.js", "lot.js"),
        report=report,
        gyros=gyros,
        names=[
            (name, say_in_words(name), choose_figure_unit(name, _middle(rows, name))[1])
            for name in names
        ],
        keys=keys,
        lines=lines,
        worst=[line for line in lines if line.row["reason"]][:WORST],
        causes=causes,
        common=shown,
        pareto=pareto_picture,
        pictures=pictures,
        sentence=make_sentence(report),
        unreadable=report.get("unreadable", []),
        populations=_populations(report.get("populations", {})),
        tests=report.get("lot_tests"),
        shade=defaultdict(str, SHADES),
        zip=zip,
        number=lambda value, digits=6: (
            "–" if value is None else format_number(float(value), digits)
        ),
        cut=_cut,
    )


def list_parameters(rows: Sequence[Row]) -> list[str]:
    """Names of the figures that gyros were compared by.

    Parameters
    ----------
    rows
        Of a lot's report.

    Returns
    -------
    list of str
        In the order of the table.

    Examples
    --------
    >>> from hrg_cli.reporting.lot_page import list_parameters
    >>> list_parameters([{"gyro_id": "SN-1", "frequency_hz": 5e3, "frequency_hz_z": 0.1}])
    ['frequency_hz']
    """
    names = dict.fromkeys(key for row in rows for key in row if f"{key}_z" in row)
    return [name for name in names if any(row[name] is not None for row in rows)]


def find_limits(name: str, limits: Mapping[str, Any]) -> Limits:
    """Minimum and maximum of a column of a lot's table.

    Parameters
    ----------
    name
        Of the column.
    limits
        Kind of file -> limits of its figures.

    Returns
    -------
    tuple
        In the figure's own unit; None where none is set.

    Examples
    --------
    >>> from hrg_cli.reporting.lot_page import find_limits
    >>> find_limits("scale_factor", {"resonator": {"scale_factor": {"minimum": 0.5}}})
    (0.5, None)
    """
    spelt = {("resonator", name), ("diagnosis", f"values.{name}")}
    for stem in ("drift_rms_rad_s", "scale_factor_rms_ppm"):
        if name.startswith(f"{stem}_"):
            spelt.add(("calibration", f"{stem}.{name.removeprefix(f'{stem}_')}"))
    if name == "calibrated_scale_factor":
        spelt.add(("calibration", "scale_factor"))
    for kind, key in sorted(spelt):
        table = limits.get(kind)
        named = spell_whole_names(table) if isinstance(table, Mapping) else {}
        if key in named:
            return read_bounds(key, named[key])
    return None, None


def _svg(plot: Plot) -> Markup:
    return Markup(write_svg(plot, plot.key))


def _line(row: Row, page: str | None, names: Sequence[str], keys: Sequence[str]) -> GyroLine:
    share = "" if row["cause_share"] is None else f"{100 * row['cause_share']:.0f} %"
    return GyroLine(
        row,
        None if page is None else f"./{quote(page)}",
        "valid" if row["passed"] else "refused",
        "passed" if row["passed"] else "not passed",
        row["health"] or ("no result" if row["status"] == "failed" else row["status"]),
        clean_text(row["cause"]).replace("_", " "),
        clean_text(row["cause_size"]),
        share,
        row["reason"].partition("; ")[2] if row["cause"] else row["reason"],
        [clean_text(row.get(key) or "") for key in keys],
        [_cell(row, name) for name in names],
    )


def _cell(row: Row, name: str) -> Cell:
    value, std = row[name], row[f"{name}_std"]
    if value is None:
        return Cell("–", "", "")
    factor, unit = choose_figure_unit(name, value)
    text = round_with_std(value * factor, None if std is None else std * abs(factor))
    z = row[f"{name}_z"]
    far = format_signed(z) if name in row["outliers"].split() and z is not None else ""
    return Cell(f"{text} {unit}".strip(), repr(float(value)), far)


def _middle(rows: Sequence[Row], name: str) -> float:
    known = sorted(row[name] for row in rows if row[name] is not None)
    return float(known[len(known) // 2]) if known else 0.0


def _causes(rows: Sequence[Row]) -> list[tuple[str, int, list[str]]]:
    """(cause in words, how many gyros, the worst of them), most frequent first."""
    counts = Counter(name for row in rows for name in row["causes"].split())
    ranked = sorted(rows, key=lambda row: row["rank"])
    return [
        (
            clean_text(name).replace("_", " "),
            count,
            [clean_text(row["gyro_id"]) for row in ranked if name in row["causes"].split()][:WORST],
        )
        for name, count in sorted(counts.items(), key=lambda pair: (-pair[1], pair[0]))
    ]


def _populations(found: Mapping[str, Any]) -> list[tuple[str, list[str], bool]]:
    """(name, mean, spread, measurement σ, gyros; whether it is a cause's size) of everything."""
    out = []
    for name, one in found.items():
        cause = "." in name
        if cause:
            factor, unit = choose_unit(
                name.partition(".")[2], one["mean"] or one["measured_std"], one["units"]
            )
        else:
            factor, unit = choose_figure_unit(name, one["mean"])
        size = abs(factor)
        spread = (
            f"{round_with_std(one['spread'] * size, one['spread_std'] * size)} {unit}"
            if one["spread"] > one["spread_std"]
            else f"less than {format_number((one['spread'] + 2 * one['spread_std']) * size, 2)}"
            f" {unit}"
        )
        words = (
            clean_text(say_in_words(name))
            if not cause
            else clean_text(name.replace("_", " ").replace(".", ": "))
        )
        cells = [
            f"{round_with_std(one['mean'] * factor, one['mean_std'] * size)} {unit}".strip(),
            spread.strip(),
            f"{format_number(one['measured_std'] * size, 2)} {unit}".strip(),
            str(one["gyros"]),
        ]
        out.append((words, cells, cause))
    return out


def _cut(text: str) -> str:
    """A reason short enough for a card or a cell."""
    text = clean_text(text)
    return text if len(text) <= LONGEST else text[: LONGEST - 1].rsplit(" ", 1)[0] + " …"
