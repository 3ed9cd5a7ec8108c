"""The samples that are demodulated: a recording that can be, the part of it that was asked for, and
the survey of the run-down in it.
"""

from __future__ import annotations

import numpy as np

from ...errors import HrgError
from ...fitting.samples.run_down import RunDown
from ...fitting.samples.survey import Survey, survey
from ...records import Recording


def check_recording(recording: Recording) -> str:
    """The run's name for messages, after the checks that need no sample.

    Parameters
    ----------
    recording
        Of both channels.

    Returns
    -------
    str
        "run NAME", or "the recording".

    Raises
    ------
    HrgError
        Lengths that differ, no sampling rate, an unknown read-out, or a carrier whose frequency is
        missing.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.stages.demodulation.part import check_recording
    >>> made = Recording(c=np.zeros(9), s=np.zeros(8), sample_rate_hz=1e4, mode="free", run_id="a")
    >>> check_recording(made)
    Traceback (most recent call last):
    ...
    hrg_cli.errors.HrgError: run a: channel C has 9 samples and S 8; equal lengths were expected
    """
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


def cut_part(
    recording: Recording, name: str, from_s: float | None, to_s: float | None
) -> tuple[Recording, list[str]]:
    """The samples from_s ≤ t − t_first < to_s of a recording.

    Parameters
    ----------
    recording
        All of it.
    name
        For messages.
    from_s, to_s
        Where the part begins and ends [s]; None: with the recording.

    Returns
    -------
    tuple
        The part, and notes on what was taken.

    Raises
    ------
    HrgError
        Nothing lies between them.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.stages.demodulation.part import cut_part
    >>> made = Recording(c=np.arange(9.0), s=np.zeros(9), sample_rate_hz=2.0, mode="free")
    >>> part, notes = cut_part(made, "run a", 1.0, 3.0)
    >>> part.c[:].tolist(), notes
    ([2.0, 3.0, 4.0, 5.0], ['samples 3 to 6 of 9 were taken: 1 s to 3 s of the recording'])
    """
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
        fallback if at is None else _find_row(recording, begin + at)
        for at, fallback in ((from_s, 0), (to_s, n))
    )
    last = min(end - begin, to_s or np.inf)
    notes.append(
        f"samples {start + 1} to {stop} of {n} were taken: {from_s or 0:.6g} s to {last:.6g} s of"
        " the recording"
    )
    return recording.part(start, stop), notes


def survey_run_down(recording: Recording, whole: Survey, found: RunDown, name: str) -> Survey:
    """The survey of the run-down alone.

    Parameters
    ----------
    recording
        All of it.
    whole
        Its survey.
    found
        Where the run-down begins and ends.
    name
        For messages.

    Returns
    -------
    Survey
        Of the run-down; that of the whole where too little is left.

    Examples
    --------
    Of a run-down of three samples only the whole can be looked at:

    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.fitting.samples.run_down import RunDown
    >>> from hrg_cli.fitting.samples.survey import survey
    >>> from hrg_cli.stages.demodulation.part import survey_run_down
    >>> t = np.arange(4000) / 1e4
    >>> c = np.cos(2e3 * np.pi * t)
    >>> made = Recording(c=c, s=0.5 * c, sample_rate_hz=1e4, mode="free")
    >>> whole = survey(made, "run a")
    >>> survey_run_down(made, whole, RunDown(0.0, 3e-4, ()), "run a") is whole
    True
    """
    start, stop = (
        fallback if not np.isfinite(at) else _find_row(recording, at)
        for at, fallback in ((found.begin_s, 0), (found.end_s, len(recording.c)))
    )
    try:
        inside = survey(recording.part(start, stop), name)
    except HrgError:
        return whole
    # Little is left of a short ring: its own frequency would be noise.
    return whole if inside.refused else inside


def _find_row(recording: Recording, time_s: float) -> int:
    """The first row whose time is not before `time_s`."""
    if recording.time_s is None:
        assert recording.sample_rate_hz is not None
        return min(
            len(recording.c),
            # A millionth of a step: a time written in decimals may come out a little above a whole
            # number of steps, as 0.1·3·10 does.
            max(0, int(np.ceil(time_s * recording.sample_rate_hz - 1e-6)) - recording.first_sample),
        )
    low, high = 0, len(recording.c)
    while low < high:
        middle = (low + high) // 2
        low, high = (
            (middle + 1, high) if recording.times(middle, middle + 1)[0] < time_s else (low, middle)
        )
    return low
