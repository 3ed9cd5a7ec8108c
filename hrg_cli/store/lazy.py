"""A column of a lazily opened record: its rows are read, and held to their declaration, when they
are asked for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import h5py
import numpy as np

from ..errors import HrgError
from ..records import Column
from .handles import Handle, explain_reading
from .validity import find_values_problem

Array = np.ndarray


class CheckedColumn:
    """A dataset left on disk whose rows are held to their declaration when they are sliced."""

    def __init__(
        self,
        handle: Handle,
        dataset: h5py.Dataset,
        place: str,
        spec: Column,
        excused: Callable[[Any], Array] | None,
    ) -> None:
        self._handle, self._place, self._spec, self._excused = handle, place, spec, excused
        self._dataset = dataset
        self._end: tuple[int, float] = (-1, 0.0)
        self.shape, self.ndim, self.size = dataset.shape, dataset.ndim, dataset.size
        self.dtype = dataset.dtype if spec.dtype == "raw" else np.dtype(spec.dtype)

    def __len__(self) -> int:
        return int(self.shape[0])

    def __getitem__(self, key: Any) -> Any:
        with explain_reading(self._handle.path, self._place):
            return self._checked(key)

    def _checked(self, key: Any) -> Any:
        file = self._handle.open_file()
        if (
            not self._dataset
        ):  # the file was closed meanwhile; else the dataset's cache of chunks is kept
            self._dataset = file[self._place]
        values = np.asarray(self._dataset[key])
        if self._spec.valid.raw:
            return values
        rows = key[0] if isinstance(key, tuple) and key else key
        first, apart = _start_of(rows, len(self))
        spec = self._spec
        excused = self._excused
        problem = find_values_problem(
            np.atleast_1d(values),
            spec,
            first,
            None if excused is None else lambda: np.atleast_1d(excused(rows)),
        )
        if problem is None and spec.valid.rising and values.size and not apart:
            end, last = self._end
            if end == first and not values.flat[0] > last:
                problem = (
                    f"holds {values.flat[0]:.9g} in row {first + 1} after {last:.9g}; the values"
                    " must increase from row to row"
                )
            self._end = (first + len(np.atleast_1d(values)), float(values.flat[-1]))
        if problem is not None:
            raise HrgError(
                f"{self._handle.path}: dataset {self._place} {problem}; make the file again or"
                " record it again"
            )
        return values.astype(spec.dtype, copy=False)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> Array:
        whole = self[()]
        return whole if dtype is None else np.asarray(whole, dtype=dtype)


def _start_of(rows: Any, length: int) -> tuple[int, bool]:
    """The first row a key asks for, and whether rows are left out between (neighbours need not be
    neighbours in the file)."""
    if isinstance(rows, slice):
        start, _, step = rows.indices(length)
        return start, step != 1
    if isinstance(rows, tuple) or rows is Ellipsis:
        return 0, False
    if isinstance(rows, int | np.integer):
        return int(rows) % max(length, 1), False
    return 0, True
