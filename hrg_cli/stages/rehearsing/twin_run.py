"""One run of a twin: the measured run's start, length, sampling, logs, loops and noise as a table
of the simulation file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...errors import HrgError
from ...fitting.envelopes import free_windows
from ...physics import ellipse
from ...physics.resonator import Mechanics, build_generator, exponentiate
from ...records import Wave
from ..run_tables import (
    compute_sample_noise,
    describe_loops,
    make_rate_course,
    make_temperature_course,
)
from . import twin_mode
from .channel_shares import split_noise
from .twin_colour import Colour

Array = np.ndarray
SAMPLES_A_PERIOD = 8
"""Samples a period where the recording is not at hand."""
SLOWEST_SAMPLING = 2.5
"""Samples a period of which a recording must have more to be imitated; fewer are aliased."""
LOG_POINTS = 20_000
"""Rows of a log that the twin's course keeps at most."""
COURSE_POINTS = 24
"""Stretches of a run over which the course of its frequency is averaged."""
FLOAT32 = 1e-5
"""Noise over amplitude from which 32-bit samples lose nothing: their rounding is 3e-8."""
CARRIED = ("run_id", "gyro_id", "lot_id", "start_time", "mode")
"""What a run is called and how it is said to have been driven: a twin's wave has it from the
measured one."""
LOGS = ("temperature_degc", "rate_rad_s", "drive_main", "drive_quadrature")


@dataclass(frozen=True)
class Measured:
    """One input of the result: its wave, and what is known of the files before it."""

    wave: Wave
    sample_rate_hz: float | None = None
    carrier_hz: float | None = None
    demodulate: Mapping[str, Any] = field(default_factory=dict)
    estimate: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class TwinRun:
    """One run of the twin: its name in the simulation file, the settings of its chain, what its
    wave is called and which logs it keeps; its noise's colour with the windows it was measured in
    (σ of one real, length), and the course of its frequency where tables are over that."""

    name: str
    demodulate: Mapping[str, Any]
    estimate: Mapping[str, Any]
    carried: Mapping[str, Any]
    missing: tuple[str, ...]
    colour: Colour = ()
    std: float = 0.0
    window_s: float = 1.0
    frequency: tuple[Array, Array] | None = None
    """Times (k,) and frequencies (k,), Hz."""
    silent: bool = False
    """The second channel held nothing."""
    channels: tuple[float, tuple[float, float]] = (1.0, (0.0, 0.0))
    """How its channels share the noise, as `split_noise` says it."""


def imitate_run(
    name: str,
    measured: Measured,
    device: Mechanics,
    hidden_rad_s: float,
    settings: Mapping[str, Any],
    samples_a_period: float | None,
) -> tuple[TwinRun, dict[str, Any]]:
    """One run and its table: from its first good window's beginning to its last one's end.

    Parameters
    ----------
    name
        Of the run in the simulation file.
    measured
        The run.
    device
        The twin's resonator, by which the start is traced back half a window.
    hidden_rad_s
        Rate that no log holds [rad/s].
    settings
        Of the stage that gave the result; a constant rate there stands for the log.
    samples_a_period
        Of the simulated recording; None: the measured one's own sampling.

    Returns
    -------
    tuple
        The twin's run, and its table of the simulation file.

    Raises
    ------
    HrgError
        Fewer than two windows without a flag.

    Examples
    --------
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> from hrg_cli.stages.rehearsing.drawn_input import draw_input
    >>> from hrg_cli.stages.rehearsing.twin_run import imitate_run
    >>> run, table = imitate_run("a", draw_input(), Mechanics(500.0, 0.5), 0.0, {}, None)
    >>> table["recording"], round(table["start"]["amplitude"], 3)
    ({'sample_rate_hz': 2000.0, 'duration_s': 1.0, 'samples': 'float32'}, 1.0)
    """
    wave = measured.wave
    good = np.flatnonzero(wave.good())
    if len(good) < 2:
        raise HrgError(
            f"{wave.run_id or 'a run'}: has fewer than two windows without a flag; there is nothing"
            " to rehearse"
        )
    first, last = int(good[0]), int(good[-1])
    begin = float(wave.time_s[first]) - wave.window_s / 2
    length = float(wave.time_s[last]) - begin + wave.window_s / 2
    rate, missing = _read_rate(wave, settings)
    first_rate = 0.0 if rate is None else float(np.nan_to_num(rate[first]))
    carrier = measured.carrier_hz if wave.readout == "carrier" else None
    sampling = choose_sample_rate(measured, device.frequency_hz, carrier or 0.0, samples_a_period)
    # noise far above the rounding of single precision hides it, and halves the file
    amplitude = float(np.median(wave.main_amplitude[good]))
    coarse = compute_sample_noise(wave, 1.0) > FLOAT32 * amplitude
    table: dict[str, Any] = {
        "run_id": name,
        "start": _trace_back_start(wave, first, device, first_rate + hidden_rad_s),
        "environment": _write_environment(wave, begin, length, rate, hidden_rad_s),
        "readout": {
            "noise": compute_sample_noise(wave, sampling),
            "units": wave.units,
            **write_carrier(carrier),
        },
        "recording": {
            "sample_rate_hz": sampling,
            "duration_s": length,
            "samples": "float32" if coarse else "float64",
        },
    }
    control = _read_loops(wave, begin, device.damping_rate_1_s)
    if control is not None:
        table["control"] = control
    return _name_twin(name, measured, device.frequency_hz, missing), table


def _name_twin(
    name: str, measured: Measured, frequency_hz: float, missing: tuple[str, ...]
) -> TwinRun:
    """How the simulated run is made a wave of, and what it is called; missing: columns that the
    measured one did not have and that simulation writes."""
    wave = measured.wave
    carried, absent = name_run(wave)
    return TwinRun(
        name,
        _keep_windows(measured, frequency_hz),
        measured.estimate,
        carried,
        absent + missing,
        std=float(np.nanmedian(wave.signal_std)),
        silent=twin_mode.has_one_signal(wave),
        window_s=wave.window_s,
        channels=split_noise(wave),
    )


def _write_environment(
    wave: Wave, begin_s: float, length_s: float, rate: Array | None, hidden_rad_s: float
) -> dict[str, Any]:
    """The run's rate (n,) and temperature as courses of the simulation file, and what its log
    leaves out of the rate."""
    times = np.asarray(wave.time_s, float) - begin_s
    kept = slice(None, None, max(1, len(times) // LOG_POINTS))
    environment = make_rate_course(times[kept], None if rate is None else rate[kept], length_s)
    if wave.temperature_degc is not None:
        temperature = np.asarray(wave.temperature_degc, float)
        environment |= make_temperature_course(times[kept], temperature[kept])
    if hidden_rad_s:
        environment |= {"earth_rate_rad_s": hidden_rad_s, "earth_logged": False}
    return environment


def _keep_windows(measured: Measured, frequency_hz: float) -> dict[str, Any]:
    """The measured run's settings of demodulate: the part that was cut out is the whole of the
    twin's recording, and its frequency is known."""
    kept = {
        key: value
        for key, value in measured.demodulate.items()
        if key not in ("from_s", "to_s", "nominal_frequency_hz")
    }
    kept.setdefault("periods_per_window", max(1.0, measured.wave.window_s * frequency_hz))
    return kept


def name_run(wave: Wave) -> tuple[dict[str, Any], tuple[str, ...]]:
    """What a run is called, and the logs it lacks.

    Parameters
    ----------
    wave
        The measured run.

    Returns
    -------
    tuple
        Attributes that a twin's wave has from it, and the names of the logs that it lacks.

    Examples
    --------
    >>> from hrg_cli.stages.rehearsing.drawn_input import draw_input
    >>> from hrg_cli.stages.rehearsing.twin_run import name_run
    >>> carried, missing = name_run(draw_input().wave)
    >>> carried["mode"], missing
    ('free', ('drive_main', 'drive_quadrature'))
    """
    missing = tuple(key for key in LOGS if getattr(wave, key) is None)
    return {key: getattr(wave, key) for key in CARRIED}, missing


def average_frequency(wave: Wave) -> tuple[Array, Array]:
    """A run's frequency without its windows' noise: means of `COURSE_POINTS` stretches.

    Parameters
    ----------
    wave
        The measured run.

    Returns
    -------
    tuple of ndarray
        Times (k,) [s] from the run's beginning, and frequencies (k,) [Hz].

    Examples
    --------
    >>> from hrg_cli.stages.rehearsing.drawn_input import draw_input
    >>> from hrg_cli.stages.rehearsing.twin_run import average_frequency
    >>> times, frequency = average_frequency(draw_input().wave)
    >>> len(times), float(frequency.mean().round(1))
    (24, 500.0)
    """
    good = np.flatnonzero(wave.good() & np.isfinite(wave.frequency_hz))
    begin = float(wave.time_s[int(np.flatnonzero(wave.good())[0])]) - wave.window_s / 2
    parts = [p for p in np.array_split(good, min(COURSE_POINTS, len(good))) if len(p)]
    times = np.array([float(np.mean(np.asarray(wave.time_s)[p])) for p in parts]) - begin
    return times, np.array([float(np.mean(np.asarray(wave.frequency_hz)[p])) for p in parts])


def _read_rate(wave: Wave, settings: Mapping[str, Any]) -> tuple[Array | None, tuple[str, ...]]:
    """The run's rate (n,): a constant of the settings where they give one, else its log; and the
    logs that its wave is to lack then."""
    rows = len(wave)
    of_run = (settings.get("rates_rad_s") or {}).get(wave.run_id)
    constant = of_run if of_run is not None else settings.get("rate_rad_s")
    if constant is not None:
        return np.full(rows, float(constant)), (
            () if wave.rate_rad_s is not None else ("rate_rad_s",)
        )
    return (None, ()) if wave.rate_rad_s is None else (np.asarray(wave.rate_rad_s, float), ())


def choose_sample_rate(
    measured: Measured, frequency_hz: float, carrier_hz: float, samples_a_period: float | None
) -> float:
    """Sampling rate of the twin: as asked for, else the recording's own where it resolves the
    signal.

    Else `SAMPLES_A_PERIOD` times the highest frequency.

    Parameters
    ----------
    measured
        The run, with the sampling rate of its recording where that is known.
    frequency_hz, carrier_hz
        Of the oscillation, and of the carrier or 0 [Hz].
    samples_a_period
        As asked for; None: nothing was.

    Returns
    -------
    float
        Sampling rate [Hz].

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.rehearsing.twin_run import choose_sample_rate
    >>> choose_sample_rate(Told(sample_rate_hz=20_000.0), 5000.0, 0.0, None)
    20000.0
    >>> choose_sample_rate(Told(sample_rate_hz=None), 5000.0, 0.0, None)
    40000.0
    """
    highest = frequency_hz + carrier_hz
    own = measured.sample_rate_hz
    if samples_a_period is None and own is not None and own > SLOWEST_SAMPLING * highest:
        return float(own)
    return float(np.ceil((samples_a_period or SAMPLES_A_PERIOD) * highest))


def write_carrier(carrier_hz: float | None) -> dict[str, Any]:
    """The part of [readout] that a carrier needs.

    Parameters
    ----------
    carrier_hz
        Of the carrier [Hz]; None: the channels are read directly.

    Returns
    -------
    dict
        Keys of the table; empty without one.

    Examples
    --------
    >>> from hrg_cli.stages.rehearsing.twin_run import write_carrier
    >>> write_carrier(50_000.0), write_carrier(None)
    ({'kind': 'carrier', 'carrier_hz': 50000.0}, {})
    """
    return {} if carrier_hz is None else {"kind": "carrier", "carrier_hz": float(carrier_hz)}


def _trace_back_start(
    wave: Wave, row: int, device: Mechanics, rate_rad_s: float
) -> dict[str, float]:
    """The wave of a row, integrated back by half a window with the device's own generator."""
    columns = (wave.main_amplitude, wave.quadrature_amplitude, wave.wave_angle_rad, wave.phase_rad)
    main, quadrature, wave_angle, wave_phase = (
        np.asarray(column[row], float) for column in columns
    )
    u = ellipse.compute_envelopes(main, quadrature, wave_angle, wave_phase, wave.mode_number)
    back = (
        exponentiate(
            build_generator(device, rate_rad_s, wave.reference_frequency_hz), -wave.window_s / 2
        )
        @ u
    )
    a_A, a_B, angle, phase = (float(value) for value in ellipse.find_wave(back, wave.mode_number))
    return {
        "amplitude": a_A,
        "quadrature": float(np.clip(a_B, -a_A, a_A)),
        "wave_angle_rad": angle,
        "phase_rad": phase,
    }


def _read_loops(wave: Wave, begin_s: float, damping_rate_1_s: float) -> dict[str, Any] | None:
    """The loops that the log shows, off where the run was left free; None for a free run."""
    driven = wave.drive_main is not None and np.nanmax(np.abs(wave.drive_main), initial=0.0) > 0
    if wave.mode == "free" and not driven:
        return None
    found: dict[str, Any] = {"mode": "forced"} | describe_loops(wave, damping_rate_1_s)
    if driven:
        try:
            free = free_windows.cut_free_windows(wave)
        except HrgError:
            free = []  # driven throughout
        edge = wave.window_s
        found["off_s"] = [
            [max(0.0, float(w.time_s[0]) - begin_s - edge), float(w.time_s[-1]) - begin_s + edge]
            for w in free
        ]
    return found
