"""demodulate: samples of the two channels -> least-squares signals per window, against one constant
reference frequency.

C = c_cos·cos ω_r t + c_sin·sin ω_r t (PHYSICS §0), so C0 = c_cos − j·c_sin at the window's centre.
Every window of a fixed number of samples shares one least-squares basis about its centre at the
local frequency; one matrix product serves a chunk, one turn by the reference phase at each centre
makes the signals. No whole periods are needed and nothing leaks. With a carrier the basis has the
two side bands |ω_c ∓ ω| and the carrier's leakage: eight signals (PHYSICS §3, seed B (1)).
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from ..fitting.medians import find_median
from ..fitting.samples.demodulator import Demodulator
from ..fitting.samples.even import make_even_rows
from ..fitting.samples.looks import take_looks
from ..fitting.samples.run_down import RunDown, find_run_down
from ..fitting.samples.signal_rows import Rows
from ..fitting.samples.survey import survey, survey_quiet
from ..fitting.samples.uneven import make_uneven_rows
from ..fitting.samples.wild import mask_wild
from ..records import FLAG_CLIPPED, FLAG_GAP, FLAG_NOT_FINITE, FLAG_SETTLING, Periods, Recording
from ..records.time_origin import measure_from_first_sample
from .demodulation.judge import StreamJudge
from .demodulation.part import check_recording, cut_part, survey_run_down


def demodulate(
    recording: Recording,
    *,
    periods_per_window: Annotated[
        float, Field(gt=0, description="oscillation periods per window, any fraction")
    ] = 1.0,
    moving_envelope: Annotated[
        bool | None,
        Field(
            description=(
                "let the envelope move linearly within a window (t·cos, t·sin); by default from 3"
                " periods per window"
            )
        ),
    ] = None,
    nominal_frequency_hz: Annotated[
        float | None,
        Field(
            gt=0,
            description=(
                "look for the oscillation near this frequency; the recording's own where not given"
            ),
        ),
    ] = None,
    from_s: Annotated[
        float | None,
        Field(ge=0, description="time from the recording's first sample on at which to begin"),
    ] = None,
    to_s: Annotated[
        float | None,
        Field(gt=0, description="time from the recording's first sample on at which to end"),
    ] = None,
    block_samples: Annotated[
        int,
        Field(gt=0, description="samples worked on at once; memory depends on it, results do not"),
    ] = 1 << 21,
) -> Iterator[Periods]:
    """The signals of every window: least-squares coefficients of both channels at one reference
    frequency.

    C = c_cos·cos ω_r t + c_sin·sin ω_r t and the same of S, fitted about each window's centre; with
    a carrier the coefficients at both side bands |ω_c ∓ ω| (seed B (1), PHYSICS §3). Memory does
    not grow with the recording. With `from_s`, `to_s` the rest is as if it had not been recorded,
    but rows keep the times of the whole recording, to which the reference phase, the auxiliary log
    and `start_time` belong. Times whose clock began so long before that doubles are too coarse
    (seconds since 1970) count from the first sample; details keep its time as `clock_origin_s`.

    Parameters
    ----------
    recording
        Samples (n,) of both channels, raw; it may be open on disk.

    Returns
    -------
    Iterator[Periods]
        Blocks of windows: signals (windows, 4), with a carrier (windows, 8), and their standard
        deviations, in the channels' unit; the last block holds spectrum and status.

    Raises
    ------
    HrgError
        An empty part, no samples, unequal or constant channels, a nominal frequency not below half
        the sampling rate, times that do not increase, too short for one window.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording, collect, demodulate
    >>> t = np.arange(8000) / 8000
    >>> noise = 1e-4 * np.random.default_rng(0).standard_normal((2, 8000))
    >>> c, s = np.array([[1.0], [0.1]]) * np.cos(2 * np.pi * 1000 * t) + noise
    >>> recording = Recording(c=c, s=s, sample_rate_hz=8000.0, mode="free")
    >>> periods = collect(demodulate(recording, periods_per_window=20))
    >>> periods.signals.shape, round(periods.reference_frequency_hz, 2)
    ((50, 4), 1000.0)
    >>> float(np.hypot(*periods.signals[0, :2]).round(3))
    1.0
    """
    name = check_recording(recording)
    recording, origin_s = measure_from_first_sample(recording)
    recording, notes = cut_part(recording, name, from_s, to_s)
    if origin_s:
        notes.append(f"its clock had run {origin_s:.15g} s; times count from the first sample on")
    if nominal_frequency_hz is not None:
        recording = recording.replace(nominal_frequency_hz=nominal_frequency_hz)
    looks = take_looks(recording, recording.time_s is None, name)
    tame = mask_wild(recording, looks)
    looked = survey(tame, name, looks if tame is recording else None)
    recording = tame
    found = find_run_down(recording, looked)
    if found is not None:
        notes.extend(found.notes)
        looked = survey_run_down(recording, looked, found, name)
    run = Demodulator(recording, looked, name, periods_per_window, moving_envelope, notes=notes)
    yield from _rows_of(run, found, origin_s, block_samples)


def demodulate_quiet(recording: Recording, *, periods_per_window: float) -> Iterator[Periods]:
    """`demodulate` of simulated samples without noise, of which the envelopes alone are asked.

    Without a search for lines, ends and the noise's colour; harmonics are fitted beside, whether
    there are any or not.

    Parameters
    ----------
    recording
        Samples (n,) of both channels.
    periods_per_window
        Periods of the oscillation in a window.

    Returns
    -------
    iterator of Periods
        The blocks.

    Raises
    ------
    HrgError
        As of `demodulate`.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.stages.demodulate import demodulate_quiet
    >>> c = np.cos(2 * np.pi * 1000 * np.arange(8000) / 8000)
    >>> quiet = Recording(c=c, s=0.1 * c, sample_rate_hz=8000.0, mode="free")
    >>> (periods,) = demodulate_quiet(quiet, periods_per_window=20)
    >>> len(periods), bool(np.allclose(np.hypot(*periods.signals[:, :2].T), 1.0))
    (50, True)
    """
    name = check_recording(recording)
    quiet = survey_quiet(recording, name)
    run = Demodulator(recording, quiet, name, periods_per_window, None, every_harmonic=True)
    yield from _rows_of(run, None, 0.0, 1 << 20)


def _rows_of(
    run: Demodulator, found: RunDown | None, origin_s: float, block_samples: int
) -> Iterator[Periods]:
    """Blocks of rows; the last one holds spectrum and status."""
    recording, looked = run.recording, run.survey
    ends = (recording.times(0, 1)[0], recording.times(len(recording.c) - 1)[0])
    if found is not None:
        run.judged_s = (found.begin_s, found.end_s)
        ends = (max(ends[0], found.begin_s), min(ends[1], found.end_s))
    judge = StreamJudge(run, float(ends[0]), float(ends[1]), found)
    held: Periods | None = None
    for rows in (make_even_rows if recording.time_s is None else make_uneven_rows)(
        run, block_samples
    ):
        # One block is held back: the last one carries spectrum and status, and which is last is
        # known behind it.
        if held is not None:
            yield held
        held = _write_periods(run, rows, judge)
    if held is None:
        raise run.tell_too_short()
    yield judge.judge(
        held.replace(
            spectrum_frequency_hz=looked.spectrum_hz,
            spectrum_density=looked.spectrum_density,
            spectrum_line_frequency_hz=looked.line_hz,
            spectrum_line_amplitude=looked.line_amplitude,
            spectrum_line_ratio=looked.line_ratio,
            details=json.dumps({"clock_origin_s": origin_s} if origin_s else {}),
        )
    )


SUMMARY_ROWS = 1 << 17
"""Rows that a median of the summary looks at; longer files are thinned, their flags counted block
by block."""


def summarise(periods: Periods) -> dict[str, Any]:
    """What a person or another program wants to know of demodulated signals.

    Parameters
    ----------
    periods
        Made by `demodulate`.

    Returns
    -------
    dict
        Windows, frequency, noise, flags and the strongest lines; of a long run the noise is that of
        some of its windows.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording, collect, demodulate
    >>> from hrg_cli.stages.demodulate import summarise
    >>> t = np.arange(8000) / 8000
    >>> noise = 1e-4 * np.random.default_rng(0).standard_normal((2, 8000))
    >>> c, s = np.array([[1.0], [0.1]]) * np.cos(2 * np.pi * 1000 * t) + noise
    >>> recording = Recording(c=c, s=s, sample_rate_hz=8000.0, mode="free")
    >>> found = summarise(collect(demodulate(recording, periods_per_window=20)))
    >>> found["windows"], round(found["duration_s"], 6), round(found["reference_frequency_hz"], 2)
    (50, 1.0, 1000.0)
    """
    names = {
        "clipped": FLAG_CLIPPED,
        "gap": FLAG_GAP,
        "not_finite": FLAG_NOT_FINITE,
        "settling": FLAG_SETTLING,
    }
    rms = _thin(periods.residual_rms)
    counts = dict.fromkeys(names, 0)
    for start in range(0, len(periods), SUMMARY_ROWS):
        flags = np.asarray(periods.flags[start : start + SUMMARY_ROWS])
        counts = {
            name: counts[name] + int(np.count_nonzero(flags & bit)) for name, bit in names.items()
        }
    where, amplitude, ratio = (
        periods.spectrum_line_frequency_hz,
        periods.spectrum_line_amplitude,
        periods.spectrum_line_ratio,
    )
    lines = []
    if where is not None and amplitude is not None and ratio is not None:
        lines = [
            {"frequency_hz": float(f), "amplitude": [float(v) for v in a], "power_ratio": float(r)}
            for f, a, r in zip(where[:8], amplitude[:8], ratio[:8], strict=True)
        ]
    return {
        "windows": len(periods),
        "reference_frequency_hz": periods.reference_frequency_hz,
        "periods_per_window": periods.periods_per_window,
        "window_s": periods.window_s,
        "duration_s": (
            float(periods.time_s[-1] - periods.time_s[0]) + periods.window_s
            if len(periods)
            else 0.0
        ),
        "residual_rms": [
            float(find_median(column[np.isfinite(column)])) if np.isfinite(column).any() else None
            for column in rms.T
        ],
        "flagged": counts,
        "residual_lines": lines,
    }


def _thin(column: Any) -> Any:
    """Every nth row of a column, n such that `SUMMARY_ROWS` are left at least; read block by block,
    as single rows take HDF5 twice as long as all of them."""
    every = max(1, len(column) // SUMMARY_ROWS)
    step = every * (1 + SUMMARY_ROWS // every)
    starts = range(0, max(1, len(column)), step)
    return np.concatenate([np.asarray(column[start : start + step])[::every] for start in starts])


def _write_periods(run: Demodulator, rows: Rows, judge: StreamJudge) -> Periods:
    """One block of the stream."""
    recording = run.recording
    judge.flag_settling(rows)
    judge.count(rows["flags"])
    return Periods(
        time_s=rows["time_s"],
        signals=rows["signals"],
        signals_std=rows["signals_std"],
        residual_rms=rows["residual_rms"],
        flags=rows["flags"],
        **judge.log.read_at(rows["time_s"], run.window_s),
        reference_frequency_hz=run.reference_hz,
        periods_per_window=run.window_s * run.reference_hz,
        window_s=run.window_s,
        window_stands_for="middle" if run.takes_bends_off else "mean",
        mode=recording.mode,
        readout=recording.readout,
        carrier_hz=recording.carrier_hz,
        mode_number=recording.mode_number,
        gyro_id=recording.gyro_id,
        run_id=recording.run_id,
        lot_id=recording.lot_id,
        start_time=recording.start_time,
        units=recording.c_units,
        least_count=run.find_least_count(),
        quantisation_share=run.estimate_quantisation_share(),
        noise_correlation=run.survey.noise_correlation,
    )
