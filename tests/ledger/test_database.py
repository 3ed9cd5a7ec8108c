"""The ledger's file: whole or nothing, two writers at once, damage told in one sentence."""

import contextlib
import resource
import signal
import sqlite3
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from conftest import importing_the_same
from production import entry

from hrg_cli.errors import HrgError
from hrg_cli.ledger import database
from hrg_cli.ledger.entry import Figure

PACKAGE = Path(database.__file__).parents[2]


def entries(count, gyro="SN"):
    return [entry(f"{gyro}-{n}", float(n), 0.1 + 1e-3 * n) for n in range(count)]


def test_what_is_entered_comes_back(tmp_path):
    path = tmp_path / "l.sqlite"
    given = entry(
        "SN '1'; DROP TABLE entry; \ud800",
        1.5,
        0.1,
        station="=2",
        reasons=("a — b",),
        verdict="adequate",
        figures={"z": Figure(1.0, None, ""), "a": Figure(-2.5, 0.1, "Hz")},
    )
    assert database.add_entries(path, [given, *entries(3)]) == [True] * 4
    back = database.read_entries(path)
    assert back[1:] == entries(3)
    assert back[0].figures == given.figures and list(back[0].figures) == ["z", "a"]
    assert back[0].reasons == given.reasons and back[0].station == "=2"
    assert back[0].gyro_id.startswith("SN '1'; DROP TABLE entry; ")


def test_the_same_file_twice_is_one_row(tmp_path):
    path = tmp_path / "l.sqlite"
    one = entries(2)
    assert database.add_entries(path, one + one[:1]) == [True, True, False]
    assert database.add_entries(path, one) == [False, False]
    assert database.read_entries(path) == one


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
def test_nothing_is_entered_where_one_fails(value, tmp_path):
    """What is no number was blamed on the ledger ("is damaged"), or entered where it is infinite."""
    path = tmp_path / "l.sqlite"
    database.add_entries(path, entries(2))
    bad = entry("SN-x", 0.0, value)
    with pytest.raises(HrgError, match=rf"{value}, a finite number was expected") as refused:
        database.add_entries(path, [*entries(5, "NEW"), bad])
    assert str(refused.value).startswith(bad.file)
    assert database.read_entries(path) == entries(2)


@contextlib.contextmanager
def files_no_longer_than(size):
    """A disk with so much room: longer files cannot be written."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.parametrize("room", [0, 4096, 40_000])
def test_a_new_ledger_is_whole_or_absent(room, tmp_path):
    path = tmp_path / "l.sqlite"
    with files_no_longer_than(room), pytest.raises(HrgError, match=r"l\.sqlite: ") as refused:
        database.add_entries(path, entries(500))
    assert ".tmp" not in str(refused.value), "the sentence names what the user named"
    assert list(tmp_path.iterdir()) == []
    assert database.add_entries(path, entries(2)) == [True] * 2


def test_an_old_ledger_is_as_it_was_where_the_disk_is_full(tmp_path):
    path = tmp_path / "l.sqlite"
    database.add_entries(path, entries(2))
    room = files_no_longer_than(path.stat().st_size)
    with room, pytest.raises(HrgError, match=r"l\.sqlite: .*nothing was entered"):
        database.add_entries(path, entries(500, "NEW"))
    assert database.read_entries(path) == entries(2)


def test_a_ledger_made_by_another_meanwhile_is_added_to(tmp_path, monkeypatch):
    path = tmp_path / "l.sqlite"
    make_new = database._add_to_new

    def after_another(new, given):
        monkeypatch.undo()
        database.add_entries(path, entries(3, "THEIRS"))
        return make_new(new, given)

    monkeypatch.setattr(database, "_add_to_new", after_another)
    assert database.add_entries(path, entries(2)) == [True] * 2
    assert database.read_entries(path) == [*entries(3, "THEIRS"), *entries(2)]
    assert [one.name for one in tmp_path.iterdir()] == ["l.sqlite"]


WRITER = """
import sys
from pathlib import Path
from test_database import entries
from hrg_cli.ledger import database
for one in entries(40, sys.argv[2]):
    database.add_entries(Path(sys.argv[1]), [one])
"""


def test_two_writers_at_once_lose_nothing(tmp_path):
    path = tmp_path / "l.sqlite"
    arguments = [sys.executable, "-c", WRITER, str(path)]
    writers = [
        subprocess.Popen(
            [*arguments, name],
            cwd=PACKAGE,
            env=importing_the_same(),
            stderr=subprocess.PIPE,
            text=True,
        )
        for name in ("A", "B")
    ]
    for writer in writers:
        assert writer.wait(120) == 0, writer.stderr.read()
        writer.stderr.close()
    assert sorted(e.gyro_id for e in database.read_entries(path)) == sorted(
        e.gyro_id for name in ("A", "B") for e in entries(40, name)
    )


@pytest.fixture
def locked(tmp_path):
    """A ledger that another program holds for itself."""
    path = tmp_path / "l.sqlite"
    database.add_entries(path, entries(2))
    with contextlib.closing(sqlite3.connect(path, isolation_level=None)) as other:
        other.execute("BEGIN EXCLUSIVE")
        yield path


TOUCH = {
    "write": lambda path: database.add_entries(path, entries(1, "MINE")),
    "read": database.read_entries,
}


@pytest.mark.parametrize("touch", TOUCH)
def test_a_ledger_that_stays_locked_is_one_sentence(touch, locked, monkeypatch):
    monkeypatch.setattr(database, "WAIT_S", 0.2)
    monkeypatch.setattr(database, "STEP_S", 0.1)
    with pytest.raises(HrgError, match=r"has been writing to it for 0\.2 s; try again later"):
        TOUCH[touch](locked)


@pytest.mark.parametrize("touch", TOUCH)
def test_waiting_for_a_ledger_can_be_interrupted(touch, locked, monkeypatch):
    """SQLite slept in one piece: Ctrl-C was taken after a minute."""
    monkeypatch.setattr(database, "WAIT_S", 10.0)

    def interrupt(*_):
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 0.2)
    started = time.monotonic()
    try:
        with pytest.raises(KeyboardInterrupt):
            TOUCH[touch](locked)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert time.monotonic() - started < 5


def test_what_is_no_lock_is_not_waited_for(monkeypatch):
    monkeypatch.setattr(database, "WAIT_S", 10.0)
    started = time.monotonic()
    with (
        contextlib.closing(sqlite3.connect(":memory:", isolation_level=None)) as connection,
        pytest.raises(sqlite3.OperationalError, match="no such table"),
    ):
        database._begin(connection, "BEGIN", "SELECT * FROM missing")
    assert time.monotonic() - started < 5


def test_a_row_that_its_table_forbids_is_damage(tmp_path):
    """SQLite reads it; only its own check tells that no ledger was written so."""
    path = tmp_path / "l.sqlite"
    database.add_entries(path, entries(2))
    strict, loose = '"station" TEXT NOT NULL', '"station" TEXT'
    steps = (
        f"UPDATE sqlite_master SET sql = replace(sql, '{strict}', '{loose}')",
        "UPDATE entry SET station = NULL",
        f"UPDATE sqlite_master SET sql = replace(sql, '{loose},', '{strict},')",
    )
    for step in steps:  # each with the tables as the last one left them
        with contextlib.closing(sqlite3.connect(path, isolation_level=None)) as connection:
            connection.execute("PRAGMA writable_schema = ON")
            connection.execute(step)
    with pytest.raises(HrgError, match=r"is a damaged ledger \(.*NULL value in entry\.station"):
        database.read_entries(path)


def test_a_ledger_that_is_let_go_is_entered_into(tmp_path):
    path = tmp_path / "l.sqlite"
    database.add_entries(path, entries(2))
    with contextlib.closing(
        sqlite3.connect(path, isolation_level=None, check_same_thread=False)
    ) as other:
        other.execute("BEGIN EXCLUSIVE")
        threading.Timer(0.8, other.rollback).start()
        assert database.add_entries(path, entries(1, "MINE")) == [True]


KILLED = """
import os, sqlite3, sys
connection = sqlite3.connect(sys.argv[1], isolation_level=None)
connection.execute("PRAGMA cache_size = 1")
connection.execute("PRAGMA cache_spill = 1")
connection.execute("BEGIN IMMEDIATE")
connection.execute("UPDATE figure SET value = 7")
connection.execute("DELETE FROM entry")
os.kill(os.getpid(), 9)
"""


def test_a_killed_writer_leaves_what_was_there(tmp_path):
    path = tmp_path / "l.sqlite"
    many = entries(500)
    database.add_entries(path, many)
    done = subprocess.run([sys.executable, "-c", KILLED, str(path)], check=False)
    assert done.returncode == -9
    assert database.read_entries(path) == many
    assert database.add_entries(path, entries(1, "NEW")) == [True]


def damaged(path, how):
    whole = bytearray(path.read_bytes())
    if how == "cut":
        whole = whole[: len(whole) // 2]
    elif how == "page":
        whole[4096:8192] = b"\xa5" * 4096
    elif how == "text":
        whole = bytearray(b"gyro_id,value\nSN-1,3\n" * 50)
    elif how == "head":
        whole[20:60] = b"\xff" * 40
    path.write_bytes(whole)


@pytest.mark.parametrize("how", ["cut", "page", "text", "head"])
def test_a_damaged_ledger_is_one_sentence(how, tmp_path):
    path = tmp_path / "l.sqlite"
    database.add_entries(path, entries(60))
    damaged(path, how)
    before = path.read_bytes()
    for work in (
        lambda: database.read_entries(path),
        lambda: database.add_entries(path, entries(1, "NEW")),
    ):
        with pytest.raises(HrgError, match=r"l\.sqlite: is (a damaged|no) ") as told:
            work()
        assert "\n" not in str(told.value)
    assert path.read_bytes() == before


@pytest.mark.parametrize(
    ("statement", "said"),
    [
        ("PRAGMA application_id = 5", "but no ledger"),
        ("UPDATE entry SET processed = ''", "Invalid isoformat"),
        ("UPDATE entry SET measured = 'yesterday'", "Invalid isoformat"),
        ("UPDATE entry SET added = char(0, 0)", "Invalid isoformat"),
        ("PRAGMA user_version = 9", "version 9"),
        ("CREATE TRIGGER t AFTER INSERT ON entry BEGIN DELETE FROM figure; END", "were changed"),
        ("UPDATE entry SET status = 'perfect'", "damaged ledger (a status"),
        ("UPDATE entry SET samples = '{'", "damaged ledger"),
        ("UPDATE figure SET value = 'much'", "damaged ledger"),
        ("UPDATE entry SET mode_number = -3", "damaged ledger (a mode"),
    ],
)
def test_what_no_ledger_would_hold_is_refused(statement, said, tmp_path):
    path = tmp_path / "l.sqlite"
    database.add_entries(path, entries(2))
    with sqlite3.connect(path) as connection:
        connection.execute(statement)
    connection.close()
    with pytest.raises(HrgError) as told:
        database.read_entries(path)
    assert said in str(told.value)


def test_another_programs_database_stays_as_it_is(tmp_path):
    path = tmp_path / "other.sqlite"
    with sqlite3.connect(path) as connection:
        connection.execute("CREATE TABLE mine (a)")
    connection.close()
    before = path.read_bytes()
    with pytest.raises(HrgError, match="no ledger"):
        database.add_entries(path, entries(1))
    assert path.read_bytes() == before


def test_places_that_are_none(tmp_path):
    for path, said in (
        (tmp_path, "no regular file"),
        (tmp_path / "no" / "l.sqlite", "does not exist"),
    ):
        with pytest.raises(HrgError, match=said):
            database.add_entries(path, entries(1))
    with pytest.raises(HrgError, match="no such ledger"):
        database.read_entries(tmp_path / "l.sqlite")
    assert not (tmp_path / "l.sqlite").exists()


def test_a_name_with_signs_of_an_address_is_a_name(tmp_path):
    path = tmp_path / "a?mode=ro&x#y %41.sqlite"
    assert database.add_entries(path, entries(1)) == [True] and path.is_file()
    assert database.read_entries(path) == entries(1)
