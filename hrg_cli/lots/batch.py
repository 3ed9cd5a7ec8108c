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
import math
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
from ..extras import without_pages
from ..formats import partners
from ..formats.hdf5 import SIGNATURE
from .groups import Origin
from .gyro_page import PAGE
from .identity import Told, grouped, owner_of, told_by
from .lot_diagnosis import lot_diagnosis
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

    A recording or gyro that fails is reported and does not stop the others. Status: refused (a gyro
    did not pass or a recording cannot be read), suspect (a gyro has a fault, an outlier or a suspect
    result), valid. HrgError: a wrong lot file, no recordings, a folder that holds something else
    (unless `force`).
    """
    started = time.monotonic()
    path, folder = Path(path), Path(folder)
    lot = read_lot(path, assignments, over)
    command = _command(path, assignments, over)
    recordings = recordings_of(lot, path.parent)
    _claim(folder, force)
    with _only_writer(folder):
        open_executor = open_executor or executor_for()
        first, failed, origins = _recording_tasks(lot, recordings, folder, command)
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
        found = [_plain(r, folder, path) for r in found]
        told = [_plain(r, folder, path) for r in failed + done]
        rows = judged_rows(lot, told, found)
        whole = lot_diagnosis(found, _measured(rows, found), origins, lot.common_rate)
        for row in rows:
            origin = origins.get(row["gyro_id"], Origin({}))
            row |= {**origin.groups, **({"day": origin.day} if origin.day else {})}
        store.remove_stale(folder, below=True)  # of workers that were killed
        report = _report(lot, rows, told) | whole
        write_table(folder, rows)
        folders = {t.gyro_id: Path(t.folder) for t in first if Path(t.folder).is_dir()}
        pages = {
            gyro: f"{place.name}/{PAGE}"
            for gyro, place in folders.items()
            if (place / PAGE).is_file()
        }
        if not without_pages():
            from ..reporting.lot_page import lot_page

            _write_text(folder / "lot.html", lot_page(report, pages, lot.limits))
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
) -> tuple[list[RecordingTask], list[dict[str, Any]], dict[str, Origin]]:
    """The tasks, the results of recordings that cannot even be opened, and where each gyro's come
    from."""
    tasks: list[RecordingTask] = []
    unread: list[tuple[Path, str]] = []
    told: dict[Path, Told] = {}
    used: set[tuple[str, str]] = set()
    second = partners(
        [file for _, file in recordings], lambda file: lot.table("import", file.name).get("s_file")
    )
    for named, file in recordings:
        if file in second:
            continue
        foreign = _is_foreign(file)
        try:
            if foreign:
                said = Told(str(lot.table("import", file.name).get("gyro_id", "")), "", {})
            else:
                said = told_by(file)
        except HrgError as error:
            unread.append((file, str(error)))
            if named is not None:
                told[file] = Told(named, "", {})
            continue
        gyro = named or said.gyro_id or file.parent.name
        told[file] = Told(gyro, said.day, said.groups)
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
    known = {file: one.gyro_id for file, one in told.items()}
    failed = [_unreadable(file, error, known) for file, error in unread]
    return tasks, failed, _origins(lot, told)


def _unreadable(file: Path, error: str, known: Mapping[Path, str]) -> dict[str, Any]:
    """The result of a recording that cannot be read, with its gyro where that can be told."""
    named = known.get(file)
    gyro, by = (named, "by the lot's file") if named else owner_of(file, known)
    return {
        "gyro_id": gyro,
        "name": file.name,
        "status": "failed",
        "error": f"{error} (of gyro {gyro} {by})" if gyro and not named else error,
        "told_by": by,
        "unreadable": True,
    }


def _origins(lot: LotSettings, told: Mapping[Path, Told]) -> dict[str, Origin]:
    """Every gyro's day, the first of its recordings, and the keys that group it."""
    of: dict[str, list[Told]] = {}
    for one in told.values():
        of.setdefault(one.gyro_id, []).append(one)
    return {
        gyro: Origin(
            grouped(lot.grouped(gyro), ones),
            lot.day_of(gyro) or min((one.day for one in ones if one.day), default=""),
        )
        for gyro, ones in of.items()
    }


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


def _measured(
    rows: Sequence[Mapping[str, Any]], gyros: Sequence[Mapping[str, Any]]
) -> list[dict[str, tuple[float, float]]]:
    """(value, σ) of every figure of these gyros, from the table."""
    of = {row["gyro_id"]: row for row in rows}
    names = [key.removesuffix("_z") for key in (rows[0] if rows else {}) if key.endswith("_z")]
    return [
        {
            name: (row[name], math.nan if row[f"{name}_std"] is None else row[f"{name}_std"])
            for name in names
            if (row := of[gyro["gyro_id"]])[name] is not None
        }
        for gyro in gyros
    ]


MOST_NAMED, MOST_TOLD = 6, 20
"""Gyros that a sentence names; gyros that did not pass of which each has a sentence of its own."""


def _report(
    lot: LotSettings, rows: list[dict[str, Any]], recordings: list[dict[str, Any]]
) -> dict[str, Any]:
    """Refused: a gyro did not pass, or a recording cannot be read; suspect: one has a fault, stands
    off the lot, or has a result in doubt."""
    passed = [row for row in rows if row["passed"]]
    worst = sorted((row for row in rows if not row["passed"]), key=lambda row: row["rank"])
    reasons = [f"{row['gyro_id'] or 'a recording'}: {row['why']}" for row in worst[:MOST_TOLD]]
    if len(worst) > MOST_TOLD:
        reasons.append(f"{len(worst) - MOST_TOLD} more gyros did not pass; lot.csv says why")
    unreadable = [r for r in recordings if r.get("unreadable")]
    doubts = {
        "have a fault": [r for r in passed if r["health"] not in ("", "sound", "not examined")],
        "stand off the lot": [r for r in passed if r["outliers"]],
        "have a suspect result": [r for r in passed if r["status"] == "suspect"],
    }
    for what, ones in doubts.items():
        if ones:
            named = sorted(ones, key=lambda row: row["rank"])[:MOST_NAMED]
            more = f" and {len(ones) - len(named)} more" if len(ones) > len(named) else ""
            reasons.append(
                f"{len(ones)} of {len(rows)} gyros {what}:"
                f" {', '.join(str(row['gyro_id']) for row in named)}{more}"
            )
    refused = worst or unreadable or not rows
    return {
        "kind": "lot",
        "status": "refused" if refused else "suspect" if any(doubts.values()) else "valid",
        "status_reasons": reasons,
        "lot_id": lot.lot_id,
        "gyros": len(rows),
        "passed": len(passed),
        "recordings": len(recordings),
        "recordings_failed": sum(r["status"] == "failed" for r in recordings),
        "unreadable": [
            {key: r[key] for key in ("name", "gyro_id", "told_by", "error")} for r in unreadable
        ],
        "outliers": [row["gyro_id"] for row in rows if row["outliers"]],
        "outlier_rate": None if lot.outlier_z is not None else lot.outlier_rate,
        "worst": [row["gyro_id"] for row in sorted(rows, key=lambda row: row["rank"])[:3]],
        "rows": rows,
    }


def _write_text(path: Path, text: str) -> None:
    with store.atomic_path(path, force=True) as temporary:
        temporary.write_text(text, encoding="utf-8")
