"""Figures of demodulated signals: their course with σ, and the spectrum of what the fit left."""

from __future__ import annotations

import numpy as np

from ...records import Periods, Wave
from ..text import format_number
from .drawing import (
    INK,
    MUTED,
    SERIES,
    Plot,
    choose_time_unit,
    draw_legend,
    draw_line,
    make_panels,
    say_spread,
    set_labels,
    set_log_axis,
)
from .recording import name_channel_unit, thin_line


def plot_periods(record: Periods) -> list[Plot]:
    """Every figure of demodulated periods.

    Parameters
    ----------
    record
        The periods.

    Returns
    -------
    list of Plot
        Signals against time, and the residual's spectrum with its lines.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording, collect, demodulate
    >>> from hrg_cli.reporting.figures.periods import plot_periods
    >>> t = np.arange(8000) / 8000
    >>> noise = 1e-4 * np.random.default_rng(0).standard_normal((2, 8000))
    >>> c, s = np.cos(2 * np.pi * 1000 * t) + noise
    >>> made = collect(
    ...     demodulate(Recording(c=c, s=s, sample_rate_hz=8e3, mode="free"), periods_per_window=20)
    ... )
    >>> len(plot_periods(made))
    2
    """
    found = [_signals(record)] if len(record) else []
    if (
        record.spectrum_frequency_hz is not None
        and record.spectrum_density is not None
        and len(record.spectrum_frequency_hz)
    ):
        found.append(plot_residual_spectrum(record))
    return found


def _signals(record: Periods) -> Plot:
    time, signals, residual = (
        np.asarray(a[:]) for a in (record.time_s, record.signals, record.residual_rms)
    )
    factor, unit = choose_time_unit(float(time[-1]))
    names = (
        ("C cos", "C sin", "S cos", "S sin")
        if signals.shape[1] == 4
        else ("a_c⁻", "a_c⁺", "b_c⁻", "b_c⁺", "a_s⁻", "a_s⁺", "b_s⁻", "b_s⁺")
    )
    figure, axes = make_panels(3, 1, height=1.8, sharex=True)
    half = signals.shape[1] // 2
    for k, name in enumerate(names):
        ax = axes[k // half, 0]
        draw_line(ax, time * factor, signals[:, k], k % half, name)
    for ax, channel in zip(axes[:2, 0], "CS"):
        set_labels(ax, y=name_channel_unit(record.units), title=f"Signals of channel {channel}")
        ax.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), handlelength=1.2)
    for k, channel in enumerate("CS"):
        draw_line(axes[2, 0], time * factor, residual[:, k], k, channel)
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
    set_labels(
        axes[2, 0],
        x=f"time, {unit}",
        y=name_channel_unit(record.units),
        title="rms of what the fit leaves a window",
    )
    axes[2, 0].legend(loc="center left", bbox_to_anchor=(1.0, 0.5), handlelength=1.2)
    words = (
        f"{len(time)} windows of {format_number(record.window_s)} s over"
        f" {format_number(time[-1] * factor)} {unit} against"
        f" {format_number(record.reference_frequency_hz, 8)} Hz; signals {say_spread(signals)},"
        f" residual rms {say_spread(residual)} {name_channel_unit(record.units)};"
        f" {int(flags.sum())} windows are flagged."
    )
    return Plot("signals", "Demodulated signals", words, figure)


def plot_residual_spectrum(record: Periods | Wave) -> Plot:
    """Averaged spectrum of what a demodulation leaves, with the lines that stand out of it.

    Parameters
    ----------
    record
        Periods or a wave that hold it.

    Returns
    -------
    Plot
        Amplitude density of both channels.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording, collect, demodulate
    >>> from hrg_cli.reporting.figures.periods import plot_residual_spectrum
    >>> t = np.arange(8000) / 8000
    >>> noise = 1e-4 * np.random.default_rng(0).standard_normal((2, 8000))
    >>> c, s = np.cos(2 * np.pi * 1000 * t) + noise
    >>> made = collect(
    ...     demodulate(Recording(c=c, s=s, sample_rate_hz=8e3, mode="free"), periods_per_window=20)
    ... )
    >>> plot_residual_spectrum(made).words[:40]
    'Residual amplitude density from 0 to ...
    """
    frequency, density = (
        np.asarray(record.spectrum_frequency_hz, dtype=float),
        np.asarray(record.spectrum_density, dtype=float),
    )
    figure, axes = make_panels(1, 1, height=2.4)
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
        f"Residual amplitude density from 0 to {format_number(frequency[-1])} Hz, median"
        f" {format_number(median, 3)} {name_channel_unit(record.units)}/√Hz."
    )
    if record.spectrum_line_frequency_hz is not None and len(record.spectrum_line_frequency_hz):
        at = np.asarray(record.spectrum_line_frequency_hz)[:12]
        top = np.sqrt(np.interp(at, frequency, density.max(1)))
        ax.plot(at, top * 1.4, "v", color=MUTED, ms=4, label="stands out")
        words += " Lines stand out at " + ", ".join(f"{format_number(f, 5)} Hz" for f in at) + "."
    set_labels(ax, x="frequency, Hz", y=f"{name_channel_unit(record.units)}/√Hz")
    set_log_axis(ax.yaxis)
    draw_legend(ax, above=True)
    return Plot("residual-spectrum", "Spectrum of the demodulation's residual", words, figure)
