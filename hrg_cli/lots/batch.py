"""run_lot: the whole chain for every gyro of a lot, shared among processes or a cluster, resumable,
one table at the end.

The folder: one folder a gyro with its periods, waves, resonator, calibration; `lot.csv` (and
`lot.parquet` with pyarrow), `lot.html`, `lot.json`. The same lot gives the same results whatever
the number of workers and however often it was interrupted; files differ in the stamp alone
(`created`, the time in `history`, and the hashes of sources that bear one), and not even in that
where the lot orders a time.
"""

from __future__ import annotations

import json
import shlex
import time
from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from .. import settings, store
from ..executors import OpenExecutor, connect_dask, run_tasks, start_processes
from ..extras import tell_lack_of_pages, warn_of_plain_python
from .copies import fail_copies
from .groups import Origin
from .gyro_page import PAGE
from .lot_course import LotCourse, Progress, say_how_far
from .lot_diagnosis import diagnose_lot
from .lot_folder import MARK, claim, hold_as_only_writer, write_text
from .lot_report import make_lot_report, make_paths_plain, read_measured
from .lot_settings import list_recordings, read_lot
from .lot_table import judge_rows, write_table
from .lot_tasks import list_tasks
from .lot_work import Task, work


def choose_executor(
    jobs: int = 1, dask: bool = False, scheduler: str | None = None
) -> OpenExecutor:
    """The executor a command line asks for: processes here, Dask workers started here, or a
    cluster's.

    Parameters
    ----------
    jobs
        Workers.
    dask
        Whether they are Dask's.
    scheduler
        Address of a running scheduler, whose workers are taken; it says that they are Dask's.

    Returns
    -------
    callable
        Opens the executor.

    Examples
    --------
    Nothing starts before it is opened:

    >>> from hrg_cli.lots.batch import choose_executor
    >>> choose_executor(jobs=2).func.__name__, choose_executor(jobs=2, dask=True).func.__name__
    ('start_processes', 'connect_dask')
    """
    if scheduler is not None or dask:
        return partial(connect_dask, scheduler, jobs)
    return partial(start_processes, jobs)


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
    """Run the lot of a TOML file into a folder; the report as JSON.

    What is done already, unchanged, is not done again. A recording or gyro that fails is reported
    and does not stop the others.

    Parameters
    ----------
    path
        The lot's file.
    folder
        New, empty, or this lot's.
    open_executor
        What shares the work; None: one process here.
    force
        The folder may hold something else.
    assignments
        Texts `key=value` over the file's settings.
    over
        Tables over them, before the assignments.
    progress
        Told how much of the work is done, from 0 to 1.

    Returns
    -------
    dict
        The report. Status: refused (a gyro did not pass or a recording cannot be read), suspect (a
        gyro has a fault, an outlier or a suspect result), valid.

    Raises
    ------
    HrgError
        A wrong lot file, no recordings, a folder that holds something else.

    Examples
    --------
    A lot of one recording that is none:

    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from hrg_cli.lots.batch import run_lot
    >>> with TemporaryDirectory() as name:
    ...     place = Path(name)
    ...     _ = (place / "SN-1.h5").write_text("no HDF5")
    ...     _ = (place / "lot.toml").write_text('recordings = "*.h5"')
    ...     report = run_lot(place / "lot.toml", place / "lot")
    >>> report["status"], report["recordings"], report["recordings_failed"]
    ('refused', 1, 1)
    """
    started = time.monotonic()
    path, folder = Path(path), Path(folder)
    lot = read_lot(path, assignments, over)
    command = _command(path, assignments, over)
    recordings = list_recordings(lot, path)
    claim(folder, force)
    if "diagnose" in lot.stages:  # simulates what it has written
        warn_of_plain_python()
    with hold_as_only_writer(folder):
        tasks = list_tasks(lot, recordings, folder, command)
        course = LotCourse(lot, tasks, progress)
        with say_how_far(folder, course):
            run_tasks(
                work,
                list[Task](tasks.recordings),
                open_executor or choose_executor(),
                then=course.take_result,
            )
        found = [make_paths_plain(r, folder, path) for r in course.gyros]
        told = [make_paths_plain(r, folder, path) for r in fail_copies(course.recordings)]
        rows = judge_rows(lot, told, found)
        whole = diagnose_lot(found, read_measured(rows, found), tasks.origins, lot.common_rate)
        for row in rows:
            origin = tasks.origins.get(row["gyro_id"], Origin({}))
            row |= {**origin.groups, **({"day": origin.day} if origin.day else {})}
        store.remove_stale(folder, below=True)  # of workers that were killed
        report = make_lot_report(lot, rows, told) | whole
        write_table(folder, rows)
        folders = {t.gyro_id: Path(t.folder) for t in tasks.recordings if Path(t.folder).is_dir()}
        pages = {
            gyro: f"{place.name}/{PAGE}"
            for gyro, place in folders.items()
            if (place / PAGE).is_file()
        }
        if not tell_lack_of_pages():
            from ..reporting.lot_page import make_lot_page

            write_text(folder / "lot.html", make_lot_page(report, pages, lot.limits))
        write_text(
            folder / MARK, json.dumps(report, indent=1, sort_keys=True, ensure_ascii=False) + "\n"
        )
    return report | {"output": str(folder), "elapsed_s": round(time.monotonic() - started, 3)}


def _command(path: Path, assignments: Sequence[str], over: Mapping[str, Any] | None) -> str:
    """The command as histories keep it: what it was told, not where or by how many processes it was
    done."""
    words = ["hrg", "batch", path.name, *(word for text in assignments for word in ("--set", text))]
    added = f", settings over it {settings.to_toml({'batch': over}).strip()!r}" if over else ""
    return f"{shlex.join(words)}; {path.name} has SHA-256 {store.compute_sha256(path)}{added}"
