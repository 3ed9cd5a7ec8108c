"""First look at samples: both channels, the orbit, the raw spectrum with what a local fit leaves of
it; and the demodulated signals.

A recording may be larger than memory: it is read in a few dozen short looks spread over its length.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...fitting.least_squares import fit_columns
from ...fitting.samples.frequency import compute_even_power, find_peak
from ...records import Array, Recording
from ..text import format_number
from .drawing import (
    MUTED,
    SERIES,
    Plot,
    choose_time_unit,
    draw_dots,
    draw_legend,
    draw_line,
    make_panels,
    note,
    say_spread,
    set_labels,
    set_log_axis,
)

LOOKS, LOOK_SAMPLES = 48, 1 << 13
SPECTRUM_BINS = 700


@dataclass(frozen=True)
class RecordingLook:
    """One short stretch of a recording: times from the recording's start, both channels, sampling
    rate."""

    time_s: Array
    signal: Array
    rate_hz: float


def plot_recording(record: Recording, truth: bool) -> list[Plot]:
    """Every figure of a recording.

    Parameters
    ----------
    record
        The recording.
    truth
        Whether what a simulation knows is shown.

    Returns
    -------
    list of Plot
        Overview, orbit and spectrum, and what beside them is logged; empty of a few samples.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.reporting.figures.recording import plot_recording
    >>> c = np.cos(0.3 * np.arange(999))
    >>> record = Recording(c=c, s=0.1 * c, sample_rate_hz=1e4, mode="free")
    >>> len(plot_recording(record, truth=False))
    3
    """
    looks = _looks(record)
    if not looks:
        return []
    frequency = _frequency(looks)
    found = [
        _overview(record, looks),
        _orbit(record, looks, frequency),
        _spectrum(record, looks, frequency),
    ]
    log = _log(record)
    if log is not None:
        found.append(log)
    if truth and record.truth_time_s is not None and len(record.truth_time_s):
        found.append(_truth(record))
    return found


def _looks(record: Recording) -> list[RecordingLook]:
    n = len(record)
    if n < 16:
        return []
    size = min(LOOK_SAMPLES, n if n < 256 else n // 3)
    count = min(LOOKS, n // size)
    found = []
    for start in np.unique(np.linspace(0, n - size, count).astype(int)):
        start = int(start)
        time = record.times(start, start + size)
        signal = np.stack(record.physical(start, start + size))
        good = np.isfinite(time) & np.isfinite(signal).all(0)
        time, signal = time[good], signal[:, good]
        if len(time) < 16 or time[-1] <= time[0]:
            continue
        rate = record.sample_rate_hz or (len(time) - 1) / (time[-1] - time[0])
        if record.time_s is not None:
            even = np.linspace(time[0], time[-1], len(time))
            signal = np.stack([np.interp(even, time, channel) for channel in signal])
            time = even
        found.append(RecordingLook(time, signal, float(rate)))
    return found


def _frequency(looks: list[RecordingLook]) -> float:
    """The strongest line of the first looks [Hz]."""
    best = max(looks[:8], key=lambda look: float(np.var(look.signal)))
    return _strongest(best.signal, best.rate_hz)


def _strongest(signal: Array, rate_hz: float) -> float:
    """Frequency [Hz] of the highest line of both channels' spectrum; of less than a period none is
    told, and where there is no line, the lowest."""
    low_hz = rate_hz / signal.shape[1]
    found, _ = find_peak(*compute_even_power(signal, rate_hz), low_hz, rate_hz / 2)
    return found if np.isfinite(found) else low_hz


def _overview(record: Recording, looks: list[RecordingLook]) -> Plot:
    figure, axes = make_panels(2, 1, height=1.75, sharex=True)
    factor, unit = choose_time_unit(looks[-1].time_s[-1])
    pieces = max(1, 200 // len(looks))
    centre = (
        np.concatenate(
            [[part.mean() for part in np.array_split(look.time_s, pieces)] for look in looks]
        )
        * factor
    )
    said = []
    for i, (ax, channel, units) in enumerate(
        zip(axes[:, 0], "CS", (record.c_units, record.s_units))
    ):
        parts = [part for look in looks for part in np.array_split(look.signal[i], pieces)]
        low, high = (np.array([f(part) for part in parts]) for f in (np.min, np.max))
        ax.fill_between(centre, low, high, color=SERIES[i], alpha=0.35, lw=0)
        ax.plot(centre, low, color=SERIES[i], lw=0.8)
        ax.plot(centre, high, color=SERIES[i], lw=0.8)
        said.append(
            f"channel {channel} runs from {say_spread(np.concatenate([low, high]))}"
            f" {name_channel_unit(units)}"
        )
        set_labels(ax, y=f"{channel}, {name_channel_unit(units)}", title=f"Channel {channel}")
    axes[1, 0].set_xlabel(f"time, {unit}")
    note(
        axes[0, 0], f"lowest and highest, from {len(looks)} looks of {len(looks[0].time_s)} samples"
    )
    words = (
        f"Both channels over {format_number(looks[-1].time_s[-1] * factor)} {unit}:"
        f" {'; '.join(said)}."
    )
    return Plot("channels", "Channels against time", words, figure)


def name_channel_unit(units: str) -> str:
    """The channels' unit as an axis names it.

    Parameters
    ----------
    units
        Of the recording.

    Returns
    -------
    str
        "full scale" where the samples are parts of it.

    Examples
    --------
    >>> from hrg_cli.reporting.figures.recording import name_channel_unit
    >>> name_channel_unit("V"), name_channel_unit("1")
    ('V', 'full scale')
    """
    return "full scale" if units in ("", "1") else units


def _orbit(record: Recording, looks: list[RecordingLook], frequency: float) -> Plot:
    """A few periods of S against C at the start, the middle and the end."""
    figure, axes = make_panels(1, 3, height=2.85, sharey=True, sharex=True)
    factor, unit = choose_time_unit(looks[-1].time_s[-1])
    said = []
    reach = 1e-300
    for ax, look, i in zip(axes[0], (looks[0], looks[len(looks) // 2], looks[-1]), range(3)):
        a_period = look.rate_hz / frequency if frequency > 0 else 16.0
        samples = max(240, round(4 * a_period))
        middle = len(look.time_s) // 2
        part = look.signal[:, max(0, middle - samples // 2) : middle + samples // 2 + 1]
        draw_dots(ax, part[0], part[1], i, size=2.2, alpha=0.7)
        if a_period > 12:
            ax.plot(*part[:, :600], color=SERIES[i], lw=0.5, alpha=0.5)
        centred = part - part.mean(1, keepdims=True)
        values, vectors = np.linalg.eigh(centred @ centred.T / part.shape[1])
        angle = np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1])) % 180 / record.mode_number
        ratio = np.sqrt(max(values[0], 0.0) / values[1]) if values[1] > 0 else 0.0
        ax.set_aspect("equal", adjustable="box")
        set_labels(
            ax,
            x=f"C, {name_channel_unit(record.c_units)}",
            title=(
                f"at {format_number(look.time_s[middle] * factor, 3)} {unit}\nθ {angle:.1f}°,"
                f" axes 1 : {format_number(ratio, 2)}"
            ),
        )
        said.append(
            f"at {format_number(look.time_s[middle] * factor, 3)} {unit} the main axis lies at a"
            f" wave angle of {angle:.1f}° and the minor axis is {ratio:.2g} of it"
        )
        reach = max(reach, 1.08 * float(np.abs(part).max()))
    axes[0, 0].set_xlim(-reach, reach)
    axes[0, 0].set_ylim(-reach, reach)
    axes[0, 0].set_ylabel(f"S, {name_channel_unit(record.s_units)}")
    return Plot(
        "orbit",
        "Orbit: S against C",
        "A few periods of the orbit: " + "; ".join(said) + ".",
        figure,
    )


def _spectrum(record: Recording, looks: list[RecordingLook], frequency: float) -> Plot:
    lines = 2 if record.readout == "carrier" else 1
    size = min(len(look.time_s) for look in looks)
    rate = looks[0].rate_hz
    window = np.hanning(size + 2)[1:-1]
    scale = 2 / (rate * (window**2).sum())
    raw = np.zeros((2, size // 2 + 1))
    left = np.zeros_like(raw)
    for look in looks:
        signal = look.signal[:, :size] - look.signal[:, :size].mean(1, keepdims=True)
        residual = _without_lines(signal, rate, lines)
        raw += np.abs(np.fft.rfft(signal * window)) ** 2 * scale / len(looks)
        left += np.abs(np.fft.rfft(residual * window)) ** 2 * scale / len(looks)
    axis = np.fft.rfftfreq(size, 1 / rate)
    figure, axes = make_panels(2, 1, height=2.1, sharex=True)
    floor = np.sqrt(np.median(left[:, 1:], axis=1))
    for i, (ax, channel) in enumerate(zip(axes[:, 0], "CS")):
        x, top = thin_line(axis[1:], np.sqrt(raw[i, 1:]))
        ax.semilogy(x, top, color=SERIES[i], lw=1.0, label="raw")
        x, top = thin_line(axis[1:], np.sqrt(left[i, 1:]))
        ax.semilogy(x, top, color=MUTED, lw=0.8, label="residual of a local fit")
        set_log_axis(ax.yaxis)
        set_labels(
            ax,
            y=f"{channel}, {name_channel_unit(record.c_units if i == 0 else record.s_units)}/√Hz",
            title=f"Channel {channel}",
        )
        draw_legend(ax, above=True)
    axes[1, 0].set_xlabel("frequency, Hz")
    axes[1, 0].set_xlim(0, rate / 2)
    words = (
        f"Amplitude spectral density from 0 to {format_number(rate / 2)} Hz: the strongest line"
        f" is at {format_number(frequency, 7)} Hz; the median of the residual is"
        f" {format_number(floor[0], 3)} (C) and {format_number(floor[1], 3)} (S)"
        f" {name_channel_unit(record.c_units)}/√Hz."
    )
    return Plot("spectrum", "Raw spectrum with its residual", words, figure)


def _without_lines(signal: Array, rate: float, lines: int) -> Array:
    """What least squares of `lines` slowly changing lines (cos, sin, each times 1, t, t²)
    leaves."""
    tau = np.linspace(-1, 1, signal.shape[1])
    seconds = np.arange(signal.shape[1]) / rate
    residual = signal
    parts: list[Array] = [np.ones_like(tau)]
    for _ in range(lines):
        frequency = _strongest(residual, rate)
        turn = 2 * np.pi * frequency * seconds
        parts += [
            wave * power
            for wave in (np.cos(turn), np.sin(turn))
            for power in (np.ones_like(tau), tau, tau**2, tau**3)
        ]
        basis = np.stack(parts, 1)
        residual = signal - (basis @ fit_columns(basis, signal.T)).T
    return residual


def thin_line(x: Array, y: Array) -> tuple[Array, Array]:
    """A spectrum of fewer points, of which none that stands out is lost: the highest value of each
    bin.

    Parameters
    ----------
    x, y
        The spectrum (n,).

    Returns
    -------
    tuple of ndarray
        Middles of the bins, and their highest values.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.reporting.figures.recording import thin_line
    >>> y = np.full(100_000, 1e-6)
    >>> y[12_345] = 1.0
    >>> x, top = thin_line(np.arange(100_000.0), y)
    >>> len(top) < 5000, float(top.max())
    (True, 1.0)
    """
    size = max(1, -(-len(y) // SPECTRUM_BINS))
    starts = np.arange(0, len(y), size)
    top = np.maximum.reduceat(y, starts)
    return x[np.minimum(starts + size // 2, len(x) - 1)], np.maximum(top, np.finfo(float).tiny)


def _log(record: Recording) -> Plot | None:
    if record.auxiliary_time_s is None or not len(record.auxiliary_time_s):
        return None
    named = (
        ("temperature_degc", "temperature, °C", 1.0),
        ("rate_rad_s", "rate Ω, °/s", np.degrees(1.0)),
        ("drive_main", "main drive", 1.0),
        ("drive_quadrature", "quadrature drive", 1.0),
    )
    rows = [
        (name, label, factor) for name, label, factor in named if getattr(record, name) is not None
    ]
    if not rows:
        return None
    time = np.asarray(record.auxiliary_time_s)
    to_unit, unit = choose_time_unit(float(time[-1] - time[0]))
    figure, axes = make_panels(len(rows), 1, height=1.45, sharex=True)
    said = []
    for i, (ax, (name, label, factor)) in enumerate(zip(axes[:, 0], rows)):
        values = np.asarray(getattr(record, name)) * factor
        draw_line(ax, time * to_unit, values, i)
        set_labels(ax, y=label)
        said.append(f"{label} {say_spread(values)}")
    axes[-1, 0].set_xlabel(f"time, {unit}")
    return Plot("log", "Log beside the samples", "Auxiliary log: " + "; ".join(said) + ".", figure)


def _truth(record: Recording) -> Plot:
    assert record.truth_time_s is not None
    time = np.asarray(record.truth_time_s)
    to_unit, unit = choose_time_unit(float(time[-1] - time[0]))
    named = (
        ("truth_wave_angle_rad", "θ, °", np.degrees(1.0)),
        ("truth_main_amplitude", f"a_A, {name_channel_unit(record.c_units)}", 1.0),
        ("truth_quadrature_amplitude", f"a_B, {name_channel_unit(record.c_units)}", 1.0),
        ("truth_phase_rad", "φ, rad", 1.0),
    )
    rows = [
        (name, label, factor) for name, label, factor in named if getattr(record, name) is not None
    ]
    figure, axes = make_panels(len(rows), 1, height=1.4, sharex=True)
    said = []
    for ax, (name, label, factor) in zip(axes[:, 0], rows):
        values = np.asarray(getattr(record, name)) * factor
        draw_line(ax, time * to_unit, values, 3)
        set_labels(ax, y=label)
        said.append(f"{label} {say_spread(values)}")
    axes[-1, 0].set_xlabel(f"time, {unit}")
    return Plot("truth", "Truth of the simulation", "True values: " + "; ".join(said) + ".", figure)
