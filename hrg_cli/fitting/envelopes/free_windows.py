"""Free windows cut out of a long record whose drive switches off for a while, and the choice of the
most different ones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...errors import HrgError
from ...physics import ellipse
from ...records import Wave
from .envelope_runs import MIN_ROWS, EnvelopeRun

Array = np.ndarray
OFF_FRACTION = 1e-6
"""A drive below this part of its largest value is off."""
DECAY_PIECES = 400
MIN_WINDOW_ROWS = 3 * MIN_ROWS
BESIDE = 3
"""Rows beside a window from which the envelope's bend within it is taken."""


def cut_free_windows(wave: Wave) -> list[Wave]:
    """Free windows of a wave in time order.

    They are where `drive_main` is zero, else where the main amplitude itself decays steadily; a
    free wave without a drive is one window.

    Parameters
    ----------
    wave
        With its drive's log, where there is one.

    Returns
    -------
    list of Wave
        Each of mode "free", numbered behind the run's name where there are several.

    Raises
    ------
    HrgError
        A forced wave in which no free window is found.

    Examples
    --------
    A drive that is off from 50 to 150 s; the rows beside a switch hold both states:

    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli import Wave
    >>> from hrg_cli.fitting.envelopes.free_windows import cut_free_windows
    >>> t, ones = np.arange(200.0), np.ones(200)
    >>> wave = Wave(**{f.name: ones for f in fields(Wave) if f.default is MISSING} | dict(
    ...     time_s=t, flags=np.zeros(200, "u1"), iterations=np.zeros(200, "i2"), mode="forced",
    ...     drive_main=np.where((t >= 50) & (t < 150), 0.0, 0.1), window_s=1.0,
    ... ))
    >>> (free,) = cut_free_windows(wave)
    >>> free.mode, float(free.time_s[0]), float(free.time_s[-1])
    ('free', 53.0, 146.0)
    """
    if wave.drive_main is None and wave.mode == "free":
        return [wave]
    wave = wave.rows(0, len(wave))
    drive = wave.drive_main
    driven = drive is not None and np.isfinite(drive).any() and np.nanmax(np.abs(drive)) > 0
    if not driven and wave.mode == "free":
        return [wave]
    if driven:
        assert drive is not None
        off = np.abs(np.nan_to_num(drive, nan=np.inf)) <= OFF_FRACTION * np.nanmax(np.abs(drive))
        if (
            wave.drive_quadrature is not None
            and np.nanmax(np.abs(wave.drive_quadrature), initial=0.0) > 0
        ):
            off &= np.abs(np.nan_to_num(wave.drive_quadrature)) <= OFF_FRACTION * np.nanmax(
                np.abs(wave.drive_quadrature)
            )
    else:
        off = find_decay(np.asarray(wave.main_amplitude, float), wave.good())
    windows = [wave.rows(a, b) for a, b in find_stretches(off) if b - a >= MIN_WINDOW_ROWS]
    if not windows:
        raise HrgError(
            f"{wave.run_id or 'the run'}: is driven throughout (mode {wave.mode}), free windows"
            " were expected; record a run-down or switch the drive off for a while, or use"
            " --method working-mode"
        )
    return (
        [w.replace(run_id=f"{wave.run_id}[{i}]", mode="free") for i, w in enumerate(windows)]
        if len(windows) > 1
        else [windows[0].replace(mode="free")]
    )


def split_driven_and_free(
    wave: Wave, run: EnvelopeRun
) -> tuple[list[EnvelopeRun], list[EnvelopeRun]]:
    """The stretches of a wave's good rows in which it is driven, and those in which it is free.

    Parameters
    ----------
    wave
        With its drive's log, where there is one.
    run
        Its good rows.

    Returns
    -------
    tuple of list of EnvelopeRun
        Driven and free ones; the whole run is driven where no free window is found.

    Examples
    --------
    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli import Wave
    >>> from hrg_cli.fitting.envelopes.envelope_runs import from_wave
    >>> from hrg_cli.fitting.envelopes.free_windows import split_driven_and_free
    >>> t, ones = np.arange(200.0), np.ones(200)
    >>> wave = Wave(**{f.name: ones for f in fields(Wave) if f.default is MISSING} | dict(
    ...     time_s=t, flags=np.zeros(200, "u1"), iterations=np.zeros(200, "i2"), mode="forced",
    ...     drive_main=np.where(t < 120, 0.1, 0.0), window_s=1.0, reference_frequency_hz=5e3,
    ... ))
    >>> driven, free = split_driven_and_free(wave, from_wave(wave))
    >>> [len(run) for run in driven], [len(run) for run in free]
    ([120], [74])
    """
    try:
        windows = [(float(w.time_s[0]), float(w.time_s[-1])) for w in cut_free_windows(wave)]
    except HrgError:
        return [run], []
    free = np.zeros(len(run), bool)
    for begin, end in windows:
        free |= (run.time_s >= begin) & (run.time_s <= end)
    driven, loose = (
        [run.select_rows(slice(a, b)) for a, b in find_stretches(on) if b - a >= MIN_WINDOW_ROWS]
        for on in (~free, free)
    )
    return driven, loose


def find_stretches(on: Array) -> list[tuple[int, int]]:
    """The stretches of True, shortened at a switch by the rows that hold something of both states.

    Parameters
    ----------
    on
        bool (n,).

    Returns
    -------
    list of tuple of int
        (start, stop) of each of which rows are left.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.free_windows import find_stretches
    >>> on = np.repeat([True, False, True, False], [5, 1, 9, 1])
    >>> [(int(start), int(stop)) for start, stop in find_stretches(on)]
    [(0, 2), (9, 12)]
    """
    edge = np.flatnonzero(np.diff(np.concatenate([[False], on, [False]]).astype(int)))
    shed = [
        (int(a) + BESIDE * (a > 0), int(b) - BESIDE * (b < len(on)))
        for a, b in zip(edge[::2], edge[1::2])
    ]
    return [(start, stop) for start, stop in shed if stop > start]


def find_decay(amplitude: Array, good: Array) -> Array:
    """Rows in steady decay.

    They are those of pieces whose fall of ln a_A is above half the typical fall of the fastest
    tenth and below twice of it; ends are shed.

    Parameters
    ----------
    amplitude
        a_A (n,).
    good
        Which rows count, bool (n,).

    Returns
    -------
    ndarray
        bool (n,); no row where no fall is clear of its scatter.

    Examples
    --------
    A held amplitude that is let go for the second half of the record:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.free_windows import find_decay
    >>> t = np.arange(400.0)
    >>> rows = find_decay(np.exp(-0.01 * np.maximum(0.0, t - 200.0)), np.ones(400, bool))
    >>> np.flatnonzero(rows)[[0, -1]].tolist()
    [201, 398]
    """
    n = len(amplitude)
    size = max(1, n // DECAY_PIECES)
    pieces = n // size
    usable = np.where(good & (amplitude > 0), amplitude, np.nan)[: pieces * size].reshape(
        pieces, size
    )
    count = np.maximum(1, np.sum(np.isfinite(usable), axis=1))
    level = np.log(np.nansum(usable, axis=1) / count + 1e-300)
    fall = -np.diff(level)
    typical = float(np.median(np.sort(fall)[-max(1, len(fall) // 10) :]))
    spread = float(np.median(np.abs(np.diff(fall)))) + 1e-300
    # a decay is steady: its fall stands clear of the error that its scatter leaves in the mean
    if typical < 5 * spread / np.sqrt(max(1, len(fall) // 10)):
        return np.zeros(n, bool)
    falling = (fall > typical / 2) & (fall < 2 * typical)
    both = np.concatenate([[False], falling]) & np.concatenate([falling, [False]])
    rows = np.repeat(both, size)
    return np.concatenate([rows, np.zeros(n - len(rows), bool)])


def choose_different(runs: Sequence[EnvelopeRun], count: int) -> list[int]:
    """Indices of the runs that are spread widest in the wave's Stokes direction and rate.

    Parameters
    ----------
    runs
        To choose from.
    count
        How many are wanted.

    Returns
    -------
    list of int
        Rising; chosen one after the other, the longest first, each next one farthest from all
        before.

    Examples
    --------
    The longest of four run-downs, and of the others the one whose wave stands across it:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.free_windows import choose_different
    >>> def make_run(angle, rows):
    ...     t, u = np.arange(float(rows)), np.tile([np.cos(angle), np.sin(angle)], (rows, 1))
    ...     return EnvelopeRun("", t, u, 0 * t + 1e-4, 0 * t, None, 5e3, 2, 1.0)
    >>> choose_different([make_run(0.0, 50), make_run(0.1, 40), make_run(np.pi / 2, 40)], 2)
    [0, 2]
    """
    features = []
    for run in runs:
        s = ellipse.compute_stokes(run.envelope).mean(axis=0)
        rate = (
            np.ptp(run.turn_rad)
            / max(run.duration_s, 1e-300)
            * np.sign(run.turn_rad[-1] - run.turn_rad[0])
        )
        features.append([*(s[1:] / s[0]), rate])
    table = np.array(features)
    table[:, 3] /= max(1e-300, np.abs(table[:, 3]).max())
    # farthest first: the next run is the one whose nearest chosen neighbour is farthest away
    chosen = [int(np.argmax([r.duration_s for r in runs]))]
    while len(chosen) < min(count, len(runs)):
        distance = np.min(np.linalg.norm(table[:, None] - table[chosen][None], axis=2), axis=1)
        distance[chosen] = -1
        chosen.append(int(np.argmax(distance)))
    return sorted(chosen)
