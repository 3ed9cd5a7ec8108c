"""The tables of a rehearsal on the screen and on its page: every figure in words, and how often
each cause was named."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .answer_words import say_in_words
from .figure_names import name_figure
from .page_table import PageTable
from .text import format_hundredths

HEAD = ("figure", "bias/σ", "error/σ, rms", "within 68 %", "within 95 %", "σ, file/twins")


def tabulate_rehearsal(told: Mapping[str, Any]) -> list[PageTable]:
    """What a rehearsal tells (`table()` of it), as one or two tables.

    Parameters
    ----------
    told
        Its JSON.

    Returns
    -------
    list of PageTable
        Figures, and causes where there are some.

    Examples
    --------
    >>> from hrg_cli.reporting.rehearsal_tables import tabulate_rehearsal
    >>> figure = {"name": "scale_factor", "bias_over_std": -0.1, "error_over_std_rms": 1.0}
    >>> told = {"times": 9, "truth": "the file's parameters", "causes": []}
    >>> told["figures"] = [figure | {"coverage_68": 0.67, "coverage_95": 1.0}]
    >>> tabulate_rehearsal(told)[0].rows
    [('scale factor K', '−0.10', '1.00', '67 %', '100 %', '')]
    """
    rows = [
        (
            name_figure(f["name"]),
            *(format_hundredths(f[key]) for key in ("bias_over_std", "error_over_std_rms")),
            *(f"{100 * f[key]:.0f} %" for key in ("coverage_68", "coverage_95")),
            "" if f.get("std_ratio") is None else format_hundredths(f["std_ratio"]),
        )
        for f in told["figures"]
    ]
    found = [PageTable(f"{told['times']} rehearsals, truth: {told['truth']}", HEAD, rows)]
    causes = [
        (say_in_words(c["name"]), "yes" if c["held"] else "no", f"{c['named']} of {c['times']}")
        for c in told["causes"]
    ]
    if causes:
        found.append(PageTable("causes", ("cause", "in the twin", "named"), causes))
    return found
