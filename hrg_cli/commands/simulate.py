"""`hrg simulate`: one recording file a run of a simulation file."""

from __future__ import annotations

import shutil
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from .. import pipeline, settings, store
from ..effects import load_effects
from ..errors import HrgError
from ..executors import run_tasks, start_processes
from ..extras import warn_of_plain_python
from ..records import Recording
from ..reporting import console
from ..stages.simulate import compute_size_bytes, simulate, summarise
from ..stages.simulation_file import SimulationFile, list_runs
from .common import Common
from .frame import EffectsFrom, make_command, need_inputs, read_command_line
from .options import make_flags


@make_command(
    "simulate",
    "hrg simulate configs/free_run_downs.toml -o run.h5",
    flags=make_flags(simulate, "model", "run"),
)
def main(
    run: Common,
    /,
    config_file: Annotated[
        Path | None, typer.Argument(metavar="CONFIG.toml", show_default=False)
    ] = None,
    effects_from: EffectsFrom = None,
    **flags: Any,
) -> None:
    """Simulate recordings of a gyro described in TOML; several [[run]] tables give OUTPUT-RUN.h5
    each."""
    started = time.monotonic()
    file = need_inputs([config_file] if config_file else [], "a simulation file (TOML)")[0]
    with console.show_progress("simulate", run.quiet or run.json) as progress:
        report = _simulate_files(file, run, flags, effects_from, progress)
    run.finish({**report, "elapsed_s": round(time.monotonic() - started, 3)})


STAGE_SETTINGS = ("model", "run", "block_samples", "seed")


def _simulate_files(
    file: Path,
    run: Common,
    flags: Mapping[str, Any],
    effects_from: Path | None,
    progress: pipeline.Progress,
) -> dict[str, Any]:
    """Simulate every run of `file` (or one) into files; the command's JSON."""
    config = settings.load_toml(file)
    for_stage = tuple(
        text
        for text in run.assignments
        if text.partition("=")[0].removeprefix("simulate.") in STAGE_SETTINGS
    )
    for text in run.assignments:
        if text not in for_stage:
            settings.assign(config, *settings.parse_assignment(text))
    values = settings.resolve(simulate, run.config, for_stage, {**flags, "seed": run.seed})
    runs = {each.run_id: each for each in list_runs(config, str(file))}
    if run.show_config:
        run.leave_with_settings({"simulate": values, "runs": runs})
    names = list(runs) if values["run"] is None else [values["run"]]
    output = run.need_output("recording.h5")
    outputs = (
        [output]
        if len(names) == 1
        else [output.with_name(f"{output.stem}-{name}{output.suffix or '.h5'}") for name in names]
    )
    for path in outputs:
        store.check_output(path, run.force)
    _need_room([runs[name] for name in names if name in runs], file, output.parent)
    typed = read_command_line()
    tasks = [
        Task(config, file, effects_from, {**values, "run": name}, path, run.force, typed)
        for name, path in zip(names, outputs)
    ]
    with store.keep_whole_or_none(outputs):
        reports = _simulate_all(tasks, run.jobs, progress)
    statuses = [report["status"] for report in reports]
    return {
        "kind": "recording",
        "status": max(statuses, key=["valid", "suspect", "refused"].index),
        "status_reasons": [reason for report in reports for reason in report["status_reasons"]],
        "output": str(
            output
            if len(names) == 1
            else output.parent / f"{output.stem}-*{output.suffix or '.h5'}"
        ),
        "outputs": [str(path) for path in outputs],
        "runs": reports,
    }


def _need_room(runs: Sequence[SimulationFile], file: Path, folder: Path) -> None:
    """HrgError: the disk has no room for what the runs would hold."""
    need, free = sum(map(compute_size_bytes, runs)), shutil.disk_usage(folder).free
    if need > free:
        raise HrgError(
            f"{file}: would give {need / 1e9:.3g} GB of samples, {folder} has {free / 1e9:.3g} GB"
            " free; shorten recording.duration_s, lower recording.sample_rate_hz or choose another"
            " --output"
        )


def _simulate_all(
    tasks: Sequence[Task], jobs: int, progress: pipeline.Progress
) -> list[dict[str, Any]]:
    if len(tasks) == 1:
        return [_simulate_one(tasks[0], progress)]
    if tasks[0].values["model"] == "fast":  # the processes leave it to this one
        warn_of_plain_python()
    made = run_tasks(
        _simulate_apart,
        tasks,
        partial(start_processes, jobs),
        lambda count: progress(count / len(tasks)),
        _take_over,
    )
    return [_require_report(one, task) for one, task in zip(made, tasks, strict=True)]


Made = tuple[dict[str, Any], Any]
"""A run's report, and what the file is known by that another process has written."""


def _simulate_apart(task: Task) -> Made:
    return _simulate_one(task), store.find_own(task.output)


def _take_over(task: Task, made: Made | None) -> tuple[()]:
    """Take a worker's output for the program's own, which goes where another run fails."""
    if made is not None:
        store.note_own(task.output, made[1])
    return ()


def _require_report(made: Made | None, task: Task) -> dict[str, Any]:
    if made is None:
        raise HrgError(
            f"{task.output}: the process that simulated it was killed, probably for want of memory;"
            " simulate with fewer --jobs"
        )
    return made[0]


@dataclass(frozen=True)
class Task:
    """One run to simulate into one file."""

    config: Mapping[str, Any]
    file: Path
    effects_from: Path | None
    values: Mapping[str, Any]
    output: Path
    force: bool
    typed: str


def _simulate_one(task: Task, progress: pipeline.Progress | None = None) -> dict[str, Any]:
    extra = load_effects(task.effects_from) if task.effects_from is not None else ()
    stream = simulate(task.config, extra, **task.values)
    chosen = next(
        each for each in list_runs(task.config) if task.values["run"] in (None, each.run_id)
    )
    if progress is not None:
        stream = _timed(
            stream, chosen.recording.duration_s * chosen.recording.sample_rate_hz, progress
        )
    sources = [task.file] if task.effects_from is None else [task.file, task.effects_from]
    whole = {**task.values, "file": chosen}
    record = pipeline.write_first(
        task.output, stream, whole, "simulate", sources, force=task.force, command_line=task.typed
    )
    return {
        "output": str(task.output),
        "status": record.status,
        "status_reasons": list(record.status_reasons),
        **summarise(record),
    }


def _timed(
    stream: Iterator[Recording], samples: float, progress: pipeline.Progress
) -> Iterator[Recording]:
    done = 0
    for block in stream:
        yield block
        done += len(block)
        progress(min(1.0, done / samples))
