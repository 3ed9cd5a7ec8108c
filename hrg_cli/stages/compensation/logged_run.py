"""A run and its own rate log, as far as the log goes: pieces that fit into memory, and where each
increment's rate is known."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...fitting.samples.rate_log import describe_left_out, find_stretches
from ...fitting.tables.increments import ROWS_AT_ONCE
from ...records import Wave

Array = np.ndarray


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

    def split_pieces(self, windows: int) -> Iterator[tuple[Wave, Array]]:
        """The wave in pieces, and on which stretch of the log each good block of `windows` stands.

        Each begins with the last good block of the one before, so that no increment is lost between
        them.
        """
        rows = len(self.wave)
        step = max(windows, ROWS_AT_ONCE // windows * windows)
        begin, stop = 0, 0
        while stop < rows:
            # a last piece shorter than the others goes with the one before it
            stop = rows if rows - stop < 2 * step else stop + step
            piece = self.wave.rows(begin, stop)
            kept = _good_blocks(piece, windows)
            if len(kept) < 2:
                continue
            yield piece, _find_block_stretches(self.stretch[begin:stop], windows)[kept]
            begin += int(kept[-1]) * windows

    def find_known_rates(self, of_log: Array) -> Array:
        """Increments (n,) whose rate is known: both blocks, of stretch `of_log` (n + 1,), are in
        the same one."""
        return (of_log[1:] == of_log[:-1]) & (of_log[1:] > 0) & self.logged


def _good_blocks(piece: Wave, windows: int) -> Array:
    """Numbers of the blocks of `windows` rows that are at least half good."""
    good = np.asarray(piece.good())
    count = np.add.reduceat(good.astype(int), np.arange(0, len(good), windows))
    return np.flatnonzero(count >= max(1.0, windows / 2))


def _find_block_stretches(stretch: Array, windows: int) -> Array:
    """The stretch of the rate log that a block of windows is in, 0 where it is not wholly in
    one."""
    starts = np.arange(0, len(stretch), windows)
    least, most = (f.reduceat(stretch, starts) for f in (np.minimum, np.maximum))
    return np.where(least == most, least, 0)
