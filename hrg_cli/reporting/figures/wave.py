"""First look at a wave: θ, a_A, a_B, φ against time, and its rates against everything that might
drive them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...fitting.least_squares import fit_columns
from ...records import Array, Recording, Wave
from ...units import DEGREE_PER_HOUR
from ..text import format_number
from .drawing import (
    INK,
    SERIES,
    Plot,
    choose_time_unit,
    draw_legend,
    draw_line,
    draw_scatter_with_mean,
    make_panels,
    note,
    say_spread,
    set_labels,
    thin_envelope,
)
from .periods import plot_residual_spectrum

INCREMENTS = 900
"""Increments a run is cut into for its rates."""


@dataclass(frozen=True)
class Rates:
    """Mean rates of change over increments of a run, with what the wave was like meanwhile."""

    time_s: Array
    wave_angle_rad: Array
    main_amplitude: Array
    temperature_degc: Array | None
    rate_rad_s: Array | None
    precession_rad_s: Array
    decay_1_s: Array
    quadrature_1_s: Array


def plot_wave(record: Wave, truth: Recording | None, spectrum: bool = True) -> list[Plot]:
    """Every figure of a wave.

    Parameters
    ----------
    record
        The wave.
    truth
        The simulated recording of its run, where it may be shown; None: not.
    spectrum
        Whether the residual's spectrum is asked for.

    Returns
    -------
    list of Plot
        Its course, the increments of angle and phase, and the spectrum; empty of no windows.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording, collect, demodulate, estimate
    >>> from hrg_cli.reporting.figures.wave import plot_wave
    >>> t = np.arange(8000) / 8000
    >>> noise = 1e-4 * np.random.default_rng(0).standard_normal((2, 8000))
    >>> c, s = np.cos(2 * np.pi * 1000 * t) + noise
    >>> made = collect(
    ...     demodulate(Recording(c=c, s=s, sample_rate_hz=8e3, mode="free"), periods_per_window=20)
    ... )
    >>> len(plot_wave(collect(estimate(made)), None))
    3
    """
    if not len(record):
        return []
    found = [_course(record, truth)]
    rates = _compute_increments(record)
    if rates is not None:
        found.append(_rates(record, rates))
    if (
        spectrum
        and record.spectrum_frequency_hz is not None
        and record.spectrum_density is not None
        and len(record.spectrum_frequency_hz)
    ):
        found.append(plot_residual_spectrum(record))
    return found


def _rows_of_course(record: Wave) -> list[tuple[str, str, float, str]]:
    """Column, axis label, factor from SI and title of every row of the course."""
    amplitude = "full scale" if record.units in ("", "1") else record.units
    reference = f"{format_number(record.reference_frequency_hz, 8)} Hz"
    rows = [
        ("wave_angle_rad", "θ, °", float(np.degrees(1.0)), "Wave angle θ"),
        ("main_amplitude", f"a_A, {amplitude}", 1.0, "Main amplitude a_A"),
        ("quadrature_amplitude", f"a_B, {amplitude}", 1.0, "Quadrature amplitude a_B"),
        ("phase_rad", "φ, rad", 1.0, f"Phase φ against {reference}"),
    ]
    if record.readout == "carrier":
        rows.append(("carrier_phase_rad", "ψ, rad", 1.0, "Carrier phase ψ"))
    if record.temperature_degc is not None:
        rows.append(("temperature_degc", "T, °C", 1.0, "Temperature"))
    if record.rate_rad_s is not None:
        rows.append(("rate_rad_s", "Ω, °/s", float(np.degrees(1.0)), "Rate Ω"))
    return rows


def _draw_truth(
    ax: Any, record: Wave, truth: Recording, name: str, values: Array, scale: float
) -> bool:
    """The simulated value beside the estimates, on the branch of theirs; False where none is
    known."""
    expected = getattr(truth, f"truth_{name}", None)
    if expected is None or truth.truth_time_s is None:
        return False
    time, at = np.asarray(record.time_s[:]), np.asarray(truth.truth_time_s)
    factor, _ = choose_time_unit(float(time[-1] - time[0]))
    shift = _branch(record, name, values, time, at, np.asarray(expected) * scale, scale)
    ax.plot(
        *thin_envelope(at * factor, np.asarray(expected) * scale + shift),
        color=INK,
        lw=1.2,
        ls=(0, (3, 4)),
        label="truth",
    )
    return True


def _course(record: Wave, truth: Recording | None) -> Plot:
    time = np.asarray(record.time_s[:])
    good = record.good()
    factor, unit = choose_time_unit(float(time[-1] - time[0]))
    rows = _rows_of_course(record)
    figure, axes = make_panels(len(rows), 1, height=1.35, sharex=True)
    said = []
    for k, (ax, (name, label, scale, title)) in enumerate(zip(axes[:, 0], rows)):
        values = np.where(good, np.asarray(getattr(record, name)[:], dtype=float), np.nan) * scale
        draw_line(ax, time * factor, values, k, "estimate")
        deviation = getattr(record, f"{name}_std", None)
        if deviation is not None and np.isfinite(deviation[:]).any():
            unit_of = label.partition(", ")[2]
            usual = format_number(float(np.nanmedian(deviation[:])) * scale, 2)
            note(ax, f"median σ {usual}{'' if unit_of == '°' else ' '}{unit_of}")
        if truth is not None and _draw_truth(ax, record, truth, name, values, scale) and k == 0:
            draw_legend(ax, above=True, bbox_to_anchor=(0.8, 1.0))
        set_labels(ax, y=label, title=title)
        said.append(f"{title} {say_spread(values)} {label.partition(', ')[2]}")
    axes[-1, 0].set_xlabel(f"time, {unit}")
    bad = int(len(time) - good.sum())
    words = (
        f"Run over {format_number((time[-1] - time[0]) * factor)} {unit}, {len(time)} windows of"
        f" which {bad} are flagged or failed: " + "; ".join(said) + "."
    )
    return Plot("wave", "Wave against time: θ, a_A, a_B, φ", words, figure)


def _branch(
    record: Wave,
    name: str,
    values: Array,
    time: Array,
    truth_time: Array,
    truth: Array,
    scale: float,
) -> float:
    """Whole turns between an unwrapped angle and its truth (θ is known modulo π/m, φ modulo π)."""
    turn = {"wave_angle_rad": np.pi / record.mode_number, "phase_rad": np.pi}.get(name)
    finite = np.flatnonzero(np.isfinite(values))
    if turn is None or not len(finite):
        return 0.0
    middle = finite[len(finite) // 2]
    return float(
        np.round((values[middle] - np.interp(time[middle], truth_time, truth)) / (turn * scale))
        * turn
        * scale
    )


def _compute_increments(record: Wave) -> Rates | None:
    """Rates over increments of a run: differences of the means of neighbouring blocks, only where
    windows are good."""
    good = record.good()
    time = np.asarray(record.time_s[:])[good]
    if len(time) < 16:
        return None
    size = max(1, len(time) // INCREMENTS)
    count = len(time) // size

    def mean(values: Any) -> Array:
        return np.asarray(values[:], dtype=float)[good][: count * size].reshape(count, size).mean(1)

    at = time[: count * size].reshape(count, size).mean(1)
    step = np.diff(at)
    whole = (step > 0) & (step < 1.5 * np.median(step))

    def middle(values: Array) -> Array:
        return ((values[1:] + values[:-1]) / 2)[whole]

    def slope(values: Array) -> Array:
        return (np.diff(values) / np.where(step > 0, step, 1))[whole]

    angle, main = mean(record.wave_angle_rad), np.maximum(mean(record.main_amplitude), 1e-300)
    return Rates(
        middle(at),
        middle(angle),
        middle(main),
        None if record.temperature_degc is None else middle(mean(record.temperature_degc)),
        None if record.rate_rad_s is None else middle(mean(record.rate_rad_s)),
        record.mode_number * slope(angle),
        -slope(np.log(main)),
        slope(mean(record.quadrature_amplitude) / main),
    )


def _remove_constants(rates: Rates) -> tuple[Array, str]:
    """m·dθ/dt less a constant drift and, where the rate turns enough, a constant scale factor times
    it; and what was taken out in words."""
    y = rates.precession_rad_s
    columns = [np.ones_like(y)]
    turning = (
        rates.rate_rad_s is not None
        and np.isfinite(rates.rate_rad_s).all()
        and np.ptp(rates.rate_rad_s) > 1e-3 * np.abs(rates.rate_rad_s).max()
    )
    if turning and rates.rate_rad_s is not None:
        columns.append(rates.rate_rad_s)
    basis = np.stack(columns, 1)
    solution = fit_columns(basis, y)
    said = (
        f"mean {format_number(solution[0] / DEGREE_PER_HOUR)} °/h"
        if not turning
        else (
            f"K = {format_number(-solution[1], 5)} and a drift of"
            f" {format_number(solution[0] / DEGREE_PER_HOUR)} °/h"
        )
    )
    return y - basis @ solution, said


def _abscissae_of_rates(record: Wave, rates: Rates) -> list[tuple[str, Array]]:
    """(label, values) of all that the wave's rates may follow."""
    period = np.pi / record.mode_number
    factor, unit = choose_time_unit(float(rates.time_s[-1] - rates.time_s[0]))
    amplitude_unit = "full scale" if record.units in ("", "1") else record.units
    against = [
        (
            f"θ modulo {format_number(np.degrees(period), 3)}°",
            np.degrees(rates.wave_angle_rad % period),
        ),
        (f"time, {unit}", rates.time_s * factor),
        (f"a_A, {amplitude_unit}", rates.main_amplitude),
    ]
    if rates.temperature_degc is not None and np.ptp(rates.temperature_degc) > 0:
        against.append(("T, °C", rates.temperature_degc))
    return against


def _rates(record: Wave, rates: Rates) -> Plot:
    left, constants = _remove_constants(rates)
    against = _abscissae_of_rates(record, rates)
    decay = rates.decay_1_s - rates.decay_1_s.mean()
    rows = (
        ("m·dθ/dt, °/h", left / DEGREE_PER_HOUR, f"less {constants}"),
        ("−d ln a_A/dt, 1/s", decay, f"less {format_number(rates.decay_1_s.mean())} 1/s"),
        ("d(a_B/a_A)/dt, 1/s", rates.quadrature_1_s, ""),
    )
    figure, axes = make_panels(3, len(against), height=1.8, width=8.2, sharex="col", sharey="row")
    for i, (label, y, taken) in enumerate(rows):
        low, high = np.nanpercentile(y, [0.5, 99.5])
        for j, (_, x) in enumerate(against):
            draw_scatter_with_mean(axes[i, j], x, y, i)
            axes[i, j].axhline(0, color=INK, lw=0.5)
        if high > low:
            axes[i, 0].set_ylim(low - 0.08 * (high - low), high + 0.08 * (high - low))
        axes[i, 0].set_ylabel(label)
        if taken:
            axes[i, 0].set_title(taken, fontsize=8, fontweight="normal", color=SERIES[i])
    for j, (label, _) in enumerate(against):
        axes[-1, j].set_xlabel(label)
    scatter = float(np.std(left)) / DEGREE_PER_HOUR
    words = (
        f"Rates over {len(left)} increments. Precession m·dθ/dt less {constants} scatters by"
        f" {format_number(scatter)} °/h rms; the decay rate is"
        f" {format_number(rates.decay_1_s.mean())} 1/s and scatters by"
        f" {format_number(float(np.std(decay)))} 1/s; the quadrature ratio moves by"
        f" {format_number(float(np.mean(rates.quadrature_1_s)))} 1/s on average."
    )
    return Plot(
        "rates",
        "What constants leave of the wave's rates, against θ, time, amplitude and temperature",
        words,
        figure,
    )
