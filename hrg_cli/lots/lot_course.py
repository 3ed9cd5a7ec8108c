"""How far a lot has come: when all recordings of a gyro are done its own task follows, whatever the
other gyros are at."""

from __future__ import annotations

import contextlib
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

from .. import store
from ..errors import DiskFullError, InterruptedRunError
from .lot_settings import LotSettings
from .lot_tasks import LotTasks, make_gyro_task
from .lot_work import GyroTask, RecordingTask, Task

Progress = Callable[[float | None], None]
KILLED = "its process was killed, even alone; it needs more memory than there is, or crashes"


class LotCourse:
    """What came of the recordings and gyros of a lot so far."""

    def __init__(self, lot: LotSettings, tasks: LotTasks, progress: Progress) -> None:
        self._lot, self._tasks, self._progress = lot, tasks, progress
        self._of_gyro: dict[str, list[RecordingTask]] = defaultdict(list)
        for task in tasks.recordings:
            self._of_gyro[task.gyro_id].append(task)
        self._recordings: dict[tuple[str, str], dict[str, Any]] = {}
        self._gyros: dict[str, dict[str, Any]] = {}

    def take_result(self, task: Task, result: dict[str, Any] | None) -> Sequence[Task]:
        """Note what came of a task (None: its process was killed); a gyro's, where that was the
        last of its recordings."""
        following: list[Task] = []
        killed = {"gyro_id": task.gyro_id, "status": "failed", "error": KILLED}
        if isinstance(task, GyroTask):
            self._gyros[task.gyro_id] = result or killed
        else:
            told = self._tasks.examine(task, result or killed | {"name": task.name})
            self._recordings[task.gyro_id, task.name] = told
            own = self._of_gyro[task.gyro_id]
            if all((one.gyro_id, one.name) in self._recordings for one in own):
                done = [self._recordings[one.gyro_id, one.name] for one in own]
                following = [make_gyro_task(self._lot, own[0], done)]
        self._progress(
            (len(self._recordings) + len(self._gyros))
            / (len(self._tasks.recordings) + len(self._of_gyro))
        )
        return following

    @property
    def recordings(self) -> list[dict[str, Any]]:
        """The results of all recordings, first those that cannot be opened."""
        done = [self._recordings[task.gyro_id, task.name] for task in self._tasks.recordings]
        return [*self._tasks.unreadable, *done]

    @property
    def gyros(self) -> list[dict[str, Any]]:
        """The results of all gyros, in the order of their names."""
        return [self._gyros[gyro] for gyro in self._of_gyro]

    def describe(self) -> str:
        """How far it has come."""
        return (
            f"{len(self._gyros)} of {len(self._of_gyro)} gyros and {len(self._recordings)} of"
            f" {len(self._tasks.recordings)} recordings done; the same command goes on"
        )


@contextlib.contextmanager
def say_how_far(folder: Path, course: LotCourse) -> Iterator[None]:
    """Let an interrupted lot say how far it came, and clean up after its workers.

    So does one whose disk is full.

    Parameters
    ----------
    folder
        The lot's.
    course
        How far it has come.

    Returns
    -------
    context manager
        Of the work.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.errors import InterruptedRunError
    >>> from hrg_cli.lots.lot_course import say_how_far
    >>> with TemporaryDirectory() as name:
    ...     try:
    ...         with say_how_far(Path(name), Told(describe=lambda: "1 of 2 gyros done")):
    ...             raise KeyboardInterrupt
    ...     except InterruptedRunError as error:
    ...         print(str(error).partition(": ")[2])
    interrupted: 1 of 2 gyros done
    """
    try:
        yield
    except KeyboardInterrupt:
        raise InterruptedRunError(f"{folder}: interrupted: {course.describe()}") from None
    except DiskFullError as error:
        raise DiskFullError(f"{error}; {course.describe()}") from error
    finally:
        store.remove_stale(folder, below=True)
