"""An engine's blocks as a stream of recordings: converted samples, the log's and the truth's
rows."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any

import numpy as np

from ...errors import HrgError
from ...physics import ellipse, readout
from ...physics.plant import Block, Environment, Readout
from ...records import Recording
from ...settings import to_toml
from ..loop_watch import LoopWatch
from ..simulation_file import SimulationFile
from .bench_tables import RecordingTable

Array = np.ndarray


def record_blocks(
    settings: SimulationFile,
    made: Iterator[Block],
    pickoff: Readout,
    world: Environment,
    random: np.random.Generator,
    block_samples: int,
) -> Iterator[Recording]:
    """An engine's blocks as recordings of at most so many samples, the log's rows with the first of
    them.

    What the loops could not hold is in the last one's reasons.

    Parameters
    ----------
    settings
        The run.
    made
        Blocks of the engine.
    pickoff
        Its read-out.
    world
        Its bench, whose logged rate and temperature are written.
    random
        What the read-out's noise is drawn from.
    block_samples
        Samples (n,) of each channel in a recording at most.

    Returns
    -------
    iterator of Recording
        The samples, a part each.

    Raises
    ------
    HrgError
        The motion has left what a number can hold.

    Examples
    --------
    `simulate_run` puts a run together:

    >>> from hrg_cli.stages.simulate import simulate_run
    >>> from hrg_cli.stages.simulation_file import list_runs
    >>> device = {"frequency_hz": 1000.0, "quality_factor": 1e5}
    >>> recording = {"sample_rate_hz": 8000.0, "duration_s": 0.5, "log_rate_hz": 10.0}
    >>> (run,) = list_runs({"device": device, "recording": recording})
    >>> blocks = list(simulate_run(run, model="slow", block_samples=3000))
    >>> [(len(block.c), len(block.temperature_degc)) for block in blocks]
    [(3000, 5), (1000, 0)]
    """
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
        _need_finite(block, settings, watch)
        raw = readout.convert(pickoff, readout.measure(pickoff, block.samples, random))
        keep = readout.find_kept_samples(pickoff, first, n, rate)
        waiting.append(raw if keep is None else raw[:, keep])
        at = np.arange(-first % log_stride, n, log_stride)
        if len(at):
            rows, last_wave = _rows(block, at, first, world, settings, last_wave)
            waiting_rows.append(rows)
            if watch is not None:
                watch.take_rows(rows)
        first += n
        if sum(w.shape[1] for w in waiting) > block_samples:
            joined = np.concatenate(waiting, axis=1)
            while joined.shape[1] > block_samples:
                yield _recording(head, joined[:, :block_samples], waiting_rows, settings.recording)
                joined = joined[:, block_samples:]
                waiting_rows = [{name: values[:0] for name, values in waiting_rows[0].items()}]
            waiting = [joined]
    last = _recording(head, np.concatenate(waiting, axis=1), waiting_rows, settings.recording)
    yield last if watch is None else last.judged(watch.list_reasons())


def _need_finite(block: Block, settings: SimulationFile, watch: LoopWatch | None) -> None:
    """HrgError: the motion has left what a number can hold, by its loops or otherwise."""
    wrong = np.flatnonzero(~np.isfinite(block.samples.z).all(axis=0))
    if not len(wrong):
        return
    at = float(block.samples.time_s[wrong[0]])
    if watch is not None and settings.control.mode == "forced":
        raise watch.make_error(at)
    raise HrgError(
        f"simulation: the motion of run {settings.run_id} is no finite number from {at:.6g} s"
        " on; it grows without bound, or its settings are beyond what can be simulated: correct"
        " them"
    )


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
    a_A, a_B, angle, phase = ellipse.find_wave(block.envelopes(at), mode_number)
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
    least, units = readout.compute_least_count(pickoff), settings.readout.units
    return {
        "sample_rate_hz": settings.recording.sample_rate_hz,
        "mode": settings.control.mode,
        "readout": pickoff.kind,
        "carrier_hz": settings.readout.carrier_hz,
        "mode_number": settings.device.mode_number,
        "gyro_id": settings.recording.gyro_id,
        "lot_id": settings.recording.lot_id,
        "run_id": settings.run_id,
        "start_time": settings.recording.start_time,
        "nominal_frequency_hz": settings.device.frequency_hz,
        "c_units": units,
        "s_units": units,
        "c_scale_factor": least,
        "s_scale_factor": least,
        "truth_settings": to_toml(settings.model_dump()),
    }
