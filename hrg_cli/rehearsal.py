"""A result's own rehearsal on files: its inputs found again by their content, the verdict written
into its status."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from . import pipeline, settings, store
from .errors import HrgError, name_some
from .executors import run_tasks, start_processes
from .extras import warn_of_plain_python
from .records import Calibration, Diagnosis, Periods, Record, Recording, Resonator, Source, Wave
from .stages.rehearse import rehearse
from .stages.rehearsing.rehearsals import Rehearsal, judge_by_rehearsal
from .stages.rehearsing.rehearsed_figures import Rehearsed
from .stages.rehearsing.repeat import Work, rehearse_once
from .stages.rehearsing.twin_physical import Identified, is_physical
from .stages.rehearsing.twin_run import Measured
from .version import __version__

STAGE_OF = {Resonator: "identify", Calibration: "calibrate", Diagnosis: "diagnose"}
"""The stage that made a result, for every kind that is rehearsed."""


def rehearse_file(
    path: Path,
    beside: Sequence[Path],
    values: Mapping[str, Any],
    jobs: int,
    progress: pipeline.Progress,
    written_by: str | None,
) -> tuple[Record, Rehearsal]:
    """Rehearse a result file.

    Parameters
    ----------
    path
        A resonator, a calibration or a diagnosis.
    beside
        Files and folders named by the user, of which its inputs may be some.
    values
        Whole settings of the rehearsals.
    jobs
        Processes that share them.
    progress
        Called with the share done.
    written_by
        Line of history with which the verdict is written into the file; None: it is not written.

    Returns
    -------
    tuple
        The result with the verdict in its status beside what it was doubted for before, and the
        rehearsal.

    Raises
    ------
    HrgError
        Another kind of file, one that was changed since it was written, an input that is not found
        or was changed, no twin can be made, too much work.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> from hrg_cli import HrgError, Recording, store
    >>> from hrg_cli.rehearsal import rehearse_file
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder) / "run.h5"
    ...     run = Recording(c=np.zeros(2), s=np.zeros(2), sample_rate_hz=4.0, mode="free")
    ...     _ = store.write(file, run)
    ...     try:
    ...         rehearse_file(file, [], {}, 1, print, None)
    ...     except HrgError as error:
    ...         print(str(error).split("run.h5: ")[1])
    is a recording file; a resonator, a calibration or a diagnosis is rehearsed
    """
    kind = store.find_kind(path)
    if kind not in STAGE_OF:
        raise HrgError(
            f"{path}: is a {kind.kind} file; a resonator, a calibration or a diagnosis is rehearsed"
        )
    written = None if written_by is None else need_as_written(path)
    record = store.read(path, kind)
    stage = STAGE_OF[kind]
    own = settings.check_settings(
        pipeline.STAGES[stage].load_function(), find_settings(path, stage)
    )
    inputs = [attach_measured(wave, beside) for wave in list_inputs(path, beside)]

    def share(works: Sequence[Work]) -> list[Rehearsed | None]:
        warn_of_plain_python()  # for the processes that share it
        return run_tasks(
            rehearse_once,
            works,
            lambda: start_processes(jobs),
            lambda count: progress(count / len(works)),
        )

    try:
        told = rehearse(record, inputs, own, share, find_identified(path, record, beside), **values)
    except HrgError as error:
        raise HrgError(f"{path}: {error}") from error
    judged = judge_by_rehearsal(record, told)
    if written_by is not None:
        if store.compute_sha256(path) != written:
            raise HrgError(
                f"{path}: was changed by another program while it was rehearsed; the verdict is not"
                " written into it: rehearse again"
            )
        write_verdict(path, judged, written_by)
    return judged, told


def need_as_written(path: Path) -> str:
    """See to it that a file which is to be written anew, with new checksums, is as it was written:
    these would vouch for what was changed since.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    str
        SHA-256 of its bytes, by which it is known again.

    Raises
    ------
    HrgError
        Something in it was changed, or it keeps no checksums that would tell.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import h5py
    >>> import numpy as np
    >>> from hrg_cli import HrgError, Recording, store
    >>> from hrg_cli.rehearsal import need_as_written
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder) / "run.h5"
    ...     run = Recording(c=np.zeros(2), s=np.zeros(2), sample_rate_hz=4.0, mode="free")
    ...     _ = store.write(file, run)
    ...     print(len(need_as_written(file)))
    ...     with h5py.File(file, "a") as opened:
    ...         opened["recording/c"][0] = 1.0
    ...     try:
    ...         need_as_written(file)
    ...     except HrgError as error:
    ...         print(str(error).split("run.h5: ")[1].split(",")[0])
    64
    the values of /recording/c were changed since it was written
    """
    digest = store.compute_sha256(path)
    changes = store.find_changes(path)
    if not changes and changes is not None:
        return digest
    why = "keeps no checksums" if changes is None else f"{name_some(changes)} since it was written"
    raise HrgError(
        f"{path}: {why}, and a verdict written into it would vouch for what it holds now: make it"
        " again, or hear the verdict alone with --keep-file"
    )


def write_verdict(path: Path, judged: Record, typed: str) -> None:
    """Write a result that a rehearsal has judged over its file.

    The file is written beside itself and renamed, so that it is whole at any time.

    Parameters
    ----------
    path
        The result.
    judged
        As it was read, with the rehearsal's verdict in its status and details.
    typed
        The command, for the history.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> from hrg_cli import Resonator, store
    >>> from hrg_cli.rehearsal import write_verdict
    >>> from hrg_cli.stages.rehearsing.rehearsals import Rehearsal, judge_by_rehearsal
    >>> one = np.ones(1)
    >>> found = Resonator(
    ...     name=np.array(["scale_factor"]), units=np.array(["1"]), value=one, std=one,
    ...     covariance=np.eye(1), details="{}",
    ... )
    >>> told = Rehearsal(30, [], (), 0, {"valid": 30}, "the file's")
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder) / "resonator.h5"
    ...     write_verdict(file, judge_by_rehearsal(found, told), "rehearse resonator.h5")
    ...     print(store.read(file, Resonator).provenance.history[0].split(" ", 3)[3])
    rehearse resonator.h5
    """
    provenance = judged.provenance
    line = f"{store.stamp_now()} hrg {__version__} {typed}"
    store.write(
        path,
        judged.replace(
            provenance=dataclasses.replace(provenance, history=(*provenance.history, line))
        ),
        force=True,
    )


def find_settings(path: Path, stage: str) -> dict[str, Any]:
    """The settings of a stage that a file keeps.

    Parameters
    ----------
    path
        The file.
    stage
        Its name.

    Returns
    -------
    dict
        Name -> value; empty where it keeps none.

    Raises
    ------
    HrgError
        They cannot be read.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> from hrg_cli import Recording, store
    >>> from hrg_cli.pipeline import write_first
    >>> from hrg_cli.rehearsal import find_settings
    >>> run = Recording(c=np.zeros(2), s=np.zeros(2), sample_rate_hz=4.0, mode="free")
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder) / "run.h5"
    ...     told = dict(force=False, command_line="hrg simulate gyro.toml")
    ...     _ = write_first(file, run, {"seed": 1}, "simulate", [], **told)
    ...     print(find_settings(file, "simulate"))
    {'seed': 1}
    """
    try:
        found = settings.parse_toml(store.find_provenance(path).settings).get(stage, {})
    except HrgError as error:
        raise HrgError(f"{path}: {error}; make it again") from error
    return dict(found) if isinstance(found, dict) else {}


def list_inputs(path: Path, beside: Sequence[Path]) -> list[Path]:
    """The wave files that a result was made of, in its order.

    Parameters
    ----------
    path
        The result.
    beside
        Files and folders named by the user, which are looked at first.

    Returns
    -------
    list of Path
        Those with the very content.

    Raises
    ------
    HrgError
        It names none, or one is not found, or has changed.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> from hrg_cli import HrgError, Recording, store
    >>> from hrg_cli.rehearsal import list_inputs
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder) / "run.h5"
    ...     run = Recording(c=np.zeros(2), s=np.zeros(2), sample_rate_hz=4.0, mode="free")
    ...     _ = store.write(file, run)
    ...     try:
    ...         list_inputs(file, [])
    ...     except HrgError as error:
    ...         print(str(error).split("run.h5: ")[1].split(";")[0])
    names no wave file among its sources
    """
    sources = [source for source in store.find_provenance(path).sources if source.kind == Wave.kind]
    if not sources:
        raise HrgError(
            f"{path}: names no wave file among its sources; only what was made of wave files is"
            " rehearsed"
        )
    return [_must(find_source(source, path.parent, beside), source, path) for source in sources]


def find_identified(path: Path, record: Record, beside: Sequence[Path]) -> list[Identified]:
    """The resonator files that tables of `--model physical` were made of.

    Parameters
    ----------
    path
        The calibration.
    record
        As it was read.
    beside
        Files and folders named by the user, which are looked at first.

    Returns
    -------
    list of Identified
        Each with its own waves and settings; empty for another model.

    Raises
    ------
    HrgError
        One is not found, or has changed.

    Examples
    --------
    >>> from pathlib import Path
    >>> from hrg_cli.rehearsal import find_identified
    >>> from hrg_cli.stages.calibration.drawn_tables import draw_tables
    >>> find_identified(Path("calibration.h5"), draw_tables(), [])
    []
    """
    if not is_physical(record):
        return []
    out = []
    for source in store.find_provenance(path).sources:
        if source.kind == Resonator.kind:
            file = _must(find_source(source, path.parent, beside), source, path)
            out.append(
                Identified(
                    store.read(file, Resonator),
                    [attach_measured(wave, beside) for wave in list_inputs(file, beside)],
                    settings.check_settings(
                        pipeline.STAGES["identify"].load_function(), find_settings(file, "identify")
                    ),
                )
            )
    return out


def _must(found: Path | None, source: Source, path: Path) -> Path:
    if found is not None:
        return found
    there = path.parent / source.name
    if there.exists():
        raise HrgError(
            f"{path}: its input {there} has changed since; name the file it was made of beside it,"
            " or make it again"
        )
    raise HrgError(
        f"{path}: its input {source.name} is not in {path.parent}; name it beside it, wherever"
        " it is"
    )


def find_source(source: Source, folder: Path, beside: Sequence[Path]) -> Path | None:
    """The file with a source's SHA-256: named by the user, under its own name in the folder, or
    under another one there.

    Parameters
    ----------
    source
        Name, kind and SHA-256.
    folder
        Of the file that names it.
    beside
        Files named by the user.

    Returns
    -------
    Path or None
        Files of its name are read first.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> from hrg_cli import Recording, store
    >>> from hrg_cli.records import Source
    >>> from hrg_cli.rehearsal import find_source
    >>> with TemporaryDirectory() as name:
    ...     folder = Path(name)
    ...     run = Recording(c=np.zeros(2), s=np.zeros(2), sample_rate_hz=4.0, mode="free")
    ...     _ = store.write(folder / "renamed.h5", run)
    ...     source = Source("run.h5", "recording", store.compute_sha256(folder / "renamed.h5"))
    ...     print(find_source(source, folder, []).name)
    renamed.h5
    """
    own = folder / source.name
    others = sorted(p for p in folder.glob("*.h5") if p != own)
    candidates = dict.fromkeys([*beside, own, *others])
    for candidate in sorted(candidates, key=lambda path: path.name != source.name):
        try:
            if (
                candidate.is_file()
                and store.find_kind(candidate).kind == source.kind
                and store.compute_sha256(candidate) == source.sha256
            ):
                return candidate
        except HrgError:
            continue  # another laboratory's file in the same folder
    return None


def attach_measured(wave: Path, beside: Sequence[Path]) -> Measured:
    """A wave and what its periods and its recording say of sampling and windows.

    Parameters
    ----------
    wave
        Its file; periods and recording are looked for beside it.
    beside
        Files named by the user, which are looked at first.

    Returns
    -------
    Measured
        Without a periods file neither carrier nor sampling rate.

    Raises
    ------
    HrgError
        A wave read out by a carrier, whose periods file is not at hand.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from hrg_cli import store
    >>> from hrg_cli.rehearsal import attach_measured
    >>> from hrg_cli.stages.rehearsing.drawn_input import draw_input
    >>> with TemporaryDirectory() as folder:
    ...     file = Path(folder) / "run.wave.h5"
    ...     _ = store.write(file, draw_input().wave)
    ...     found = attach_measured(file, [])
    >>> len(found.wave), found.sample_rate_hz
    (50, None)
    """
    record = store.read(wave, Wave)
    periods = _parent(wave, Periods.kind, beside)
    demodulate, carrier, sampling = {}, None, None
    if periods is not None:
        demodulate = find_settings(periods, "demodulate")
        with store.open_record(periods, Periods) as opened:
            demodulate["periods_per_window"] = float(opened.periods_per_window)
            carrier = opened.carrier_hz
        recording = _parent(periods, Recording.kind, beside)
        if recording is not None:
            with store.open_record(recording, Recording) as samples:
                ends = samples.times(0, 1)[0], samples.times(len(samples.c) - 1)[0]
                sampling = samples.sample_rate_hz or float(
                    (len(samples.c) - 1) / (ends[1] - ends[0])
                )
    if record.readout == "carrier" and carrier is None:
        raise HrgError(
            f"{wave}: was read out by a carrier, whose frequency its periods file holds; name that"
            " file too"
        )
    return Measured(record, sampling, carrier, demodulate, find_settings(wave, "estimate"))


def _parent(path: Path, kind: str, beside: Sequence[Path]) -> Path | None:
    """The file of a kind that `path` was made of, where it is at hand."""
    sources = [source for source in store.find_provenance(path).sources if source.kind == kind]
    return find_source(sources[0], path.parent, beside) if sources else None
