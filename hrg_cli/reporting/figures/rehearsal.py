"""Picture of a rehearsal: every figure's bias and the rms of its errors in units of its standard
deviation, with the limits."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..figure_names import name_figure
from ..text import format_hundredths
from .drawing import GRID, INK, SERIES, Plot, draw_legend, make_panels, set_labels


def plot_rehearsal(report: Mapping[str, Any]) -> Plot:
    """Bias and rms of a rehearsal's figures, and how often their intervals hold the truth.

    Parameters
    ----------
    report
        Its JSON.

    Returns
    -------
    Plot
        A row a figure.

    Examples
    --------
    >>> from hrg_cli.reporting.figures.rehearsal import plot_rehearsal
    >>> figure = {"name": "scale_factor", "bias_over_std": -0.1, "error_over_std_rms": 1.0}
    >>> figure |= {"coverage_68": 0.67, "coverage_95": 1.0}
    >>> plot_rehearsal({"figures": [figure], "times": 9}).key
    'rehearsal'
    """
    figures = report["figures"]
    place = np.arange(len(figures))
    figure, axes = make_panels(
        1, 2, height=max(2.0, 0.28 * len(figures) + 0.8), width=9.0, sharey=True
    )
    left, right = axes[0]
    bias, rms = (
        np.array([f[key] for f in figures]) for key in ("bias_over_std", "error_over_std_rms")
    )
    left.axvspan(-1, 1, color=GRID, alpha=0.5, lw=0)
    left.axvline(0, color=INK, lw=0.5)
    left.axvline(1, color=INK, lw=0.5, ls=":")
    left.plot(bias, place, "o", color=SERIES[0], label="bias")
    left.plot(rms, place, "s", color=SERIES[1], label="rms")
    reach = float(np.nanmax(np.abs([bias, rms]), initial=1.5)) * 1.1
    left.set_xscale("symlog", linthresh=3) if reach > 30 else left.set_xlim(-reach, reach)
    left.set_yticks(place, [name_figure(f["name"]) for f in figures])
    left.invert_yaxis()
    set_labels(left, x="error, standard deviations")
    draw_legend(left, above=True)
    for key, expected, colour in (
        ("coverage_68", 68.3, SERIES[2]),
        ("coverage_95", 95.0, SERIES[3]),
    ):
        right.axvline(expected, color=colour, lw=0.7, ls="--")
        right.plot(
            [100 * f[key] for f in figures], place, "o", color=colour, label=f"{expected:.0f} %"
        )
    right.set_xlim(0, 102)
    set_labels(right, x="true value within the interval, %")
    draw_legend(right, above=True)
    words = (
        f"{report['times']} rehearsals on a simulated twin: errors of {rms.min():.2f} to"
        f" {rms.max():.2f} standard deviations, bias of {format_hundredths(bias.min())} to"
        f" {format_hundredths(bias.max())}."
    )
    return Plot("rehearsal", "Rehearsal", words, figure)
