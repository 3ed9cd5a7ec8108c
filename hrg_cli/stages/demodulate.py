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
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from ..errors import HrgError
from ..fitting.samples.course import (
    Course,
    course,
    impulse,
    mean_of,
    means_of_values,
)
from ..fitting.samples.demodulator import Demodulator, Rows
from ..fitting.samples.even import even_rows
from ..fitting.samples.run_down import RunDown, run_down
from ..fitting.samples.survey import Survey, survey
from ..fitting.samples.uneven import uneven_rows
from ..records import (
    FLAG_CLIPPED,
    FLAG_GAP,
    FLAG_NOT_FINITE,
    FLAG_SETTLING,
    Array,
    Periods,
    Recording,
)
from ..records.clock import from_first_sample

SETTLING_FACTOR, SETTLING_SHARE = 5.0, 0.1
"""A settling start has a residual so many times the run's, absolutely and relative to the wave, and
is at most this part of the run."""

GAPS_SHARE = 0.1
"""Part of the windows above which gaps make the result suspect."""

COMMANDS = ("drive_main", "drive_quadrature")
AUXILIARY = ("temperature_degc", "rate_rad_s", *COMMANDS)


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
    ] = 1 << 20,
) -> Iterator[Periods]:
    """The signals of every window: least-squares coefficients of both channels at one reference
    frequency.

    C = c_cos·cos ω_r t + c_sin·sin ω_r t and the same of S, fitted about each window's centre; with
    a carrier the coefficients at both side bands |ω_c ∓ ω| (seed B (1), PHYSICS §3). Memory does not
    grow with the recording. With `from_s`, `to_s` the rest is as if it had not been recorded, but
    rows keep the times of the whole recording, to which the reference phase, the auxiliary log and
    `start_time` belong. Times whose clock began so long before that doubles are too coarse (seconds
    since 1970) count from the first sample; details keep its time as `clock_origin_s`.

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
    >>> c = np.cos(2 * np.pi * 1000 * t) + 1e-4 * np.random.default_rng(0).standard_normal(8000)
    >>> recording = Recording(c=c, s=0.1 * c, sample_rate_hz=8000.0, mode="free")
    >>> periods = collect(demodulate(recording, periods_per_window=20))
    >>> periods.signals.shape, round(periods.reference_frequency_hz, 2)
    ((50, 4), 1000.0)
    >>> float(np.hypot(*periods.signals[0, :2]).round(3))
    1.0
    """
    name = _checked(recording)
    recording, origin_s = from_first_sample(recording)
    recording, notes = _part(recording, name, from_s, to_s)
    if origin_s:
        notes.append(f"its clock had run {origin_s:.15g} s; times count from the first sample on")
    if nominal_frequency_hz is not None:
        recording = recording.replace(nominal_frequency_hz=nominal_frequency_hz)
    looked = survey(recording, name)
    found = run_down(recording, looked)
    if found is not None:
        notes.extend(found.notes)
        looked = _survey_within(recording, looked, found, name)
    run = Demodulator(recording, looked, name, periods_per_window, moving_envelope, notes=notes)
    ends = (recording.times(0, 1)[0], recording.times(len(recording.c) - 1)[0])
    if found is not None:
        run.judged_s = (found.begin_s, found.end_s)
        ends = (max(ends[0], found.begin_s), min(ends[1], found.end_s))
    judge = _Judge(run, float(ends[0]), float(ends[1]), found)
    held: Periods | None = None
    for rows in (even_rows if recording.time_s is None else uneven_rows)(run, block_samples):
        if held is not None:
            yield held
        held = _periods(run, rows, judge)
    if held is None:
        raise run.too_short()
    yield judge.verdict(
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


def summary(periods: Periods) -> dict[str, Any]:
    """What a person or another program wants to know of demodulated signals: windows, frequency,
    noise, flags, the strongest lines."""
    names = {
        "clipped": FLAG_CLIPPED,
        "gap": FLAG_GAP,
        "not_finite": FLAG_NOT_FINITE,
        "settling": FLAG_SETTLING,
    }
    every = max(1, len(periods) // SUMMARY_ROWS)
    rms = np.asarray(periods.residual_rms[::every])
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
            float(np.median(column[np.isfinite(column)])) if np.isfinite(column).any() else None
            for column in rms.T
        ],
        "flagged": counts,
        "residual_lines": lines,
    }


def _checked(recording: Recording) -> str:
    """The run's name for messages, after the checks that need no sample."""
    name = f"run {recording.run_id}" if recording.run_id else "the recording"
    c, s = len(recording.c), len(recording.s)
    if c != s:
        raise HrgError(f"{name}: channel C has {c} samples and S {s}; equal lengths were expected")
    if recording.time_s is not None and len(recording.time_s) != c:
        raise HrgError(
            f"{name}: time_s has {len(recording.time_s)} values for {c} samples; one time a sample"
            " was expected"
        )
    rate = recording.sample_rate_hz
    if recording.time_s is None and not (rate is not None and np.isfinite(rate) and rate > 0):
        raise HrgError(
            f"{name}: sample_rate_hz is {rate}; a positive number (or a time_s of every sample) was"
            " expected"
        )
    if recording.readout not in ("direct", "carrier"):
        raise HrgError(f"{name}: read-out is {recording.readout!r}; direct or carrier was expected")
    if recording.readout == "carrier" and recording.carrier_hz is None:
        raise HrgError(
            f"{name}: read-out is by carrier, but carrier_hz is missing; add it to the recording"
        )
    return name


def _part(
    recording: Recording, name: str, from_s: float | None, to_s: float | None
) -> tuple[Recording, list[str]]:
    """The samples from_s ≤ t − t_first < to_s, and notes. HrgError: nothing lies between them."""
    if from_s is None and to_s is None:
        return recording, []
    n = len(recording.c)
    if n == 0:
        return recording, []
    begin, end = (float(recording.times(k, k + 1)[0]) for k in (0, n - 1))
    if from_s is not None and to_s is not None and not from_s < to_s:
        raise HrgError(
            f"{name}: from_s = {from_s:g} is not before to_s = {to_s:g}; a part of the recording"
            " was expected"
        )
    if from_s is not None and begin + from_s > end:
        raise HrgError(
            f"{name}: from_s = {from_s:g} lies behind its end; it is {end - begin:.6g} s long"
        )
    notes = []
    if to_s is not None and begin + to_s > end + 1.5 * (end - begin) / max(1, n - 1):
        notes.append(
            f"to_s = {to_s:g} lies behind the recording's end at {end - begin:.6g} s; it was taken"
            " up to there"
        )
    start, stop = (
        fallback if at is None else _row_at(recording, begin + at)
        for at, fallback in ((from_s, 0), (to_s, n))
    )
    last = min(end - begin, to_s or np.inf)
    notes.append(
        f"samples {start + 1} to {stop} of {n} were taken: {from_s or 0:.6g} s to {last:.6g} s of"
        " the recording"
    )
    return recording.part(start, stop), notes


def _survey_within(recording: Recording, whole: Survey, found: RunDown, name: str) -> Survey:
    """The survey of the run-down alone; of the whole where too little is left."""
    start, stop = (
        fallback if not np.isfinite(at) else _row_at(recording, at)
        for at, fallback in ((found.begin_s, 0), (found.end_s, len(recording.c)))
    )
    try:
        inside = survey(recording.part(start, stop), name)
    except HrgError:
        return whole
    return whole if inside.refused else inside


def _row_at(recording: Recording, time_s: float) -> int:
    """The first row whose time is not before `time_s`."""
    if recording.time_s is None:
        assert recording.sample_rate_hz is not None
        return min(
            len(recording.c),
            max(0, int(np.ceil(time_s * recording.sample_rate_hz - 1e-6)) - recording.first_sample),
        )
    low, high = 0, len(recording.c)
    while low < high:
        middle = (low + high) // 2
        low, high = (
            (middle + 1, high) if recording.times(middle, middle + 1)[0] < time_s else (low, middle)
        )
    return low


def _periods(run: Demodulator, rows: Rows, judge: _Judge) -> Periods:
    """One block of the stream."""
    recording = run.recording
    judge.settling(rows)
    judge.count(rows["flags"])
    return Periods(
        time_s=rows["time_s"],
        signals=rows["signals"],
        signals_std=rows["signals_std"],
        residual_rms=rows["residual_rms"],
        flags=rows["flags"],
        **judge.auxiliary(rows["time_s"]),
        reference_frequency_hz=run.reference_hz,
        periods_per_window=run.window_s * run.reference_hz,
        window_s=run.window_s,
        mode=recording.mode,
        readout=recording.readout,
        carrier_hz=recording.carrier_hz,
        mode_number=recording.mode_number,
        gyro_id=recording.gyro_id,
        run_id=recording.run_id,
        lot_id=recording.lot_id,
        start_time=recording.start_time,
        units=recording.c_units,
        least_count=run.least_count(),
        quantisation_share=run.quantisation_share(),
    )


@dataclass
class _Judge:
    """What the rows so far have shown, and the log beside them."""

    run: Demodulator
    begin_s: float
    end_s: float
    part: RunDown | None
    rows: int = 0
    flagged: dict[int, int] = field(default_factory=dict)
    settled: bool = False
    settle: int = 0
    outside_log: int = 0

    def __post_init__(self) -> None:
        recording = self.run.recording
        time = recording.auxiliary_time_s
        self.log_time = np.asarray(time, float) if time is not None and len(time) else None
        self.log: dict[str, Course] = {}
        if self.log_time is not None:
            if (np.diff(self.log_time) <= 0).any():
                raise HrgError(
                    f"{self.run.name}: the times of its auxiliary log do not increase; strictly"
                    " increasing times were expected"
                )
            logged = {name: getattr(recording, name) for name in AUXILIARY}
            self.log = {
                name: (
                    impulse(self.log_time, means_of_values(self.log_time, values))
                    if name in COMMANDS
                    else course(self.log_time, values)
                )
                for name, values in logged.items()
                if values is not None
            }

    def outside(self, rows: Rows) -> Array:
        """Flag the rows that reach beyond the run-down; those before it (n,) bool."""
        if self.part is None:
            return np.zeros(len(rows["flags"]), bool)
        half = self.run.window_s / 2
        before, behind = (
            rows["time_s"] - half < self.part.begin_s,
            rows["time_s"] + half > self.part.end_s,
        )
        rows["flags"][before | behind] |= FLAG_SETTLING
        return np.asarray(before)

    def settling(self, rows: Rows) -> None:
        """Flag the rows outside the run-down, and its leading ones whose residual is far above the
        run's, until the first that is not."""
        before = self.outside(rows)
        if self.settled:
            return
        power, relative = self.run.calm
        residual2 = (rows["residual_rms"] ** 2).sum(1)
        wave2 = (rows["signals"] ** 2).sum(1) / 2
        least2 = max(self.run.least_variance(0), self.run.least_variance(1))
        far = (residual2 > SETTLING_FACTOR**2 * max(power, least2)) & (
            residual2 > SETTLING_FACTOR**2 * relative * wave2
        )
        far &= rows["time_s"] - self.begin_s < SETTLING_SHARE * (self.end_s - self.begin_s)
        far &= rows["flags"] & FLAG_CLIPPED == 0
        calm = np.flatnonzero(~far & ~before & np.isfinite(residual2))
        stop = int(calm[0]) if len(calm) else len(far)
        far[:stop] &= ~before[:stop]
        rows["flags"][:stop][far[:stop]] |= FLAG_SETTLING
        self.settle += int(far[:stop].sum())
        self.settled = len(calm) > 0

    def count(self, flags: Array) -> None:
        """Keep count of the flags."""
        self.rows += len(flags)
        if flags.any():
            for bit in (FLAG_CLIPPED, FLAG_GAP, FLAG_NOT_FINITE, FLAG_SETTLING):
                self.flagged[bit] = self.flagged.get(bit, 0) + int(np.count_nonzero(flags & bit))

    def auxiliary(self, times: Array) -> dict[str, Any]:
        """The log at the windows' centres, commands as their means over the windows, which move the
        wave; up to one of its steps beyond its ends the end value, farther out NaN."""
        if self.log_time is None or not self.log:
            return {}
        log = self.log_time
        reach = float(np.median(np.diff(log))) if len(log) > 1 else np.inf
        outside = (times < log[0] - reach) | (times > log[-1] + reach)
        self.outside_log += int(outside.sum())
        values = {
            name: (
                mean_of(series, times, self.run.window_s) if name in COMMANDS else series.at(times)
            )
            for name, series in self.log.items()
        }
        if outside.any():
            for series in values.values():
                series[outside] = np.nan
        return values

    def _shorter(self, flagged: int) -> str:
        """Advice where gaps touch many windows and would touch fewer shorter ones."""
        gaps = self.run.gaps
        if gaps is None or flagged <= GAPS_SHARE * self.rows:
            return ""
        periods = gaps.shorter_periods(self.end_s - self.begin_s, GAPS_SHARE)
        return "" if periods is None else f"; use periods_per_window of at most {periods:.2g}"

    def verdict(self, periods: Periods) -> Periods:
        """The last block with the reasons to note, suspect or refuse the whole."""
        found, recording = self.run.survey, self.run.recording
        notes, suspect, refused = list(self.run.notes), list(found.suspect), list(found.refused)
        clipped, gaps, bad = (
            self.flagged.get(bit, 0) for bit in (FLAG_CLIPPED, FLAG_GAP, FLAG_NOT_FINITE)
        )
        of = f"of {self.rows} windows"
        if clipped:
            (suspect if clipped > 0.01 * self.rows else notes).append(
                f"{clipped} {of} hold clipped samples"
            )
        if gaps:
            (suspect if gaps > GAPS_SHARE * self.rows else notes).append(
                f"{gaps} {of} lie in or beside gaps of the sampling{self._shorter(gaps)}"
            )
        if bad:
            (suspect if bad > 0.01 * self.rows else notes).append(
                f"{bad} {of} hold samples that are not finite"
            )
        if self.settle:
            after = (
                ""
                if self.part is None or not np.isfinite(self.part.begin_s)
                else " after the strike"
            )
            notes.append(f"the first {self.settle} windows{after} settle")
        if self.outside_log:
            notes.append(
                f"{self.outside_log} {of} lie outside the auxiliary log; their temperature and rate"
                " are NaN"
            )
        if recording.s_units != recording.c_units:
            suspect.append(
                f"channel C is in {recording.c_units!r} and S in {recording.s_units!r}; the same"
                " unit was expected"
            )
        if self.run.bent > 2 * max(8, 0.01 * self.rows):
            shorter = (
                self.run.window_s
                * self.run.reference_hz
                * min(0.7, 0.5 * self.run.bent_by ** (-1 / 6))
            )
            advice = (
                f"use periods_per_window of at most {shorter:.2g}"
                if shorter >= 1
                else "another oscillation is near"
            )
            suspect.append(
                "the envelope moves too much within windows of"
                f" {self.run.window_s * self.run.reference_hz:.3g} periods: what the window's"
                f" average leaves uncorrected is {self.run.bent_by:.2g} times the noise; {advice}"
            )
        if bad == self.rows:
            refused.append("no window holds finite samples only")
        return periods.judged(notes, "valid").judged(suspect, "suspect").judged(refused, "refused")
