"""`hrg rehearse`: a result's inputs found again, its programme rehearsed, the verdict
written into its file."""

from __future__ import annotations

import dataclasses
import html
import json
import time
import tomllib
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from .. import __version__, pipeline, settings, store
from ..errors import HrgError, UsageError
from ..executors import local_processes, run_tasks
from ..records import Calibration, Diagnosis, Periods, Record, Recording, Resonator, Source, Wave
from ..reporting import console
from ..stages.rehearse import Rehearsal, Rehearsed, Work, once, rehearse, with_verdict
from ..stages.twin import Measured
from .frame import Common, Files, command, command_line, existing
from .options import flags_of


@command(
    "rehearse",
    "hrg rehearse resonator.h5 --times 30 --jobs 2 -o rehearsal.svg",
    flags=flags_of(rehearse, "times"),
    says={
        "output": "File for the report (.json), its picture (.svg) or both (.html).",
        "jobs": "Processes that share the rehearsals.",
    },
)
def main(
    run: Common,
    /,
    files: Files = None,
    keep_file: Annotated[
        bool, typer.Option("--keep-file", help="Tell the verdict without writing it into FILE.")
    ] = False,
    **flags: Any,
) -> None:
    """Whether a result's errors hold: its programme again and again on a simulated twin, through
    raw samples and the same stages.

    FILE: a resonator or calibration file, whose waves are found in its folder by their SHA-256 or
    named beside it. The verdict is written into the file's status.
    """
    with console.progress_bar("rehearse", run.quiet or run.json) as progress:
        report, show = rehearse_files(files or [], run, flags, keep_file, progress)
    run.finish(report, show)


RESULTS = (Resonator, Calibration, Diagnosis)
SUFFIXES = (".json", ".svg", ".html")
STAGE_OF = {Resonator: "identify", Calibration: "calibrate"}


def rehearse_files(
    files: Sequence[Path],
    run: Common,
    flags: Mapping[str, Any],
    keep_file: bool,
    progress: pipeline.Progress,
) -> tuple[dict[str, Any], Callable[[], None]]:
    """Rehearse the one result among the files, the others are its inputs; the command's JSON and
    the function that shows its table."""
    started = time.monotonic()
    values = run.settings(rehearse, **flags)
    if run.output is not None:
        if run.output.suffix not in SUFFIXES:
            raise UsageError(
                f"{run.output}: a rehearsal is written as {', '.join(SUFFIXES)}; choose one of"
                " these suffixes"
            )
        store.check_output(run.output, run.force)
    given = existing(files, "a resonator or calibration file")
    results = [path for path in given if store.kind_of(path) in RESULTS]
    if len(results) != 1:
        found = "none" if not results else " and ".join(str(path) for path in results)
        raise UsageError(
            f"one resonator or calibration file is rehearsed at a time, {found} was given; the rest"
            " of FILE are its inputs"
        )
    told = rehearsed(
        results[0], given, values, run.jobs, progress, None if keep_file else command_line()
    )
    report = {
        **pipeline.common_keys("rehearsal", told.status, told.reasons, run.output, started),
        "file": str(results[0]),
        "written": not keep_file,
        **told.table(),
    }
    if run.output is not None:
        with store.atomic_path(run.output, run.force) as temporary:
            _write(report, run.output.suffix, temporary)
    if not keep_file:
        console.message(f"{results[0]}: the verdict ({told.status}) was written into its status")
    return report, lambda: show(told.table())


def rehearsed(
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
    kind = store.kind_of(path)
    if kind not in STAGE_OF:
        raise HrgError(f"{path}: is a {kind.kind} file; a resonator or a calibration is rehearsed")
    record = store.read(path, kind)
    stage = STAGE_OF[kind]
    own = settings.checked(pipeline.STAGES[stage].function(), settings_of(path, stage))
    inputs = [measured(wave, beside) for wave in inputs_of(path, beside)]

    def share(works: Sequence[Work]) -> list[Rehearsed | None]:
        return run_tasks(
            once, works, lambda: local_processes(jobs), lambda count: progress(count / len(works))
        )

    try:
        told = rehearse(record, inputs, own, share, **values)
    except HrgError as error:
        raise HrgError(f"{path}: {error}") from error
    if written_by is not None:
        write_verdict(path, record, told, written_by)
    return told


def write_verdict(path: Path, record: Record, told: Rehearsal, typed: str) -> None:
    """The verdict in the file's own status and details: written beside it and renamed, so that it
    is whole at any time."""
    provenance = record.provenance
    line = f"{store.created_now()} hrg {__version__} {typed}"
    judged = with_verdict(record, told)
    store.write(
        path,
        judged.replace(
            provenance=dataclasses.replace(provenance, history=(*provenance.history, line))
        ),
        force=True,
    )


def settings_of(path: Path, stage: str) -> dict[str, Any]:
    """The settings of a stage that a file keeps. HrgError: they cannot be read."""
    try:
        found = tomllib.loads(store.provenance_of(path).settings).get(stage, {})
    except tomllib.TOMLDecodeError as error:
        raise HrgError(
            f"{path}: the settings it keeps cannot be read ({error}); make it again"
        ) from error
    return dict(found) if isinstance(found, dict) else {}


def inputs_of(path: Path, beside: Sequence[Path]) -> list[Path]:
    """The wave files a result was made of, in its order. HrgError: one is not found, or has
    changed."""
    sources = [source for source in store.provenance_of(path).sources if source.kind == Wave.kind]
    if not sources:
        raise HrgError(
            f"{path}: names no wave file among its sources; only what was made of wave files is"
            " rehearsed"
        )
    return [_must(found_again(source, path.parent, beside), source, path) for source in sources]


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


def found_again(source: Source, folder: Path, beside: Sequence[Path]) -> Path | None:
    """The file with a source's SHA-256: named by the user, under its own name in the folder, or
    under another one there."""
    own = folder / source.name
    others = sorted(p for p in folder.glob("*.h5") if p != own)
    for candidate in dict.fromkeys([*beside, own, *others]):
        try:
            if (
                candidate.is_file()
                and store.kind_of(candidate).kind == source.kind
                and store.sha256(candidate) == source.sha256
            ):
                return candidate
        except HrgError:
            continue  # another laboratory's file in the same folder
    return None


def measured(wave: Path, beside: Sequence[Path]) -> Measured:
    """A wave and, where they lie beside it, what its periods and its recording say of sampling and
    windows."""
    record = store.read(wave, Wave)
    periods = _parent(wave, Periods.kind, beside)
    demodulate, carrier, sampling = {}, None, None
    if periods is not None:
        demodulate = settings_of(periods, "demodulate")
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
    return Measured(record, sampling, carrier, demodulate, settings_of(wave, "estimate"))


def _parent(path: Path, kind: str, beside: Sequence[Path]) -> Path | None:
    """The file of a kind that `path` was made of, where it is at hand."""
    sources = [source for source in store.provenance_of(path).sources if source.kind == kind]
    return found_again(sources[0], path.parent, beside) if sources else None


def show(table: Mapping[str, Any]) -> None:
    """The rehearsal's table."""
    head = ("figure", "bias/σ", "error/σ, rms", "within 68 %", "within 95 %")
    rows = [
        (
            f["name"],
            *(f"{f[key]:.2f}" for key in ("bias_over_std", "error_over_std_rms")),
            *(_percent(f[k]) for k in _COVERAGE),
        )
        for f in table["figures"]
    ]
    console.print_table(f"{table['times']} rehearsals, truth: {table['truth']}", head, rows)


_COVERAGE = ("coverage_68", "coverage_95")


def _percent(part: float) -> str:
    return f"{100 * part:.0f} %"


def _write(report: Mapping[str, Any], suffix: str, path: Path) -> None:
    """The report as JSON, its picture, or a page of both."""
    if suffix == ".json":
        path.write_text(
            json.dumps(console.clean(report), indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
        )
        return
    from ..reporting.figures.drawing import standalone_svg, style
    from ..reporting.figures.rehearsal import rehearsal_plot

    with style():
        plot = rehearsal_plot(report)
    standalone_svg(plot, path)
    if suffix == ".html":
        drawing = path.read_text(encoding="utf-8")
        path.write_text(
            _page(report, plot.words, drawing[drawing.index("<svg") :]), encoding="utf-8"
        )


def _page(report: Mapping[str, Any], words: str, drawing: str) -> str:
    """A page that stands alone: verdict, picture, table."""
    rows = "".join(
        f"<tr><td>{html.escape(f['name'])}</td>"
        + "".join(
            f"<td>{text}</td>"
            for text in (f"{f['bias_over_std']:.2f}", f"{f['error_over_std_rms']:.2f}")
        )
        + "".join(f"<td>{_percent(f[key])}</td>" for key in _COVERAGE)
        + "</tr>"
        for f in report["figures"]
    )
    reasons = "".join(f"<li>{html.escape(reason)}</li>" for reason in report["status_reasons"])
    title = f"Rehearsal of {Path(report['file']).name}: {report['status']}"
    return (
        '<!doctype html><html lang="en"><meta charset="utf-8">'
        f"<title>{html.escape(title)}</title>"
        "<style>body{font:16px/1.5 sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem;"
        "color:#1a2028;background:#fff}table{border-collapse:collapse}"
        "td,th{padding:.2rem .8rem;text-align:right}"
        "td:first-child,th:first-child{text-align:left}svg{max-width:100%;height:auto}</style>"
        f"<h1>{html.escape(title)}</h1><p>{html.escape(words)}</p><ul>{reasons}</ul>"
        f"<figure>{drawing}</figure>"
        "<table><tr><th>figure</th><th>bias/σ</th><th>error/σ, rms</th>"
        f"<th>within 68 %</th><th>within 95 %</th></tr>{rows}</table></html>\n"
    )


def and_rehearse(
    outcome: pipeline.Outcome, output: Path, inputs: Sequence[Path], times: int, run: Common
) -> pipeline.Outcome:
    """What `--rehearse N` of a command adds to its outcome: the verdict in the file's status and in
    the JSON."""
    values = settings.checked(
        rehearse, {"times": times} | ({} if run.seed is None else {"seed": run.seed}), usage=True
    )
    with console.progress_bar("rehearse", run.quiet or run.json) as progress:
        told = rehearsed(
            output, inputs, values, run.jobs, progress, f"{command_line()} (its rehearsal)"
        )
    record = store.read(output, type(outcome.record))
    reasons = list(record.status_reasons)
    return pipeline.Outcome(
        record,
        {
            **outcome.json,
            "status": record.status,
            "status_reasons": reasons,
            "rehearsal": told.table(),
        },
    )
