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

    Parameters
    ----------
    paths
        Recordings, foreign logs (imported first), or folders of them.
    folder
        Of the results; it exists.
    tables
        Settings by stage.
    limits
        By kind of file.
    force
        An output may be replaced that this chain did not make.
    command_line
        Of the history.
    told
        Called with every step.
    jobs
        Processes that share the recordings up to their waves, and the rehearsals; the results are
        the same for any number.
    rehearse
        Whole settings of the rehearsals of resonator and calibration; None: there are none.

    Returns
    -------
    list of Step
        Those that were done, in their order.

    Raises
    ------
    HrgError
        Recordings of several gyros, two inputs of one name.

    Examples
    --------
    A recording that is not there leaves nothing to identify:

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from hrg_cli.gyro import run_gyro
    >>> with TemporaryDirectory() as folder:
    ...     steps = run_gyro([Path(folder) / "run-1.h5"], Path(folder))
    >>> [(step.name, step.output, step.status) for step in steps]
    [('demodulate', 'run-1.periods.h5', 'failed')]
    """
    tables = tables or {}
    inputs = list_inputs(paths, tables.get("import", {}).get("s_file"))
    find_gyro(read_headings(inputs))
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
    """What a run would do, without doing it.

    Parameters
    ----------
    paths
        Recordings, logs or folders; the modes of recordings are read, logs count as free.
    tables
        Settings by stage.
    rehearse
        Results would be rehearsed.

    Returns
    -------
    list of tuple
        Stage, names of inputs, name of the output of every step; a rehearsal has no output.

    Raises
    ------
    HrgError
        A recording cannot be read, several gyros, two inputs of one name.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from hrg_cli.gyro import plan_steps
    >>> with TemporaryDirectory() as folder:
    ...     log = Path(folder) / "run-1.csv"
    ...     _ = log.write_text("0.0,0.1,0.2")
    ...     for step in plan_steps([log], {}):
    ...         print(*step)
    import ('run-1.csv',) run-1.recording.h5
    demodulate ('run-1.recording.h5',) run-1.periods.h5
    estimate ('run-1.periods.h5',) run-1.wave.h5
    identify ('run-1.wave.h5',) resonator.h5
    diagnose ('run-1.wave.h5',) diagnosis.h5
    """
    inputs = list_inputs(paths, tables.get("import", {}).get("s_file"))
    headings = need_readable(read_headings(inputs))
    find_gyro(headings)
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
        mode = tables.get("import", {}).get("mode", "free") if one.logs else headings[one.path].mode
        waves[str(mode)].append(f"{one.name}.wave.h5")
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
    """The whole settings of stages.

    Parameters
    ----------
    tables
        What is set, by stage.
    stages
        Their names, "import" among them.

    Returns
    -------
    dict
        By stage: its defaults with what is set over them.

    Raises
    ------
    HrgError
        A key that a stage does not have, or a value that it does not take.

    Examples
    --------
    >>> from hrg_cli.gyro import resolve_settings
    >>> resolve_settings({"demodulate": {"from_s": 0.5}}, ["demodulate"])["demodulate"]["from_s"]
    0.5
    """
    from .formats import import_log

    functions = {
        name: import_log if name == "import" else STAGES[name].load_function() for name in stages
    }
    return {
        name: settings.check_settings(function, tables.get(name, {}))
        for name, function in functions.items()
    }


def list_inputs(paths: Sequence[Path], s_file: str | None = None) -> list[Input]:
    """The recordings and logs that are run, folders opened.

    Parameters
    ----------
    paths
        Recordings, logs or folders.
    s_file
        Pattern of the files that hold the channel S of another one; these are no inputs.

    Returns
    -------
    list of Input
        In the order of the paths, those of a folder run-2 before run-10.

    Raises
    ------
    HrgError
        Nothing to run in a folder, two inputs whose outputs would have one name.

    Examples
    --------
    >>> from pathlib import Path
    >>> from hrg_cli.gyro import list_inputs
    >>> [one.name for one in list_inputs([Path("run-2.h5"), Path("run-10.csv.gz")])]
    ['run-2', 'run-10']
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


Headings = Mapping[Path, Recording | HrgError]
"""What the recordings say of themselves, without their rows, or why one cannot be read."""


def read_headings(inputs: Sequence[Input]) -> Headings:
    """The heading of every recording: whose it is, free or forced, columns of one length.

    Parameters
    ----------
    inputs
        Recordings and logs; a log has no heading before it is imported.

    Returns
    -------
    mapping
        By path, in their order; the error of one that cannot be read stands in its place.

    Examples
    --------
    >>> from pathlib import Path
    >>> from hrg_cli.gyro import Input, read_headings
    >>> print(*read_headings([Input(Path("nowhere.h5"), "nowhere")]).values())
    nowhere.h5: no such file; name a file that `hrg` or your laboratory wrote
    """
    return {one.path: _read_heading(one.path) for one in inputs if not one.logs}


def _read_heading(path: Path) -> Recording | HrgError:
    try:
        with store.open_record(path, Recording) as record:
            return record
    except HrgError as error:
        return error


def need_readable(headings: Headings) -> dict[Path, Recording]:
    """The headings of recordings that can all be read, asked before any work is done.

    Parameters
    ----------
    headings
        Of the recordings.

    Returns
    -------
    dict
        The same, without an error among them.

    Raises
    ------
    HrgError
        Some do not open; the sentence is the first one's, and names the others.

    Examples
    --------
    >>> from pathlib import Path
    >>> from hrg_cli import HrgError
    >>> from hrg_cli.gyro import need_readable
    >>> damaged = {Path(f"run-{k}.h5"): HrgError(f"run-{k}.h5: is damaged") for k in (1, 2)}
    >>> try:
    ...     need_readable(damaged)
    ... except HrgError as error:
    ...     print(error)
    run-1.h5: is damaged; nor can these be read: run-2.h5
    """
    bad = {path: found for path, found in headings.items() if isinstance(found, HrgError)}
    if bad:
        _, *others = (path.name for path in bad)
        further = f"; nor can these be read: {name_some(others)}" if others else ""
        raise HrgError(f"{next(iter(bad.values()))}{further}")
    return {path: found for path, found in headings.items() if not isinstance(found, HrgError)}


def find_gyro(headings: Headings) -> str:
    """The gyro that recordings are of; one that cannot be read is left to its step.

    Parameters
    ----------
    headings
        Of the recordings.

    Returns
    -------
    str
        Its identity, empty where none names it.

    Raises
    ------
    HrgError
        They are of several gyros.

    Examples
    --------
    >>> from pathlib import Path
    >>> from types import SimpleNamespace as Heading
    >>> from hrg_cli.gyro import find_gyro
    >>> find_gyro({Path("a.h5"): Heading(gyro_id=""), Path("b.h5"): Heading(gyro_id="SN-17")})
    'SN-17'
    """
    gyros: dict[str, Path] = {}
    for path, found in headings.items():
        if not isinstance(found, HrgError) and found.gyro_id:
            gyros.setdefault(found.gyro_id, path)
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
