"""The pages of the ledger: of all gyros (standing, charts, capability, gauge study, golden unit)
and of one gyro over time; each one HTML file that needs no network.

The same ledger gives the same bytes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup

from ..ledger.history import FigureHistory, History
from ..ledger.overview import FigureReport, Overview, Standing
from ..ledger.times import format_time
from .figure_names import name_figure, name_figures
from .figures.drawing import Plot, use_style, write_svg
from .figures.ledger import ChartedFigure, draw_capability, draw_course
from .ledger_tables import (
    say_sigma,
    say_what_counts,
    tabulate_courses,
    tabulate_figures,
    tabulate_gyros,
    tabulate_results,
)
from .page_table import PageTable
from .templates import render_page
from .text import clean_text, format_number

MOST = 24
"""Charts on one page; the rest is asked for by name."""
FAR = 3.0
"""σ from which a gyro counts as moved."""


@dataclass(frozen=True)
class GyroRow:
    """A gyro's cells, the number that each sorts by (None: by its text; "": it has none), and what
    the filter knows."""

    cells: Sequence[str]
    keys: Sequence[str | None]
    tags: str
    shade: str


def make_overview_page(found: Overview, status: str) -> str:
    """The page of all gyros of a ledger.

    Parameters
    ----------
    found
        What `hrg_cli.ledger.overview.make_overview` tells.
    status
        "valid", "suspect" or "refused", as the command judges it.

    Returns
    -------
    str
        HTML that needs no other file.

    Examples
    --------
    >>> from hrg_cli.ledger.overview import make_overview
    >>> from hrg_cli.reporting.ledger_page import make_overview_page
    >>> page = make_overview_page(make_overview([]), "valid")
    >>> "Ledger: 0 results of 0 gyros" in page, "http://" in page
    (True, False)
    """
    table = tabulate_gyros(found)
    rows = [_gyro_row(row, cells) for row, cells in zip(found.standings, table.rows, strict=True)]
    courses = _courses_of_overview(found)
    names = name_figures([(row.kind, row.name) for row in found.figures])
    with use_style():
        capability = draw_capability(found.figures, [names[f.kind, f.name] for f in found.figures])
    return _render(
        title=f"Ledger: {say_what_counts(found)}",
        status=status,
        missed=found.missed,
        doubts=found.doubts,
        sentence=_sentence(found, _most_moved(found)),
        gyros=(table.head, rows),
        tables=tabulate_figures(found),
        results=None,
        capability=None if capability is None else (capability, _svg(capability)),
        courses=courses,
        expected=found.false_alarms_expected,
    )


def make_history_page(found: History, status: str) -> str:
    """The page of one gyro over time.

    Parameters
    ----------
    found
        What `hrg_cli.ledger.history.tell_history` tells.
    status
        "valid", "suspect" or "refused", as the command judges it.

    Returns
    -------
    str
        HTML that needs no other file.

    Examples
    --------
    >>> from hrg_cli.ledger.entry import Entry
    >>> from hrg_cli.ledger.history import tell_history
    >>> from hrg_cli.reporting.ledger_page import make_history_page
    >>> entry = Entry("ab" * 32, "r.h5", "resonator", "SN-1", "2026-01-01T00:00:00Z", "refused")
    >>> "SN-1: 1 result" in make_history_page(tell_history([entry], "SN-1"), "suspect")
    True
    """
    names = name_figures([(row.kind, row.name) for row in found.figures])
    courses = [_course_of(row, names[row.kind, row.name], k) for k, row in enumerate(found.figures)]
    moves, results = tabulate_courses(found), tabulate_results(found)
    count = len(found.entries)
    return _render(
        title=f"{clean_text(found.gyro_id)}: {count} result{'' if count == 1 else 's'}",
        status=status,
        missed=found.missed,
        doubts=found.doubts,
        sentence=_sentence(found, _largest_move(found)),
        gyros=None,
        tables=[PageTable("how every figure moved", moves.head, moves.rows)],
        results=PageTable("results, in the order of processing", results.head, results.rows),
        capability=None,
        courses=courses,
        expected=0.0,
    )


def _sentence(found: Overview | History, moved: str) -> str:
    """Limits, doubts and the largest move in one sentence."""
    missed, doubts = len(found.missed), len(found.doubts)
    said = (
        f"{missed} limit{'s are' if missed > 1 else ' is'} missed"
        if missed
        else "No limit is missed"
    )
    doubted = "nothing is in doubt" if not doubts else f"{doubts} in doubt"
    return f"{said}; {doubted}{moved}."


def _most_moved(found: Overview) -> str:
    """The gyro that moved most since the measurement before."""
    moved = [row for row in found.standings if row.moved_sigma is not None]
    if not moved:
        return ""
    row = max(moved, key=lambda row: abs(row.moved_sigma or 0.0))
    name = name_figure(row.moved_figure)
    return f"; most moved {clean_text(row.entry.gyro_id)}: {name} {say_sigma(row.moved_sigma)}"


def _largest_move(found: History) -> str:
    """The figure that moved most since the measurement before."""
    moved = [
        (row.since_before.sigma, row.name)
        for row in found.figures
        if row.since_before is not None and row.since_before.sigma is not None
    ]
    if not moved:
        return ""
    sigma, name = max(moved, key=lambda pair: abs(pair[0]))
    return f"; {name_figure(name)} moved most since the last: {say_sigma(sigma)}"


def _render(*, courses: Sequence[ChartedFigure], **content: Any) -> str:
    # a single point has no course: its value stands in the table
    charted = [course for course in courses if len(course.values) > 1]
    first = sorted(charted, key=lambda c: c.chart is None or not c.chart.out_of_control)
    with use_style():
        plots = [draw_course(course) for course in first[:MOST]]
        pictures = [(plot, _svg(plot)) for plot in plots]
    return render_page(
        "ledger.html",
        ("page.js", "lot.js"),
        **content,
        pictures=pictures,
        untold=len(charted) - len(pictures),
        measured=bool(courses),
        number=format_number,
        zip=zip,
    )


def _svg(plot: Plot) -> Markup:
    return Markup(write_svg(plot, plot.key))


def _gyro_row(row: Standing, cells: Sequence[str]) -> GyroRow:
    missed = any(not held.passed for held in row.held)
    tags = [
        name
        for name, told in (
            ("failed", missed),
            ("moved", row.farthest_sigma > FAR),
            ("refused", row.entry.status == "refused"),
        )
        if told
    ]
    keys: list[str | None] = [None] * len(cells)
    keys[2] = str(row.results)
    keys[6] = repr(abs(row.moved_sigma or 0.0)) if row.moved_figure else ""
    keys[7] = repr(abs(row.changed.sigma)) if row.changed else ""
    shade = "refused" if missed else row.entry.status
    return GyroRow([clean_text(cell) for cell in cells], keys, " ".join(tags), shade)


def _courses_of_overview(found: Overview) -> list[ChartedFigure]:
    names = name_figures([(row.kind, row.name) for row in found.figures])
    courses = [
        _course_over(row, names[row.kind, row.name], k)
        for k, row in enumerate(found.figures)
        if len(row.measured)
    ]
    of_golden = name_figures({(row.kind, row.name) for row in found.golden})
    for k, row in enumerate(found.golden):
        where = f" on {found.by} {row.station}" if row.station else ""
        courses.append(
            ChartedFigure(
                key=f"golden-{k}",
                title=clean_text(f"{of_golden[row.kind, row.name]}, golden unit{where}"),
                name=row.name,
                units=row.units,
                times=row.measured.times,
                values=row.measured.values,
                stds=row.measured.stds,
                points=[entry.processed[:10] for entry in row.measured.entries],
                bounds=(None, None),
                chart=row.chart,
                own=True,
            )
        )
    return courses


def _course_over(row: FigureReport, name: str, place: int) -> ChartedFigure:
    return ChartedFigure(
        key=f"figure-{place}",
        title=f"{name}, over the gyros",
        name=row.name,
        units=row.units,
        times=row.measured.times,
        values=row.measured.values,
        stds=row.measured.stds,
        points=row.points,
        bounds=row.bounds,
        chart=row.chart,
        own=False,
    )


def _course_of(row: FigureHistory, name: str, place: int) -> ChartedFigure:
    times = np.array(row.times)
    return ChartedFigure(
        key=f"figure-{place}",
        title=name,
        name=row.name,
        units=row.units,
        times=times,
        values=np.array(row.values),
        stds=np.array(row.stds),
        points=[format_time(t)[:10] for t in row.times],
        bounds=row.bounds,
        chart=row.chart,
        own=True,
    )
