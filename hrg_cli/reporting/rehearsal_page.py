"""The page of a rehearsal: verdict, picture and tables in one HTML file that needs no network."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from markupsafe import Markup

from .figures.drawing import style, svg
from .figures.good_and_bad import how_to_read
from .figures.rehearsal import rehearsal_plot
from .rehearsal_tables import tabulate_rehearsal
from .templates import render_page
from .text import plain


def rehearsal_page(report: Mapping[str, Any]) -> str:
    """The HTML of a rehearsal's JSON."""
    file = Path(str(report["file"])).name
    with style():
        plot = rehearsal_plot(report)
        picture = Markup(svg(plot, plot.key))
    return render_page(
        "rehearsal.html",
        ("page.js",),
        title=f"Rehearsal of {plain(file)}",
        file=file,
        status=report["status"],
        reasons=report["status_reasons"],
        plot=plot,
        picture=picture,
        how=how_to_read(plot.key),
        tables=tabulate_rehearsal(report),
    )
