"""The rows of an opened log as blocks of a recording, as they are read."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..errors import HrgError
from ..records import Recording
from ..records.clock import shift_time
from .log import Array, Log
from .log_columns import Roles
from .opened_log import OpenedLog, judge_state
from .readers import guard_reading
from .slow import SlowLog
from .taken import Taken
from .timing import Timing


def stream_blocks(
    opened: OpenedLog, blank: Recording, timing: Timing, slow: SlowLog, taken: Taken
) -> Iterator[Recording]:
    """Blocks of the recording; the last one bears what only the whole log tells: what was taken,
    what was left out or is not finite. HrgError: a broken row, no rows, a file that changes."""
    path, roles = opened.files[0], opened.roles
    fast = 1 if roles.s is None else 2
    first = True
    with guard_reading(path, opened.log.format):
        pieces = _pieces(opened.log, roles, timing, slow, taken)
        held = next(pieces, None)
        while held is not None:
            row, times, columns = held
            following = next(pieces, None)
            shift = taken.first_s or 0.0
            times, c = times - shift, columns[0]
            s = np.zeros_like(c) if roles.s is None else columns[1]
            _count_not_finite(c, s, row, taken)
            slow_columns = columns[fast : fast + len(slow.indexes)]
            auxiliary = slow.make_block(
                path, timing, times, slow_columns, first, following is None, shift
            )
            block = blank.replace(
                c=c, s=s, start_time=shift_time(blank.start_time, shift), **auxiliary
            )
            if timing.sample_rate_hz is None:
                block = block.replace(time_s=times)
            yield block if following is not None else _close(block, opened, taken)
            held, first = following, False
    taken.check_range(str(path))
    if first:
        raise HrgError(f"{path}: holds no rows of numbers; record again")


def _count_not_finite(c: Array, s: Array, row: int, taken: Taken) -> None:
    """Samples from the log's row on that are no numbers; integers always are."""
    if c.dtype.kind == "f":
        bad = ~(np.isfinite(c) & np.isfinite(s))
        if bad.any():
            taken.count_not_finite(bad, row)


def _close(block: Recording, opened: OpenedLog, taken: Taken) -> Recording:
    """The last block with what the whole log tells. HrgError: the file changed meanwhile."""
    if judge_state(opened.files) != opened.before:
        raise HrgError(
            f"{opened.files[0]}: changed while it was read; wait until it is written and import it"
            " again"
        )
    for status, reason in taken.judge():
        block = block.judged([reason], status)
    return block.replace(details=taken.dump_facts())


def _pieces(
    log: Log, roles: Roles, timing: Timing, slow: SlowLog, taken: Taken
) -> Iterator[tuple[int, Array, list[Array]]]:
    """The rows in the range asked for, block by block: the log's row of the first, times from the
    log's first row on, columns."""
    wanted = [
        roles.c,
        *([] if roles.s is None else [roles.s]),
        *slow.indexes,
        *([] if roles.time is None else [roles.time]),
    ]
    scale = 1.0 if roles.time is None else log.channels[roles.time].scale_factor
    row = 0
    for columns in log.read(wanted):
        if len(columns[0]) == 0:
            continue
        if timing.sample_rate_hz is None:
            times = np.asarray(columns[-1], float) * timing.factor * scale - timing.first
        else:
            times = np.arange(row, row + len(columns[0])) / timing.sample_rate_hz
        part = taken.take_block(times)
        if part.stop > part.start:
            yield row + part.start, times[part], [column[part] for column in columns]
        row += len(times)
        if taken.to_s is not None and times[-1] >= taken.to_s:
            return
