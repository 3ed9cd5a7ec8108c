"""Many trials, some dozens in one process: what a command imports and prepares at its first call is
paid once, not twenty thousand times.

A process forked from a warm one runs its trials one after another and tells what came of each; one
that dies or hangs is blamed on its trial, which is run again in a process of its own.
"""

from __future__ import annotations

import contextlib
import gc
import json
import os
import select
import signal
import time
import traceback
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from typing import TypeVar

from robustness import judge

BATCH = 60
Trial = TypeVar("Trial")
Attempt = Callable[[Trial, "judge.Runner"], judge.Outcome]
"""Puts one trial's files in place, and runs its command with the runner it is given."""


def outcomes(trials: Sequence[Trial], attempt: Attempt[Trial]) -> Iterator[judge.Outcome]:
    """What came of each trial, in order."""
    gc.collect()
    gc.freeze()  # objects that no child touches stay shared with it
    done = 0
    while done < len(trials):
        batch = trials[done : done + BATCH]
        told = list(_in_one_process(batch, attempt))
        if len(told) < len(batch):
            told.append(judge.Outcome(70, "", "", 0.0, 0.0, ["ended the process it ran in"]))
        for trial, found in zip(batch, told):
            yield _confirmed(trial, found, attempt) if found.broken else found
        done += len(told)


def _confirmed(trial: Trial, found: judge.Outcome, attempt: Attempt[Trial]) -> judge.Outcome:
    """A broken promise once more in a process of its own; what shows only after other commands is
    told as such."""
    alone = attempt(trial, judge.run)
    if alone.broken:
        return alone
    found.broken = [f"{what} (only after other commands)" for what in found.broken]
    return found


def _in_one_process(batch: Sequence[Trial], attempt: Attempt[Trial]) -> Iterator[judge.Outcome]:
    """What came of the trials, until the process ends; it is killed when it says nothing more."""
    reading, writing = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(reading)
        _tell_each(batch, attempt, writing)
    os.close(writing)
    try:
        with os.fdopen(reading, "rb", buffering=0) as said:
            yield from _told(said.fileno())
    finally:
        with contextlib.suppress(ProcessLookupError):
            os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)


def _tell_each(batch: Sequence[Trial], attempt: Attempt[Trial], writing: int) -> None:
    try:
        judge.limit_memory()
        for trial in batch:
            found = attempt(trial, judge.run_here)
            os.write(writing, json.dumps(asdict(found)).encode() + b"\n")
    except BaseException:
        traceback.print_exc()
    finally:
        os._exit(0)


def _told(said: int) -> Iterator[judge.Outcome]:
    rest, deadline = b"", time.monotonic() + judge.CLOCK_S
    while select.select([said], [], [], max(0.0, deadline - time.monotonic()))[0]:
        read = os.read(said, 1 << 16)
        if not read:
            return
        *lines, rest = (rest + read).split(b"\n")
        for line in lines:
            deadline = time.monotonic() + judge.CLOCK_S
            yield judge.Outcome(**json.loads(line))
