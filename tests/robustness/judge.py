"""One judge for every command and fault: a command runs in a process forked from a warm one; what
it leaves is held against the promises.

The promises: exit status 0, 1, 2 or 3; with 1 and 2 one sentence on standard error, nothing on
standard output and no output file; with 0 and 3 one JSON object; no traceback, no internal error,
no library's warning, no half file; no figure that is not finite in what is handed on under 0;
bounded processor time and memory.
"""

from __future__ import annotations

import contextlib
import ctypes
import importlib
import json
import os
import re
import resource
import shutil
import signal
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn

from hrg_cli import store

PROCESSOR_S, CLOCK_S = 60, 900.0
MEMORY_MB = 1500
"""Above what the warm process has."""
NOISE = re.compile(r"Traceback|internal error|Warning|\*\* On entry|Fatal|Segmentation|core dumped")
NOT_FINITE = re.compile(r"(?<![\w.])[-+]?(nan|inf|infinity)(?![\w.])", re.IGNORECASE)
WARM = (
    *(
        "pipeline",
        "store",
        "exporting",
        "limits",
        "verification",
        "formats",
        "reporting.page",
        "cli",
    ),
    *(
        f"commands.{name}"
        for name in (
            "info",
            "report",
            "import_",
            "ledger",
            "simulate",
            "batch",
            "plan",
            "diagnose",
        )
    ),
)


@dataclass
class Outcome:
    """What a command left: its exit status (negative: killed by a signal), what it said, its peak
    memory, its broken promises."""

    status: int
    out: str
    err: str
    seconds: float
    peak_mb: float
    broken: list[str] = field(default_factory=list)
    reached: bool = True
    """Whether the call that was to fail was made: what a command did once already, it may skip."""


def warm() -> None:
    """Import what commands import, so that a forked child need not."""
    for name in WARM:
        importlib.import_module(f"hrg_cli.{name}")
    for name in pipeline_stages():
        importlib.import_module(f"hrg_cli.stages.{name}")


def pipeline_stages() -> list[str]:
    """The names of all stages."""
    from hrg_cli.pipeline import STAGES

    return list(STAGES)


Arm = tuple[str, int, int]
"""A call's kind, which one of them fails, and with which errno."""
NEVER = 1 << 30
UNREACHED = ".unreached"
"""A mark in the folder: the command ended before the call that was to fail."""


def run(words: list[str], folder: Path, output: Path, arm: Arm | None = None) -> Outcome:
    """Run `hrg WORDS` in `folder` in a child of this process and judge what it left; arm: (call,
    n-th, errno) to fail there."""
    before, said = _names(folder), _said(folder)
    started = time.monotonic()
    child = os.fork()
    if child == 0:
        in_child(words, folder, arm)
    status, used = _waited(child)
    seconds, peak_mb = used.ru_utime + used.ru_stime, used.ru_maxrss / 1024
    outcome = _judged(status, said, seconds, peak_mb, folder, output, before)
    if time.monotonic() - started > CLOCK_S:
        outcome.broken.append("did not end")
    return outcome


def run_here(words: list[str], folder: Path, output: Path, arm: Arm | None = None) -> Outcome:
    """Run `hrg WORDS` in this process and judge what it left: many in turn are quick so, but a
    crash ends them all."""
    before, said = _names(folder), _said(folder)
    _forget_peak()
    started = sum(os.times()[:4])
    limit = int(started) + PROCESSOR_S + 1
    resource.setrlimit(resource.RLIMIT_CPU, (limit, resource.RLIM_INFINITY))
    os.chdir(folder)
    with _output_into(said), _armed(folder, arm):
        status = _command(words)
    seconds = sum(os.times()[:4]) - started
    return _judged(status, said, seconds, _peak_mb(), folder, output, before)


Runner = Callable[..., Outcome]
"""`run` or `run_here`."""


def limit_memory() -> None:
    """At most so much memory above what this process has now."""
    have = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (have + (MEMORY_MB << 21), have + (MEMORY_MB << 21)))


def _names(folder: Path) -> set[str]:
    return {path.name for path in folder.iterdir()}


def _said(folder: Path) -> list[Path]:
    return [folder / ".stdout", folder / ".stderr"]


def _judged(
    status: int,
    said: list[Path],
    seconds: float,
    peak_mb: float,
    folder: Path,
    output: Path,
    before: set[str],
) -> Outcome:
    out, err = (path.read_text(errors="replace") if path.exists() else "" for path in said)
    for path in said:
        path.unlink(missing_ok=True)
    unreached = folder / UNREACHED
    outcome = Outcome(status, out, err, seconds, peak_mb, reached=not unreached.exists())
    unreached.unlink(missing_ok=True)
    outcome.broken = _broken(outcome, folder, output, before)
    return outcome


def _waited(child: int) -> tuple[int, resource.struct_rusage]:
    deadline = time.monotonic() + CLOCK_S
    while True:
        done, status, used = os.wait4(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status), used
        if time.monotonic() > deadline:
            os.kill(child, signal.SIGKILL)
            deadline += 60
        time.sleep(0.002)


def _forget_peak() -> None:
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def _peak_mb() -> float:
    found = re.search(r"VmHWM:\s+(\d+) kB", Path("/proc/self/status").read_text())
    return int(found[1]) / 1024 if found else 0.0


@contextlib.contextmanager
def _output_into(said: list[Path]) -> Iterator[None]:
    """Standard output and error into files, also of libraries below Python."""
    kept, streams = [os.dup(1), os.dup(2)], (sys.stdout, sys.stderr)
    try:
        for handle, path in zip((1, 2), said):
            opened = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            os.dup2(opened, handle)
            os.close(opened)
        sys.stdout = open(1, "w", closefd=False)  # noqa: SIM115
        sys.stderr = open(2, "w", buffering=1, closefd=False)  # noqa: SIM115
        yield
    finally:
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(Exception):
                stream.flush()
        sys.stdout, sys.stderr = streams
        for handle, own in zip((1, 2), kept):
            os.dup2(own, handle)
            os.close(own)


def _command(words: list[str]) -> int:
    """Exit status of `hrg WORDS`; what escapes it is printed as Python would."""
    sys.argv = ["hrg", *words]
    from hrg_cli.cli import main

    try:
        main()
        return 0
    except SystemExit as leaving:
        return int(leaving.code or 0)
    except BaseException:
        import traceback

        traceback.print_exc()
        return 70


def in_child(words: list[str], folder: Path, arm: Arm | None = None) -> NoReturn:
    """In a forked child: run `hrg WORDS` and end."""
    status = 70
    try:
        os.chdir(folder)
        resource.setrlimit(resource.RLIMIT_CPU, (PROCESSOR_S, PROCESSOR_S + 5))
        limit_memory()
        with _output_into(_said(folder)), _armed(folder, arm):
            status = _command(words)
    finally:
        os._exit(status)


@contextlib.contextmanager
def _armed(folder: Path, arm: Arm | None) -> Iterator[None]:
    """Let the n-th call fail that concerns the folder."""
    if arm is None:
        yield
        return
    shim = ctypes.CDLL(None)
    shim.hrg_fault_arm(str(folder).encode(), arm[0].encode(), arm[1], arm[2])
    try:
        yield
    finally:
        shim.hrg_fault_disarm()
        if arm[1] != NEVER and not shim.hrg_fault_hits():
            (folder / UNREACHED).touch()


def calls_of(words: list[str], folder: Path, kind: str) -> int:
    """How many calls of a kind `hrg WORDS` makes that concern the folder."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.chdir(folder)
            with _output_into(_said(folder)), _armed(folder, (kind, NEVER, 0)):
                _command(words)
            os.write(writing, str(ctypes.CDLL(None).hrg_fault_seen()).encode())
        finally:
            os._exit(0)
    os.close(writing)
    os.waitpid(child, 0)
    with os.fdopen(reading) as told:
        return int(told.read() or 0)


def _broken(found: Outcome, folder: Path, output: Path, before: set[str]) -> list[str]:
    """The promises that were broken."""
    broken = []
    if found.status not in (0, 1, 2, 3):
        where = re.search(r"crashed (inside \S+)", found.err)
        broken.append(f"ended with {found.status}" + (f" {where[1]}" if where else ""))
    if NOISE.search(found.err) or NOISE.search(found.out):
        broken.append("a traceback, an internal error or a library's words")
    lines = found.err.strip().splitlines()
    if found.status in (1, 2):
        if found.out.strip():
            broken.append("something on standard output of a failed command")
        if len(lines) != 1 or not lines[0].startswith("hrg: ") or len(lines[0]) > 4000:
            broken.append("not one sentence")
        if output.exists() and not output.is_dir():
            broken.append("an output of a failed command")
    if "\x1b" in found.err + found.out:
        broken.append("control characters for the terminal")
    if found.status in (0, 3):
        broken += _judged_output(found, output)
    left = {p.name for p in folder.iterdir()} - before - {output.name, ".stdout", ".stderr"}
    inside = [p.name for p in output.rglob("*.tmp")] if output.is_dir() else []
    strange = sorted({name for name in left if not name.startswith(output.stem)} | set(inside))
    if strange:
        broken.append(f"left {strange[:3]} behind")
    if found.seconds > PROCESSOR_S:
        broken.append(f"took {found.seconds:.0f} s")
    if found.peak_mb > MEMORY_MB:
        broken.append(f"took {found.peak_mb:.0f} MB")
    return broken


def _judged_output(found: Outcome, output: Path) -> list[str]:
    broken = []
    try:
        told = json.loads(found.out)
        if not isinstance(told, dict) or "status" not in told:
            broken.append("JSON without a status")
    except ValueError:
        return ["no JSON object on standard output"]
    if output.suffix == ".h5" and output.is_file():
        try:
            store.read_any(output)
            if store.find_changes(output):
                broken.append("an output that differs from its own checksums")
        except Exception as error:
            broken.append(f"an output that cannot be read: {error}")
    elif output.suffix in (".csv", ".h", ".toml") and output.is_file() and found.status == 0:
        text = output.read_text(errors="replace")
        text = re.sub(r"/\*.*?\*/", "", text, flags=re.DOTALL) if output.suffix == ".h" else text
        match = NOT_FINITE.search(text)
        if match:
            broken.append(f"{match[0]} in {output.name} of a valid result")
    return broken


def clean(folder: Path) -> Path:
    """The folder, made anew and empty."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return folder
