"""The rows of an opened log of demodulated signals: times, envelopes, slow columns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..records import Array
from .envelope_signal import EnvelopeSignal
from .log import Log
from .log_columns import Roles
from .no_values import BEYOND_ALL
from .readers import guard_reading
from .row_rounding import RowRounding
from .slow import SlowLog
from .timing import Timing

MOST_SEEN = 1 << 14
"""First rows from which the lattices are found that the columns' values lie on."""


@dataclass(frozen=True)
class EnvelopeRows:
    """The opened log and how its rows are read."""

    path: Path
    log: Log
    roles: Roles
    timing: Timing
    slow: SlowLog
    signal: EnvelopeSignal

    def read_blocks(self) -> Iterator[tuple[Array, Array, list[Array]]]:
        """Blocks: times from the log's first row on, envelopes (channel, n), slow columns in SI
        units."""
        wanted = [
            *self.signal.columns.values(),
            *self.slow.indexes,
            *([] if self.roles.time is None else [self.roles.time]),
        ]
        count, row = len(self.signal.columns), 0
        self.slow.begin()
        with guard_reading(self.path, self.log.format):
            for columns in self.log.read(wanted):
                n = len(columns[0])
                if n == 0:
                    continue
                if self.timing.sample_rate_hz is None and self.roles.time is not None:
                    scale = self.timing.factor * self.log.channels[self.roles.time].scale_factor
                    times = np.asarray(columns[-1], float) * scale - self.timing.first
                else:
                    times = np.arange(row, row + n) / (self.timing.sample_rate_hz or 1.0)
                columns_beside = columns[count : count + len(self.slow.indexes)]
                slow = self.slow.convert(columns_beside, row + np.arange(n))
                row += n
                yield times, self.signal.compute_envelopes(_drop_marks(columns[:count])), slow

    def find_rounding(self) -> RowRounding:
        """The lattices on which the first rows' values lie."""
        seen: list[list[Array]] = []
        with guard_reading(self.path, self.log.format):
            for columns in self.log.read([*self.signal.columns.values()]):
                seen.append([np.asarray(column, float) for column in columns])
                if sum(len(block[0]) for block in seen) >= MOST_SEEN:
                    break
        values = (
            np.concatenate(column) * scale
            for column, scale in zip(zip(*seen, strict=True), self.signal.scale, strict=True)
        )
        named = dict(zip(self.signal.columns, values, strict=True))
        return RowRounding.of_columns(named, self.signal.decibel, self.signal.phase_factor)

    def read_between(
        self, from_s: float | None, to_s: float | None
    ) -> Iterator[tuple[Array, Array]]:
        """Times and envelopes of the rows in the range asked for."""
        for times, u, _ in self.read_blocks():
            low = 0 if from_s is None else int(np.searchsorted(times, from_s))
            high = len(times) if to_s is None else int(np.searchsorted(times, to_s))
            yield times[low:high], u[:, low:high]


def _drop_marks(columns: Sequence[Array]) -> list[Array]:
    """The columns with NaN for what an instrument writes where it has no value (9.9E37)."""
    values = (np.asarray(column, float) for column in columns)
    return [np.where(np.abs(one) < BEYOND_ALL, one, np.nan) for one in values]
