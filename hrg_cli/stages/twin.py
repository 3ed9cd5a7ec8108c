"""The simulated twin of a measured programme: a device with a result's own values, and each
measured run's start, length and logs."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..effects.effect import Effect, Values, frame
from ..errors import HrgError
from ..fitting.envelopes import free_windows
from ..fitting.envelopes.base_fit import nominal_scale_factor
from ..fourier import evaluate
from ..physics import ellipse
from ..physics.plant import SlowState
from ..physics.resonator import J, Mechanics, exponential, generator
from ..records import Calibration, Record, Resonator, Wave
from . import twin_colour, twin_mode, twin_physical
from .earth_rate import earth_rate_rad_s
from .rate_table import is_rate_table
from .run_tables import loops, rate_course, sample_noise, temperature_course
from .twin_colour import Colour
from .twin_physical import Identified, is_physical

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
NEEDED = (
    "frequency_hz",
    "damping_split_1_s",
    "damping_axis_rad",
    "frequency_split_rad_s",
    "stiffness_axis_rad",
)
"""Parameters without which a resonator file describes no device."""
COLOUR = 2
"""Number of the random stream of a run's coloured noise."""
TABLES = "calibrated_tables"
"""Name of the twin's own effect: drift and scale factor as a calibration file has them."""
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


@dataclass(frozen=True)
class Twin:
    """A programme to rehearse: tables of a simulation file, its runs, the stage that gave the
    result, its settings, the truth, and the twins of the resonator files it was made of."""

    config: Mapping[str, Any]
    runs: Sequence[TwinRun]
    stage: str
    settings: Mapping[str, Any]
    truth: Record
    resonators: Sequence[Twin] = ()

    @property
    def samples(self) -> int:
        """Samples of all runs together."""
        own = sum(self.samples_of(run) for run in self.config["run"])
        return own + sum(beside.samples for beside in self.resonators)

    @property
    def longest(self) -> int:
        """Samples of the longest run."""
        own = max(self.samples_of(run) for run in self.config["run"])
        return max([own, *(beside.longest for beside in self.resonators)])

    @staticmethod
    def samples_of(run: Mapping[str, Any]) -> int:
        """Samples of one run of the simulation file."""
        return int(run["recording"]["duration_s"] * run["recording"]["sample_rate_hz"])


def twin_of(
    truth: Record,
    inputs: Sequence[Measured],
    settings: Mapping[str, Any],
    samples_a_period: float | None = None,
    identified: Sequence[Identified] = (),
) -> Twin:
    """The twin of a result and its inputs; `settings` are the stage's own, as the result's file
    keeps them.

    samples_a_period: of the simulated recordings, instead of the measured ones' own sampling;
    identified: the resonator files that tables of `--model physical` were made of.
    HrgError: the result holds no device (two modes without axes, a foreign table, tables whose
    resonator files are not at hand), no wave.
    """
    settings = dict(settings)
    colours: Sequence[Colour]
    if isinstance(truth, Resonator):
        stage, device, hidden = (
            "identify",
            _resonator(truth, settings, inputs),
            _hidden_rate(truth, settings),
        )
        waves = [measured.wave for measured in inputs]
        colours = [twin_colour.of_free_runs(waves, settings, hidden)] * len(inputs)
        # what a method adds to the answer without changing it is not repeated
        settings |= {"profile": False} | (
            {"method": "likelihood"} if settings.get("method") == "all" else {}
        )
    elif isinstance(truth, Calibration):
        stage, device, hidden = (
            "calibrate",
            _calibrated(truth, inputs, identified),
            float(settings.get("earth_rate_rad_s") or 0.0),
        )
        settings |= {"ladder": False, "bootstrap": 0}
        found = twin_colour.of_calibration(truth)
        colours = [found.get(measured.wave.run_id, ()) for measured in inputs]
    else:
        raise HrgError(
            f"is a {truth.kind} file; a resonator, a calibration or a diagnosis is rehearsed"
        )
    by_frequency = isinstance(truth, Calibration) and truth.axis == "frequency"
    runs, tables = [], []
    for number, (measured, colour) in enumerate(zip(inputs, colours, strict=True), 1):
        name = f"run{number}"
        own = device
        if by_frequency:
            own = replace(device, frequency_hz=float(np.nanmedian(measured.wave.frequency_hz)))
        run, table = _run(name, measured, own, hidden, settings, samples_a_period)
        if by_frequency:
            table["device"] = {"frequency_hz": own.frequency_hz}
            run = replace(run, frequency=frequency_course(measured.wave))
        runs.append(replace(run, colour=colour))
        tables.append(table)
    first = tables[0]["recording"]
    config = {
        "device": {key: getattr(device, key) for key in Mechanics.__dataclass_fields__},
        "recording": {"sample_rate_hz": first["sample_rate_hz"], "duration_s": first["duration_s"]},
        "run": tables,
    }
    beside = [twin_of(i.resonator, i.inputs, i.settings, samples_a_period) for i in identified]
    return Twin(config, runs, stage, settings, truth, beside)


def _resonator(
    truth: Resonator, settings: Mapping[str, Any], inputs: Sequence[Measured]
) -> Mechanics:
    """The device of a resonator file; what was held, or is not told by such runs, has the value
    that the fit held it at."""
    if twin_mode.is_modes(truth):
        return twin_mode.device(truth)
    values = {name: value for name, (value, _, _) in truth.parameters().items()}
    for name in ("scale_factor", "damping_axis_rad", "stiffness_axis_rad"):
        if settings.get(name) is not None:
            values.setdefault(name, float(settings[name]))
    lacking = [name for name in NEEDED if name not in values]
    if lacking:
        raise HrgError(
            f"holds no {lacking[0]}: these are modes, not a whole resonator; a twin cannot be made"
            " of them"
        )
    values.setdefault("scale_factor", nominal_scale_factor(truth.mode_number))
    values.setdefault("damping_rate_1_s", max(_decay(inputs), abs(values["damping_split_1_s"])))
    return Mechanics(**values, mode_number=truth.mode_number)


def _calibrated(
    truth: Calibration, inputs: Sequence[Measured], identified: Sequence[Identified]
) -> Mechanics:
    """A device without splits: drift and scale factor are the tables' or the resonator files', which
    the twin's own effect gives it."""
    if is_rate_table(truth):
        raise HrgError("was made of a foreign table of dwells; there are no runs to rehearse")
    if is_physical(truth) and not identified:
        raise HrgError(
            "has the coefficients of resonator files (model physical) and their errors, which are"
            " identified again in every rehearsal; name the resonator files it was made of beside"
            " it"
        )
    frequency = float(np.median([np.nanmedian(m.wave.frequency_hz) for m in inputs]))
    return Mechanics(
        frequency,
        _decay(inputs),
        0.0,
        0.0,
        0.0,
        0.0,
        float(np.mean(truth.scale_factor_harmonics[:, 0])),
        truth.mode_number,
    )


def _decay(inputs: Sequence[Measured]) -> float:
    """ν that the drive has to make up for, a_ΦA/a_A, 1/s; where no drive is logged one decay in the
    longest run."""
    found = []
    for wave in (m.wave for m in inputs):
        if wave.drive_main is not None:
            ratio = np.asarray(wave.drive_main, float) / np.asarray(wave.main_amplitude, float)
            found.append(float(np.median(ratio[wave.good() & np.isfinite(ratio)])))
    if found and np.median(found) > 0:
        return float(np.median(found))
    return 1.0 / max(float(m.wave.time_s[-1] - m.wave.time_s[0]) for m in inputs)


def _hidden_rate(truth: Resonator, settings: Mapping[str, Any]) -> float:
    """Rate about the axis that the logs leave out, rad/s: Earth's, and the unknown one that was
    fitted."""
    keys = ("earth_rate_deg_h", "latitude_deg", "axis_tilt_deg", "axis_azimuth_deg")
    earth = earth_rate_rad_s(
        **{key: settings[key] for key in keys if settings.get(key) is not None}
    )
    return earth + float(
        json.loads(truth.details).get("rate_rad_s", {}).get("value", 0.0)
        if settings.get("fit_rate")
        else 0.0
    )


def _run(
    name: str,
    measured: Measured,
    device: Mechanics,
    hidden_rad_s: float,
    settings: Mapping[str, Any],
    samples_a_period: float | None,
) -> tuple[TwinRun, dict[str, Any]]:
    """One run and its table: from its first good window's beginning to its last one's end."""
    wave = measured.wave
    good = np.flatnonzero(wave.good())
    if len(good) < 2:
        raise HrgError(
            f"{wave.run_id or 'a run'}: has fewer than two windows without a flag; there is nothing"
            " to rehearse"
        )
    first, last = int(good[0]), int(good[-1])
    begin = float(wave.time_s[first]) - wave.window_s / 2
    times = np.asarray(wave.time_s, float) - begin
    rate, missing = _rate(wave, settings)
    kept = slice(None, None, max(1, len(times) // LOG_POINTS))
    length = float(times[last]) + wave.window_s / 2
    environment = rate_course(times[kept], None if rate is None else rate[kept], length)
    if wave.temperature_degc is not None:
        environment |= temperature_course(
            times[kept], np.asarray(wave.temperature_degc, float)[kept]
        )
    if hidden_rad_s:
        environment |= {"earth_rate_rad_s": hidden_rad_s, "earth_logged": False}
    amplitude = float(np.median(wave.main_amplitude[good]))
    noise = sample_noise(wave, 1.0)
    carrier = measured.carrier_hz if wave.readout == "carrier" else None
    sampling = sample_rate(measured, device.frequency_hz, carrier or 0.0, samples_a_period)
    table: dict[str, Any] = {
        "run_id": name,
        "start": _start(
            wave,
            first,
            device,
            (0.0 if rate is None else float(np.nan_to_num(rate[first]))) + hidden_rad_s,
        ),
        "environment": environment,
        "readout": {"noise": sample_noise(wave, sampling), "units": wave.units}
        | carrier_table(carrier),
        "recording": {
            "sample_rate_hz": sampling,
            "duration_s": length,
            "samples": "float32" if noise > FLOAT32 * amplitude else "float64",
        },
    }
    if (control := _control(wave, begin, device.damping_rate_1_s)) is not None:
        table["control"] = control
    # the part that was cut out is the whole of the twin's recording, and its frequency is known
    demodulate = {
        key: value
        for key, value in measured.demodulate.items()
        if key not in ("from_s", "to_s", "nominal_frequency_hz")
    }
    demodulate.setdefault("periods_per_window", max(1.0, wave.window_s * device.frequency_hz))
    carried, absent = named_and_missing(wave)
    return (
        TwinRun(
            name,
            demodulate,
            measured.estimate,
            carried,
            absent + missing,
            std=float(np.nanmedian(wave.signal_std)),
            silent=twin_mode.one_signal(wave),
            window_s=wave.window_s,
        ),
        table,
    )


def named_and_missing(wave: Wave) -> tuple[dict[str, Any], tuple[str, ...]]:
    """What a run is called, and the logs it lacks."""
    missing = tuple(key for key in LOGS if getattr(wave, key) is None)
    return {key: getattr(wave, key) for key in CARRIED}, missing


def frequency_course(wave: Wave) -> tuple[Array, Array]:
    """A run's frequency without its windows' noise: times from the run's beginning and means of
    `COURSE_POINTS` stretches, Hz."""
    good = np.flatnonzero(wave.good() & np.isfinite(wave.frequency_hz))
    begin = float(wave.time_s[int(np.flatnonzero(wave.good())[0])]) - wave.window_s / 2
    parts = [p for p in np.array_split(good, min(COURSE_POINTS, len(good))) if len(p)]
    times = np.array([float(np.mean(np.asarray(wave.time_s)[p])) for p in parts]) - begin
    return times, np.array([float(np.mean(np.asarray(wave.frequency_hz)[p])) for p in parts])


def _rate(wave: Wave, settings: Mapping[str, Any]) -> tuple[Array | None, tuple[str, ...]]:
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


def sample_rate(
    measured: Measured, frequency_hz: float, carrier_hz: float, samples_a_period: float | None
) -> float:
    """Sampling rate of the twin: as asked for, else the recording's own where it resolves the
    signal, else `SAMPLES_A_PERIOD`."""
    highest = frequency_hz + carrier_hz
    own = measured.sample_rate_hz
    if samples_a_period is None and own is not None and own > SLOWEST_SAMPLING * highest:
        return float(own)
    return float(np.ceil((samples_a_period or SAMPLES_A_PERIOD) * highest))


def carrier_table(carrier_hz: float | None) -> dict[str, Any]:
    """The part of [readout] that a carrier needs."""
    return {} if carrier_hz is None else {"kind": "carrier", "carrier_hz": float(carrier_hz)}


def _start(wave: Wave, row: int, device: Mechanics, rate_rad_s: float) -> dict[str, float]:
    """The wave of a row, integrated back by half a window with the device's own generator."""
    columns = (wave.main_amplitude, wave.quadrature_amplitude, wave.wave_angle_rad, wave.phase_rad)
    main, quadrature, wave_angle, wave_phase = (
        np.asarray(column[row], float) for column in columns
    )
    u = ellipse.envelopes(main, quadrature, wave_angle, wave_phase, wave.mode_number)
    back = (
        exponential(generator(device, rate_rad_s, wave.reference_frequency_hz), -wave.window_s / 2)
        @ u
    )
    a_A, a_B, angle, phase = (float(value) for value in ellipse.wave(back, wave.mode_number))
    return {
        "amplitude": a_A,
        "quadrature": float(np.clip(a_B, -a_A, a_A)),
        "wave_angle_rad": angle,
        "phase_rad": phase,
    }


def _control(wave: Wave, begin_s: float, damping_rate_1_s: float) -> dict[str, Any] | None:
    """The loops that the log shows, off where the run was left free; None for a free run."""
    driven = wave.drive_main is not None and np.nanmax(np.abs(wave.drive_main), initial=0.0) > 0
    if wave.mode == "free" and not driven:
        return None
    found: dict[str, Any] = {"mode": "forced"} | loops(wave, damping_rate_1_s)
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


def effects_of(twin: Twin, number: int, seed: int) -> tuple[Effect, ...]:
    """The twin's own effects in one of its runs: the tables of a calibration, what one mode's decay
    and frequency do with its amplitude, the colour of the noise."""
    run, table = twin.runs[number], twin.config["run"][number]
    out: list[Effect] = []
    if isinstance(twin.truth, Calibration):
        factor = twin.config["device"]["scale_factor"]
        out.append(
            twin_physical.effect(twin.truth, run.frequency)
            if is_physical(twin.truth)
            else tables_effect(twin.truth, factor, run.frequency)
        )
    elif isinstance(twin.truth, Resonator) and twin_mode.is_modes(twin.truth):
        out.append(twin_mode.effect(twin_mode.laws_of(twin.truth), run.silent))
    if run.colour:
        length = float(table["recording"]["duration_s"])
        out.append(
            twin_colour.effect(run.colour, run.std, run.window_s, length, (seed, number, COLOUR))
        )
    return tuple(out)


def tables_effect(
    truth: Calibration,
    device_scale_factor: float,
    frequency: tuple[Array, Array] | None = None,
) -> Effect:
    """The effect that turns the wave as the tables say, mθ' = −K(x,θ)Ω + D(x,θ): what the device's
    constant K leaves of it.

    x: the temperature or, with the course `frequency` of a run, the frequency, which then follows
    the course.
    """
    nodes, mode = np.asarray(truth.node, float), truth.mode_number
    drift, scale = (
        np.asarray(truth.drift_harmonics, float),
        np.asarray(truth.scale_factor_harmonics, float),
    )

    def slow(_: Values, u: Array, state: SlowState) -> Array:
        e_A = frame(u, state.phase_rad)[1]
        angle = np.arctan2(e_A[..., 1], e_A[..., 0]).ravel() / mode
        x = state.temperature_degc if frequency is None else np.interp(state.time_s, *frequency)
        at = np.broadcast_to(x, u.shape[:-1]).ravel()
        D, K = (
            evaluate(at, angle, nodes, table, mode, truth.interpolation) for table in (drift, scale)
        )
        rate = np.broadcast_to(state.rate_rad_s, u.shape[:-1]).ravel()
        turning = ((K - device_scale_factor) * rate - D).reshape(u.shape[:-1])
        change = turning[..., None] * (u @ J.T)
        if frequency is not None:
            faster = 2j * np.pi * (np.asarray(x) - state.mechanics.frequency_hz)
            change = change + faster[..., None] * u
        return np.asarray(change)

    return Effect(
        TABLES,
        "bench",
        "Drift and scale factor as a calibration file has them, mθ' = −K(T,θ)Ω + D(T,θ).",
        (),
        slow=slow,
    )
