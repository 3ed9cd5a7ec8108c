"""The ledger as one SQLite file: opened, written in one transaction, read whole.

A rollback journal, no write-ahead log: the first also holds on a shared folder, the second does not
(https://www.sqlite.org/wal.html, §1). A writer waits for another one's transaction. A new ledger is
made under a temporary name and gets its own when whole, as every output.
"""

from __future__ import annotations

import contextlib
import json
import math
import os
import sqlite3
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any
from urllib.parse import quote

from ..errors import HrgError
from ..records.time_origin import parse_time
from ..store.atomic import write_whole
from .entry import Entry, Figure

APPLICATION, VERSION = 0x68726731, 1
"""SQLite's marks of whose file it is ("hrg1"), and of the tables' version."""
WAIT_S = 60.0
"""So long a program waits for another one's transaction."""
STEP_S = 0.5
"""So long at a time: SQLite's own waiting cannot be interrupted."""
_TEXTS = (
    *("sha256", "file", "kind", "gyro_id", "processed", "measured", "added"),
    *("station", "operator", "fixture", "firmware", "order", "software", "status"),
)
_COLUMNS = (*_TEXTS, "verdict", "mode_number", "reasons", "samples")
_NAMES = ", ".join(f'"{name}"' for name in _COLUMNS)
_SCHEMA = (
    "CREATE TABLE entry (number INTEGER PRIMARY KEY, "
    + ", ".join(f'"{name}" TEXT NOT NULL' for name in _TEXTS)
    + ", verdict TEXT, mode_number INTEGER NOT NULL, reasons TEXT NOT NULL, samples TEXT NOT NULL,"
    " UNIQUE (sha256))",
    "CREATE TABLE figure (entry INTEGER NOT NULL REFERENCES entry (number),"
    " place INTEGER NOT NULL, name TEXT NOT NULL, value REAL NOT NULL, std REAL,"
    " units TEXT NOT NULL, PRIMARY KEY (entry, place)) WITHOUT ROWID",
)


def add_entries(path: Path, entries: Sequence[Entry]) -> list[bool]:
    """Enter results, all or none where anything fails.

    Parameters
    ----------
    path
        File of the ledger; it is made where there is none.
    entries
        The results.

    Returns
    -------
    list of bool
        Whether each is new, by its SHA-256.

    Raises
    ------
    HrgError
        A figure is not finite; the database is damaged, another program's, busy, or cannot be
        written.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from hrg_cli.ledger.database import add_entries
    >>> from hrg_cli.ledger.entry import Entry
    >>> entry = Entry("ab" * 32, "r.h5", "resonator", "SN-1", "2026-01-01T00:00:00Z", "valid")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     ledger = Path(folder) / "ledger.db"
    ...     add_entries(ledger, [entry]), add_entries(ledger, [entry])
    ([True], [False])
    """
    for entry in entries:
        _need_finite(entry)
    if not os.path.lexists(path) and path.parent.is_dir():
        try:
            return _add_to_new(path, entries)
        except HrgError as error:
            if not path.exists():  # otherwise another program has made it meanwhile
                raise HrgError(str(error).replace("--output", "--ledger")) from error
    return _add_to(path, path, entries)


def _need_finite(entry: Entry) -> None:
    """HrgError: a figure is no number that a table or a chart could show."""
    for name, figure in entry.figures.items():
        if not math.isfinite(figure.value):
            raise HrgError(
                f"{entry.file}: its {name} is {figure.value}, a finite number was expected; nothing"
                " was entered: make the file again"
            )


def _add_to_new(path: Path, entries: Sequence[Entry]) -> list[bool]:
    """Make the ledger whole or not at all: nothing is left of one whose disk was full."""
    with write_whole(path) as temporary:
        return _add_to(temporary, path, entries, journal="MEMORY")


def _add_to(
    place: Path, path: Path, entries: Sequence[Entry], journal: str = "DELETE"
) -> list[bool]:
    """Enter all or none into the file at `place`, which errors call `path`. A file that is dropped
    where anything fails needs no journal beside it."""
    with _open(place, "rwc", path) as connection:
        _begin(connection, f"PRAGMA journal_mode = {journal}", "BEGIN IMMEDIATE")
        try:
            _make_tables(connection, path)
            new = [_insert(connection, entry) for entry in entries]
        except BaseException:
            connection.rollback()
            raise
        connection.commit()
    return new


def read_entries(path: Path) -> list[Entry]:
    """Every entry of a ledger, in the order in which they were entered.

    Parameters
    ----------
    path
        File of the ledger.

    Returns
    -------
    list of Entry
        As they were entered.

    Raises
    ------
    HrgError
        There is no ledger; it is damaged, another program's, or busy.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from hrg_cli.ledger.database import add_entries, read_entries
    >>> from hrg_cli.ledger.entry import Entry
    >>> entry = Entry("ab" * 32, "r.h5", "resonator", "SN-1", "2026-01-01T00:00:00Z", "valid")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     ledger = Path(folder) / "ledger.db"
    ...     _ = add_entries(ledger, [entry])
    ...     read_entries(ledger) == [entry]
    True
    """
    if not path.is_file():
        raise HrgError(
            f"{path}: no such ledger; make one with `hrg ledger add FILE`, or name it with --ledger"
        )
    left_by_a_killed_writer = Path(f"{path}-journal").exists()  # only who may write can undo it
    with _open(path, "rw" if left_by_a_killed_writer else "ro", path) as connection:
        _begin(connection, "BEGIN", "SELECT count(*) FROM sqlite_master")
        _need_own(connection, path)
        figures: dict[int, dict[str, Figure]] = {}
        for number, name, value, std, units in connection.execute(
            "SELECT entry, name, value, std, units FROM figure ORDER BY entry, place"
        ):
            known = None if std is None else float(std)
            figures.setdefault(number, {})[str(name)] = Figure(float(value), known, str(units))
        rows = connection.execute(f"SELECT number, {_NAMES} FROM entry ORDER BY number")
        return [_entry(row, figures.get(number, {})) for number, *row in rows]


@contextlib.contextmanager
def _open(place: Path, mode: str, path: Path) -> Iterator[sqlite3.Connection]:
    """A connection to `place` that is closed on leaving; every way SQLite fails becomes a sentence
    that names `path`."""
    if not path.parent.is_dir():
        raise HrgError(f"{path}: the folder {path.parent} does not exist; make it first")
    if path.exists() and not path.is_file():
        raise HrgError(f"{path}: is no regular file; name a file for the ledger")
    connection = None
    try:
        address = quote(str(place.absolute()).encode("utf-8", "surrogateescape"))
        connection = sqlite3.connect(
            f"file:{address}?mode={mode}", uri=True, timeout=STEP_S, isolation_level=None
        )
        connection.execute("PRAGMA trusted_schema = OFF")
        connection.execute("PRAGMA cell_size_check = ON")
        yield connection
    except sqlite3.Error as error:
        raise HrgError(f"{path}: {_sentence(error)}") from error
    except (ValueError, TypeError, OverflowError, RecursionError) as error:
        raise HrgError(f"{path}: {_DAMAGED.format(str(error)[:80])}") from error
    finally:
        if connection is not None:
            connection.close()


def _begin(connection: sqlite3.Connection, *statements: str) -> None:
    """Begin a transaction; wait for another program's, which Ctrl-C ends."""
    deadline = time.monotonic() + WAIT_S
    while True:
        try:
            for statement in statements:
                connection.execute(statement).fetchall()
            break
        except sqlite3.OperationalError as error:
            connection.rollback()
            if not _is_busy(error) or time.monotonic() > deadline:
                raise
    connection.execute(f"PRAGMA busy_timeout = {round(1e3 * WAIT_S)}")


def _is_busy(error: sqlite3.Error) -> bool:
    return getattr(error, "sqlite_errorname", "").startswith(("SQLITE_BUSY", "SQLITE_LOCKED"))


_DAMAGED = "is a damaged ledger ({}); put a copy of it in its place and add the later files again"


def _sentence(error: sqlite3.Error) -> str:
    """What went wrong and what to do."""
    name = getattr(error, "sqlite_errorname", "")
    if _is_busy(error):
        return f"another program has been writing to it for {WAIT_S:g} s; try again later"
    if name.startswith(("SQLITE_READONLY", "SQLITE_CANTOPEN", "SQLITE_PERM", "SQLITE_AUTH")):
        return f"cannot be opened ({error}); ask for the right to write it and its folder"
    if name.startswith("SQLITE_FULL"):
        return "the disk is full, nothing was entered; free space and add again"
    if name.startswith("SQLITE_IOERR"):
        return f"cannot be read or written ({error}); nothing was entered; check its disk"
    if name.startswith("SQLITE_NOTADB"):
        return "is no SQLite file, a ledger was expected; name another with --ledger"
    return _DAMAGED.format(error)


def _make_tables(connection: sqlite3.Connection, path: Path) -> None:
    """The tables of a new file; of an existing one, whether they are a ledger's."""
    (known,) = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
    (mark,) = connection.execute("PRAGMA application_id").fetchone()
    if known or mark:
        _need_own(connection, path)
        return
    for statement in _SCHEMA:
        connection.execute(statement)
    connection.execute(f"PRAGMA application_id = {APPLICATION}")
    connection.execute(f"PRAGMA user_version = {VERSION}")


def _need_own(connection: sqlite3.Connection, path: Path) -> None:
    """HrgError: another program's file, a newer version, tables of another form, or pages that do
    not fit together."""
    (mark,) = connection.execute("PRAGMA application_id").fetchone()
    (version,) = connection.execute("PRAGMA user_version").fetchone()
    found = [
        sql for (sql,) in connection.execute("SELECT sql FROM sqlite_master WHERE sql IS NOT NULL")
    ]
    if mark != APPLICATION:
        raise HrgError(f"{path}: is an SQLite file, but no ledger; name another file with --ledger")
    if version != VERSION:
        raise HrgError(
            f"{path}: is a ledger of version {version}, this hrg knows {VERSION}; use the hrg that"
            " wrote it"
        )
    if sorted(found) != sorted(_SCHEMA):
        raise HrgError(f"{path}: {_DAMAGED.format('its tables were changed')}")
    (said,) = connection.execute("PRAGMA quick_check(1)").fetchone()
    if said != "ok":
        raise HrgError(f"{path}: {_DAMAGED.format(' '.join(said.split()))}")


def _insert(connection: sqlite3.Connection, entry: Entry) -> bool:
    """Enter one; False where its file is known already."""
    row = [_text(getattr(entry, name)) for name in _TEXTS]
    lists = [
        json.dumps(list(value), ensure_ascii=False) for value in (entry.reasons, entry.samples)
    ]
    done = connection.execute(
        f"INSERT INTO entry ({_NAMES}) VALUES ({', '.join('?' * len(_COLUMNS))})"
        " ON CONFLICT (sha256) DO NOTHING",
        [*row, entry.verdict, entry.mode_number, *map(_text, lists)],
    )
    if done.rowcount == 0:
        return False
    connection.executemany(
        "INSERT INTO figure VALUES (?, ?, ?, ?, ?, ?)",
        [
            (done.lastrowid, place, _text(name), figure.value, figure.std, _text(figure.units))
            for place, (name, figure) in enumerate(entry.figures.items())
        ],
    )
    return True


def _text(value: str) -> str:
    """Text that SQLite takes: a file's name may be none."""
    return value.encode("utf-8", "backslashreplace").decode().replace("\0", "\ufffd")


def _entry(row: Sequence[Any], figures: dict[str, Figure]) -> Entry:
    """ValueError: a row that `_insert` did not write."""
    values = dict(zip(_COLUMNS, row, strict=True))
    lists = {name: json.loads(values.pop(name)) for name in ("reasons", "samples")}
    if not all(isinstance(value, list) for value in lists.values()):
        raise ValueError("its reasons or samples are no list")
    if values["status"] not in ("valid", "suspect", "refused"):
        raise ValueError(f"a status is {str(values['status'])[:20]!r}")
    mode = int(values.pop("mode_number"))
    if not 1 <= mode <= 1000:
        raise ValueError(f"a mode number is {mode}")
    texts: dict[str, Any] = {name: str(values[name]) for name in _TEXTS}
    for time_text in (texts["processed"], *filter(None, (texts["measured"], texts["added"]))):
        parse_time(time_text)
    verdict = None if values["verdict"] is None else str(values["verdict"])
    told: dict[str, Any] = {name: tuple(map(str, value)) for name, value in lists.items()}
    return Entry(**texts, verdict=verdict, mode_number=mode, **told, figures=figures)
