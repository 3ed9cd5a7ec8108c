"""The part of a free recording that is the run-down of a struck body: from the end of the strike to
where it is gone or touched.

Short windows along the recording give the wave's power P, the floor F beside its frequency and the
power R of all that is not the wave. A strike is a rise of P and of the whole sound within two
windows, from far below; before it, there is nothing of the run-down. At the end the wave is gone
where P does not stand out of F, or something else has begun where R jumps up to stay while P falls
much faster than before. A beat passes through zero again and again, dry friction ends a run-down
without a sound: neither is cut.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ...records import Recording
from ..medians import find_median
from .survey import Survey

Array = np.ndarray

WINDOWS, SUB_WINDOWS = 256, 4
"""Windows along a recording that is looked at closely, and those a look of the survey is cut into
before."""

FEWEST_PERIODS, FEW_SAMPLES, MOST_SAMPLES = 8.0, 1024, 4096
"""Least length of a window, and its most samples at the first look and at the closer one."""

STRIKE, SOUND = 10.0, 4.0
"""Rise of the wave's power and of the whole sound's that is a strike."""

CLEAR, GONE = 100.0, 10.0
"""Power over the floor of a wave that is there, and below which it is gone."""

LOUDER, FASTER, FEWEST_END = 3.0, 2.5, 3
"""Rise of what is not the wave, factor of the decay, and windows up to the end that show another
sound."""

BESIDE = np.array([0.0, -7, -6, -5, -4, 4, 5, 6, 7])
"""Bins of a window's spectrum, from the oscillation's on, at which its power and the floor are
taken."""

NEAR = 0.02
"""Part of a bin and of a period within which two windows share their sines."""

BEFORE = 24
"""Windows before a possible end with which it is compared."""


@dataclass(frozen=True)
class RunDown:
    """Times between which the run-down lies (±∞ where the recording's ends do) and what was found
    outside."""

    begin_s: float
    end_s: float
    notes: tuple[str, ...]


@dataclass(frozen=True)
class _Course:
    """Windows: time of begin and end [s], powers of the wave, of the floor beside it, of the rest
    (n,)."""

    begin_s: Array
    end_s: Array
    wave: Array
    floor: Array
    rest: Array


def find_run_down(recording: Recording, survey: Survey) -> RunDown | None:
    """Where the run-down of a free recording begins and ends.

    Parameters
    ----------
    recording
        Of both channels.
    survey
        What its looks show.

    Returns
    -------
    RunDown or None
        None where all of it is one, and of a recording that is driven, read by a carrier or
        refused.

    Examples
    --------
    A body that is struck at 1 s:

    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.fitting.samples.run_down import find_run_down
    >>> from hrg_cli.fitting.samples.survey import survey
    >>> t = np.arange(80_000) / 8000
    >>> c = np.where(t > 1, np.exp(-(t - 1) / 3), 0) * np.cos(2 * np.pi * 1234 * t)
    >>> noise = 1e-4 * np.random.default_rng(0).standard_normal((2, 80_000))
    >>> run = Recording(c=c + noise[0], s=0.5 * c + noise[1], sample_rate_hz=8000.0, mode="free")
    >>> found = find_run_down(run, survey(run, "run"))
    >>> 1.0 < found.begin_s < 1.1, found.end_s
    (True, inf)
    """
    if recording.mode != "free" or recording.readout != "direct" or survey.refused:
        return None
    coarse = _judge_course(_measure_course(_cut_looks(survey), survey))
    if coarse is None:
        return None
    return _judge_course(_measure_course(_take_windows(recording, survey), survey))


def _judge_course(course: _Course) -> RunDown | None:
    """The run-down that the windows' powers show; None where all of them are of it."""
    n = len(course.wave)
    if n < 4 * FEWEST_END:
        return None
    first, last = _find_strike(course), n
    if course.wave[first:].max() > CLEAR * find_median(course.floor):
        last = _find_end(course, first)
        last = min(last, _find_disturbance(course, first, last))
    notes = []
    if first > 0:
        notes.append(
            f"the run-down begins with a strike that ends at about {course.end_s[first]:.4g} s; the"
            " windows before are flagged as settling"
        )
    if last < n:
        notes.append(
            f"the run-down is over at about {course.begin_s[last]:.4g} s; the windows behind are"
            " flagged as settling"
        )
    if not notes:
        return None
    begin = float(course.end_s[first]) if first else -np.inf
    return RunDown(begin, float(course.begin_s[last]) if last < n else np.inf, tuple(notes))


def _find_strike(course: _Course) -> int:
    """The first window that holds the whole wave after a strike; 0 where there is none."""
    wave, sound = course.wave, course.wave + course.rest
    for k in range(1, len(wave) // 2 + len(wave) // 4):
        after = min(k + 1, len(wave) - 1)
        peak = wave[k : k + BEFORE].max()
        if (
            find_median(wave[:k] / course.floor[:k]) > GONE
        ):  # a wave is there already: what follows is a beat
            return 0
        if (
            wave[:k].max() * STRIKE < peak
            and peak < 2 * STRIKE * wave[after]
            and sound[:k].max() * SOUND < sound[k : after + 1].max()
        ):
            later = np.flatnonzero(wave[k : k + 3] > peak / STRIKE)
            return k + int(later[0]) if len(later) else k
    return 0


def _find_end(course: _Course, first: int) -> int:
    """The window from which on the wave no longer stands out of the noise beside it."""
    there = course.wave > GONE * course.floor
    last = int(np.flatnonzero(there)[-1]) + 1 if there.any() else len(there)
    # single windows that stand out by chance or by another sound do not hold the end up
    while last - first > 2 * FEWEST_END and there[last - 2 * FEWEST_END : last].mean() < 0.5:
        last -= 1
    return last if len(course.wave) - last >= FEWEST_END else len(course.wave)


def _find_disturbance(course: _Course, first: int, last: int) -> int:
    """The window from which on another sound is there and the wave falls faster; `last` where there
    is none."""
    log_rest, log_wave = (
        np.log(np.maximum(course.rest, 1e-300)),
        np.log(np.maximum(course.wave, 1e-300)),
    )
    time = (course.begin_s + course.end_s) / 2
    best, found = 0.0, last
    for k in range(first + (last - first) // 2, last - FEWEST_END + 1):
        before, after = slice(max(first, k - BEFORE), k), slice(k, last)
        rise = float(find_median(log_rest[after]) - find_median(log_rest[before]))
        if rise < np.log(LOUDER) or np.mean(log_rest[after] > find_median(log_rest[before])) < 0.9:
            continue
        slow, fast = (
            float(np.polyfit(time[part], log_wave[part], 1)[0]) for part in (before, after)
        )
        step = float(np.std(np.diff(log_rest[before])))
        if (
            fast < FASTER * min(slow, 0.0)
            and fast < 0
            and rise > 3 * step
            and rise * np.sqrt(last - k) > best
        ):
            best, found = rise * np.sqrt(last - k), k
    return found


def _cut_looks(survey: Survey) -> Iterable[tuple[Array, Array]]:
    """Times and samples (2, n) of the parts of the survey's looks."""
    period = FEWEST_PERIODS / survey.reference_hz / survey.step_s
    shortest = max(16, int(np.ceil(period)))
    for look in survey.looks:
        n = len(look.time_s)
        parts = max(1, min(SUB_WINDOWS if len(survey.looks) > 1 else WINDOWS, n // shortest))
        length = min(n // parts, max(shortest, FEW_SAMPLES))
        for start in range(0, n - length + 1, n // parts):
            yield look.time_s[start : start + length], look.y[:, start : start + length]


def _take_windows(recording: Recording, survey: Survey) -> Iterable[tuple[Array, Array]]:
    """Times and samples of windows all along the recording."""
    n = len(recording.c)
    least = max(16, int(np.ceil(FEWEST_PERIODS / survey.reference_hz / survey.step_s)))
    pitch = max(least, n // WINDOWS)
    length = min(pitch, max(least, MOST_SAMPLES))
    for start in range(0, n - length + 1, pitch):
        yield (
            recording.times(start, start + length),
            np.stack(recording.physical(start, start + length)),
        )


def _measure_course(pieces: Iterable[tuple[Array, Array]], survey: Survey) -> _Course:
    """Powers under a Hann window at the oscillation's frequency, at frequencies four to seven bins
    beside it, and of the rest."""
    rows: list[tuple[float, float, float, float, float]] = []
    kept: tuple[Array, float] | None = None
    window = turn = np.zeros(0)
    for time_s, y in pieces:
        if not np.isfinite(y).all():
            continue
        middle, span = (time_s[0] + time_s[-1]) / 2, time_s[-1] - time_s[0]
        tau, hz = time_s - middle, survey.interpolate_hz(middle)
        near = kept is not None and len(kept[0]) == len(tau) and abs(kept[1] - hz) < NEAR / span
        if kept is None or not near or np.abs(kept[0] - tau).max() > NEAR / survey.reference_hz:
            kept = tau, hz
            window = np.hanning(len(time_s) + 2)[1:-1]
            window /= window.sum()
            turn = np.exp(-2j * np.pi * np.multiply.outer(hz + BESIDE / span, tau))
        y = y - (y * window).sum(1, keepdims=True)
        power = (np.abs((y * window) @ turn.T) ** 2).sum(0) * 2  # of a wave of amplitude a: a²/2
        whole = float((y**2 @ window).sum())
        rows.append(
            (
                time_s[0],
                time_s[-1],
                float(power[0]),
                float(find_median(power[1:])),
                max(whole - float(power[0]), 1e-12 * whole),
            )
        )
    values = np.array(rows).reshape(-1, 5).T
    return _Course(*values)
