"""Times of a recording counted from its own first sample, where its clock began long before."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime, timedelta

import numpy as np

from .recording import Recording, Slice

SHARE = 1e-7
"""Rounding of a time, as part of the sampling step, from which times count from the first sample:
an oscillation turns by less than π a step, so what stays is below 3e-7 rad."""

SAME_DAY_S = 86_400.0
"""A start_time so near to the first stamp, read as seconds since 1970, names that stamp."""


def measure_from_first_sample(recording: Recording) -> tuple[Recording, float]:
    """The recording with its times counted from the first sample, where doubles on its own clock
    are too coarse for sums with them.

    Seconds since 1970 have a spacing of 2.4e-7 s, 1.5e-3 rad at 1 kHz. The stamps themselves are
    given; what is lost lies in window centres and phases formed from them. Their differences from
    the first are exact (Sterbenz 1974, Floating-Point Computation). The logs beside the samples run
    on the same clock. Nothing is read but the ends.

    Parameters
    ----------
    recording
        With times (n,) of its own, or evenly sampled.

    Returns
    -------
    tuple
        The recording, and the first sample's time on its own clock [s]; as it is, and 0, where that
        clock is fine enough.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.records.time_origin import measure_from_first_sample
    >>> stamps = 1.7e9 + np.arange(4) / 1024
    >>> own = dict(c=np.zeros(4), s=np.zeros(4), sample_rate_hz=1024.0, time_s=stamps, mode="free")
    >>> counted, first = measure_from_first_sample(Recording(**own))
    >>> counted.time_s[:].tolist(), first
    ([0.0, 0.0009765625, 0.001953125, 0.0029296875], 1700000000.0)
    """
    times, n = recording.time_s, len(recording.c)
    if times is None or n < 2 or len(times) != n:
        return recording, 0.0
    first, last = (float(times[k : k + 1][0]) for k in (0, n - 1))
    if not (np.isfinite(first) and last > first):
        return recording, 0.0
    if np.spacing(abs(first)) <= SHARE * (last - first) / (n - 1):
        return recording, 0.0
    logs = {
        name: np.asarray(values, float) - first
        for name in ("auxiliary_time_s", "truth_time_s")
        if (values := getattr(recording, name)) is not None
    }
    return recording.replace(
        time_s=Slice(times, 0, n, first),
        start_time=_first_moment(recording.start_time, first),
        **logs,
    ), first


def shift_time(start_time: str, by_s: float) -> str:
    """An ISO 8601 time so many seconds later.

    Parameters
    ----------
    start_time
        ISO 8601 text.
    by_s
        s.

    Returns
    -------
    str
        ISO 8601; as it is where it cannot be read.

    Examples
    --------
    >>> from hrg_cli.records.time_origin import shift_time
    >>> shift_time("2026-05-04T14:03:22Z", 1.5), shift_time("yesterday", 1.5)
    ('2026-05-04T14:03:23.500000Z', 'yesterday')
    """
    if not by_s:
        return start_time
    try:
        later = _moment(start_time) + timedelta(seconds=by_s)
    except (ValueError, OverflowError):
        return start_time
    return later.isoformat().replace("+00:00", "Z")


def _first_moment(start_time: str, first_s: float) -> str:
    """start_time of the first sample: that of t = 0 moved, unless it names the first sample's stamp
    in seconds since 1970 already."""
    try:
        since_1970 = parse_time(start_time)
    except ValueError:
        return start_time
    if abs(since_1970 - first_s) <= SAME_DAY_S:
        return start_time
    return shift_time(start_time, first_s)


def parse_time(text: str) -> float:
    """Seconds since 1970 of a time as text.

    Parameters
    ----------
    text
        ISO 8601; one without a zone is UTC.

    Returns
    -------
    float
        s.

    Examples
    --------
    >>> from hrg_cli.records.time_origin import parse_time
    >>> parse_time("1970-01-02T00:00:00"), parse_time("1970-01-01T01:00:00+01:00")
    (86400.0, 0.0)
    """
    found = _moment(text)
    return (found if found.tzinfo else found.replace(tzinfo=UTC)).timestamp()


def count_from_first(start_times: Sequence[str]) -> list[float]:
    """How long after the first of several runs each of them began.

    Parameters
    ----------
    start_times
        ISO 8601.

    Returns
    -------
    list of float
        s; 0 of all where one of the times is not known or cannot be read.

    Examples
    --------
    >>> from hrg_cli.records.time_origin import count_from_first
    >>> count_from_first(["2026-05-04T09:00:00Z", "2026-05-04T08:00:00Z"])
    [3600.0, 0.0]
    >>> count_from_first(["2026-05-04T09:00:00Z", ""])
    [0.0, 0.0]
    """
    try:
        moments = [parse_time(text) for text in start_times]
    except ValueError:
        return [0.0] * len(start_times)
    return [one - min(moments) for one in moments]


def _moment(text: str) -> datetime:
    return datetime.fromisoformat(text.replace("Z", "+00:00"))
