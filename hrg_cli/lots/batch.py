"""run_lot: the whole chain for every gyro of a lot, shared among processes or a cluster, resumable,
one table at the end.

The folder: one folder a gyro with its periods, waves, resonator, calibration; `lot.csv` (and
`lot.parquet` with pyarrow), `lot.html`, `lot.json`. The same lot gives the same results whatever
the number of workers and however often it was interrupted; files differ in the stamp alone
(`created`, the time in `history`, and the hashes of sources that bear one), and not even in that
where the lot orders a time.
"""

from __future__ import annotations

import contextlib
import fcntl
import hashlib
import json
import os
import re
import shlex
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any

from .. import settings, store
from ..errors import DiskFullError, HrgError, InterruptedRunError
from ..executors import OpenExecutor, dask_workers, local_processes, run_tasks
from ..formats import partners
from ..formats.hdf5 import SIGNATURE
from ..records import Recording
from .lot_settings import PER_RECORDING, LotSettings, read_lot, recordings_of
from .lot_table import judged_rows, write_table
from .lot_work import GyroTask, RecordingTask, work_gyro, work_recording

MARK = "lot.json"
Progress = Callable[[float | None], None]


def executor_for(jobs: int = 1, dask: bool = False, scheduler: str | None = None) -> OpenExecutor:
    """The executor a command line asks for: local processes, Dask workers started here, or those of
    a running scheduler."""
    if scheduler is not None or dask:
        return partial(dask_workers, scheduler, jobs)
    return partial(local_processes, jobs)


def run_lot(
    path: Path | str,
    folder: Path | str,
    *,
    open_executor: OpenExecutor | None = None,
    force: bool = False,
    assignments: tuple[str, ...] = (),
    over: dict[str, Any] | None = None,
    progress: Progress = lambda share: None,
) -> dict[str, Any]:
    """Run the lot of a TOML file into a folder; the report as JSON. What is done already,
    unchanged, is not done again.

    A recording or gyro that fails is reported and does not stop the others. Status: valid (every
    gyro passed), suspect (some did not), refused (none did). HrgError: a wrong lot file, no
    recordings, a folder that holds something else (unless `force`).
    """
    from ..reporting.lot_page import lot_page

    started = time.monotonic()
    path, folder = Path(path), Path(folder)
    lot = read_lot(path, assignments, over)
    command = _command(path, assignments, over)
    recordings = recordings_of(lot, path.parent)
    _claim(folder, force)
    with _only_writer(folder):
        open_executor = open_executor or executor_for()
        first, failed = _recording_tasks(lot, recordings, folder, command)
        count_of = _Count(len(first), len({task.folder for task in first}), progress)
        with _saying_how_far(folder, count_of):
            waves = run_tasks(work_recording, first, open_executor, count_of.recordings_done)
            done = [result or _killed(task) for task, result in zip(first, waves)]
            second = _gyro_tasks(lot, first, done, command)
            results = run_tasks(work_gyro, second, open_executor, count_of.gyros_done)
        found = [
            result or {"gyro_id": task.gyro_id, "status": "failed", "error": KILLED}
            for task, result in zip(second, results)
        ]
        rows = judged_rows(
            lot,
            [_plain(r, folder, path) for r in failed + done],
            [_plain(r, folder, path) for r in found],
        )
        store.remove_stale(folder, below=True)  # of workers that were killed
        report = _report(lot, rows, failed + done)
        write_table(folder, rows)
        _write_text(
            folder / "lot.html",
            lot_page(
                report, {t.gyro_id: Path(t.folder).name for t in first if Path(t.folder).is_dir()}
            ),
        )
        _write_text(
            folder / MARK, json.dumps(report, indent=1, sort_keys=True, ensure_ascii=False) + "\n"
        )
    return report | {"output": str(folder), "elapsed_s": round(time.monotonic() - started, 3)}


KILLED = "its process was killed, even alone; it needs more memory than there is, or crashes"


class _Count:
    """How far a lot has come."""

    def __init__(self, recordings: int, gyros: int, progress: Progress) -> None:
        self.recordings, self.gyros, self._progress = recordings, gyros, progress
        self.waves = self.done = 0

    def recordings_done(self, count: int) -> None:
        self.waves = count
        self._tell()

    def gyros_done(self, count: int) -> None:
        self.done = count
        self._tell()

    def _tell(self) -> None:
        self._progress((self.waves + self.done) / (self.recordings + self.gyros))

    def sentence(self) -> str:
        return (
            f"{self.done} of {self.gyros} gyros and {self.waves} of {self.recordings} recordings"
            " done; the same command goes on"
        )


@contextlib.contextmanager
def _saying_how_far(folder: Path, count: _Count) -> Iterator[None]:
    """An interrupted lot says how far it came and cleans up after its workers; so does one whose
    disk is full."""
    try:
        yield
    except KeyboardInterrupt:
        raise InterruptedRunError(f"{folder}: interrupted: {count.sentence()}") from None
    except DiskFullError as error:
        raise DiskFullError(f"{error}; {count.sentence()}") from error
    finally:
        store.remove_stale(folder, below=True)


def _command(path: Path, assignments: Sequence[str], over: Mapping[str, Any] | None) -> str:
    """The command as histories keep it: what it was told, not where or by how many processes it was
    done."""
    words = ["hrg", "batch", path.name, *(word for text in assignments for word in ("--set", text))]
    added = f", settings over it {settings.to_toml({'batch': over}).strip()!r}" if over else ""
    return f"{shlex.join(words)}; {path.name} has SHA-256 {store.sha256(path)}{added}"


def _killed(task: RecordingTask) -> dict[str, Any]:
    return {"gyro_id": task.gyro_id, "name": task.name, "status": "failed", "error": KILLED}


def _claim(folder: Path, force: bool) -> None:
    """The folder is new, empty, or that of a lot."""
    if folder.exists() and not folder.is_dir():
        raise HrgError(f"{folder}: is a file; name a folder for the lot")
    if not folder.exists():
        if not folder.absolute().parent.is_dir():
            raise HrgError(f"{folder}: the folder {folder.parent} does not exist; make it first")
        try:
            folder.mkdir()
        except OSError as error:
            raise HrgError(
                f"{folder}: cannot be made ({error.strerror}); choose another --output"
            ) from error
    elif not force and any(folder.iterdir()) and not (folder / MARK).exists():
        raise HrgError(
            f"{folder}: holds files that are not of a lot; name an empty folder or give --force"
        )
    store.check_output(folder / MARK, force=True)
    if not (folder / MARK).exists():
        _write_text(folder / MARK, '{"kind": "lot", "status": "unfinished"}\n')


@contextlib.contextmanager
def _only_writer(folder: Path) -> Iterator[None]:
    """No two programs work on one lot at a time."""
    handle = os.open(folder, os.O_RDONLY)
    try:
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise HrgError(
                f"{folder}: another program works on this lot; wait until it has ended"
            ) from error
        yield
    finally:
        os.close(handle)


def _epoch(lot: LotSettings) -> int | None:
    """The time that all files of the lot bear, s since 1970, where the lot or SOURCE_DATE_EPOCH
    orders one; None: the true one."""
    if lot.created:
        return int(datetime.fromisoformat(lot.created.replace("Z", "+00:00")).timestamp())
    fixed = os.environ.get("SOURCE_DATE_EPOCH")
    return int(float(fixed)) if fixed else None


def safe_name(text: str) -> str:
    """A file name that stays in its folder whatever the text; texts that had to be changed stay
    distinct."""
    plain = re.sub(r"[^A-Za-z0-9_+.-]", "_", text).lstrip(".")[:60]
    return (
        plain
        if plain == text and plain
        else f"{plain or 'gyro'}-{hashlib.sha256(text.encode()).hexdigest()[:8]}"
    )


def _recording_tasks(
    lot: LotSettings, recordings: list[tuple[str | None, Path]], folder: Path, command: str
) -> tuple[list[RecordingTask], list[dict[str, Any]]]:
    """The tasks, and the results of recordings that cannot even be opened."""
    tasks: list[RecordingTask] = []
    failed: list[dict[str, Any]] = []
    used: set[tuple[str, str]] = set()
    second = partners(
        [file for _, file in recordings], lambda file: lot.table("import", file.name).get("s_file")
    )
    for named, file in recordings:
        if file in second:
            continue
        foreign = _is_foreign(file)
        try:
            gyro = (
                named
                or (
                    str(lot.table("import", file.name).get("gyro_id", ""))
                    if foreign
                    else _gyro_of(file)
                )
                or file.parent.name
            )
        except HrgError as error:
            failed.append(
                {"gyro_id": named or "", "name": file.name, "status": "failed", "error": str(error)}
            )
            continue
        name = safe_name(file.stem)
        if (gyro, name) in used:
            name = f"{name}-{hashlib.sha256(str(file).encode()).hexdigest()[:8]}"
        used.add((gyro, name))
        stages = (*(["import"] if foreign else []), *PER_RECORDING)
        values = {stage: lot.values(stage, file.name) for stage in stages}
        target = folder.absolute() / safe_name(gyro)
        tasks.append(
            RecordingTask(
                str(file),
                str(target),
                name,
                gyro,
                _epoch(lot),
                values,
                foreign,
                lot.lot_id,
                command,
            )
        )
    return tasks, failed


def _is_foreign(file: Path) -> bool:
    """Whether a file is a laboratory's log rather than an hrg file."""
    try:
        with open(file, "rb") as opened:
            if opened.read(8) != SIGNATURE:
                return True
        store.kind_of(file)
        return False
    except HrgError as error:
        return "is HDF5 but not an hrg file" in str(error)
    except OSError:
        return False


def _gyro_of(file: Path) -> str:
    with store.open_record(file, Recording) as recording:
        return recording.gyro_id


def _gyro_tasks(
    lot: LotSettings, tasks: list[RecordingTask], done: list[dict[str, Any]], command: str
) -> list[GyroTask]:
    """One task a gyro, in the order of the gyros' names."""
    waves: dict[tuple[str, str], dict[str, list[str]]] = {}
    for task, result in zip(tasks, done):
        by_mode = waves.setdefault((task.gyro_id, task.folder), {"free": [], "forced": []})
        if result["status"] != "failed":
            by_mode[result["mode"]].append(result["wave"])
    stages: tuple[str, ...] = tuple(
        stage for stage in ("identify", "calibrate", "diagnose") if stage in lot.stages
    )
    values = {stage: lot.values(stage) for stage in stages}
    return [
        GyroTask(
            gyro,
            folder,
            tuple(sorted(m["free"])),
            tuple(sorted(m["forced"])),
            _epoch(lot),
            stages,
            values,
            lot.limits,
            command,
        )
        for (gyro, folder), m in sorted(waves.items())
    ]


def _plain(result: Mapping[str, Any], folder: Path, lot_file: Path) -> dict[str, Any]:
    """A result whose sentences name files relative to the lot, so that the table does not depend on
    where it lies."""

    def strip(value: Any) -> Any:
        if isinstance(value, str):
            for root in (folder.absolute(), folder, lot_file.parent.absolute(), lot_file.parent):
                value = value.replace(f"{root}/", "") if str(root) != "." else value
            return value
        if isinstance(value, Mapping):
            return {key: strip(inner) for key, inner in value.items()}
        return [strip(inner) for inner in value] if isinstance(value, list) else value

    return {key: strip(value) for key, value in result.items()}


def _report(
    lot: LotSettings, rows: list[dict[str, Any]], recordings: list[dict[str, Any]]
) -> dict[str, Any]:
    passed = [row for row in rows if row["passed"]]
    reasons = [
        f"{row['gyro_id'] or 'a recording'}: {row['why']}" for row in rows if not row["passed"]
    ]
    return {
        "kind": "lot",
        "status": "valid" if len(passed) == len(rows) else "suspect" if passed else "refused",
        "status_reasons": reasons,
        "lot_id": lot.lot_id,
        "gyros": len(rows),
        "passed": len(passed),
        "recordings": len(recordings),
        "recordings_failed": sum(r["status"] == "failed" for r in recordings),
        "outliers": [row["gyro_id"] for row in rows if row["outliers"]],
        "rows": rows,
    }


def _write_text(path: Path, text: str) -> None:
    with store.atomic_path(path, force=True) as temporary:
        temporary.write_text(text, encoding="utf-8")
