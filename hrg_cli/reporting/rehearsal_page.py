"""The page of a rehearsal: verdict, picture and tables in one HTML file that needs no network."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from markupsafe import Markup

from .figures.drawing import use_style, write_svg
from .figures.good_and_bad import explain_reading
from .figures.rehearsal import plot_rehearsal
from .rehearsal_tables import tabulate_rehearsal
from .templates import render_page
from .text import clean_text


def make_rehearsal_page(report: Mapping[str, Any]) -> str:
    """The page of a rehearsal.

    Parameters
    ----------
    report
        Its JSON.

    Returns
    -------
    str
        HTML that needs no other file.

    Examples
    --------
    >>> from hrg_cli.reporting.rehearsal_page import make_rehearsal_page
    >>> figure = {"name": "scale_factor", "bias_over_std": -0.1, "error_over_std_rms": 1.0}
    >>> told = {"file": "r.h5", "status": "valid", "status_reasons": [], "times": 9, "causes": []}
    >>> told |= {
    ...     "truth": "the file",
    ...     "figures": [figure | {"coverage_68": 0.67, "coverage_95": 1.0}],
    ... }
    >>> "Rehearsal of r.h5" in make_rehearsal_page(told)
    True
    """
    file = Path(str(report["file"])).name
    with use_style():
        plot = plot_rehearsal(report)
        picture = Markup(write_svg(plot, plot.key))
    return render_page(
        "rehearsal.html",
        ("page.js",),
        title=f"Rehearsal of {clean_text(file)}",
        file=file,
        status=report["status"],
        reasons=report["status_reasons"],
        plot=plot,
        picture=picture,
        how=explain_reading(plot.key),
        tables=tabulate_rehearsal(report),
    )
