"""What a mistake on the bench did to one run, undone: every function takes a wave and gives it as
it should have been."""

from __future__ import annotations

from dataclasses import replace as replaced
from typing import Any

import numpy as np

from ....fitting.envelopes.envelope_runs import compute_envelopes, replace_envelopes
from ....records import Array, Wave
from ....units import ZERO_KELVIN_DEGC
from ...estimation.late_rate import read_log_later


def swap_channels(wave: Wave) -> Wave:
    """C and S exchanged: θ → π/2m − θ, the sense of rotation and the sign of a_B with it.

    Parameters
    ----------
    wave
        Of a run.

    Returns
    -------
    Wave
        As it would have been read.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import swap_channels
    >>> swapped = swap_channels(draw_waves()[0])
    >>> angles = (swapped.wave_angle_rad + draw_waves()[0].wave_angle_rad)[:2]
    >>> angles.round(6).tolist()
    [0.785398, 0.785398]
    """
    return _mirrored(_with_noise_swapped(wave), np.pi / (2 * wave.mode_number))


def invert_channel(wave: Wave) -> Wave:
    """One channel with the other sign: θ → −θ, a_B → −a_B.

    Which of the two is a common turn by π, which nobody sees.

    Parameters
    ----------
    wave
        Of a run.

    Returns
    -------
    Wave
        As it would have been read.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import invert_channel
    >>> inverted = invert_channel(draw_waves()[0])
    >>> bool((inverted.wave_angle_rad == -draw_waves()[0].wave_angle_rad).all())
    True
    """
    return _mirrored(_with_noise_inverted(wave), 0.0)


def swap_and_invert(wave: Wave) -> Wave:
    """Both mistakes: θ → θ + π/2m, the damping's and the stiffness's axes change places.

    Parameters
    ----------
    wave
        Of a run.

    Returns
    -------
    Wave
        As it would have been read.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import swap_and_invert
    >>> both = swap_and_invert(draw_waves()[0])
    >>> float((both.wave_angle_rad - draw_waves()[0].wave_angle_rad)[0].round(6))
    0.785398
    """
    return _with_noise_inverted(_with_noise_swapped(wave)).replace(
        wave_angle_rad=wave.wave_angle_rad + np.pi / (2 * wave.mode_number)
    )


def scale_channel(wave: Wave, ratio: complex) -> Wave:
    """C over S multiplied by a ratio: its size the gains', its argument what C leads S by.

    Each channel takes half of it, since which of them is wrong nobody sees.

    Parameters
    ----------
    wave
        Of a run.
    ratio
        By which C over S is multiplied.

    Returns
    -------
    Wave
        With its envelopes and the noise of its channels scaled.

    Examples
    --------
    A gain of C of 2 beside that of S turns a wave at 45° to arctan 1/2 of the envelopes' plane:

    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import scale_channel
    >>> wave = draw_waves()[0].replace(wave_angle_rad=np.full(50, np.pi / 8))
    >>> float(np.tan(2 * scale_channel(wave, 2.0).wave_angle_rad[0]).round(2))
    0.5
    """
    half = np.sqrt(complex(ratio))
    scaled = replace_envelopes(wave, compute_envelopes(wave) * [half, 1 / half])
    if wave.channel_std is None:
        return scaled
    gain = abs(half)
    return scaled.replace(channel_std=np.asarray(wave.channel_std, float) * [gain, 1 / gain])


def invert_quadrature_drive(wave: Wave) -> Wave:
    """The logged command against quadrature with the other sign.

    Parameters
    ----------
    wave
        Of a run.

    Returns
    -------
    Wave
        The same where none is logged.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import invert_quadrature_drive
    >>> free = draw_waves()[0]
    >>> invert_quadrature_drive(free) is free
    True
    """
    if wave.drive_quadrature is None:
        return wave
    return wave.replace(drive_quadrature=-np.asarray(wave.drive_quadrature, float))


def _mirrored(wave: Wave, about_rad: float) -> Wave:
    return wave.replace(
        wave_angle_rad=about_rad - wave.wave_angle_rad,
        quadrature_amplitude=-wave.quadrature_amplitude,
    )


def _with_noise_swapped(wave: Wave) -> Wave:
    """The noise of C for that of S."""
    if wave.channel_std is None:
        return wave
    return wave.replace(channel_std=np.asarray(wave.channel_std, float)[:, ::-1])


def _with_noise_inverted(wave: Wave) -> Wave:
    """What the channels' noise has in common with the other sign."""
    common = wave.noise_correlation
    return wave if common is None else wave.replace(noise_correlation=-common)


def scale_times(wave: Wave, factor: float) -> Wave:
    """All times multiplied; every frequency divided.

    Parameters
    ----------
    wave
        Of a run.
    factor
        By which.

    Returns
    -------
    Wave
        On the other clock.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import scale_times
    >>> slow = scale_times(draw_waves()[0], 2.0)
    >>> slow.reference_frequency_hz / draw_waves()[0].reference_frequency_hz, slow.window_s
    (0.5, 0.04)
    """
    hz = (
        None
        if wave.spectrum_frequency_hz is None
        else np.asarray(wave.spectrum_frequency_hz, float) / factor
    )
    lines = (
        None
        if wave.spectrum_line_frequency_hz is None
        else np.asarray(wave.spectrum_line_frequency_hz, float) / factor
    )
    return wave.replace(
        time_s=np.asarray(wave.time_s, float) * factor,
        window_s=wave.window_s * factor,
        reference_frequency_hz=wave.reference_frequency_hz / factor,
        frequency_hz=np.asarray(wave.frequency_hz, float) / factor,
        spectrum_frequency_hz=hz,
        spectrum_line_frequency_hz=lines,
    )


LOGS = ("rate_rad_s", "temperature_degc", "drive_main", "drive_quadrature")
"""Columns that a slower recorder with a clock of its own may have written."""


def scale_times_of_samples(wave: Wave, factor: float) -> Wave:
    """The wave with its own times multiplied, the logs beside it on the clock that they had.

    Parameters
    ----------
    wave
        Of a run.
    factor
        By which.

    Returns
    -------
    Wave
        Without the rows that no log reaches.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import scale_times_of_samples
    >>> len(scale_times_of_samples(draw_waves()[1], 1.25))
    40
    """
    scaled = scale_times(wave, factor)
    logged, time = np.asarray(wave.time_s, float), np.asarray(scaled.time_s, float)
    known = int(np.count_nonzero(time <= logged[-1]))
    names = [name for name in LOGS if getattr(wave, name) is not None]
    # a row was given what the log says at its wrong time: of the right time another row has it
    moved = {
        name: np.interp(time, logged, np.asarray(getattr(wave, name), float)) for name in names
    }
    return scaled.replace(**moved).rows(0, known)


def undo_damping(wave: Wave, less_1_s: float) -> Wave:
    """The wave as it would have been with a smaller damping rate: everything times e^{Δν t}.

    Parameters
    ----------
    wave
        Of a run.
    less_1_s
        Δν [1/s].

    Returns
    -------
    Wave
        With its noise larger where it is.

    Examples
    --------
    A run-down by 0.5 1/s without that:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import undo_damping
    >>> wave = undo_damping(draw_waves()[0], 0.5)
    >>> bool(abs(wave.main_amplitude[-1] / wave.main_amplitude[0] - 1) < 0.01)
    True
    """
    growth = np.exp(less_1_s * (np.asarray(wave.time_s, float) - float(wave.time_s[0])))
    names = (
        "main_amplitude",
        "quadrature_amplitude",
        "main_amplitude_std",
        "quadrature_amplitude_std",
        "signal_std",
    )
    # of the channels' own σ the ratio counts, which stays as it is
    return replaced(wave, **{name: getattr(wave, name) * growth for name in names})


def scale_rate(wave: Wave, factor: float) -> Wave:
    """The logged rate multiplied.

    Parameters
    ----------
    wave
        Of a run.
    factor
        By which.

    Returns
    -------
    Wave
        With another log.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import scale_rate
    >>> float(scale_rate(draw_waves()[1], -1.0).rate_rad_s[0].round(6))
    -1.0
    """
    assert wave.rate_rad_s is not None
    return wave.replace(rate_rad_s=factor * np.asarray(wave.rate_rad_s, float))


def hold_rate(wave: Wave, rate_rad_s: float) -> Wave:
    """A constant rate in place of the log.

    Parameters
    ----------
    wave
        Of a run.
    rate_rad_s
        Ω [rad/s].

    Returns
    -------
    Wave
        With another log.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import hold_rate
    >>> float(hold_rate(draw_waves()[1], 0.5).rate_rad_s[0])
    0.5
    """
    return wave.replace(rate_rad_s=np.full(len(wave), rate_rad_s))


def offset_rate(wave: Wave, more_rad_s: float) -> Wave:
    """The logged rate with a constant added.

    Parameters
    ----------
    wave
        Of a run.
    more_rad_s
        [rad/s]

    Returns
    -------
    Wave
        With another log.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import offset_rate
    >>> float(offset_rate(draw_waves()[1], 0.5).rate_rad_s[0].round(6))
    1.5
    """
    assert wave.rate_rad_s is not None
    return wave.replace(rate_rad_s=np.asarray(wave.rate_rad_s, float) + more_rad_s)


def advance_rate(wave: Wave, late_s: float) -> Wave:
    """The rate log moved forward by the time it came late; its first and last value held.

    Parameters
    ----------
    wave
        Of a run.
    late_s
        That time [s].

    Returns
    -------
    Wave
        With another log.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import advance_rate
    >>> rising = draw_waves()[0].replace(rate_rad_s=draw_waves()[0].time_s[:])
    >>> float((advance_rate(rising, 0.1).rate_rad_s - rising.rate_rad_s)[20].round(6))
    0.1
    """
    return wave.replace(rate_rad_s=_advance(wave, wave.rate_rad_s, late_s))


def advance_rate_within_log(wave: Wave, late_s: float, least_s: float, most_s: float) -> Wave:
    """The rate log moved forward by the time it came late, without the rows that it does not reach.

    Parameters
    ----------
    wave
        Of a run.
    late_s
        That time [s].
    least_s, most_s
        Any time by which it may have come late [s].

    Returns
    -------
    Wave
        Of the rows that the log reaches whichever it was.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import advance_rate_within_log
    >>> len(advance_rate_within_log(draw_waves()[1], 0.0, -0.09, 0.09))
    40
    """
    time = np.asarray(wave.time_s, float)
    reached = (time + least_s >= time[0]) & (time + most_s <= time[-1])
    held = np.flatnonzero(reached)
    return advance_rate(wave, late_s).rows(int(held[0]), int(held[-1]) + 1)


def _advance(wave: Wave, log: Any, late_s: float) -> Array:
    """A log read later, its first and last value held, holes bridged."""
    time, values = np.asarray(wave.time_s, float), np.asarray(log, float)
    moved = read_log_later(time, values, late_s)
    known = np.isfinite(values)
    bridged = np.interp(time + late_s, time[known], values[known])
    return np.where(np.isfinite(moved), moved, bridged)


COMMANDS = ("drive_main", "drive_quadrature")


def scale_drive(wave: Wave, factor: float) -> Wave:
    """The logged commands multiplied.

    Parameters
    ----------
    wave
        Of a run.
    factor
        By which.

    Returns
    -------
    Wave
        With other logs.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import scale_drive
    >>> driven = draw_waves()[0].replace(drive_main=draw_waves()[0].time_s[:])
    >>> scale_drive(driven, 2.0).drive_main[9] / driven.drive_main[9]
    np.float64(2.0)
    """
    return wave.replace(**{name: factor * values for name, values in _commands(wave).items()})


def advance_drive(wave: Wave, late_s: float) -> Wave:
    """The commands' log moved forward by the time it came late; first and last values held.

    Parameters
    ----------
    wave
        Of a run.
    late_s
        That time [s].

    Returns
    -------
    Wave
        With other logs.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import advance_drive
    >>> driven = draw_waves()[0].replace(drive_main=draw_waves()[0].time_s[:])
    >>> float((advance_drive(driven, 0.1).drive_main - driven.drive_main)[20].round(6))
    0.1
    """
    commands = _commands(wave).items()
    return wave.replace(**{name: _advance(wave, values, late_s) for name, values in commands})


def _commands(wave: Wave) -> dict[str, Any]:
    logs = {name: getattr(wave, name) for name in COMMANDS}
    return {name: np.asarray(log, float) for name, log in logs.items() if log is not None}


def from_kelvin(wave: Wave) -> Wave:
    """A temperature log in kelvin as °C.

    Parameters
    ----------
    wave
        Of a run.

    Returns
    -------
    Wave
        With another log.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import from_kelvin
    >>> warm = draw_waves()[0].replace(temperature_degc=np.full(50, 300.0))
    >>> float(from_kelvin(warm).temperature_degc[0].round(6))
    26.85
    """
    return _warmed(wave, lambda t: t + ZERO_KELVIN_DEGC)


def from_fahrenheit(wave: Wave) -> Wave:
    """A temperature log in °F as °C.

    Parameters
    ----------
    wave
        Of a run.

    Returns
    -------
    Wave
        With another log.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import from_fahrenheit
    >>> warm = draw_waves()[0].replace(temperature_degc=np.full(50, 68.0))
    >>> float(from_fahrenheit(warm).temperature_degc[0].round(6))
    20.0
    """
    return _warmed(wave, lambda t: (t - 32) / 1.8)


def _warmed(wave: Wave, change: object) -> Wave:
    assert callable(change)
    return wave.replace(temperature_degc=change(np.asarray(wave.temperature_degc, float)))


def undo_lag(wave: Wave, lag_s: float) -> Wave:
    """The temperature that a thermometer with a lag of first order has shown: T + τ dT/dt.

    The log is smoothed before it is differentiated.

    Parameters
    ----------
    wave
        Of a run.
    lag_s
        τ [s].

    Returns
    -------
    Wave
        With another log.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import undo_lag
    >>> ramp = draw_waves()[0].replace(temperature_degc=20 + 3 * draw_waves()[0].time_s[:])
    >>> float((undo_lag(ramp, 0.5).temperature_degc - ramp.temperature_degc)[20].round(6))
    1.5
    """
    time, warm = np.asarray(wave.time_s, float), np.asarray(wave.temperature_degc, float)
    x = (time - time.mean()) / np.ptp(time)
    fit = np.polynomial.polynomial.Polynomial.fit(x, warm, min(7, max(1, len(x) // 16)))
    return wave.replace(temperature_degc=warm + lag_s * fit.deriv()(x) / np.ptp(time))


def cut_rows(wave: Wave, before: int, after: int) -> tuple[Wave, Wave]:
    """A run cut in two, each a run of its own.

    Parameters
    ----------
    wave
        Of a run.
    before, after
        Last row of the first, first row of the second.

    Returns
    -------
    tuple of Wave
        Named "RUN before" and "RUN after".

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import cut_rows
    >>> [len(part) for part in cut_rows(draw_waves()[0], 9, 12)]
    [10, 38]
    """
    first, last = wave.rows(0, before + 1), wave.rows(after, len(wave))
    return first.replace(run_id=f"{wave.run_id} before"), last.replace(
        run_id=f"{wave.run_id} after"
    )
