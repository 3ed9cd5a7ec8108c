"""The two units of work of a lot: one recording to its wave, and the waves of one gyro to its
results.

Each takes paths and settings, writes its own files atomically and returns a small dictionary; a
failure is a result too. What was done is remembered beside the outputs with a key made of the
inputs' content, the settings and the version, so that work already done is not done again, and
anything that changed is.
"""

from __future__ import annotations

import contextlib
import shlex
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from .. import chain, store
from ..errors import NO_MEMORY, DiskFullError, HrgError, is_no_memory
from ..extras import PlainPythonWarning
from .gyro_page import answer_gyro

TABLED = (
    *("status", "status_reasons", "chi2_per_dof", "parameters", "values", "verdict", "effects"),
    *("scores", "drift_rms_rad_s", "scale_factor_rms_ppm", "scale_factor"),
)
"""What the lot's table and the causes in common are made of; the rest of a result stays in its
file, so that a lot of thousands fits in memory."""


@dataclass(frozen=True)
class RecordingTask:
    """One recording: the file, what it is called in the folder, the settings of import, demodulate
    and estimate."""

    source: str
    folder: str
    name: str
    gyro_id: str
    epoch: int | None
    settings: Mapping[str, Mapping[str, Any]]
    foreign: bool = False
    lot_id: str = ""
    command: str = "hrg batch"

    @property
    def title(self) -> str:
        """What it is called where tasks are watched."""
        return f"{self.gyro_id}: {self.name}"


@dataclass(frozen=True)
class GyroTask:
    """One gyro: its waves by mode, the stages to run and their settings, the limits."""

    gyro_id: str
    folder: str
    free: tuple[str, ...]
    forced: tuple[str, ...]
    epoch: int | None
    stages: tuple[str, ...]
    settings: Mapping[str, Mapping[str, Any]]
    limits: Mapping[str, Any] = field(default_factory=dict)
    command: str = "hrg batch"

    @property
    def title(self) -> str:
        """What it is called where tasks are watched."""
        return f"{self.gyro_id}: {', '.join(self.stages)}"


Task = RecordingTask | GyroTask


def work(task: Task) -> dict[str, Any]:
    """Do a task of either kind; what came of it.

    Parameters
    ----------
    task
        Of a recording: import (a foreign log), demodulate, estimate. Of a gyro: identify,
        calibrate, diagnose, and hold against the limits.

    Returns
    -------
    dict
        Of a recording `wave`, `mode`, `status`, `reasons`, `error`; of a gyro `results` (`TABLED`
        of each stage's JSON), `checks`, `answer`, `undiagnosed`, `status`, `error`. Every failure
        but that of a full disk is an `error`.

    Examples
    --------
    >>> from hrg_cli.lots.lot_work import RecordingTask, work
    >>> gone = work(RecordingTask("nowhere/a.h5", "lot/SN-1", "a", "SN-1", None, {}))
    >>> gone["status"], gone["error"]
    ('failed', "nowhere/a.h5: vanished; the lot's file names it")
    """
    return _work_gyro(task) if isinstance(task, GyroTask) else _work_recording(task)


def _write_history_line(task: Task, stage: str, inputs: Sequence[Path], output: Path) -> str:
    """The line of `history`: the step as a command of its own, and the command that ran it."""
    return (
        f"hrg {stage} {shlex.join(p.name for p in inputs)} -o {shlex.quote(output.name)} (in:"
        f" {task.command})"
    )


def _work_recording(task: RecordingTask) -> dict[str, Any]:
    """Import (a foreign log), demodulate, estimate: {gyro_id, name, wave, mode, status, reasons,
    error}."""
    folder = Path(task.folder)
    told = {
        "gyro_id": task.gyro_id,
        "name": task.name,
        "wave": str(folder / f"{task.name}.wave.h5"),
    }
    with store.order_time(task.epoch), _reporting(told) as result:
        if not Path(task.source).is_file():
            raise HrgError(f"{task.source}: vanished; the lot's file names it")
        folder.mkdir(parents=True, exist_ok=True)
        settings = {**task.settings}
        if task.foreign:
            settings["import"] = {
                **settings["import"],
                "gyro_id": task.gyro_id,
                "lot_id": task.lot_id,
            }
        work = chain.Work(
            folder, settings, same_if=[task.epoch], command_line=partial(_write_history_line, task)
        )
        logs = _logs(task) if task.foreign else []
        steps = list(
            chain.recording_to_wave(
                work, Path(task.source), task.name, logs, [task.gyro_id, task.lot_id]
            )
        )
        if steps[-1].status == "failed":
            raise HrgError(steps[-1].reasons[0])
        reasons = list(dict.fromkeys(reason for step in steps for reason in step.reasons))
        result |= {
            "mode": str(steps[-1].json["mode"]),
            "status": steps[-1].status,
            "reasons": reasons,
            "error": "",
        }
    return result


def _work_gyro(task: GyroTask) -> dict[str, Any]:
    """Identify, calibrate, diagnose and hold against the limits: {gyro_id, status, results: {stage:
    `TABLED` of its JSON}, checks, answer, undiagnosed, error}."""
    results: dict[str, Any] = {}
    errors: list[str] = []
    checks: list[dict[str, Any]] = []
    made: list[str] = []
    steps: list[chain.Step] = []
    with store.order_time(task.epoch), _reporting({}) as failed:
        work = chain.Work(
            Path(task.folder),
            task.settings,
            task.limits,
            [task.epoch],
            command_line=partial(_write_history_line, task),
        )
        for step in chain.waves_to_results(
            work, [Path(p) for p in task.free], [Path(p) for p in task.forced], task.stages
        ):
            steps.append(step)
            if step.status == "failed":
                errors.append(f"{step.name}: {step.reasons[0]}")
                continue
            results[step.name] = {key: step.json[key] for key in TABLED if key in step.json}
            made.append(step.output)
            checks += [{**check, "stage": step.name} for check in step.checks]
    errors += [failed["error"]] if failed.get("error") else []
    answer: dict[str, Any] = {}
    with store.order_time(task.epoch), _reporting({}) as failed:
        answer = answer_gyro([Path(task.folder) / name for name in made], task.limits, task.epoch)
    errors += [f"page: {failed['error']}"] if failed.get("error") else []
    return {
        "gyro_id": task.gyro_id,
        "results": results,
        "checks": checks,
        "answer": answer,
        "undiagnosed": chain.list_undiagnosed(steps),
        "error": "; ".join(errors),
        "status": _worst(results, errors),
    }


def _logs(task: RecordingTask) -> list[Path]:
    """The log, and the file of its channel S where it has one of its own."""
    from ..formats import find_second_file

    source, s_file = Path(task.source), task.settings["import"]["s_file"]
    return [source] if s_file is None else [source, find_second_file(source, s_file)]


def _worst(results: Mapping[str, Any], errors: list[str]) -> str:
    """The worst status of a gyro's results; "failed" where a stage could not be done or there was
    nothing to do."""
    if errors or not results:
        return "failed"
    order = ("valid", "suspect", "refused")
    return max((str(r["status"]) for r in results.values()), key=order.index)


@contextlib.contextmanager
def _reporting(told: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """A result that turns every failure of the work into its `error`."""
    result: dict[str, Any] = dict(told)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter(
                "ignore", RuntimeWarning
            )  # of numpy in steps that are judged by their result
            warnings.simplefilter("ignore", PlainPythonWarning)  # said by who shares the work
            yield result
    except DiskFullError:  # no verdict on the gyro: the whole lot stops
        raise
    except HrgError as error:
        result |= {"status": "failed", "error": str(error)}
    except Exception as error:
        said = f"internal error: {type(error).__name__}: {str(error)[:200]}"
        result |= {"status": "failed", "error": NO_MEMORY if is_no_memory(error) else said}
