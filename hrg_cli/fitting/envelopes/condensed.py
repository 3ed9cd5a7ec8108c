"""Long records without their windows in memory: read block by block, averaged along the motion that
a sample of their windows shows.

Every n-th window of a record is a record itself, with nothing averaged, so its fit is right within
its own errors. Along that motion all windows are averaged, a block at a time, to some ten thousand
rows: what the motion is wrong by acts with its square over a row's short time only. The fit of
these rows is the answer; where it has moved too far from the sample's, the record is read again
along it.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence

import numpy as np

from ...errors import HrgError
from ...records import Wave
from ..samples.rate_log import restrict_to_log
from . import rows
from .base_fit import fit_base_model
from .base_freedom import Known
from .envelope_runs import (
    MIN_ROWS,
    EnvelopeRun,
    average_rows,
    from_wave,
    integrate_rate,
    select_good_rows,
    turn_table,
)
from .likelihood import Fit

Array = np.ndarray
IN_MEMORY = 100_000
"""Windows of all records together up to which they are simply read."""
SAMPLE = 40_000
"""Windows of all records together from which the motion is first found."""
CONDENSED = 60_000
"""Rows of all records together to which the windows are averaged."""
BLOCK = 1 << 16
OVERLAP = 64
"""Rows by which blocks overlap where the rate's course is integrated."""
HARMLESS = 0.02
"""Part of a row's standard deviation that the motion's own error may leave in it."""
PASSES = 3


def read_runs(
    waves: Sequence[Wave], rate_rad_s: float | None, earth_rad_s: float, known: Known, blocks: int
) -> list[EnvelopeRun]:
    """Every wave's run: all its windows where they are few, else averages along their motion.

    Parameters
    ----------
    waves
        Free ones of one gyro.
    rate_rad_s
        Of the table; None: each wave's own log.
    earth_rad_s
        The Earth's part along the axis, which no log shows.
    known
        What is held in the fit that finds the motion.
    blocks
        Rows of a run at least, where windows are averaged.

    Returns
    -------
    list of EnvelopeRun
        In the order of the waves.

    Raises
    ------
    HrgError
        As `from_wave`, and where a sample of a long record shows no run-down.

    Examples
    --------
    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli import Wave
    >>> from hrg_cli.fitting.envelopes.base_freedom import Known
    >>> from hrg_cli.fitting.envelopes.condensed import read_runs
    >>> t, ones = np.arange(20.0), np.ones(20)
    >>> wave = Wave(**{f.name: ones for f in fields(Wave) if f.default is MISSING} | dict(
    ...     time_s=t, flags=np.zeros(20, "u1"), iterations=np.zeros(20, "i2"), window_s=1.0,
    ...     reference_frequency_hz=5e3,
    ... ))
    >>> (run,) = read_runs([wave], 0.5, -7e-5, Known(), 300)
    >>> run.turn_rad[:3].round(9).tolist()
    [0.0, 0.49993, 0.99986]
    """
    if sum(len(w) for w in waves) <= IN_MEMORY:
        return [turn_table(from_wave(w.rows(0, len(w)), rate_rad_s), earth_rad_s) for w in waves]
    if rate_rad_s is None:
        waves = [restrict_to_log(w) for w in waves]

    def pieces(wave: Wave) -> Iterator[EnvelopeRun]:
        return (turn_from(p, earth_rad_s, float(wave.time_s[0])) for p in _pieces(wave, rate_rad_s))

    every = max(1, -(-sum(len(w) for w in waves) // SAMPLE))
    # rows by their numbers are copied; a slice would keep its whole piece in memory
    sample = [
        _join_pieces(
            [
                p.select_rows(np.arange(-start % every, len(p), every))
                for start, p in _number_rows(pieces(w))
            ],
            w,
            every,
        )
        for w in waves
    ]
    if max(float(np.ptp(r.turn_rad)) for r in sample) == 0 and all(_one_signal(r) for r in sample):
        return sample  # one channel: modes are judged from single windows
    found = fit_base_model(sample, known, blocks)
    count = max(rows.count_rows(found.p, sample, blocks), CONDENSED // len(waves))
    out = sample
    for _ in range(PASSES):
        carries = rows.list_motions(sample, found.response)
        out = [
            _average_pieces(pieces(w), s, count, *c)
            for w, s, c in zip(waves, sample, carries, strict=True)
        ]
        better = fit_base_model(out, known, blocks)
        if _error_of_averaging(found, better, out) < HARMLESS:
            return out
        found = better
        sample = [dataclasses.replace(r) for r in out]
    return out


def turn_from(run: EnvelopeRun, rate_rad_s: float, first_s: float) -> EnvelopeRun:
    """A piece of a run on a table that turns by a constant rate more since the run's first row.

    Parameters
    ----------
    run
        The piece.
    rate_rad_s
        More of it.
    first_s
        When the run began.

    Returns
    -------
    EnvelopeRun
        The same envelopes.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.condensed import turn_from
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> t = np.array([10.0, 11.0, 12.0])
    >>> run = EnvelopeRun("", t, np.ones((3, 2)), 0 * t + 1e-4, 0 * t, None, 5e3, 2, 1.0)
    >>> turn_from(run, 0.25, 8.0).turn_rad.tolist()
    [0.5, 0.75, 1.0]
    """
    if rate_rad_s == 0:
        return run
    return dataclasses.replace(run, turn_rad=run.turn_rad + rate_rad_s * (run.time_s - first_s))


def _one_signal(run: EnvelopeRun) -> bool:
    power = np.sum(np.abs(run.envelope / run.std[:, None]) ** 2, axis=0)
    return bool(power.min() < 3 * len(run))  # noise alone has 2 a row


def _number_rows(pieces: Iterator[EnvelopeRun]) -> Iterator[tuple[int, EnvelopeRun]]:
    """Pieces with the number of rows before them."""
    start = 0
    for piece in pieces:
        yield start, piece
        start += len(piece)


def _pieces(wave: Wave, rate_rad_s: float | None) -> Iterator[EnvelopeRun]:
    """The wave's good rows, a block at a time, the table's angle running on from block to block."""
    total, turn, last = len(wave), 0.0, -np.inf
    name = wave.run_id or "the run"
    for start in range(0, total, BLOCK):
        stop = min(start + BLOCK, total)
        low, high = max(0, start - OVERLAP), min(total, stop + OVERLAP)
        part = wave.rows(low, high)
        angle = integrate_rate(
            np.asarray(part.time_s),
            part.rate_rad_s if rate_rad_s is None else np.full(high - low, rate_rad_s),
        )
        inside = slice(start - low, stop - low)
        run = select_good_rows(part, angle - angle[start - low] + turn, inside)
        turn += float(angle[min(stop - low, len(angle) - 1)] - angle[start - low])
        if len(run) == 0:
            continue
        if run.time_s[0] <= last or np.any(np.diff(run.time_s) <= 0):
            raise HrgError(
                f"{name}: the windows' times do not increase; sort the record or remove repeated"
                " rows"
            )
        last = float(run.time_s[-1])
        yield run


def _join_pieces(pieces: Sequence[EnvelopeRun], wave: Wave, every: int) -> EnvelopeRun:
    """A sample's pieces as one run. HrgError: too few rows."""
    if sum(len(p) for p in pieces) < MIN_ROWS:
        raise HrgError(
            f"{wave.run_id or 'the run'}: {sum(len(p) for p in pieces)} of every {every}th window"
            f" without a flag, at least {MIN_ROWS} are needed; demodulate a longer or cleaner"
            " record"
        )
    return _gather_pieces(*pieces)


def _average_pieces(
    pieces: Iterator[EnvelopeRun],
    sample: EnvelopeRun,
    count: int,
    carry: rows.Carry,
    phase: Callable[[Array], Array],
) -> EnvelopeRun:
    """All windows of a run averaged along a motion to `count` equal pieces of its time, a block at
    a time."""
    first, step = (
        float(sample.time_s[0]),
        (sample.duration_s * (1 + 1e-9) + sample.window_s) / count,
    )
    out: list[EnvelopeRun] = []
    rest: EnvelopeRun | None = None
    for piece in pieces:
        here = piece if rest is None else _gather_pieces(rest, piece)
        index = np.floor((here.time_s - first) / step)
        whole = int(
            np.searchsorted(index, index[-1])
        )  # the last piece of time may go on in the next block
        if whole:
            out.append(
                average_rows(
                    here.select_rows(slice(None, whole)), count, carry, phase, (first, step)
                )
            )
        rest = here.select_rows(slice(whole, None))
    if rest is not None and len(rest):
        out.append(average_rows(rest, count, carry, phase, (first, step)))
    return _gather_pieces(*out)


def _gather_pieces(*pieces: EnvelopeRun) -> EnvelopeRun:
    """Pieces of one run as one."""
    warm = [p.temperature_degc for p in pieces if p.temperature_degc is not None]
    return dataclasses.replace(
        pieces[0],
        time_s=np.concatenate([p.time_s for p in pieces]),
        envelope=np.concatenate([p.envelope for p in pieces]),
        std=np.concatenate([p.std for p in pieces]),
        turn_rad=np.concatenate([p.turn_rad for p in pieces]),
        temperature_degc=np.concatenate(warm) if len(warm) == len(pieces) else None,
    )


def _error_of_averaging(along: Fit, better: Fit, runs: Sequence[EnvelopeRun]) -> float:
    """What averaging along a motion other than the better one leaves in a row, in the row's
    standard deviations: (δL·dt)²/24."""
    apart = np.abs(better.p[:6] - along.p[:6])
    worst = 0.0
    for run in runs:
        step = float(np.median(np.diff(run.time_s)))
        rate = rows.estimate_speed(run, np.concatenate([apart, [0.0]]))
        worst = max(
            worst, (rate * step) ** 2 / 24 * float(np.abs(run.envelope).max() / run.std.min())
        )
    return worst
