"""`hrg run`: the recordings of one gyro into one folder by the chain; a folder of recordings is
taken whole, mixed gyros are refused."""

from __future__ import annotations

import re
import shlex
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import BrokenExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import settings, store
from .chain import (
    PER_RECORDING,
    RESULTS,
    Step,
    Work,
    find_mode,
    recording_to_wave,
    waves_to_results,
)
from .errors import HrgError, name_some
from .executors import start_processes
from .pipeline import STAGES
from .records import Recording

LOGS = (".csv", ".txt", ".tsv", ".dat", ".wav", ".flac", ".mat", ".tdms", ".parquet", ".gz", ".zst")
"""Ends of names that are taken from a folder as laboratories' logs."""
Told = Callable[[Step, float], None]
"""Called with every step and the share of the work done."""


@dataclass(frozen=True)
class Input:
    """A recording or a log, and what its outputs are called."""

    path: Path
    name: str
    logs: tuple[Path, ...] = ()


def run_gyro(
    paths: Sequence[Path],
    folder: Path,
    tables: Mapping[str, Mapping[str, Any]] | None = None,
    *,
    limits: Mapping[str, Any] | None = None,
    force: bool = False,
    command_line: str = "hrg run",
    told: Told = lambda step, share: None,
    jobs: int = 1,
    rehearse: Mapping[str, Any] | None = None,
) -> list[Step]:
    """Run every step that the inputs allow; one that fails is told, and what needs it is not tried.

    paths: recordings, foreign logs (imported first), or folders of them; tables: settings a stage;
    limits: tables a kind of file; jobs: processes that share the recordings up to their waves, and
    the rehearsals (the same results for any number); rehearse: whole settings of the rehearsals of
    resonator and calibration, None: there are none. HrgError: recordings of several gyros, two inputs of one name, an
    output that this chain did not make (unless `force`).
    """
    tables = tables or {}
    inputs = list_inputs(paths, tables.get("import", {}).get("s_file"))
    find_gyro(inputs)
    stages = [*(["import"] if any(i.logs for i in inputs) else []), *PER_RECORDING, *RESULTS]
    work = Work(
        folder,
        resolve_settings(tables, stages),
        limits or {},
        (),
        force,
        _Line(command_line),
        rehearse,
        jobs,
        tuple(i.path for i in inputs if not i.logs),
    )
    total = len(inputs) + len(RESULTS)
    steps: list[Step] = []
    waves: list[Path] = []
    for done, (one, made) in enumerate(
        zip(inputs, _shared([(work, one) for one in inputs], jobs)), start=1
    ):
        for step in made:
            steps.append(step)
            told(step, done / total)
        if made[-1].status != "failed":
            waves.append(folder / f"{one.name}.wave.h5")
    modes = {wave: find_mode(wave) for wave in waves}
    chosen = {mode: [w for w in waves if modes[w] == mode] for mode in ("free", "forced")}
    done = 0
    for step in waves_to_results(work, chosen["free"], chosen["forced"]):
        steps.append(step)
        done = RESULTS.index(step.name) + 1 if step.name in RESULTS else done
        told(step, (len(inputs) + done) / total)
    return steps


def plan_steps(
    paths: Sequence[Path], tables: Mapping[str, Mapping[str, Any]], rehearse: bool = False
) -> list[tuple[str, tuple[str, ...], str]]:
    """What a run would do, without doing it: (stage, inputs, output) a line, a rehearsal without
    output; the modes of recordings are read, logs count as free."""
    inputs = list_inputs(paths, tables.get("import", {}).get("s_file"))
    find_gyro(inputs)
    lines: list[tuple[str, tuple[str, ...], str]] = []
    waves: dict[str, list[str]] = {"free": [], "forced": []}
    for one in inputs:
        read = one.path.name
        if one.logs:
            lines.append(
                ("import", tuple(p.name for p in one.logs), read := f"{one.name}.recording.h5")
            )
        lines.append(("demodulate", (read,), f"{one.name}.periods.h5"))
        lines.append(("estimate", (f"{one.name}.periods.h5",), f"{one.name}.wave.h5"))
        waves[
            str(tables.get("import", {}).get("mode", "free")) if one.logs else _head(one.path).mode
        ].append(f"{one.name}.wave.h5")
    free, forced = tuple(waves["free"]), tuple(waves["forced"])
    judged = [("rehearse", "")] if rehearse else []
    if free:
        lines.append(("identify", free, "resonator.h5"))
        lines += [(name, ("resonator.h5",), output) for name, output in judged]
    lines.append(("diagnose", free or forced, "diagnosis.h5"))
    if forced:
        lines.append(("calibrate", forced, "calibration.h5"))
        lines += [(name, ("calibration.h5",), output) for name, output in judged]
        lines += [
            ("compensate", (wave,), wave.replace(".wave.h5", ".compensated.h5")) for wave in forced
        ]
    return lines


def resolve_settings(
    tables: Mapping[str, Mapping[str, Any]], stages: Sequence[str]
) -> dict[str, dict[str, Any]]:
    """The whole settings of these stages."""
    from .formats import import_log

    functions = {
        name: import_log if name == "import" else STAGES[name].load_function() for name in stages
    }
    return {
        name: settings.check_settings(function, tables.get(name, {}))
        for name, function in functions.items()
    }


def list_inputs(paths: Sequence[Path], s_file: str | None = None) -> list[Input]:
    """The recordings and logs, folders opened, without those that hold the channel S of another
    one.

    HrgError: nothing to run in a folder, two inputs whose outputs would have one name.
    """
    from .formats import find_partners, find_second_file

    files = [file for path in paths for file in (_in_folder(path) if path.is_dir() else [path])]
    second = find_partners(files, lambda path: s_file)
    found = []
    for path in (p for p in files if p not in second):
        name = (
            path.name.removesuffix(".h5")
            if path.suffix == ".h5"
            else path.name.split(".")[0] or path.stem
        )
        foreign = path.exists() and not store.is_hdf5(path)
        logs = (
            ()
            if not foreign
            else (path,)
            if s_file is None
            else (path, find_second_file(path, s_file))
        )
        found.append(Input(path, name, logs))
    names = [one.name for one in found]
    twice = next((one for one in found if names.count(one.name) > 1), None)
    if twice is not None:
        raise HrgError(
            f"{twice.path}: two inputs are called {twice.name}; rename one, their outputs would"
            " collide"
        )
    return found


def _in_folder(folder: Path) -> list[Path]:
    """The recordings and logs of a folder, run-2 before run-10; files that hrg made from them are
    left out."""
    found = []
    for path in sorted(
        folder.iterdir(),
        key=lambda p: [int(t) if t.isdigit() else t for t in re.split(r"(\d+)", p.name)],
    ):
        if not path.is_file() or path.name.startswith("."):
            continue
        if store.is_hdf5(path):
            try:
                found += (
                    [path]
                    if store.find_kind(path) is Recording
                    and not path.name.endswith(".recording.h5")
                    else []
                )
            except HrgError:
                found.append(
                    path
                )  # a laboratory's own HDF5, or a damaged recording, which its step names
        elif path.suffix.lower() in LOGS:
            found.append(path)
    if not found:
        raise HrgError(
            f"{folder}: holds no recording and no laboratory's log; name a folder of recordings, or"
            " files"
        )
    return found


def _head(path: Path) -> Recording:
    with store.open_record(path, Recording) as record:
        return record


def need_readable(inputs: Sequence[Input]) -> None:
    """Every recording opens, with a heading and columns of one length, before any work is done.

    HrgError: some do not; the sentence is the first one's, and names the others.
    """
    bad: list[tuple[Path, HrgError]] = []
    for one in inputs:
        if one.logs:
            continue
        try:
            _head(one.path)
        except HrgError as error:
            bad.append((one.path, error))
    if bad:
        others = name_some(path.name for path, _ in bad[1:]) if len(bad) > 1 else ""
        raise HrgError(f"{bad[0][1]}" + (f"; nor can these be read: {others}" if others else ""))


def find_gyro(inputs: Sequence[Input]) -> str:
    """The gyro of these recordings, empty where none names it. HrgError: several gyros. A file that
    cannot be read is left to its step."""
    gyros: dict[str, Path] = {}
    for one in inputs:
        if one.logs:
            continue
        try:
            gyro = _head(one.path).gyro_id
        except HrgError:
            continue
        if gyro:
            gyros.setdefault(gyro, one.path)
    if len(gyros) > 1:
        (a, first), (b, second) = list(gyros.items())[:2]
        raise HrgError(
            f"{second}: is of gyro {b}, but {first.name} is of gyro {a}; run takes one gyro, batch"
            " takes a lot of them"
        )
    return next(iter(gyros), "")


@dataclass(frozen=True)
class _Line:
    """The line of `history`: the step as a command of its own, and the command that ran it."""

    within: str

    def __call__(self, name: str, inputs: Sequence[Path], output: Path) -> str:
        return (
            f"hrg {name} {shlex.join(p.name for p in inputs)} -o {shlex.quote(output.name)} (in:"
            f" {self.within})"
        )


def _make_wave(task: tuple[Work, Input]) -> list[Step]:
    work, one = task
    return list(recording_to_wave(work, one.path, one.name, one.logs))


def _shared(tasks: Sequence[tuple[Work, Input]], jobs: int) -> Iterator[list[Step]]:
    """Every recording's steps, in the recordings' order. HrgError: a process was killed."""
    if min(jobs, len(tasks)) < 2:
        yield from map(_make_wave, tasks)
        return
    with start_processes(min(jobs, len(tasks))) as executor:
        try:
            yield from executor.map(_make_wave, tasks)
        except BrokenExecutor as error:
            raise HrgError(
                "a process of --jobs was killed; it needs more memory than there is, use fewer"
                " --jobs"
            ) from error
