"""Figures of demodulated signals: their course with σ, and the spectrum of what the fit left."""

from __future__ import annotations

import numpy as np

from ...records import Periods, Wave
from ..text import number
from .drawing import (
    INK,
    MUTED,
    SERIES,
    Plot,
    labels,
    legend,
    line,
    log_axis,
    panels,
    spread,
    time_unit,
)
from .recording import thin_line, unit_of_channels


def period_plots(record: Periods) -> list[Plot]:
    """Every figure of demodulated periods: the signals against time, and the residual's spectrum
    with its lines."""
    found = [_signals(record)] if len(record) else []
    if (
        record.spectrum_frequency_hz is not None
        and record.spectrum_density is not None
        and len(record.spectrum_frequency_hz)
    ):
        found.append(residual_spectrum(record))
    return found


def _signals(record: Periods) -> Plot:
    time, signals, residual = (
        np.asarray(a[:]) for a in (record.time_s, record.signals, record.residual_rms)
    )
    factor, unit = time_unit(float(time[-1]))
    names = (
        ("C cos", "C sin", "S cos", "S sin")
        if signals.shape[1] == 4
        else ("a_c⁻", "a_c⁺", "b_c⁻", "b_c⁺", "a_s⁻", "a_s⁺", "b_s⁻", "b_s⁺")
    )
    figure, axes = panels(3, 1, height=1.8, sharex=True)
    half = signals.shape[1] // 2
    for k, name in enumerate(names):
        ax = axes[k // half, 0]
        line(ax, time * factor, signals[:, k], k % half, name)
    for ax, channel in zip(axes[:2, 0], "CS"):
        labels(ax, y=unit_of_channels(record.units), title=f"Signals of channel {channel}")
        ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), handlelength=1.2)
    for k, channel in enumerate("CS"):
        line(axes[2, 0], time * factor, residual[:, k], k, channel)
    flags = np.asarray(record.flags[:]) != 0
    if flags.any():
        axes[2, 0].plot(
            time[flags][:400] * factor,
            residual[flags][:400].max(1),
            "x",
            color=INK,
            ms=4,
            label="flagged",
        )
    labels(
        axes[2, 0],
        x=f"time, {unit}",
        y=unit_of_channels(record.units),
        title="rms of what the fit leaves a window",
    )
    axes[2, 0].legend(loc="center left", bbox_to_anchor=(1.0, 0.5), handlelength=1.2)
    words = (
        f"{len(time)} windows of {number(record.window_s)} s over {number(time[-1] * factor)}"
        f" {unit} against {number(record.reference_frequency_hz, 8)} Hz; signals {spread(signals)},"
        f" residual rms {spread(residual)} {unit_of_channels(record.units)}; {int(flags.sum())} windows are"
        " flagged."
    )
    return Plot("signals", "Demodulated signals", words, figure)


def residual_spectrum(record: Periods | Wave) -> Plot:
    """Averaged spectrum of the demodulation's residual with the lines that stand out of it."""
    frequency, density = (
        np.asarray(record.spectrum_frequency_hz, dtype=float),
        np.asarray(record.spectrum_density, dtype=float),
    )
    figure, axes = panels(1, 1, height=2.4)
    ax = axes[0, 0]
    keep = frequency > 0
    for k, channel in enumerate("CS"):
        ax.semilogy(
            *thin_line(frequency[keep], np.sqrt(np.maximum(density[keep, k], 0))),
            color=SERIES[k],
            lw=0.9,
            label=channel,
        )
    median = float(np.sqrt(np.median(density[keep])))
    words = (
        f"Residual amplitude density from 0 to {number(frequency[-1])} Hz, median"
        f" {number(median, 3)} {unit_of_channels(record.units)}/√Hz."
    )
    if record.spectrum_line_frequency_hz is not None and len(record.spectrum_line_frequency_hz):
        at = np.asarray(record.spectrum_line_frequency_hz)[:12]
        top = np.sqrt(np.interp(at, frequency, density.max(1)))
        ax.plot(at, top * 1.4, "v", color=MUTED, ms=4, label="stands out")
        words += " Lines stand out at " + ", ".join(f"{number(f, 5)} Hz" for f in at) + "."
    labels(ax, x="frequency, Hz", y=f"{unit_of_channels(record.units)}/√Hz")
    log_axis(ax.yaxis)
    legend(ax, above=True)
    return Plot("residual-spectrum", "Spectrum of the demodulation's residual", words, figure)
