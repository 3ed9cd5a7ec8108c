"""simulate: from a simulation file's tables to a recording, by the second-order equations (fast) or
the envelopes (slow)."""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from .. import effects as catalogue
from ..effects.effect import no_term, same_signal, same_state
from ..errors import HrgError
from ..physics import ellipse, fast_engine, readout, slow_engine
from ..physics import environment as bench
from ..physics import noise as noises
from ..physics.electronics import Electronics
from ..physics.plant import (
    Block,
    Control,
    Environment,
    Plant,
    Readout,
    ThermalCourses,
    linear_plant,
)
from ..physics.resonator import IDENTITY, Mechanics, reflection
from ..records import Recording
from ..settings import to_toml
from .loop_watch import LoopWatch
from .simulation_file import (
    Course,
    Cycle,
    Ramp,
    RatePoints,
    RecordingTable,
    SimulationFile,
    Sine,
    Soak,
    Steps,
    Sweep,
    TemperaturePoints,
    runs_of,
)

Array = np.ndarray
Active = Sequence[tuple[Any, dict[str, Any]]]
"""Effects with their parameters' values, in the file's order."""


def simulate(
    config: Mapping[str, Any],
    extra_effects: Sequence[Any] = (),
    *,
    model: Annotated[
        Literal["fast", "slow"], Field(description="fast: second-order equations; slow: envelopes")
    ] = "fast",
    run: Annotated[
        str | None,
        Field(description="simulate this run of the file alone, by its run_id"),
    ] = None,
    seed: Annotated[
        int, Field(ge=0, description="seed of the noise; each run has its own stream")
    ] = 0,
    block_samples: Annotated[
        int, Field(ge=1, description="samples per block of the stream; they do not depend on it")
    ] = 1_000_000,
) -> Iterator[Recording]:
    """One run of a simulation file as a stream of recording blocks.

    The fast model integrates z'' + 2(N − KΩJ)z' + Wz = drive (PHYSICS §0) with exact propagators
    between the samples; the slow model integrates the envelopes. Memory does not grow with the run's
    length.

    Parameters
    ----------
    config
        The file's tables, e.g. from `settings.load_toml`; all frequencies in Hz, times in s, angles in
        rad.
    extra_effects
        `Effect` objects beside the catalogue's.

    Returns
    -------
    Iterator[Recording]
        Blocks of samples (n,) of both channels, with the truth; `collect` joins them.

    Raises
    ------
    HrgError
        A wrong file, an unknown run.

    Examples
    --------
    >>> from hrg_cli import collect, simulate
    >>> config = {
    ...     "device": {"frequency_hz": 1000.0, "quality_factor": 20_000.0},
    ...     "recording": {"sample_rate_hz": 8000.0, "duration_s": 0.5},
    ... }
    >>> recording = collect(simulate(config, model="slow"))
    >>> len(recording), recording.sample_rate_hz
    (4000, 8000.0)
    """
    runs = {settings.run_id: settings for settings in runs_of(config)}
    if run is None and len(runs) > 1:
        raise HrgError(
            f"simulation: holds {len(runs)} runs; choose one by --run, e.g. --run"
            f" {next(iter(runs))}, or simulate them all"
        )
    if run is not None and run not in runs:
        raise HrgError(f"simulation: there is no run {run}; it has {', '.join(list(runs)[:20])}")
    settings = next(iter(runs.values())) if run is None else runs[run]
    return simulate_run(
        settings, extra_effects, model=model, seed=seed, block_samples=block_samples
    )


def run_ids(config: Mapping[str, Any]) -> list[str]:
    """The runs of a simulation file, in its order; the whole file is checked."""
    return [settings.run_id for settings in runs_of(config)]


def summary(record: Recording) -> dict[str, Any]:
    """The stage's part of the JSON."""
    return {
        name: getattr(record, name)
        for name in (
            "run_id",
            "gyro_id",
            "mode",
            "readout",
            "carrier_hz",
            "sample_rate_hz",
            "mode_number",
        )
    }


def simulate_run(
    settings: SimulationFile,
    extra_effects: Sequence[Any] = (),
    *,
    model: str = "fast",
    seed: int = 0,
    block_samples: int = 1_000_000,
) -> Iterator[Recording]:
    """One checked run as a stream of recording blocks."""
    active = _active(settings, extra_effects)
    run_number = zlib.crc32(settings.run_id.encode())
    # A generator would report a wrong environment or effect only when its first block is asked for.
    if model == "fast":
        made, pickoff, logged = _fast(
            settings, active, np.random.default_rng([seed, run_number, 1])
        )
    else:
        made, pickoff, logged = _slow(settings, active)
    return _blocks(
        settings, made, pickoff, logged, np.random.default_rng([seed, run_number]), block_samples
    )


def _active(settings: SimulationFile, extra_effects: Sequence[Any]) -> Active:
    known = (*extra_effects, *catalogue.EFFECTS)
    found = [(catalogue.find(name, known), given) for name, given in settings.effects.items()]
    return [
        (effect, effect.values(given) if hasattr(effect, "values") else dict(given))
        for effect, given in found
    ]


def _fast(
    settings: SimulationFile, active: Active, random: np.random.Generator
) -> tuple[Iterator[Block], Readout, Environment]:
    mechanics, courses, control, pickoff = (
        mechanics_of(settings),
        courses_of(settings),
        control_of(settings),
        _readout(settings),
    )
    world = environment_of(settings, bool(active))
    for effect, p in active:
        _call(effect, "environment", p, world)
    plant = sprung(settings, linear_plant(mechanics, courses, world))
    for effect, p in active:
        _call(effect, "plant", p, plant, world)
        _call(effect, "control", p, control)
        _call(effect, "readout", p, pickoff)
    step = (1 + pickoff.clock_error) / settings.recording.sample_rate_hz
    start, angle = start_of(settings)
    made = fast_engine.run(
        world, plant, control, start, step, _count(settings), angle,
        electronics=electronics_of(settings, pickoff), noise=noise_of(settings, pickoff), random=random,
    )  # fmt: skip
    return made, pickoff, world


def _slow(settings: SimulationFile, active: Active) -> tuple[Iterator[Block], Readout, Environment]:
    mechanics, courses, pickoff = mechanics_of(settings), courses_of(settings), _readout(settings)
    if settings.electronics is not None or not noise_of(settings, pickoff).silent:
        raise HrgError(
            "simulation: [electronics] and [noise] act on samples; simulate with --model fast"
        )
    world, logged = environment_of(settings, bool(active)), environment_of(settings, bool(active))
    for effect, p in active:
        _call(effect, "environment", p, logged)
        if (
            getattr(effect, "slow_environment", same_state) is same_state
            and getattr(effect, "slow", no_term) is no_term
        ):
            _call(effect, "environment", p, world)
    # slow terms tell what is true from what is logged, so they start from the log
    world.temperature_degc = (
        world.temperature_degc + logged.logged_temperature_degc - world.logged_temperature_degc
    )
    world.rate_rad_s = world.rate_rad_s + logged.logged_rate_rad_s - world.logged_rate_rad_s
    terms = slow_engine.SlowTerms(
        [
            partial(effect.slow_environment, p)
            for effect, p in active
            if getattr(effect, "slow_environment", same_state) is not same_state
        ],
        [
            partial(effect.slow, p)
            for effect, p in active
            if getattr(effect, "slow", no_term) is not no_term
        ],
        [
            partial(effect.slow_readout, p)
            for effect, p in active
            if getattr(effect, "slow_readout", same_signal) is not same_signal
        ],
        [
            partial(effect.slow_jump, p)
            for effect, p in active
            if getattr(effect, "slow_jump", None) is not None
        ],
    )
    step = (1 + pickoff.clock_error) / settings.recording.sample_rate_hz

    def plant_at(world: Environment) -> Plant:
        return sprung(settings, linear_plant(mechanics, courses, world))

    start, angle = start_of(settings)
    return (
        slow_engine.run(
            world, plant_at, control_of(settings), terms, start, step, _count(settings), angle
        ),
        pickoff,
        logged,
    )


def _call(effect: Any, place: str, *arguments: Any) -> None:
    if hasattr(effect, place):
        getattr(effect, place)(*arguments)


def _blocks(
    settings: SimulationFile,
    made: Iterator[Block],
    pickoff: Readout,
    world: Environment,
    random: np.random.Generator,
    block_samples: int,
) -> Iterator[Recording]:
    head = _head(settings, pickoff)
    rate = settings.recording.sample_rate_hz
    log_stride = max(1, round(rate / settings.recording.log_rate_hz))
    waiting: list[Array] = []
    waiting_rows: list[dict[str, Array]] = []
    last_wave: tuple[float, float] | None = None
    watch = LoopWatch(settings) if settings.electronics is not None else None
    first = 0
    for block in made:
        n = len(block.samples.time_s)
        raw = readout.convert(pickoff, readout.measure(pickoff, block.samples, random))
        keep = readout.kept(pickoff, first, n, rate)
        waiting.append(raw if keep is None else raw[:, keep])
        at = np.arange(-first % log_stride, n, log_stride)
        if len(at):
            rows, last_wave = _rows(block, at, first, world, settings, last_wave)
            waiting_rows.append(rows)
            if watch is not None:
                watch.see(rows)
        first += n
        if sum(w.shape[1] for w in waiting) > block_samples:
            joined = np.concatenate(waiting, axis=1)
            while joined.shape[1] > block_samples:
                yield _recording(head, joined[:, :block_samples], waiting_rows, settings.recording)
                joined = joined[:, block_samples:]
                waiting_rows = [{name: values[:0] for name, values in waiting_rows[0].items()}]
            waiting = [joined]
    last = _recording(head, np.concatenate(waiting, axis=1), waiting_rows, settings.recording)
    yield last if watch is None else last.judged(watch.reasons())


def _rows(
    block: Block,
    at: Array,
    first: int,
    world: Environment,
    settings: SimulationFile,
    last: tuple[float, float] | None,
) -> tuple[dict[str, Array], tuple[float, float]]:
    """The log's and the truth's rows at positions `at` of a block; angle and phase continue from
    `last`."""
    mode_number = settings.device.mode_number
    true_time, time = block.samples.time_s[at], (first + at) / settings.recording.sample_rate_hz
    rows = {
        "auxiliary_time_s": time,
        "temperature_degc": np.interp(true_time, world.time_s, world.logged_temperature_degc),
        "rate_rad_s": np.interp(true_time, world.time_s, world.logged_rate_rad_s),
    }
    if settings.control.mode == "forced":
        rows |= {"drive_main": block.command[0, at], "drive_quadrature": block.command[1, at]}
    a_A, a_B, angle, phase = ellipse.wave(block.envelopes(at), mode_number)
    if last is None:
        turn = round((settings.start.wave_angle_rad - angle[0]) * mode_number / math.pi)
        start_phase = settings.start.phase_rad
        last = (
            angle[0] + turn * math.pi / mode_number,
            start_phase + math.remainder(phase[0] + turn * math.pi - start_phase, 2 * math.pi),
        )
    angle, phase = ellipse.unwrap(np.append(last[0], angle), np.append(last[1], phase), mode_number)
    truth = {
        "main_amplitude": a_A,
        "quadrature_amplitude": a_B,
        "wave_angle_rad": angle[1:],
        "phase_rad": phase[1:],
    }
    rows |= {"truth_time_s": time} | {f"truth_{name}": values for name, values in truth.items()}
    return rows, (float(angle[-1]), float(phase[-1]))


def _recording(
    head: dict[str, Any], raw: Array, rows: list[dict[str, Array]], table: RecordingTable
) -> Recording:
    if raw.dtype.kind == "f":
        raw = raw.astype(table.samples, copy=False)
    log: dict[str, Any] = {
        name: np.concatenate([r[name] for r in rows]) for name in (rows[0] if rows else ())
    }
    return Recording(c=np.ascontiguousarray(raw[0]), s=np.ascontiguousarray(raw[1]), **head, **log)


def _head(settings: SimulationFile, pickoff: Readout) -> dict[str, Any]:
    least, units = readout.least_count(pickoff), settings.readout.units
    return {
        "sample_rate_hz": settings.recording.sample_rate_hz,
        "mode": settings.control.mode,
        "readout": pickoff.kind,
        "carrier_hz": settings.readout.carrier_hz,
        "mode_number": settings.device.mode_number,
        "gyro_id": settings.recording.gyro_id,
        "lot_id": settings.recording.lot_id,
        "run_id": settings.run_id,
        "nominal_frequency_hz": settings.device.frequency_hz,
        "c_units": units,
        "s_units": units,
        "c_scale_factor": least,
        "s_scale_factor": least,
        "truth_settings": to_toml(settings.model_dump()),
    }


def _count(settings: SimulationFile) -> int:
    return max(1, round(settings.recording.duration_s * settings.recording.sample_rate_hz))


def start_of(settings: SimulationFile) -> tuple[Array, float]:
    """Envelopes and electrical angle mθ at t = 0."""
    start = settings.start
    a_A, a_B, angle, phase = np.array(
        [start.amplitude, start.quadrature, start.wave_angle_rad, start.phase_rad]
    )
    mode_number = settings.device.mode_number
    return (
        ellipse.envelopes(a_A, a_B, angle, phase, mode_number),
        mode_number * start.wave_angle_rad,
    )


def mechanics_of(settings: SimulationFile) -> Mechanics:
    """The resonator of [device] at the reference temperature."""
    d = settings.device
    return Mechanics(
        d.frequency_hz, d.rate_1_s, d.split_1_s, d.damping_axis_rad, d.frequency_split, d.stiffness_axis_rad, d.scale_factor, d.mode_number
    )  # fmt: skip


def courses_of(settings: SimulationFile) -> ThermalCourses:
    """The courses of the resonator's parameters over temperature, [device.temperature]."""
    t = settings.device.temperature

    def course(given: Course) -> tuple[float, ...]:
        return tuple(given) if isinstance(given, list) else (given,)

    return ThermalCourses(
        t.reference_degc,
        course(t.frequency_per_degc),
        course(t.damping_rate_per_degc),
        course(t.damping_split_per_degc),
        course(t.frequency_split_per_degc),
        course(t.scale_factor_per_degc),
    )


def control_of(settings: SimulationFile) -> Control:
    """The loops of [control]."""
    c = settings.control
    if c.mode == "free":
        return Control()
    log = np.zeros((0, 3))
    if c.log is not None:
        log = np.column_stack(
            [c.log.time_s, c.log.drive_main, c.log.drive_quadrature or np.zeros(len(c.log.time_s))]
        )
    gain = 5.0 if c.quadrature_gain_1_s is None else c.quadrature_gain_1_s
    return Control(
        forced=True,
        main_amplitude=c.amplitude or settings.start.amplitude,
        amplitude_gain_1_s=c.amplitude_gain_1_s,
        # a quarter of the gain's square: the loop's two rates are equal
        amplitude_integral_1_s2=(
            c.amplitude_gain_1_s**2 / 4
            if c.amplitude_integral_1_s2 is None
            else c.amplitude_integral_1_s2
        ),
        quadrature_loop=c.quadrature_loop,
        quadrature_gain_1_s=gain if c.quadrature_loop != "off" else 0.0,
        quadrature_integral_1_s2=c.quadrature_integral_1_s2,
        drive=c.drive,
        main_phase_error_rad=c.main_phase_error_rad,
        quadrature_phase_error_rad=c.quadrature_phase_error_rad,
        on_off=np.array(c.off_s, float).reshape(-1, 2),
        log=log,
    )


def sprung(settings: SimulationFile, plant: Plant) -> Plant:
    """The plant with [spring]: W less 2ωs(I + R(2mα)), a softening along α alone."""
    s = settings.spring
    if s is not None:
        axis = IDENTITY + reflection(2 * settings.device.mode_number * s.axis_rad)
        plant.stiffness = plant.stiffness - 2 * plant.mechanics.omega_rad_s * s.size_rad_s * axis
    return plant


def electronics_of(settings: SimulationFile, pickoff: Readout) -> Electronics | None:
    """The board of [electronics], with the converter of the read-out."""
    e = settings.electronics
    if e is None:
        return None
    step = 2 * e.drive_full_scale / 2**e.drive_bits if e.drive_bits and e.drive_full_scale else 0.0
    converter = pickoff.adc_bits > 0
    return Electronics(
        periods_per_update=e.periods_per_update,
        delay_periods=e.delay_periods,
        filter_hz=e.filter_hz or 0.0,
        phase_loop_hz=e.phase_loop_hz,
        adc_step=readout.least_count(pickoff) if converter else 0.0,
        adc_limit=pickoff.full_scale if converter else 0.0,
        drive_step=step,
        drive_limit=e.drive_full_scale or 0.0,
        drive_periods=e.drive_periods,
        phase_product=e.spring_signal == "phase_product",
    )


def noise_of(settings: SimulationFile, pickoff: Readout) -> noises.Noise:
    """What is noisy, in the engine's units."""
    n = settings.noise
    warm = n.temperature_k is not None and n.effective_mass_kg is not None
    return noises.Noise(
        (
            noises.thermal_velocity2(
                n.temperature_k or 0.0, n.effective_mass_kg or 1.0, n.metres_per_unit
            )
            if warm
            else 0.0
        ),
        pickoff.noise,
        n.readout_corner_hz,
        n.drive_density,
        n.drive_corner_hz,
    )


def _readout(settings: SimulationFile) -> Readout:
    r = settings.readout
    largest = max(settings.start.amplitude, settings.control.amplitude or 0.0)
    return Readout(
        kind=r.kind,
        carrier_hz=r.carrier_hz or 0.0,
        carrier_phase_rad=r.carrier_phase_rad,
        model=r.model,
        gap=r.gap or 1.0,
        law=r.law,
        gaps=np.array(r.electrode_gaps),
        gains=np.array(r.electrode_gains),
        noise=r.noise,
        adc_bits=r.adc_bits,
        full_scale=r.full_scale or (3.0 if r.kind == "carrier" else 1.5) * largest,
        clock_error=r.clock_error,
    )


def environment_of(settings: SimulationFile, fine: bool = False) -> Environment:
    """The run's world; `fine`: on a grid that effects may bend."""
    e, duration = settings.environment, settings.recording.duration_s
    rates = [_rate_programme(e.rate, duration)] if e.rate else []
    earth = (
        e.earth_rate_rad_s or 0.0
        if e.earth_latitude_rad is None
        else bench.earth_rate(e.earth_latitude_rad)
    )
    rate = bench.total([bench.constant(e.rate_rad_s + earth), *rates])
    temperature = (
        _temperature_programme(e.temperature, duration)
        if e.temperature
        else bench.constant(e.temperature_degc)
    )
    return bench.environment(
        temperature,
        rate,
        0.0 if e.earth_logged else earth,
        duration,
        1 / settings.recording.sample_rate_hz,
        fine,
    )


def _temperature_programme(
    t: Ramp | Soak | Cycle | TemperaturePoints, duration: float
) -> bench.Programme:
    if isinstance(t, Ramp):
        end = duration if t.end_s is None else t.end_s
        if end <= t.begin_s:
            raise HrgError(
                f"simulation: environment.temperature ends at {end:g} s, before it begins at"
                f" {t.begin_s:g} s"
            )
        return bench.polyline([t.begin_s, end], [t.start_degc, t.stop_degc])
    if isinstance(t, TemperaturePoints):
        return bench.polyline(t.time_s, t.temperature_degc)
    if isinstance(t, Soak):
        return bench.levels(t.levels_degc, t.dwell_s, t.transition_s)
    if t.shape == "triangle":
        return bench.triangle(t.low_degc, t.high_degc, t.period_s, duration)
    return bench.sine(
        (t.high_degc - t.low_degc) / 2, 1 / t.period_s, -math.pi / 2, (t.high_degc + t.low_degc) / 2
    )


def _rate_programme(r: Steps | Sine | Sweep | RatePoints, duration: float) -> bench.Programme:
    if isinstance(r, RatePoints):
        return bench.polyline(r.time_s, r.rate_rad_s)
    if isinstance(r, Steps):
        return bench.levels(r.levels_rad_s, r.dwell_s, r.transition_s)
    if isinstance(r, Sine):
        return bench.sine(r.amplitude_rad_s, r.frequency_hz, r.phase_rad)
    period = r.period_s or duration
    quarters = np.arange(4 * math.ceil(duration / period) + 5)
    return bench.polyline(
        quarters * period / 4, r.maximum_rad_s * np.array([0.0, 1.0, 0.0, -1.0])[quarters % 4]
    )
