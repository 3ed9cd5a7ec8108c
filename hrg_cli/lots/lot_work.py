"""The two units of work of a lot: one recording to its wave, and the waves of one gyro to its results.

Each takes paths and settings, writes its own files atomically and returns a small dictionary; a failure is a result too. What
was done is remembered beside the outputs with a key made of the inputs' content, the settings and the version, so that work
already done is not done again, and anything that changed is.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shlex
import threading
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from .. import __version__, pipeline, store
from ..errors import DiskFullError, HrgError
from ..records import Record

_ONE_AT_A_TIME = threading.Lock()
"""The time stands in the environment, which all threads of a Dask worker share."""


@dataclass(frozen=True)
class RecordingTask:
    """One recording: the file, what it is called in the folder, the settings of import, demodulate and estimate."""

    source: str
    folder: str
    name: str
    gyro_id: str
    epoch: int | None
    settings: Mapping[str, Mapping[str, Any]]
    foreign: bool = False
    lot_id: str = ""
    command: str = "hrg batch"


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


def line(task: RecordingTask | GyroTask, stage: str, inputs: Sequence[Path], output: Path) -> str:
    """The line of `history`: the step as a command of its own, and the command that ran it."""
    return f"hrg {stage} {shlex.join(p.name for p in inputs)} -o {shlex.quote(output.name)} (in: {task.command})"


def work_recording(task: RecordingTask) -> dict[str, Any]:
    """Import (a foreign log), demodulate, estimate: {gyro_id, name, wave, mode, status, reasons, error}."""
    folder = Path(task.folder)
    wave = folder / f"{task.name}.wave.h5"
    told = {"gyro_id": task.gyro_id, "name": task.name, "wave": str(wave)}
    with _stamped(task.epoch), _reporting(told) as result:
        recording = Path(task.source)
        if not recording.is_file():
            raise HrgError(f"{recording}: vanished; the lot's file names it")
        key = _key([task.epoch, task.settings, task.gyro_id, task.lot_id], _logs(task) if task.foreign else [recording])
        done = _remembered(folder / f"{task.name}.json", key, folder)
        if done is not None:
            return told | done
        folder.mkdir(parents=True, exist_ok=True)
        outputs = [folder / f"{task.name}.periods.h5", wave]
        if task.foreign:
            recording = folder / f"{task.name}.recording.h5"
            _import(task, recording)
            outputs.insert(0, recording)
        reasons: list[str] = []
        for stage, source, output in (("demodulate", recording, outputs[-2]), ("estimate", outputs[-2], wave)):
            typed = line(task, stage, [source], output)
            outcome = pipeline.run_stage(stage, [source], output, task.settings[stage], force=True, command_line=typed)
            reasons += [reason for reason in outcome.record.status_reasons if reason not in reasons]
        mode = str(getattr(outcome.record, "mode", "free"))
        result |= {"mode": mode, "status": outcome.record.status, "reasons": reasons, "error": ""}
        _remember(folder / f"{task.name}.json", key, {k: v for k, v in result.items() if k not in told}, outputs)
    return result


def work_gyro(task: GyroTask) -> dict[str, Any]:
    """Identify, calibrate, diagnose and hold against the limits: {gyro_id, status, results: {stage: JSON}, checks, error}."""
    folder = Path(task.folder)
    results: dict[str, Any] = {}
    errors: list[str] = []
    checks: list[dict[str, Any]] = []
    with _stamped(task.epoch):
        for stage in task.stages:
            inputs = {"identify": task.free, "calibrate": task.forced, "diagnose": task.free or task.forced}[stage]
            if not inputs:
                continue
            takes = "identify" in results and "resonator" in pipeline.STAGES[stage].beside
            beside = {"resonator": folder / "resonator.h5"} if takes else {}
            done = _stage(task, stage, [Path(p) for p in inputs], beside)
            if done.get("error"):
                errors.append(f"{stage}: {done['error']}")
                continue
            results[stage] = done["json"]
            checks += done["checks"]
    return {
        "gyro_id": task.gyro_id,
        "results": results,
        "checks": checks,
        "error": "; ".join(errors),
        "status": _worst(results, errors),
    }


def _stage(task: GyroTask, stage: str, inputs: list[Path], beside: Mapping[str, Path]) -> dict[str, Any]:
    """One stage of a gyro, unless it was done before: {json, checks} or {error}."""
    folder = Path(task.folder)
    output = folder / f"{pipeline.STAGES[stage].gives}.h5"
    note = output.with_suffix(".json")
    with _reporting({}) as result:
        content = [task.epoch, stage, task.settings[stage], task.limits]
        key = _key(content, [*inputs, *beside.values()])
        done = _remembered(note, key, folder)
        if done is not None:
            return done
        typed = line(task, stage, [*inputs, *beside.values()], output)
        outcome = pipeline.run_stage(stage, inputs, output, task.settings[stage], beside=beside, force=True, command_line=typed)
        result["json"] = {k: v for k, v in outcome.json.items() if k not in ("elapsed_s", "output")}
        result["checks"] = _checked(outcome.record, task.limits)
        _remember(note, key, result, [output])
    return result


def _import(task: RecordingTask, output: Path) -> None:
    from ..formats import import_log

    values = {**task.settings["import"], "gyro_id": task.gyro_id, "lot_id": task.lot_id}
    logs = _logs(task)
    pipeline.write_first(
        output, import_log(logs[0], **values), values, "import", logs, force=True, command_line=line(task, "import", logs, output)
    )


def _logs(task: RecordingTask) -> list[Path]:
    """The log, and the file of its channel S where it has one of its own."""
    from ..formats import second_file

    source, s_file = Path(task.source), task.settings["import"]["s_file"]
    return [source] if s_file is None else [source, second_file(source, s_file)]


def _checked(record: Record, limits: Mapping[str, Any]) -> list[dict[str, Any]]:
    if record.kind not in limits:
        return []
    from ..limits import check

    return [{"name": row.name, "passed": row.passed, "sentence": row.sentence()} for row in check(record, limits)]


def _worst(results: Mapping[str, Any], errors: list[str]) -> str:
    """The worst status of a gyro's results; "failed" where a stage could not be done or there was nothing to do."""
    if errors or not results:
        return "failed"
    order = ("valid", "suspect", "refused")
    return max((str(r["status"]) for r in results.values()), key=order.index)


@contextlib.contextmanager
def _stamped(epoch: int | None) -> Iterator[None]:
    """A lot's files bear the time that was ordered, where one was, else the true one; one task at a time in a process."""
    if epoch is None:
        yield
        return
    with _ONE_AT_A_TIME:
        before = os.environ.get("SOURCE_DATE_EPOCH")
        os.environ["SOURCE_DATE_EPOCH"] = str(epoch)
        try:
            yield
        finally:
            if before is None:
                os.environ.pop("SOURCE_DATE_EPOCH", None)
            else:
                os.environ["SOURCE_DATE_EPOCH"] = before


@contextlib.contextmanager
def _reporting(told: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    """A result that turns every failure of the work into its `error`."""
    result: dict[str, Any] = dict(told)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # of numpy in steps that are judged by their result
            yield result
    except DiskFullError:  # no verdict on the gyro: the whole lot stops
        raise
    except HrgError as error:
        result |= {"status": "failed", "error": str(error)}
    except Exception as error:
        result |= {"status": "failed", "error": f"internal error: {type(error).__name__}: {str(error)[:200]}"}


def _key(content: Sequence[Any], inputs: Sequence[Path]) -> str:
    """SHA-256 over version, settings, the time the files bear and the content of the inputs."""
    text = json.dumps([__version__, content, [[p.name, store.sha256(p)] for p in inputs]], sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()


def _remembered(note: Path, key: str, folder: Path) -> dict[str, Any] | None:
    """What was noted for this key, if every output is still there, unchanged."""
    try:
        noted = json.loads(note.read_text(encoding="utf-8"))
        whole = noted["key"] == key and all(store.sha256(folder / name) == digest for name, digest in noted["outputs"].items())
        return dict(noted["result"]) if whole else None
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return None


def _remember(note: Path, key: str, result: Mapping[str, Any], outputs: list[Path]) -> None:
    text = json.dumps({"key": key, "outputs": {p.name: store.sha256(p) for p in outputs}, "result": result}, indent=1)
    with store.atomic_path(note, force=True) as temporary:
        temporary.write_text(text + "\n", encoding="utf-8")
