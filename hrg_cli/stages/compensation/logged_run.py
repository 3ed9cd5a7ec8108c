"""A run and its own rate log, as far as the log goes: pieces that fit into memory, and where each
increment's rate is known."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...fitting.samples.rate_log import describe_left_out, find_stretches
from ...fitting.tables.increments import BESIDE, ROWS_AT_ONCE, count_good, find_good_windows
from ...records import Wave

Array = np.ndarray


@dataclass(frozen=True)
class Piece:
    """Windows of a run; the stretch of the rate log that each of its good blocks is in, 0 outside;
    and which of the increments between these are the piece's own."""

    wave: Wave
    stretch: Array
    own: slice


@dataclass(frozen=True)
class LoggedRun:
    """A wave and the stretch (n,) of its rate log that each window is in, 0 outside."""

    wave: Wave
    stretch: Array

    @classmethod
    def from_wave(cls, wave: Wave) -> LoggedRun:
        """The run with its rate log read."""
        return cls(wave, find_stretches(wave))

    @property
    def name(self) -> str:
        """For sentences about it."""
        return f"run {self.wave.run_id or '?'}"

    @property
    def logged(self) -> bool:
        """Whether any of its rate was logged."""
        return self.wave.rate_rad_s is not None and bool(self.stretch.any())

    def list_doubts(self) -> list[str]:
        """What to say of the windows that the log does not cover."""
        outside = describe_left_out(self.wave, self.stretch > 0)
        return [f"{outside} of its figures"] if outside else []

    def split_pieces(self, windows: int) -> Iterator[Piece]:
        """The wave in pieces that overlap, whose increments follow each other without a gap.

        Each has a few blocks of `windows` of those beside it, by which the wave bends at its ends.
        """
        rows = len(self.wave)
        step = max(windows, ROWS_AT_ONCE // windows * windows)
        begin, stop = 0, 0
        while stop < rows:
            # a last piece shorter than the others goes with the one before it
            stop = rows if rows - stop < 2 * step else stop + step
            first = max(begin - BESIDE * windows, 0)
            last = min(stop + BESIDE * windows, rows)
            wave = self.wave.rows(first, last)
            kept = np.flatnonzero(count_good(find_good_windows(wave), windows))
            inside = np.flatnonzero(
                (kept * windows >= begin - first) & (kept * windows < stop - first)
            )
            if len(inside) < 2:
                continue
            stretch = _find_block_stretches(self.stretch[first:last], windows)[kept]
            yield Piece(wave, stretch, slice(int(inside[0]), int(inside[-1])))
            begin = first + int(kept[inside[-1]]) * windows

    def find_known_rates(self, of_log: Array) -> Array:
        """Increments (n,) whose rate is known: both blocks, of stretch `of_log` (n + 1,), are in
        the same one."""
        return (of_log[1:] == of_log[:-1]) & (of_log[1:] > 0) & self.logged


def _find_block_stretches(stretch: Array, windows: int) -> Array:
    """The stretch of the rate log that a block of windows is in, 0 where it is not wholly in
    one."""
    starts = np.arange(0, len(stretch), windows)
    least, most = (f.reduceat(stretch, starts) for f in (np.minimum, np.maximum))
    return np.where(least == most, least, 0)
