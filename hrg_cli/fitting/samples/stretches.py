"""The longest stretch of a condition over a long series that comes piece by piece."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Array = np.ndarray


@dataclass
class Stretches:
    """What is known of the True stretches of a series so far: elements, True ones, stretches that
    began after a False one, and the longest as (start, stop)."""

    count: int = 0
    true: int = 0
    begun: int = 0
    longest: tuple[int, int] = (0, 0)
    _open_since: int | None = None

    def add(self, piece: Array) -> None:
        """Add the next elements of the series.

        Parameters
        ----------
        piece
            (n,) bool.
        """
        if not len(piece):
            return
        open_before = self._open_since is not None
        steps = np.diff(np.concatenate([[open_before], piece]).astype(np.int8))
        starts, stops = (self.count + np.flatnonzero(steps == step) for step in (1, -1))
        self.begun += int(np.count_nonzero(starts))
        self.true += int(np.count_nonzero(piece))
        self.count += len(piece)
        if open_before:
            starts = np.concatenate([[self._open_since], starts])
        self._open_since = int(starts[-1]) if piece[-1] else None
        if piece[-1]:
            stops = np.concatenate([stops, [self.count]])  # it may go on
        if len(starts):
            longest = int(np.argmax(stops - starts))
            found = int(starts[longest]), int(stops[longest])
            if found[1] - found[0] > self.longest[1] - self.longest[0]:
                self.longest = found
