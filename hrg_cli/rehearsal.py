"""A result's own rehearsal on files: its inputs found again by their content, the verdict written
into its status."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from . import pipeline, settings, store
from .errors import HrgError
from .executors import run_tasks, start_processes
from .extras import warn_of_plain_python
from .records import Calibration, Diagnosis, Periods, Record, Recording, Resonator, Source, Wave
from .stages.rehearse import rehearse
from .stages.rehearsing.figures import Rehearsed
from .stages.rehearsing.rehearsals import Rehearsal, judge_by_rehearsal
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
) -> Rehearsal:
    """Rehearse a result file; with `written_by` (a line of history) the verdict is written into it.

    HrgError: an input is not found or was changed, no twin can be made, too much work.
    """
    kind = store.find_kind(path)
    if kind not in STAGE_OF:
        raise HrgError(
            f"{path}: is a {kind.kind} file; a resonator, a calibration or a diagnosis is rehearsed"
        )
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
    if written_by is not None:
        write_verdict(path, record, told, written_by)
    return told


def write_verdict(path: Path, record: Record, told: Rehearsal, typed: str) -> None:
    """The verdict in the file's own status and details: written beside it and renamed, so that it
    is whole at any time."""
    provenance = record.provenance
    line = f"{store.stamp_now()} hrg {__version__} {typed}"
    judged = judge_by_rehearsal(record, told)
    store.write(
        path,
        judged.replace(
            provenance=dataclasses.replace(provenance, history=(*provenance.history, line))
        ),
        force=True,
    )


def find_settings(path: Path, stage: str) -> dict[str, Any]:
    """The settings of a stage that a file keeps. HrgError: they cannot be read."""
    try:
        found = settings.parse_toml(store.find_provenance(path).settings).get(stage, {})
    except HrgError as error:
        raise HrgError(f"{path}: {error}; make it again") from error
    return dict(found) if isinstance(found, dict) else {}


def list_inputs(path: Path, beside: Sequence[Path]) -> list[Path]:
    """The wave files a result was made of, in its order. HrgError: one is not found, or has
    changed."""
    sources = [source for source in store.find_provenance(path).sources if source.kind == Wave.kind]
    if not sources:
        raise HrgError(
            f"{path}: names no wave file among its sources; only what was made of wave files is"
            " rehearsed"
        )
    return [_must(find_source(source, path.parent, beside), source, path) for source in sources]


def find_identified(path: Path, record: Record, beside: Sequence[Path]) -> list[Identified]:
    """The resonator files that tables of `--model physical` were made of, each with its own waves
    and settings. HrgError: one is not found, or has changed."""
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
    under another one there; files of its name are read first."""
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
    """A wave and, where they lie beside it, what its periods and its recording say of sampling and
    windows."""
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
