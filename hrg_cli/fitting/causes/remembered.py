"""What is made beside fits and asked for again: kept as long as the fit is, of what is large the
latest alone, so that what a search holds does not grow with the fits that it makes."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import Any
from weakref import ref

import numpy as np

MOST_NUMBERS = 4_000_000
"""Numbers that are remembered beside all fits together (32 MB): two thirds of what a search with
two causes in eight runs makes. What is forgotten is made again, alike."""

_Entry = tuple[int, Hashable]
"""Which memory it is of, and under which key."""


class Remembered:
    """What is made beside one fit, the same for the same key.

    Examples
    --------
    >>> from hrg_cli.fitting.causes.remembered import Remembered
    >>> known = Remembered()
    >>> known.recall("slopes", lambda: [1.0]) is known.recall("slopes", lambda: [2.0])
    True
    """

    def __init__(self) -> None:
        self.values: dict[Hashable, Any] = {}

    def recall(self, key: Hashable, made: Callable[[], Any]) -> Any:
        """What is kept under a key, made where nothing is."""
        if key in self:
            return self[key]
        value = made()
        self[key] = value
        return value

    def __contains__(self, key: Hashable) -> bool:
        return key in self.values

    def __getitem__(self, key: Hashable) -> Any:
        _LATEST.touch(self, key)
        return self.values[key]

    def __setitem__(self, key: Hashable, value: Any) -> None:
        self.values[key] = value
        _LATEST.enter(self, key, count_numbers(value))


class _Latest:
    """Large values of all memories in the order in which they were asked for."""

    def __init__(self) -> None:
        self.order: OrderedDict[_Entry, tuple[ref[Remembered], int]] = OrderedDict()
        self.numbers = 0

    def touch(self, memory: Remembered, key: Hashable) -> None:
        """A value is asked for again."""
        if (id(memory), key) in self.order:
            self.order.move_to_end((id(memory), key))

    def enter(self, memory: Remembered, key: Hashable, numbers: int) -> None:
        """One more value of so many numbers; the oldest are forgotten beyond `MOST_NUMBERS`."""
        if not numbers:
            return
        entry = id(memory), key
        self._drop(entry)
        self.order[entry] = ref(memory, lambda _: self._drop(entry)), numbers
        self.numbers += numbers
        while self.numbers > MOST_NUMBERS and len(self.order) > 1:
            oldest = next(iter(self.order))
            owner = self.order[oldest][0]()
            self._drop(oldest)
            if owner is not None:
                del owner.values[oldest[1]]

    def _drop(self, entry: _Entry) -> None:
        if entry in self.order:
            self.numbers -= self.order.pop(entry)[1]


_LATEST = _Latest()


def count_numbers(value: Any) -> int:
    """About how many numbers a value holds.

    Parameters
    ----------
    value
        An array, what says so of itself (`numbers`), or a list or tuple of these.

    Returns
    -------
    int
        0 of anything else.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.remembered import count_numbers
    >>> count_numbers([np.zeros((3, 2)), (np.zeros(4), "a word")])
    10
    """
    if isinstance(value, np.ndarray):
        return value.size
    if isinstance(value, list | tuple):
        return sum(count_numbers(one) for one in value)
    return int(getattr(value, "numbers", 0))
