"""The one figure of the answer: what is left of the runs without and with the causes, and how much
of it each cause makes."""

from __future__ import annotations

import numpy as np

from ...records import Diagnosis
from ...stages.diagnosis.report.shares import compute_difference
from ..answer_words import QUANTITIES, Cause, Departure
from ..text import format_number
from .drawing import (
    INK,
    MUTED,
    SERIES,
    Plot,
    average_bins,
    choose_time_unit,
    draw_dots,
    make_panels,
    note,
    set_labels,
)

BINS = 40


def plot_before_and_after(
    record: Diagnosis, departure: Departure | None, causes: tuple[Cause, ...]
) -> Plot | None:
    """What a model leaves without and with the causes, against time, and the causes' shares beside.

    Parameters
    ----------
    record
        A diagnosis.
    departure
        The quantity that is told; None: not known.
    causes
        Largest first; without one, what is left alone is drawn.

    Returns
    -------
    Plot or None
        None where the record holds no rows.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from hrg_cli.reporting.figures.answer import plot_before_and_after
    >>> class Told(SimpleNamespace):
    ...     def __len__(self):
    ...         return 0
    >>> plot_before_and_after(Told(), None, ()) is None
    True
    """
    if not len(record) or np.ndim(record.measured) != 2 or np.shape(record.measured)[1] != 4:
        return None
    amplitude = departure is not None and departure.key == "amplitude_ppm"
    run, time_s = np.asarray(record.run), np.asarray(record.time_s)
    factor, unit = choose_time_unit(float(np.ptp(time_s)))
    figure, axes = make_panels(1, 2 if causes else 1, height=2.7, width=8.2)
    ax = axes[0, 0]
    pairs = [
        ("without the causes", record.simulated_before, 1),
        ("with the causes", record.simulated_after, 0),
    ]
    for words, simulated, colour in pairs if causes else pairs[1:]:
        left = compute_difference(record.measured, simulated)
        values = left.amplitude * 1e6 if amplitude else left.angle * 1e3
        draw_dots(ax, time_s * factor, values, colour, points=500, alpha=0.3, size=1.7)
        for k in np.unique(run):
            at, mean, _ = average_bins(time_s[run == k] * factor, values[run == k], BINS)
            ax.plot(at, mean, color=SERIES[colour], lw=1.2, label=words if causes else None)
            words = "_nolegend_"
    ax.axhline(0, color=INK, lw=0.6)
    quantity = "amplitude, ppm" if amplitude else "wave angle m·θ, mrad"
    set_labels(ax, x=f"time, {unit}", y=quantity, title="Measured less modelled")
    if causes:
        ax.legend(loc="best")
    shown = _shares(axes[0, 1], departure, causes) if causes else _left(departure)
    good = (
        "Good: a flat band about zero, as wide as the noise. Bad: bends and slopes, which noise"
        " does not make."
    )
    return Plot(
        "answer",
        "Before and after" if causes else "What is left",
        f"{shown} Dots: rows; lines: a run's running mean. {good}",
        figure,
    )


def _left(departure: Departure | None) -> str:
    """The error of a gyro without causes, in words: one number needs no bar."""
    if departure is None:
        return "No figure of the error is known."
    words = next(w for key, w, *_ in QUANTITIES if key == departure.key)
    where = " on data left out" if departure.held_out else ""
    return (
        f"{words.capitalize()} error{where}: {format_number(departure.after, 3)} {departure.unit}."
    )


def _shares(ax: object, departure: Departure | None, causes: tuple[Cause, ...]) -> str:
    """Bars: the error without the causes, each cause's share, and what is left; the words for
    them."""
    from matplotlib.axes import Axes

    assert isinstance(ax, Axes)
    if departure is None:
        ax.set_axis_off()
        return "No figure of the error is known."
    rows = [("without causes", departure.before, SERIES[1])]
    rows += [(c.words, getattr(c, departure.key) or 0.0, MUTED) for c in causes[:6]]
    rows += [("with causes", departure.after, SERIES[0])]
    ax.barh(range(len(rows)), [v for _, v, _ in rows], color=[c for *_, c in rows], height=0.6)
    ax.set_yticks(range(len(rows)), [name for name, *_ in rows])
    ax.invert_yaxis()
    ax.grid(False, axis="y")
    top = max(v for _, v, _ in rows) or 1.0
    ax.set_xlim(0, top * 1.22)
    for k, (_, value, _) in enumerate(rows):
        ax.annotate(
            format_number(value, 3),
            (value, k),
            xytext=(4, 0),
            textcoords="offset points",
            va="center",
            fontsize=8.5,
        )
    words = next(w for key, w, *_ in QUANTITIES if key == departure.key)
    set_labels(ax, x=f"{words} error, {departure.unit}", title="Whose it is")
    note(ax, "first, last: data left out" if departure.held_out else "")
    left = f"{format_number(departure.after, 3)} {departure.unit}"
    return (
        f"{words.capitalize()} error {format_number(departure.before, 3)} {departure.unit}"
        f" without the causes, {left} with"
        f" them{' on data that was not fitted' if departure.held_out else ''}. A cause's bar:"
        " how far the runs go off where that cause is left out and all else is fitted anew;"
        " these bars do not add up."
    )
