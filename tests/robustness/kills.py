"""Commands killed at a random instant: no half output, no process that works on, and the same
command then gives what it gives undisturbed."""

from __future__ import annotations

import hashlib
import json
import os
import random
import re
import shutil
import signal
import sqlite3
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import psutil

from hrg_cli import store
from robustness import judge, programme

COSTLY_EVERY = 12
"""One kill in so many is of a command that takes seconds: a lot of several processes."""
LATEST = 1.1
"""Kills fall evenly over this part of the time that the command takes undisturbed."""
CHILDREN_END_S = 120.0
STAMP = "1767225600"
"""Time that all files bear, so that two runs can be compared byte by byte."""
TIME = re.compile(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\dZ")
"""A ledger keeps when it was told."""
LOT = 'recordings = "recording-*.h5"\nstages = ["identify"]\ncreated = "2026-01-01T00:00:00Z"\n'
GYROS = 3


@dataclass(frozen=True)
class Whole:
    """What a command gives undisturbed: exit status, digest of its output, seconds on the clock."""

    status: int
    digest: str
    seconds: float


def killed_cases(good: Path) -> list[programme.Case]:
    """Every command, and a lot shared among processes and with Dask."""
    (good / "lots.toml").write_text(
        LOT
        + "".join(
            f'[[gyro]]\ngyro_id = "G{k}"\nrecordings = ["recording-{k}.h5"]\n' for k in range(GYROS)
        )
    )
    for k in range(GYROS):
        shutil.copy(good / "recording.h5", good / f"recording-{k}.h5")
    cases = [case for case in programme.ready(good) if case.name != "batch"]
    lots = {
        "batch": "",
        "batch with two processes": "--jobs 2",
        "batch with Dask": "--jobs 2 --dask",
    }
    inputs = ("lots.toml", *(f"recording-{k}.h5" for k in range(GYROS)))
    for name, options in lots.items():
        words = ("batch", "{lots.toml}", "-o", "{out}", *options.split())
        cases.append(programme.Case(name, words, inputs, "out", costly=bool(options)))
    return cases


def put_kills(
    good: Path, folder: Path, kills: int, seed: int, only: str = ""
) -> Iterator[tuple[str, str, str]]:
    """So many kills over the commands in turn: of each the command, when it fell, and in words what
    broke a promise (empty: nothing)."""
    cases = programme.named(killed_cases(good), only)
    quick = [case for case in cases if not case.costly] or cases
    costly = [case for case in cases if case.costly] or cases
    rng = random.Random(seed)
    whole: dict[str, Whole] = {}
    for number in range(kills):
        turn = number // COSTLY_EVERY
        last = number % COSTLY_EVERY == COSTLY_EVERY - 1
        case = costly[turn % len(costly)] if last else quick[(number - turn) % len(quick)]
        if case.name not in whole:
            whole[case.name] = undisturbed(case, good, folder)
        after_s = rng.random() * LATEST * whole[case.name].seconds
        how, broken = killed(case, good, folder, after_s, whole[case.name])
        told = f"seed {seed}, kill {number}: {case.name} after {after_s:.4f} s: {'; '.join(broken)}"
        yield case.name, how, told if broken else ""


def undisturbed(case: programme.Case, good: Path, folder: Path) -> Whole:
    """The command without a kill; the second of two, since the first also prepares."""
    os.environ["SOURCE_DATE_EPOCH"] = STAMP
    for _ in range(2):
        words = programme.prepared(case, good, folder)
        started = time.monotonic()
        found = judge.run(words, folder, folder / case.output)
    if found.broken or found.status not in (0, 3):
        raise SystemExit(f"{case.name} fails as it is: {found}")
    return Whole(found.status, digest(folder / case.output), time.monotonic() - started)


def killed(
    case: programme.Case, good: Path, folder: Path, after_s: float, whole: Whole
) -> tuple[str, list[str]]:
    """Kill the command after so many seconds, look at what it left, and run it again: "before" it
    wrote anything, "within", or "after" it had ended; the broken promises."""
    os.environ["SOURCE_DATE_EPOCH"] = STAMP
    words = programme.prepared(case, good, folder)
    output, before = folder / case.output, set(folder.iterdir())
    child = os.fork()
    if child == 0:
        os.setsid()
        judge.in_child(words, folder)
    time.sleep(after_s)
    others = _children(child)
    os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    _, left = psutil.wait_procs(others, timeout=CHILDREN_END_S)
    broken = [f"{len(left)} processes work on"] if left else []
    for one in left:
        one.kill()
    ended = os.waitstatus_to_exitcode(status) != -signal.SIGKILL
    how = "after" if ended else "within" if set(folder.iterdir()) - before else "before"
    broken += half(output, whole)
    if output.is_file() and output.suffix != ".sqlite":
        for path in folder.glob(f"{output.stem}.*"):
            path.unlink()  # whole ones; --force would stand in the history of the next
    again = judge.run(words, folder, output)
    broken += again.broken
    if again.status != whole.status:
        broken.append(f"run again it ends with {again.status}: {again.err.strip()[-300:]}")
    elif digest(output) != whole.digest:
        broken.append("run again it gives another output")
    if strange := sorted(path.name for path in folder.rglob("*.tmp")):
        broken.append(f"run again it leaves {strange[:3]}")
    return how, broken


def _children(process: int) -> list[psutil.Process]:
    try:
        return psutil.Process(process).children(recursive=True)
    except psutil.NoSuchProcess:
        return []


def half(output: Path, whole: Whole) -> list[str]:
    """What is there after a kill must be whole: an output as it would be undisturbed, and in a
    lot's folder readable files."""
    if output.is_dir():
        broken = []
        for path in output.rglob("*.h5"):
            try:
                store.read_any(path)
            except Exception as error:
                broken.append(f"a half file: {error}")
        return broken
    if output.suffix == ".sqlite" or not output.exists() or digest(output) == whole.digest:
        return []
    return [f"a half {output.name}"]


def digest(path: Path) -> str:
    """Of a file's content, or of all files of a folder; without what tells the time."""
    if path.is_dir():
        parts = [
            f"{one.relative_to(path)} {digest(one)}"
            for one in sorted(path.rglob("*"))
            if one.is_file()
        ]
        return hashlib.sha256("\n".join(parts).encode()).hexdigest()
    if not path.exists():
        return "none"
    if path.suffix == ".sqlite":
        with sqlite3.connect(path) as ledger:
            rows = TIME.sub("", "\n".join(ledger.iterdump()))
        return hashlib.sha256(rows.encode()).hexdigest()
    content = path.read_bytes()
    if path.suffix == ".json" and content.startswith(b"{"):
        table = json.loads(content)
        table.pop("elapsed_s", None)
        content = json.dumps(table, sort_keys=True).encode()
    return hashlib.sha256(content).hexdigest()
