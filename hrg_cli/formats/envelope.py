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

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from ..errors import HrgError
from ..records import Periods, open_single
from .doubled_rows import time_rows
from .envelope_rows import EnvelopeRows
from .envelope_signal import EnvelopeSignal
from .envelope_stream import stream_windows
from .envelope_windows import WindowPlan, plan_windows
from .log import ONE_DEMODULATOR, Log
from .log_columns import Roles, TimingTold, find_roles
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
from .readers import open_log
from .run_heading import RunHeading, UnitsTold
from .slow import SlowLog
from .taken import Taken, check_range
from .unix_time import recognise_unix_time


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
        float | None, Field(gt=0, description="rows per second, where the log has no times")
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

    C(t) = Re[(I + jQ) e^{jω_r t}], so c_cos = I and c_sin = −Q of the periods' convention (PHYSICS
    §0); S alike.

    Parameters
    ----------
    path
        The log, in any of the formats of `READERS`.

    Returns
    -------
    Periods or Iterator[Periods]
        Windows (n,) with signals (n, 4) and their standard deviations in the log's unit, times in
        s; `collect` joins a stream.

    Raises
    ------
    HrgError
        No reference frequency, no such column, a phase without a unit, times that do not rise, too
        few rows.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from hrg_cli import collect
    >>> from hrg_cli.formats.envelope import import_envelope
    >>> t = np.arange(400) / 50
    >>> in_phase, quadrature = np.exp(-t / 20) * np.exp(0.3j * t).view(float).reshape(-1, 2).T
    >>> table = np.column_stack([t, in_phase, quadrature])
    >>> table[:, 1:] += 1e-4 * np.random.default_rng(0).standard_normal((400, 2))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "lock-in.csv"
    ...     np.savetxt(path, table, delimiter=",", header="time [s],X [V],Y [V]", comments="")
    ...     periods = collect(
    ...         import_envelope(path, c_in_phase=2, c_quadrature=3, reference_frequency_hz=5000.0)
    ...     )
    >>> periods.units, np.hypot(*periods.signals[0, :2]).round(2).item()
    ('V', 1.0)
    """
    path = Path(path)
    check_range(from_s, to_s)
    reference_hz = _need_reference(path, reference_frequency_hz)
    log = open_log(path, format, separator, decimal)
    named = {
        "c_in_phase": c_in_phase,
        "c_quadrature": c_quadrature,
        "s_in_phase": s_in_phase,
        "s_quadrature": s_quadrature,
        "amplitude": amplitude,
        "phase": phase,
    }
    signal = EnvelopeSignal.find(log, path, named, decibel, phase_units, quadrature_sign)
    timed = TimingTold(sample_rate_hz is not None, clock_hz is not None, time_units)
    roles = _find_beside(log, path, signal, time, temperature, rate, timed)
    log = recognise_unix_time(log, roles, path, timed)
    told_times = (time_units, clock_hz, sample_rate_hz, sampling_tolerance)
    log, timing = time_rows(log, roles, path, *told_times)
    told = UnitsTold(time_units, rate_units, temperature_units)
    slow = SlowLog(
        log,
        roles,
        where=str(path),
        told=told,
        rate_scale_factor=1.0,
        constants={"rate": constant_rate_rad_s, "temperature": constant_temperature_degc},
        most=1 << 62,  # as many as there are: windows average them, no auxiliary log holds them
    )
    _need_beside(path, slow)
    unit = units or signal.find_unit(log)
    columns = (
        signal.columns
        | ({} if roles.time is None else {"time": roles.time})
        | roles.list_auxiliary()
    )
    by_role = told.list_by_role(signal.columns, unit)
    taken = Taken(log, columns, by_role, timing.sample_rate_hz, from_s, to_s)
    source = EnvelopeRows(path, log, roles, timing, slow, signal)
    rows = source.read_between(from_s, to_s)
    plan = plan_windows(path, rows, rows_per_window, signal.phase_known, source.find_rounding())
    heading = RunHeading(mode, mode_number, gyro_id, run_id, lot_id, start_time)
    blank = _no_windows(reference_hz, plan)
    blank = _judge(blank.replace(**heading.make_fields(log, path), units=unit), source, plan)
    return open_single(stream_windows(source, blank, plan, taken))


def _need_reference(path: Path, reference_hz: float | None) -> float:
    """The frequency of the demodulator's reference. HrgError: not given."""
    if reference_hz is None:
        raise HrgError(
            f"{path}: the frequency of the demodulator's reference is not in the log; give"
            " reference_frequency_hz"
        )
    return reference_hz


def _find_beside(
    log: Log,
    path: Path,
    signal: EnvelopeSignal,
    time: Column,
    temperature: Column,
    rate: Column,
    timing: TimingTold,
) -> Roles:
    """The columns of times, temperature and rate beside the envelope's; channel C stands for all of
    the envelope, so that none of its columns is taken for another."""
    first = next(iter(signal.columns.values()))
    return find_roles(
        log,
        str(path),
        {"time": time, "c": first + 1, "s": "none", "temperature": temperature, "rate": rate},
        timing,
    )


def _need_beside(path: Path, slow: SlowLog) -> None:
    """HrgError: slow columns with times of their own."""
    if slow.own:
        raise HrgError(
            f"{path}: its slow columns differ in length from the signals; columns beside the"
            " signals were expected"
        )


def _judge(blank: Periods, source: EnvelopeRows, plan: WindowPlan) -> Periods:
    """What speaks against the periods before a row of them is made: the log, its times, its columns
    and the filter that its rows show."""
    of_log = [reason for reason in source.log.reasons if reason != ONE_DEMODULATOR]
    judged = blank.judged([*of_log, *source.timing.reasons, *source.roles.doubts])
    logged = bool(source.slow.scales)
    for status, reason in (
        *source.signal.judge(blank.reference_frequency_hz),
        *plan.judge(logged),
    ):
        judged = judged.judged([reason], status)
    return judged


def _no_windows(reference_hz: float, plan: WindowPlan) -> Periods:
    """Periods before the first window: what a stream's blocks are made of."""
    reference_frequency_hz = reference_hz + plan.moved_hz
    window_s = plan.rows * plan.step_s
    return Periods(
        time_s=np.empty(0),
        signals=np.empty((0, 4)),
        signals_std=np.empty((0, 4)),
        residual_rms=np.empty((0, 2)),
        flags=np.empty(0, "u1"),
        reference_frequency_hz=reference_frequency_hz,
        window_s=window_s,
        periods_per_window=window_s * reference_frequency_hz,
        least_count=plan.least_count or None,
        quantisation_share=plan.rounded if plan.least_count else None,
        mode="free",
    )
