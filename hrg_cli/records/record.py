"""What all kinds of records have in common: validity with its reasons, provenance, rows in pieces,
and one record made of a stream of them."""

from __future__ import annotations

import dataclasses
import functools
import itertools
from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal, Self, TypeVar

import numpy as np

from ..errors import HrgError
from ..notebook import NotebookView
from .columns import GROWING, Column

R = TypeVar("R", bound="Record")

Status = Literal["valid", "suspect", "refused"]

REHEARSAL = "rehearsal: "
"""Beginning of every sentence that a rehearsal leaves in a file's status."""


@dataclass(frozen=True)
class Source:
    """One input of a command, as kept in the root attribute `sources`.

    samples: fingerprints of the recorded samples it goes back to (`origins`), so that a copied
    recording is known at any later stage.
    """

    name: str
    kind: str
    sha256: str
    samples: tuple[str, ...] = ()


@dataclass(frozen=True)
class Provenance:
    """Where a record comes from: the commands behind it, its whole settings as TOML, and its
    inputs."""

    history: tuple[str, ...] = ()
    settings: str = ""
    sources: tuple[Source, ...] = ()
    created: str = ""
    generated_by: str = ""


@dataclass(frozen=True, kw_only=True, repr=False)
class Record(NotebookView):
    """Common to all kinds: validity with its reasons, and provenance."""

    kind: ClassVar[str]
    made_by: ClassVar[str]
    status: Status = "valid"
    status_reasons: tuple[str, ...] = ()
    provenance: Provenance = field(default_factory=Provenance)

    @classmethod
    @functools.cache
    def columns(cls) -> dict[str, Column]:
        """The record's columns and attributes as they are declared.

        Returns
        -------
        dict
            Field name -> its declaration (unit, meaning, dimensions, what values are valid), in
            order.
        """
        return {
            f.name: f.metadata["column"] for f in dataclasses.fields(cls) if "column" in f.metadata
        }

    def __len__(self) -> int:
        for name, spec in self.columns().items():
            if spec.dims and spec.dims[0] == "row" and getattr(self, name) is not None:
                return len(getattr(self, name))
        return 0

    def rows(self, start: int, stop: int) -> Self:
        """The same record with only rows [start, stop), read into memory.

        Parameters
        ----------
        start, stop
            Numbers of the first row and of the one after the last, as in a slice.

        Returns
        -------
        Record
            Of the same kind; what has no rows is as it was.
        """
        return self.picked(slice(start, stop))

    def picked(self, rows: slice | np.ndarray) -> Self:
        """The same record with only the named rows, read into memory.

        Parameters
        ----------
        rows
            A slice; of a record in memory also row numbers (k,) or a mask (n,).

        Returns
        -------
        Record
            Of the same kind; what has no rows is as it was.
        """
        cut = {name: getattr(self, name)[rows] for name in self._row_columns()}
        return dataclasses.replace(self, **cut)

    def only(self, names: Collection[str]) -> Self:
        """The same record without its other row columns, which then are not read.

        Parameters
        ----------
        names
            Row columns to keep; required ones may be left out, so the result is for reading alone.

        Returns
        -------
        Record
            Of the same kind, the other row columns None.
        """
        others = [name for name in self._row_columns() if name not in names]
        return self.replace(**dict.fromkeys(others))

    def _row_columns(self) -> list[str]:
        return [
            name
            for name, spec in self.columns().items()
            if spec.dims and spec.dims[0] == "row" and getattr(self, name) is not None
        ]

    def blocks(self, rows: int) -> Iterator[Self]:
        """The record in pieces; a lazily opened file is read piece by piece.

        Parameters
        ----------
        rows
            Most rows of a piece.

        Returns
        -------
        Iterator of Record
            Pieces of the same kind, whose rows follow each other.

        Examples
        --------
        >>> import numpy as np
        >>> from hrg_cli import Recording
        >>> whole = Recording(c=np.zeros(5), s=np.ones(5), sample_rate_hz=10.0, mode="free")
        >>> [len(piece) for piece in whole.blocks(2)]
        [2, 2, 1]
        """
        for start in range(0, len(self), rows):
            yield self.rows(start, min(start + rows, len(self)))

    def replace(self, **changes: Any) -> Self:
        """A copy with some fields changed.

        Parameters
        ----------
        changes
            Fields by name, with their new values.

        Returns
        -------
        Record
            Of the same kind.

        Examples
        --------
        >>> import numpy as np
        >>> from hrg_cli import Recording
        >>> recording = Recording(c=np.zeros(5), s=np.ones(5), sample_rate_hz=10.0, mode="free")
        >>> recording.replace(gyro_id="A7").gyro_id
        'A7'
        """
        return dataclasses.replace(self, **changes)

    def judged(self, reasons: Iterable[str], status: Status = "suspect") -> Self:
        """A copy whose status is at least as bad as `status` for further reasons.

        Parameters
        ----------
        reasons
            Sentences, added to those that the record has; none: the record stays as it is.
        status
            "valid", "suspect" or "refused".

        Returns
        -------
        Record
            Of the same kind.

        Examples
        --------
        >>> import numpy as np
        >>> from hrg_cli import Recording
        >>> recording = Recording(c=np.zeros(5), s=np.ones(5), sample_rate_hz=10.0, mode="free")
        >>> recording.judged(["the bench shook; record again"]).status
        'suspect'
        """
        reasons = tuple(reasons)
        if not reasons:
            return self
        order: list[Status] = ["valid", "suspect", "refused"]
        worst = max(self.status, status, key=order.index)
        return dataclasses.replace(self, status=worst, status_reasons=self.status_reasons + reasons)


def collect(stream: R | Iterable[R]) -> R:
    """One record in memory from a stream of blocks.

    Parameters
    ----------
    stream
        Records of one kind whose rows follow each other, or one record.

    Returns
    -------
    Record
        The blocks' rows joined; everything else is the last block's.

    Raises
    ------
    HrgError
        The stream is empty.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording, collect
    >>> block = Recording(c=np.zeros(3), s=np.ones(3), sample_rate_hz=10.0, mode="free")
    >>> len(collect([block, block]))
    6
    """
    if isinstance(stream, Record):
        return stream
    parts = list(stream)
    if not parts:
        raise HrgError("an empty stream holds no record; the stage before it produced nothing")
    last = parts[-1]
    joined: dict[str, Any] = {}
    for name, spec in last.columns().items():
        if spec.dims and spec.dims[0] in GROWING and getattr(last, name) is not None:
            joined[name] = np.concatenate([getattr(p, name) for p in parts])
    return dataclasses.replace(last, **joined)


def open_single(stream: Iterator[R]) -> R | Iterator[R]:
    """The record of a stream of a single block; else the stream, whole.

    Parameters
    ----------
    stream
        Of blocks.

    Returns
    -------
    Record or iterator of Record
        A stream of none stays an empty one.

    Examples
    --------
    >>> from hrg_cli.records.record import open_single
    >>> open_single(iter(["whole"])), list(open_single(iter(["first", "second", "last"])))
    ('whole', ['first', 'second', 'last'])
    """
    head = list(itertools.islice(stream, 2))
    return head[0] if len(head) == 1 else itertools.chain(head, stream)
