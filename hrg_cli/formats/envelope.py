"""import_envelope: demodulated signals of a lock-in, an FPGA or a spectrum analyser become periods,
whole or as a stream of blocks.

A row holds the envelope at its time against the reference frequency: I + jQ of one or two channels,
C(t) = Re[(I + jQ) e^{jω_r t}], or amplitude and phase of one channel, or its amplitude alone. So
c_cos = I and c_sin = −Q. Noise comes from the rows' own scatter (`row_noise`); rows that a filter
correlates are averaged, turned back by their own frequency, to windows that are nearly independent.

A filter changes no parameter of a linear resonator: what it makes of a solution of u' = L u is a
solution of the same equation. It delays the rows against the logs, attenuates by its gain at the
oscillation's distance from the reference, and turns the phase.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from ..errors import HrgError
from ..records import FLAG_GAP, FLAG_NOT_FINITE, Array, Periods
from ..records.clock import moved
from .columns import Roles, find
from .envelope_signal import EnvelopeSignal
from .envelope_windows import WindowPlan, mean_turn, plan_windows, window_means
from .log import ONE_DEMODULATOR, Log
from .log_options import (
    ClockHz,
    Column,
    ConstantRate,
    ConstantTemperature,
    Decimal,
    FormatName,
    FromS,
    GyroId,
    LotId,
    Mode,
    ModeNumber,
    RateUnits,
    RunId,
    SamplingTolerance,
    Separator,
    TemperatureUnits,
    Time,
    TimeUnits,
    ToS,
)
from .readers import guard_reading, open_log
from .slow import SlowLog
from .taken import GAP_STEPS, Taken, checked_range
from .timing import Timing, timing_of

UNKNOWN_PHASE = np.pi / np.sqrt(3)
"""Standard deviation of a phase of which nothing is known."""


def import_envelope(
    path: Path | str,
    *,
    reference_frequency_hz: Annotated[
        float | None, Field(gt=0, description="frequency of the demodulator's reference")
    ] = None,
    c_in_phase: Annotated[
        Column, Field(description="column of C's in-phase signal, by its title or 1-based number")
    ] = None,
    c_quadrature: Annotated[
        Column, Field(description="column of C's quadrature signal, by its title or 1-based number")
    ] = None,
    s_in_phase: Annotated[
        Column, Field(description="column of S's in-phase signal, by its title or 1-based number")
    ] = None,
    s_quadrature: Annotated[
        Column, Field(description="column of S's quadrature signal, by its title or 1-based number")
    ] = None,
    amplitude: Annotated[
        Column,
        Field(description="column of one channel's amplitude, by its title or 1-based number"),
    ] = None,
    phase: Annotated[
        Column, Field(description="column of that channel's phase, by its title or 1-based number")
    ] = None,
    phase_units: Annotated[
        str | None,
        Field(description="unit of the phase: deg, rad or turns; the title's where not given"),
    ] = None,
    decibel: Annotated[
        bool, Field(description="the amplitude is a level in dB, 20 dB a decade")
    ] = False,
    quadrature_sign: Annotated[
        Literal[1, -1],
        Field(
            description="-1 where the demodulator's Q is that of e^(-jwt): the phase runs backwards"
        ),
    ] = 1,
    rows_per_window: Annotated[
        int | None,
        Field(
            ge=1, description="rows averaged to a window; by the rows' correlation where not given"
        ),
    ] = None,
    time: Time = None,
    temperature: Annotated[
        Column, Field(description="column of the temperature, by its title or 1-based number")
    ] = None,
    rate: Annotated[
        Column, Field(description="column of the rate, by its title or 1-based number")
    ] = None,
    sample_rate_hz: Annotated[
        float | None, Field(gt=0, description="rows a second, where the log has no times")
    ] = None,
    sampling_tolerance: SamplingTolerance = 1e-3,
    time_units: TimeUnits = None,
    clock_hz: ClockHz = None,
    units: Annotated[str | None, Field(description="unit of the signals")] = None,
    rate_units: RateUnits = None,
    temperature_units: TemperatureUnits = None,
    constant_rate_rad_s: ConstantRate = None,
    constant_temperature_degc: ConstantTemperature = None,
    mode: Mode = "free",
    mode_number: ModeNumber = 2,
    gyro_id: GyroId = "",
    run_id: RunId = "",
    lot_id: LotId = "",
    start_time: Annotated[
        str, Field(description="ISO 8601 time of the first row; from the log where it has one")
    ] = "",
    format: FormatName = "",
    separator: Separator = None,
    decimal: Decimal = None,
    from_s: FromS = None,
    to_s: ToS = None,
) -> Periods | Iterator[Periods]:
    """A log of demodulated signals as periods: one record when it fits one block, else a stream of
    them.

    HrgError: no reference frequency, no such column, a phase without a unit, times that do not
    rise, too few rows.
    """
    path = Path(path)
    checked_range(from_s, to_s)
    if reference_frequency_hz is None:
        raise HrgError(
            f"{path}: the frequency of the demodulator's reference is not in the log; give"
            " reference_frequency_hz"
        )
    log = open_log(path, format, separator, decimal)
    named = {
        "c_in_phase": c_in_phase,
        "c_quadrature": c_quadrature,
        "s_in_phase": s_in_phase,
        "s_quadrature": s_quadrature,
        "amplitude": amplitude,
        "phase": phase,
    }
    signal = EnvelopeSignal.found(log, path, named, decibel, phase_units, quadrature_sign)
    first = next(iter(signal.columns.values()))
    roles = find(
        log,
        str(path),
        {"time": time, "c": first + 1, "s": "none", "temperature": temperature, "rate": rate},
    )
    timing = timing_of(log, roles, path, time_units, clock_hz, sample_rate_hz, sampling_tolerance)
    slow = SlowLog(
        log,
        roles,
        rate_units=rate_units,
        temperature_units=temperature_units,
        rate_scale_factor=1.0,
        constants={"rate": constant_rate_rad_s, "temperature": constant_temperature_degc},
        most=1 << 62,
    )
    if slow.own:
        raise HrgError(
            f"{path}: its slow columns differ in length from the signals; columns beside the"
            " signals were expected"
        )
    unit = units or signal.unit(log)
    columns = (
        signal.columns | ({} if roles.time is None else {"time": roles.time}) | roles.auxiliary()
    )
    taken = Taken(
        log, columns, dict.fromkeys(signal.columns, unit), timing.sample_rate_hz, from_s, to_s
    )
    source = _Source(path, log, roles, timing, slow, signal)
    plan = plan_windows(path, source.between(from_s, to_s), rows_per_window)
    blank = Periods(
        time_s=np.empty(0),
        signals=np.empty((0, 4)),
        signals_std=np.empty((0, 4)),
        residual_rms=np.empty((0, 2)),
        flags=np.empty(0, "u1"),
        reference_frequency_hz=reference_frequency_hz,
        window_s=plan.rows * plan.step_s,
        periods_per_window=plan.rows * plan.step_s * reference_frequency_hz,
        mode=mode,
        mode_number=mode_number,
        gyro_id=gyro_id,
        run_id=run_id or path.stem,
        lot_id=lot_id,
        start_time=start_time or log.start_time,
        units=unit,
    ).judged([reason for reason in log.reasons if reason != ONE_DEMODULATOR] + list(timing.reasons))
    for status, reason in (
        *signal.verdicts(reference_frequency_hz),
        *plan.verdicts(slow.scales != {}),
    ):
        blank = blank.judged([reason], status)
    stream = _stream(source, blank, plan, taken)
    head = list(itertools.islice(stream, 2))
    return head[0] if len(head) == 1 else itertools.chain(head, stream)


@dataclass(frozen=True)
class _Source:
    """The opened log and how its rows are read."""

    path: Path
    log: Log
    roles: Roles
    timing: Timing
    slow: SlowLog
    signal: EnvelopeSignal

    def rows(self) -> Iterator[tuple[Array, Array, list[Array]]]:
        """Blocks: times from the log's first row on, envelopes (channel, n), slow columns in SI
        units."""
        wanted = [
            *self.signal.columns.values(),
            *self.slow.indexes,
            *([] if self.roles.time is None else [self.roles.time]),
        ]
        count, row = len(self.signal.columns), 0
        with guard_reading(self.path, self.log.format):
            for columns in self.log.read(wanted):
                n = len(columns[0])
                if n == 0:
                    continue
                if self.timing.sample_rate_hz is None and self.roles.time is not None:
                    scale = self.timing.factor * self.log.channels[self.roles.time].scale_factor
                    times = np.asarray(columns[-1], float) * scale - self.timing.first
                else:
                    times = np.arange(row, row + n) / (self.timing.sample_rate_hz or 1.0)
                row += n
                slow = self.slow.converted(columns[count : count + len(self.slow.indexes)])
                yield times, self.signal.envelopes(columns[:count]), slow

    def between(self, from_s: float | None, to_s: float | None) -> Iterator[tuple[Array, Array]]:
        """Times and envelopes of the rows in the range asked for."""
        for times, u, _ in self.rows():
            low = 0 if from_s is None else int(np.searchsorted(times, from_s))
            high = len(times) if to_s is None else int(np.searchsorted(times, to_s))
            yield times[low:high], u[:, low:high]


def _stream(source: _Source, blank: Periods, plan: WindowPlan, taken: Taken) -> Iterator[Periods]:
    """Blocks of windows; the last one bears what only the whole log tells."""
    held: Periods | None = None
    shift = 0.0
    left: tuple[Array, Array, list[Array]] | None = None
    row = 0
    for times, u, slow in source.rows():
        part = taken.block(times)
        bad = ~np.isfinite(u[:, part].sum(0))
        if bad.any():
            taken.count_not_finite(bad, row + part.start)
        row += len(times)
        piece = (times[part], u[:, part], [values[part] for values in slow])
        if left is not None:
            piece = _join_blocks(left, piece)
        whole = len(piece[0]) // plan.rows * plan.rows
        left = (piece[0][whole:], piece[1][:, whole:], [values[whole:] for values in piece[2]])
        if whole:
            shift = taken.first_s or 0.0
            if held is not None:
                yield held
            held = _windows(
                blank,
                plan,
                source,
                piece[0][:whole] - shift,
                piece[1][:, :whole],
                [v[:whole] for v in piece[2]],
            )
            held = held.replace(start_time=moved(blank.start_time, shift))
        if taken.to_s is not None and times[-1] >= taken.to_s:
            break
    taken.check_range(str(source.path))
    if held is None:
        raise HrgError(
            f"{source.path}: holds fewer rows than one window of {plan.rows}; record longer or"
            " lower rows_per_window"
        )
    for status, reason in taken.verdicts():
        held = held.judged([reason], status)
    facts = taken.facts()
    facts["rows"] = facts.pop("samples")
    noise = {
        "correlated_rows": plan.noise.correlated_rows,
        "rows_per_window": plan.rows,
        "row_std": [float(np.sqrt(v)) for v in plan.noise.variance.mean(1)],
        "window_std": [float(np.sqrt(v / plan.rows)) for v in plan.noise.density.mean(1)],
        "offset_hz": plan.offset_hz,
        "filter_passes": plan.passed,
    }
    yield held.replace(details=json.dumps(facts | {"noise": noise}, ensure_ascii=False))


def _join_blocks(
    a: tuple[Array, Array, list[Array]], b: tuple[Array, Array, list[Array]]
) -> tuple[Array, Array, list[Array]]:
    """Rows left over before the next ones."""
    return (
        np.concatenate([a[0], b[0]]),
        np.concatenate([a[1], b[1]], axis=1),
        [np.concatenate(pair) for pair in zip(a[2], b[2], strict=True)],
    )


def _windows(
    blank: Periods, plan: WindowPlan, source: _Source, times: Array, u: Array, slow: list[Array]
) -> Periods:
    """Means of the rows, with standard deviations, flags and slow columns."""
    known, one = source.signal.phase_known, "s_in_phase" not in source.signal.columns
    means, rows = window_means(
        u, plan.rows, mean_turn(u) if plan.rows > 1 and u.shape[1] > 1 else 0.0
    )
    strong = means[np.argmax(np.nansum(np.abs(means) ** 2, axis=1))]
    cos2 = np.where(
        np.abs(strong) > 0, strong.real**2 / np.maximum(np.abs(strong) ** 2, 1e-300), 0.5
    )
    signals, std = np.empty((len(rows), 4)), np.empty((len(rows), 4))
    for k in range(2):
        along, across = plan.noise.density[0 if one else k] / plan.rows
        signals[:, 2 * k], signals[:, 2 * k + 1] = means[k].real, -means[k].imag
        std[:, 2 * k] = np.sqrt(along * cos2 + across * (1 - cos2))
        std[:, 2 * k + 1] = np.sqrt(along * (1 - cos2) + across * cos2)
    if not known:
        std[:, 1] = UNKNOWN_PHASE * np.abs(means[0])
        std[:, 2:] = std[:, :1]
    flags = np.zeros(len(rows), "u1")
    flags[~np.isfinite(means).all(0)] |= FLAG_NOT_FINITE
    steps = np.diff(times[: rows.size], prepend=times[0] - plan.step_s).reshape(rows.shape)
    flags[(steps > GAP_STEPS * plan.step_s)[:, 1:].any(1)] |= FLAG_GAP
    fields = dict(
        zip(
            source.slow.fields(),
            (values[: rows.size].reshape(rows.shape).mean(1) for values in slow),
            strict=True,
        )
    )
    fields |= {
        name: np.full(len(rows), value) for name, value in source.slow.constant_fields().items()
    }
    row_std = np.sqrt(plan.noise.variance.mean(1))
    return blank.replace(
        time_s=times[: rows.size].reshape(rows.shape).mean(1),
        signals=signals,
        signals_std=std,
        residual_rms=np.broadcast_to(
            row_std[[0, 0]] * [1, 0] if one else row_std, (len(rows), 2)
        ).copy(),
        flags=flags,
        **fields,
    )
