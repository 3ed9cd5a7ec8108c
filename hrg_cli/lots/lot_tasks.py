"""The tasks of a lot: every recording to its wave, and the waves of one gyro to its results.

Whose a recording is, its attributes alone tell; what else is wrong with it, the work on it finds.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from ..errors import HrgError
from ..formats import find_partners
from .groups import Origin
from .identity import Told, find_owner, group_keys, is_readable, read_gyro_id
from .lot_settings import PER_GYRO, PER_RECORDING, LotSettings
from .lot_work import GyroTask, RecordingTask

BY_LOT = "by the lot's file"
JUDGED = ("resonator", "calibration", "diagnosis")
"""Kinds of the results that a gyro passes or fails by."""
VALID = {"status": "valid"}
"""What is wanted of a kind for which the lot's file gives no limits, as where it gives no
status."""


@dataclass(frozen=True)
class LotTasks:
    """The recordings of a lot, those of one gyro side by side; what tells their gyro, by file; the
    results of recordings that cannot be opened; where each gyro's come from."""

    recordings: Sequence[RecordingTask]
    told_by: Mapping[str, str]
    unreadable: Sequence[dict[str, Any]]
    origins: Mapping[str, Origin]

    def examine(self, task: RecordingTask, result: dict[str, Any]) -> dict[str, Any]:
        """The result of a recording; of one that failed also whether it could be read at all."""
        if result["status"] != "failed" or task.foreign or is_readable(Path(task.source)):
            return result
        by = self.told_by[task.source]
        return _unreadable(Path(task.source), result["error"], task.gyro_id, by)


def list_tasks(
    lot: LotSettings, recordings: Sequence[tuple[str | None, Path]], folder: Path, command: str
) -> LotTasks:
    """The tasks of a lot's recordings, and what is known of their gyros before any work.

    Parameters
    ----------
    lot
        Its settings.
    recordings
        The gyro that the lot's file names, or None, and the file of each.
    folder
        Of the lot.
    command
        As histories keep it.

    Returns
    -------
    LotTasks
        A task for each recording that can be opened, but for the file of a channel S that belongs
        to another one's C.

    Examples
    --------
    A laboratory's log is of the gyro that its folder is named by:

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from hrg_cli.lots.lot_settings import LotSettings
    >>> from hrg_cli.lots.lot_tasks import list_tasks
    >>> with TemporaryDirectory() as name:
    ...     log = Path(name) / "SN-1" / "run 1.csv"
    ...     log.parent.mkdir()
    ...     _ = log.write_text("c,s")
    ...     (task,) = list_tasks(LotSettings(), [(None, log)], Path(name), "hrg batch").recordings
    >>> task.gyro_id, task.foreign, list(task.settings)
    ('SN-1', True, ['import', 'demodulate', 'estimate'])
    """
    tasks: list[RecordingTask] = []
    unread: list[tuple[str | None, Path, str]] = []
    told: dict[Path, Told] = {}
    by: dict[str, str] = {}
    used: set[tuple[str, str]] = set()
    epoch = _read_epoch(lot)
    second = find_partners(
        [file for _, file in recordings],
        lambda file: lot.merge_given("import", file.name).get("s_file"),
    )
    for named, file in recordings:
        if file in second:
            continue
        try:
            own = read_gyro_id(file)
        except HrgError as error:
            unread.append((named, file, str(error)))
            if named is not None:
                told[file] = Told(named, "", {})
            continue
        foreign = own is None
        said = own or Told(str(lot.merge_given("import", file.name).get("gyro_id", "")), "", {})
        gyro = named or said.gyro_id or file.parent.name
        told[file] = Told(gyro, said.day, said.groups)
        by[str(file)] = BY_LOT if named else _tell_origin(said)
        name = make_safe_name(file.stem)
        if (gyro, name) in used:
            name = f"{name}-{hashlib.sha256(str(file).encode()).hexdigest()[:8]}"
        used.add((gyro, name))
        stages = (*(["import"] if foreign else []), *PER_RECORDING)
        values = {stage: lot.check_settings(stage, file.name) for stage in stages}
        place = str(folder.absolute() / make_safe_name(gyro))
        tasks.append(
            RecordingTask(str(file), place, name, gyro, epoch, values, foreign, lot.lot_id, command)
        )
    known = {file: one.gyro_id for file, one in told.items()}
    lost = [
        _unreadable(file, error, *((named, BY_LOT) if named else find_owner(file, known)))
        for named, file, error in unread
    ]
    tasks.sort(key=lambda task: (task.gyro_id, task.folder))
    return LotTasks(tasks, by, lost, _origins(lot, told))


def _tell_origin(said: Told) -> str:
    return "its gyro_id can still be read" if said.gyro_id else "by its folder's name"


def make_gyro_task(
    lot: LotSettings, one: RecordingTask, results: Sequence[Mapping[str, Any]]
) -> GyroTask:
    """The task of a gyro, when all its recordings are done.

    Parameters
    ----------
    lot
        Its settings.
    one
        Any of its recordings' tasks.
    results
        What came of all.

    Returns
    -------
    GyroTask
        Of the waves of those that did not fail, by mode.

    Examples
    --------
    >>> from hrg_cli.lots.lot_settings import LotSettings
    >>> from hrg_cli.lots.lot_tasks import make_gyro_task
    >>> from hrg_cli.lots.lot_work import RecordingTask
    >>> one = RecordingTask("a.h5", "lot/SN-1", "a", "SN-1", None, {})
    >>> done = {"status": "valid", "mode": "free", "wave": "lot/SN-1/a.wave.h5"}
    >>> task = make_gyro_task(LotSettings(), one, [done])
    >>> task.free, task.forced, task.stages
    (('lot/SN-1/a.wave.h5',), (), ('identify', 'calibrate'))
    """
    waves: dict[str, list[str]] = {"free": [], "forced": []}
    for result in results:
        if result["status"] != "failed":
            waves[result["mode"]].append(result["wave"])
    stages: tuple[str, ...] = tuple(stage for stage in PER_GYRO if stage in lot.stages)
    return GyroTask(
        one.gyro_id,
        one.folder,
        tuple(sorted(waves["free"])),
        tuple(sorted(waves["forced"])),
        one.epoch,
        stages,
        {stage: lot.check_settings(stage) for stage in stages},
        dict.fromkeys(JUDGED, VALID) | lot.limits,
        one.command,
    )


def _unreadable(file: Path, error: str, gyro: str, by: str) -> dict[str, Any]:
    """The result of a recording that cannot be read, with its gyro where that can be told."""
    return {
        "gyro_id": gyro,
        "name": file.name,
        "status": "failed",
        "error": f"{error} (of gyro {gyro} {by})" if gyro and by != BY_LOT else error,
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
            group_keys(lot.find_groups(gyro), ones),
            lot.find_day(gyro) or min((one.day for one in ones if one.day), default=""),
        )
        for gyro, ones in of.items()
    }


def _read_epoch(lot: LotSettings) -> int | None:
    """The time that all files of the lot bear, s since 1970, where the lot or SOURCE_DATE_EPOCH
    orders one; None: the true one."""
    if lot.created:
        return int(datetime.fromisoformat(lot.created.replace("Z", "+00:00")).timestamp())
    fixed = os.environ.get("SOURCE_DATE_EPOCH")
    return int(float(fixed)) if fixed else None


def make_safe_name(text: str) -> str:
    """A file name that stays in its folder whatever a text says.

    Parameters
    ----------
    text
        A gyro's name, which a file may have brought.

    Returns
    -------
    str
        Texts that had to be changed stay distinct.

    Examples
    --------
    >>> from hrg_cli.lots.lot_tasks import make_safe_name
    >>> make_safe_name("SN-1"), make_safe_name("../etc")[:4], "/" in make_safe_name("../etc")
    ('SN-1', '_etc', False)
    """
    plain = re.sub(r"[^A-Za-z0-9_+.-]", "_", text).lstrip(".")[:60]
    return (
        plain
        if plain == text and plain
        else f"{plain or 'gyro'}-{hashlib.sha256(text.encode()).hexdigest()[:8]}"
    )
