"""The rows of an opened log as blocks of a recording, as they are read."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..errors import HrgError
from ..records import Recording
from ..records.time_origin import shift_time
from .log import Array, Log
from .log_columns import Roles
from .opened_log import OpenedLog, read_states
from .readers import guard_reading
from .slow import SlowLog
from .taken import Taken
from .timing import Timing


def stream_blocks(
    opened: OpenedLog, blank: Recording, timing: Timing, slow: SlowLog, taken: Taken
) -> Iterator[Recording]:
    """The rows of a log of samples as a recording, block by block, as they are read.

    Parameters
    ----------
    opened
        The log, and what was seen of its files before.
    blank
        A recording without samples, whose other fields the blocks take.
    timing
        Of the rows.
    slow
        The columns beside the channels.
    taken
        Filled with what is taken, for the last block.

    Returns
    -------
    iterator of Recording
        The last block bears what only the whole log tells: what was taken, what was left out or is
        not finite.

    Raises
    ------
    HrgError
        A broken row, no rows, none in the range asked for, or a file that changes meanwhile.

    Examples
    --------
    From 1 s on of a log at 2 Hz, whose first sample taken is t = 0:

    >>> from pathlib import Path
    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.formats.log import make_log
    >>> from hrg_cli.formats.log_columns import find_roles
    >>> from hrg_cli.formats.opened_log import OpenedLog
    >>> from hrg_cli.formats.run_heading import UnitsTold
    >>> from hrg_cli.formats.sample_blocks import stream_blocks
    >>> from hrg_cli.formats.slow import SlowLog
    >>> from hrg_cli.formats.taken import Taken
    >>> from hrg_cli.formats.timing import Timing
    >>> log = make_log("bench", {"c": np.arange(4.0), "s": np.zeros(4)}, sample_rate_hz=2.0)
    >>> opened = OpenedLog([Path("no file")], log, find_roles(log, "bench", {}), None)
    >>> taken = Taken(log, opened.roles.list_columns(), {}, 2.0, from_s=1.0)
    >>> slow = SlowLog(
    ...     log, opened.roles, where="", told=UnitsTold(None, None, None), rate_scale_factor=1.0,
    ...     constants={}, most=10,
    ... )
    >>> blank = Recording(c=np.empty(0), s=np.empty(0), sample_rate_hz=2.0, mode="free")
    >>> (block,) = stream_blocks(opened, blank, Timing(2.0, 1.0), slow, taken)
    >>> block.c.tolist(), taken.first_s
    ([2.0, 3.0], 1.0)
    """
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
                path, timing, times, slow_columns, first, following is None, shift, row
            )
            block = blank.replace(
                c=c, s=s, start_time=shift_time(blank.start_time, shift), **auxiliary
            )
            if timing.sample_rate_hz is None:
                block = block.replace(time_s=times)
            yield block if following is not None else _close(block, opened, taken, slow)
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


def _close(block: Recording, opened: OpenedLog, taken: Taken, slow: SlowLog) -> Recording:
    """The last block with what the whole log tells. HrgError: the file changed meanwhile."""
    if read_states(opened.files) != opened.before:
        raise HrgError(
            f"{opened.files[0]}: changed while it was read; wait until it is written and import it"
            " again"
        )
    for status, reason in [*taken.judge(), *slow.judge()]:
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
