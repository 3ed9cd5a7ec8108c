"""The commands around the chain: hand on, judge and show results, run many steps at once, look things up."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from .frame import NO_DRAWS, ONE_PROCESS, Common, Files, OneFile, command, existing, no_settings

app = typer.Typer()


@command(app, "export", "hrg export calibration.h5 -o table.h --fixed-point-bits 16", idle=NO_DRAWS | ONE_PROCESS)
def export_(
    run: Common,
    calibration: OneFile = None,
    fixed_point_bits: Annotated[
        int | None, typer.Option(help="C header: integers of so many bits; 0 (the default): floating point.", show_default=False)
    ] = None,
    precision: Annotated[
        float | None,
        typer.Option(help="C header: interpolation error allowed, in standard deviations of the table (default 0.5).", show_default=False),
    ] = None,
) -> None:
    """The tables for other programs: CSV, JSON or a C header, by the output's suffix, with the worst error stated."""
    from .. import store
    from ..exporting import export
    from ..records import Calibration

    started = time.monotonic()
    values = run.settings(export, fixed_point_bits=fixed_point_bits, precision=precision)
    path = existing([calibration] if calibration else [], "a calibration file")[0]
    output = run.need_output("table.csv, table.json or table.h")
    record = store.read(path, Calibration)
    made = export(record, output.suffix, **values)
    with store.atomic_path(output, run.force) as temporary:
        temporary.write_text(made.text, encoding="utf-8")
    report = {"kind": "table", "status": record.status, "status_reasons": list(record.status_reasons), "output": str(output)}
    run.finish({**report, "elapsed_s": round(time.monotonic() - started, 3), **made.errors})


@command(
    app,
    "check",
    "hrg check calibration.h5 --limits configs/limits.toml",
    idle=NO_DRAWS | ONE_PROCESS | {"strict": "the limits say which status passes"},
    says={
        "output": "File to write the JSON report into.",
        "config": "TOML file with more limits, over those of --limits.",
        "assignments": "Change one limit, e.g. resonator.scale_factor.maximum=0.6; may be repeated.",
        "show_config": "Print the limits as TOML and leave.",
    },
)
def check(
    run: Common,
    file: OneFile = None,
    limits: Annotated[Path | None, typer.Option(help="TOML file with the limits.", show_default=False)] = None,
) -> None:
    """Hold a file's figures against limits: exit status 0 within, 3 outside."""
    from .answering import check_file

    run.finish(*check_file(file, limits, run))


@command(
    app,
    "report",
    "hrg report run.h5 wave.h5 resonator.h5 -o report.html",
    idle=NO_DRAWS | ONE_PROCESS | {"strict": "the page of a suspect result is a valid page"},
)
def report(
    run: Common,
    files: Files = None,
    format: Annotated[
        str | None, typer.Option(help="html: one page; png: the figures alone, into the folder OUTPUT.", show_default=False)
    ] = None,
    truth: Annotated[bool | None, typer.Option("--truth", help="Show a simulation's truth beside the estimates.")] = None,
) -> None:
    """One self-contained page (or the figures) about any set of hrg files."""
    from .reporting import report_files

    run.finish(report_files(files or [], run, format=format, truth=truth))


@command(
    app,
    "info",
    "hrg info wave.h5 --json",
    idle=NO_DRAWS | ONE_PROCESS | no_settings("a file is told as it is") | {"strict": "the status is told, not judged"},
    says={"output": "File to write the JSON report into."},
)
def info(run: Common, file: OneFile = None) -> None:
    """What a file holds: kind, validity, history, sources, figures."""
    from .answering import info_file

    run.finish(*info_file(file, run), judged=False)


@command(
    app,
    "run",
    "hrg run recordings/ -o results/ --jobs 2",
    says={
        "output": "Folder of the results; the same folder resumes.",
        "config": "TOML file with a table a stage.",
        "assignments": "Change one setting of a stage, e.g. demodulate.periods_per_window=4; may be repeated.",
        "seed": "Seed of every stage that draws.",
        "jobs": "Processes that share the recordings.",
    },
)
def run_(
    run: Common,
    recordings: Files = None,
    limits: Annotated[Path | None, typer.Option(help="TOML file with limits the results must hold.", show_default=False)] = None,
    full: Annotated[bool, typer.Option("--full", help="Draw the figures of every run and file on the page, too.")] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="Print what would be done, and do nothing.")] = False,
) -> None:
    """The whole chain on the recordings (or logs, or a folder of them) of one gyro: the answer, and a page to show."""
    from .running import run_files, tables_of

    if run.show_config:
        tables_of(run)
    run.finish(*run_files(recordings or [], run, limits, full, dry_run))


@command(
    app,
    "batch",
    "hrg batch lot.toml -o lot/ --jobs 4",
    says={
        "output": "Folder of the lot; the same folder resumes it.",
        "config": "TOML file whose table [batch] is put over the lot's file.",
        "show_config": "Print the resolved lot as TOML and leave.",
        "seed": "Seed of every stage that draws.",
    },
)
def batch(
    run: Common,
    lot: OneFile = None,
    dask: Annotated[bool, typer.Option("--dask", help="Dask workers started here, --jobs of them.")] = False,
    scheduler: Annotated[str | None, typer.Option(help="Address of a running Dask scheduler.", show_default=False)] = None,
) -> None:
    """The whole chain for every gyro of a lot, with a table and a page of the lot; resumes where it was interrupted."""
    from .batching import batch_file

    run.finish(batch_file(lot, run, dask, scheduler))


def _effect_names(incomplete: str) -> list[str]:
    """Names of effects, for the shell's completion."""
    from ..effects import EFFECTS

    return [effect.name for effect in EFFECTS if effect.name.startswith(incomplete)]


def _study_names(incomplete: str) -> list[str]:
    """Names of studies, for the shell's completion."""
    from .studying import STUDIES

    return [name for name in STUDIES if name.startswith(incomplete)]


@command(
    app,
    "study",
    "hrg study gauss-newton -o study/",
    idle={"strict": "a study has no validity of its own"},
    says={"jobs": "Processes that share the draws of the diagnosis study; the others use one."},
)
def study(
    run: Common,
    name: Annotated[
        str | None,
        typer.Argument(metavar="NAME", help="gauss-newton, redundancy, identification or diagnosis.", autocompletion=_study_names),
    ] = None,
) -> None:
    """Repeat one of the papers' experiments, or a study of this project's own methods: table and figures into a folder."""
    from .studying import run_study

    run.finish(*run_study(name, run))


@command(
    app,
    "effects",
    "hrg effects gain_mismatch",
    idle=NO_DRAWS | ONE_PROCESS | no_settings("the catalogue has no settings") | {"strict": "nothing is judged"},
    says={"output": "File to write the JSON report into."},
)
def effects(
    run: Common,
    name: Annotated[
        str | None,
        typer.Argument(metavar="NAME", help="One effect's page; all in one list otherwise.", autocompletion=_effect_names),
    ] = None,
) -> None:
    """The catalogue of effects: what a simulation can contain and a diagnosis can name."""
    from .answering import effects_page

    run.finish(*effects_page(name, run))
