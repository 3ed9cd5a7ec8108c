"""Where the simulation departs from the motion: measured beside simulated, and their difference
against everything known along the runs."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...physics import ellipse
from ...records import Array, Diagnosis
from ..json_text import parse_list
from ..text import format_number
from .drawing import (
    INK,
    SERIES,
    Plot,
    choose_time_unit,
    draw_dots,
    draw_legend,
    draw_scatter_with_mean,
    make_panels,
    note,
    set_labels,
)

SPREAD = 1e-9
"""Relative range of a covariate below which nothing can be seen against it."""


class DepartureMotion(NamedTuple):
    """Main amplitude, quadrature over it, wave angle in rad and phase in rad of every row."""

    amplitude: Array
    quadrature: Array
    angle: Array
    phase: Array


def plot_departure(record: Diagnosis, mode_number: int) -> list[Plot]:
    """The worst run measured and simulated, then what is measured less what is simulated.

    Parameters
    ----------
    record
        A diagnosis with rows.
    mode_number
        m.

    Returns
    -------
    list of Plot
        Amplitude, wave angle, quadrature and phase against everything.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.records import Diagnosis
    >>> from hrg_cli.reporting.figures.departure import plot_departure
    >>> t = np.arange(200.0)
    >>> u = np.exp(-1e-3 * t)[:, None] * [1.0, 0.0, 0.1, 0.0]
    >>> series = dict(measured=u, simulated_before=1.01 * u, simulated_after=u)
    >>> rows = dict(run=0 * t, time_s=t, wave_angle_rad=0 * t, main_amplitude=u[:, 0])
    >>> rows |= series | dict(
    ...     residual_before=u - 1.01 * u, residual_after=0 * u, series=np.arange(4)
    ... )
    >>> plots = plot_departure(Diagnosis(verdict="explained", report="{}", **rows), 2)
    >>> len(plots)
    5
    """
    measured, before, after = (
        _motion(np.asarray(series), mode_number)
        for series in (record.measured, record.simulated_before, record.simulated_after)
    )
    period = np.pi / mode_number
    differences = []
    for simulated in (before, after):
        turns = np.round((measured.angle - simulated.angle) / period)
        angle = measured.angle - simulated.angle - turns * period
        phase = np.angle(np.exp(1j * (measured.phase - simulated.phase + np.pi * turns)))
        differences.append(
            {
                "wave angle": (angle, "mrad", 1e3),
                "amplitude": (measured.amplitude / simulated.amplitude - 1, "%", 1e2),
                "quadrature": (measured.quadrature - simulated.quadrature, "% of a_A", 1e2),
                "phase": (phase, "mrad", 1e3),
            }
        )
    found = [_worst_run(record, measured, before, after)]
    for name, (first, unit, factor) in differences[0].items():
        found.append(
            _difference(record, name, unit, first * factor, differences[1][name][0] * factor)
        )
    return found


def _motion(series: Array, mode_number: int) -> DepartureMotion:
    """The wave of rows Re C0, Re S0, Im C0, Im S0."""
    a_A, a_B, angle, phase = ellipse.find_wave(series[:, :2] + 1j * series[:, 2:], mode_number)
    return DepartureMotion(a_A, a_B / np.where(a_A > 0, a_A, np.nan), angle, phase)


def _worst_run(
    record: Diagnosis, measured: DepartureMotion, before: DepartureMotion, after: DepartureMotion
) -> Plot:
    """Amplitude, wave angle and quadrature in time of the run that the base model fits worst."""
    runs = np.asarray(record.run)
    squares = np.sum(np.asarray(record.residual_before) ** 2, axis=1)
    worst = max(np.unique(runs), key=lambda k: float(np.nanmean(squares[runs == k])))
    rows = runs == worst
    names = parse_list(record.run_ids)
    name = str(names[worst]) if worst < len(names) else str(worst)
    t = np.asarray(record.time_s)[rows]
    factor, unit = choose_time_unit(float(np.ptp(t)))
    figure, axes = make_panels(1, 3, height=2.4, width=8.2)
    for ax, label, pick in (
        (axes[0, 0], "main amplitude", lambda m: m.amplitude),
        (axes[0, 1], "wave angle, °", lambda m: np.degrees(m.angle)),
        (axes[0, 2], "quadrature, % of a_A", lambda m: 1e2 * m.quadrature),
    ):
        for motion, colour, words in (
            (before, 1, "simulated before"),
            (after, 0, "simulated after"),
        ):
            values = np.array(pick(motion)[rows])
            if label.startswith("wave angle"):
                values[1:][np.abs(np.diff(values)) > 45] = np.nan
            ax.plot(t * factor, values, color=SERIES[colour], lw=1.0, label=words)
        draw_dots(ax, t * factor, pick(measured)[rows], 2, size=2.2, alpha=0.8)
        set_labels(ax, x=f"time, {unit}", y=label)
    draw_legend(axes[0, 2], above=True)
    note(axes[0, 0], f"run {name}, dots: measured")
    words = (
        f"Run {name}, which the base model fits worst: measured (dots) and simulated before and"
        " after (lines)."
    )
    return Plot("measured-and-simulated", "Measured and simulated", words, figure)


def _difference(record: Diagnosis, name: str, unit: str, before: Array, after: Array) -> Plot:
    factor, time = choose_time_unit(float(np.ptp(record.time_s)))
    against: list[tuple[str, Array]] = [
        ("θ modulo 180°", np.degrees(np.asarray(record.wave_angle_rad)) % 180),
        (f"time, {time}", np.asarray(record.time_s) * factor),
        ("a_A", np.asarray(record.main_amplitude)),
    ]
    for values, label, scale in (
        (record.temperature_degc, "T, °C", 1.0),
        (record.rate_rad_s, "Ω, °/s", np.degrees(1.0)),
    ):
        if values is not None and np.nanmax(values) - np.nanmin(values) > SPREAD * np.nanmax(
            np.abs(values)
        ):
            against.append((label, np.asarray(values) * scale))
    figure, axes = make_panels(1, len(against), height=2.3, width=8.2, sharey=True)
    for ax, (label, x) in zip(axes[0], against):
        draw_scatter_with_mean(ax, x, before, 1, "before")
        draw_scatter_with_mean(ax, x, after, 0, "after")
        ax.axhline(0, color=INK, lw=0.5)
        set_labels(ax, x=label)
    low, high = np.nanpercentile(np.concatenate([before, after]), [0.5, 99.5])
    if high > low:
        axes[0, 0].set_ylim(low - 0.08 * (high - low), high + 0.08 * (high - low))
    axes[0, 0].set_ylabel(f"{name}, {unit}")
    draw_legend(axes[0, -1], above=True)
    rms = [format_number(float(np.sqrt(np.nanmean(r**2)))) for r in (before, after)]
    words = (
        f"Measured less simulated {name}: {rms[0]} {unit} rms before, {rms[1]} {unit} rms after the"
        " extended model."
    )
    return Plot(
        f"departure-{name.replace(' ', '-')}", f"Measured less simulated: {name}", words, figure
    )
