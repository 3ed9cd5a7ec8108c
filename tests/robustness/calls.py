"""Calls of the operating system that fail: the n-th open, read, write, rename or allocation of every
command."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import h5py
import numpy as np

from robustness import batches, judge, kills, programme

SHIM = Path(__file__).with_name("fail_nth.c")
CALLS = (
    *(("open", errno.EMFILE), ("open", errno.EACCES), ("read", errno.EIO)),
    ("sector", errno.EIO),
    *(("write", errno.ENOSPC), ("write", errno.EIO), ("rename", errno.EIO)),
    ("alloc", errno.ENOMEM),
)
"""Kinds of calls, and how each fails."""
READING = ("open", "read", "sector")
"""Kinds that many commands are tried with in one process. A full disk may end the process, and what
one command has allocated the next does not allocate again: the others run in one of their own."""


@dataclass(frozen=True)
class Failing:
    """One call of a command that fails."""

    case: programme.Case
    call: str
    nth: int
    code: int

    def line(self) -> str:
        """In words."""
        return f"{self.case.name}: {self.call} {self.nth} fails with {errno.errorcode[self.code]}"


def put_failures(
    good: Path,
    folder: Path,
    cases: Sequence[programme.Case],
    most: int,
    calls: Sequence[tuple[str, int]] = CALLS,
    sample: int = 0,
) -> tuple[Counter, list[str]]:
    """The first `most` calls of each kind that each command makes (at most `sample` of them where
    it is given), failing one at a time: how each ended, and what broke a promise. A call that the
    command did not come to the second time is not counted."""
    whole = {case.name: undisturbed(case, good, folder) for case in cases}
    trials = [
        Failing(case, call, nth, code)
        for case in cases
        for call, code, made in _made(case, good, folder, calls)
        for nth in tried(min(most, made), sample)
    ]
    together = [trial for trial in trials if trial.call in READING]
    alone = [trial for trial in trials if trial.call not in READING]
    put = partial(attempt, good=good, folder=folder, whole=whole)
    ended = (
        *zip(together, batches.outcomes(together, put), strict=True),
        *((trial, put(trial, judge.run)) for trial in alone),
    )
    counts: Counter = Counter()
    failures = []
    for trial, found in ended:
        if not found.reached:
            continue
        counts[trial.case.name, trial.call, found.status] += 1
        if found.broken:
            failures.append(
                f"{trial.line()}: {'; '.join(found.broken)}\n  {found.err.strip()[-300:]}"
            )
            print(failures[-1], file=sys.stderr, flush=True)
    return counts, failures


def undisturbed(case: programme.Case, good: Path, folder: Path) -> str:
    """What the command gives where no call fails."""
    kills.undisturbed(case, good, folder)
    return content(folder / case.output)


def tried(made: int, sample: int) -> list[int]:
    """Every one of the calls made, or `sample` of them spread evenly, the first and last among
    them."""
    if not sample or made <= sample:
        return list(range(1, made + 1))
    return sorted({round(nth) for nth in np.linspace(1, made, sample)})


def _made(
    case: programme.Case, good: Path, folder: Path, calls: Sequence[tuple[str, int]]
) -> list[tuple[str, int, int]]:
    """(kind, errno, how many of the kind the command makes) of each way to fail."""
    made = {}
    for kind in {call for call, _ in calls}:
        words = programme.prepared(case, good, folder)
        made[kind] = judge.calls_of(words, folder, kind)
    return [(call, code, made[call]) for call, code in calls]


def attempt(
    trial: Failing, run: judge.Runner, good: Path, folder: Path, whole: dict[str, str]
) -> judge.Outcome:
    """One command of which one call fails: where it succeeds all the same (it tried again, or did
    without), it must give what it gives undisturbed."""
    words = programme.prepared(trial.case, good, folder)
    arm = (trial.call, trial.nth, trial.code)
    output = folder / trial.case.output
    found = run(words, folder, output, arm)
    # Of a chain in a folder the later files hold the hash of the earlier: a chunk that was stored as
    # it is, for want of memory to compress it, changes them all.
    comparable = trial.call != "alloc" or not output.is_dir()
    if found.status == 0 and comparable and content(output) != whole[trial.case.name]:
        found.broken.append("another result than without the failure")
    return found


def content(output: Path) -> str:
    """Of an hrg file the digests it keeps of its values and attributes (a chunk for whose
    compression there was no memory is stored as it is), else of all its bytes."""
    if output.suffix == ".h5" and output.is_file():
        with h5py.File(output) as file:
            return str(file.attrs["checksums"])
    return kills.digest(output)


def preloaded() -> None:
    """Start again with the shim that makes calls fail."""
    if "HRG_FAULT_SHIM" in os.environ:
        return
    made = Path(tempfile.mkdtemp()) / "fail_nth.so"
    subprocess.run(
        ["cc", "-shared", "-fPIC", "-O1", "-o", str(made), str(SHIM), "-ldl"], check=True
    )
    os.environ |= {"LD_PRELOAD": str(made), "HRG_FAULT_SHIM": str(made)}
    os.execv(sys.executable, sys.orig_argv)
