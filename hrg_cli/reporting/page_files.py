"""The files of a report: what is told of each, with its rows left on disk."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from .. import store
from ..errors import HrgError
from ..records import Periods, Record, Recording, Wave
from .figures_in_words import list_told
from .page_content import list_tables
from .page_table import PageTable
from .tables import list_facts
from .text import clean_text

ROWS_HELD = 200_000
"""Rows of a series held in memory for its figures; of longer ones every k-th is taken."""
ROWS_A_BLOCK = 1 << 16
"""Rows kept of one reading."""


@dataclass(frozen=True)
class Picture:
    """A figure on the page."""

    anchor: str
    title: str
    words: str
    svg: Markup


@dataclass
class PageEntry:
    """One file on the page."""

    name: str
    anchor: str
    record: Record
    size: int
    sha256: str
    facts: list[tuple[str, str]]
    tables: list[PageTable]
    sources: list[tuple[str, str, str, str]] = field(default_factory=list)
    pictures: list[Picture] = field(default_factory=list)
    left_out: int = 0

    @property
    def provenance(self) -> dict[str, Any]:
        """Provenance as text."""
        p = self.record.provenance
        return {
            "history": [clean_text(h) for h in p.history],
            "settings": clean_text(p.settings),
            "created": clean_text(p.created),
            "generated_by": clean_text(p.generated_by),
        }


def drop_repeats(paths: Sequence[Path]) -> list[Path]:
    """Paths without repeats.

    Parameters
    ----------
    paths
        As they were named.

    Returns
    -------
    list of Path
        In their order.

    Raises
    ------
    HrgError
        There is none.

    Examples
    --------
    >>> from pathlib import Path
    >>> from hrg_cli.reporting.page_files import drop_repeats
    >>> [path.name for path in drop_repeats([Path("a.h5"), Path("b.h5"), Path("a.h5")])]
    ['a.h5', 'b.h5']
    """
    found = list(dict.fromkeys(Path(p) for p in paths))
    if not found:
        raise HrgError("no file to report on; name one or more files that hrg wrote")
    return found


def describe_file(path: Path, index: int, full: bool) -> PageEntry:
    """What a page tells of a file.

    Parameters
    ----------
    path
        A file that hrg wrote.
    index
        Its place on the page, from 0.
    full
        Whether its tables are told, too.

    Returns
    -------
    PageEntry
        Without the rows of the record.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from hrg_cli import Recording, store
    >>> from hrg_cli.reporting.page_files import describe_file
    >>> made = Recording(c=np.zeros(9), s=np.zeros(9), sample_rate_hz=1e4, mode="free")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = store.write(Path(folder) / "run.h5", made)
    ...     entry = describe_file(Path(folder) / "run.h5", 0, full=False)
    >>> entry.name, len(entry.record)
    ('run.h5', 0)
    """
    with store.open_record(path, store.find_kind(path)) as record:
        record = thin_out(record) if full or not isinstance(record, Periods | Wave) else record
        shown = list_told(list_facts(record))
        kept = record
        found_tables = list_tables(kept) if full else []
    bare = _bare(kept)
    return PageEntry(
        clean_text(path.name),
        f"file-{index + 1}",
        bare,
        path.stat().st_size,
        store.compute_sha256(path),
        shown,
        found_tables,
    )


def _bare(record: Record) -> Record:
    """The record without its rows."""
    nothing: dict[str, Any] = {
        name: np.empty((0,) * len(spec.dims))
        for name, spec in record.columns().items()
        if spec.dims
    }
    return replace(record, **nothing)


def thin_out(record: Record) -> Record:
    """A record in memory, every k-th row of a very long one.

    Parameters
    ----------
    record
        Any record.

    Returns
    -------
    Record
        A recording stays on disk as it is.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.reporting.page_files import thin_out
    >>> made = Recording(c=np.zeros(9), s=np.zeros(9), sample_rate_hz=1e4, mode="free")
    >>> thin_out(made) is made
    True
    """
    if isinstance(record, Recording):
        return record
    step = max(1, -(-len(record) // ROWS_HELD))
    columns = [
        name
        for name, spec in record.columns().items()
        if spec.dims and spec.dims[0] == "row" and getattr(record, name) is not None
    ]
    if not columns:
        return record
    parts: dict[str, list[np.ndarray]] = {name: [] for name in columns}
    block = step * ROWS_A_BLOCK
    for start in range(0, len(record), block):
        for name in columns:
            parts[name].append(np.asarray(getattr(record, name)[start : start + block])[::step])
    joined: dict[str, Any] = {
        name: np.concatenate(values) for name, values in parts.items() if values
    }
    return replace(record, **joined)
