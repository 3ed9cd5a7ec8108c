"""The commands around the chain: hand on, judge and show results, run many steps at once, look
things up."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from .frame import NO_DRAWS, ONE_PROCESS, Common, Files, OneFile, command, no_settings, numbers

app = typer.Typer()


@command(
    app,
    "export",
    "hrg export calibration.h5 -o table.h --fixed-point-bits 16",
    idle=NO_DRAWS | ONE_PROCESS,
)
def export_(
    run: Common,
    file: OneFile = None,
    fixed_point_bits: Annotated[
        int | None,
        typer.Option(
            help="C header: integers of so many bits; 0 (the default): floating point.",
            show_default=False,
        ),
    ] = None,
    precision: Annotated[
        float | None,
        typer.Option(
            help=(
                "C header: interpolation error allowed, in standard deviations of the table"
                " (default 0.5)."
            ),
            show_default=False,
        ),
    ] = None,
) -> None:
    """Any hrg file for other programs, by the output's suffix: CSV, JSON (.gz), Parquet, XLSX, MAT;
    a calibration as a C header."""
    from .exporting import export_file

    run.finish(export_file(file, run, fixed_point_bits=fixed_point_bits, precision=precision))


@command(
    app,
    "check",
    "hrg check results/*.h5 --limits configs/limits.toml --junit check.xml",
    idle=NO_DRAWS | ONE_PROCESS | {"strict": "the limits say which status passes"},
    says={
        "output": "File to write the JSON report into.",
        "config": "TOML file with more limits, over those of --limits.",
        "assignments": (
            'Change one limit, e.g. diagnosis.causes=0 or resonator.damping_split_1_s="5 deg/h";'
            " may be repeated."
        ),
        "show_config": "Print the limits as TOML and leave.",
    },
)
def check(
    run: Common,
    files: Files = None,
    limits: Annotated[
        Path | None, typer.Option(help="TOML file with the limits.", show_default=False)
    ] = None,
    baseline: Annotated[
        Path | None,
        typer.Option(
            help="Earlier result, or folder of results by the same names, to compare with in σ.",
            show_default=False,
        ),
    ] = None,
    limit_sigma: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            help="Difference from the baseline that passes, in σ (default 5).",
            show_default=False,
        ),
    ] = None,
    junit: Annotated[
        Path | None, typer.Option(help="File to write as JUnit XML.", show_default=False)
    ] = None,
    markdown: Annotated[
        Path | None, typer.Option(help="File to write as a Markdown summary.", show_default=False)
    ] = None,
) -> None:
    """Hold the figures of files against limits and an earlier result: exit status 0 within, 3
    outside."""
    from .checking import check_files

    run.finish(*check_files(files or [], run, limits, baseline, limit_sigma, junit, markdown))


@command(
    app,
    "diff",
    "hrg diff old/resonator.h5 new/resonator.h5 --limit-sigma 5",
    idle=NO_DRAWS
    | ONE_PROCESS
    | no_settings("there is nothing to set")
    | {"strict": "--limit-sigma says what passes"},
    says={"output": "File to write the JSON report into."},
)
def diff(
    run: Common,
    old: Annotated[Path | None, typer.Argument(metavar="OLD", show_default=False)] = None,
    new: Annotated[Path | None, typer.Argument(metavar="NEW", show_default=False)] = None,
    limit_sigma: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            help="End with status 3 where a figure moved by more, in σ.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """What moved between two results of one kind, in σ of both."""
    from .checking import diff_files

    run.finish(*diff_files(old, new, run, limit_sigma))


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
        str | None,
        typer.Option(
            help="html: one page; png: the figures alone, into the folder OUTPUT.",
            show_default=False,
        ),
    ] = None,
    truth: Annotated[
        bool | None, typer.Option("--truth", help="Show a simulation's truth beside the estimates.")
    ] = None,
    full: Annotated[
        bool | None,
        typer.Option("--full", help="Draw the figures of every file behind the answer."),
    ] = None,
    limits: Annotated[
        Path | None,
        typer.Option(help="TOML file with limits to show the results against.", show_default=False),
    ] = None,
) -> None:
    """One self-contained page (or the figures) about any set of hrg files: the answer first."""
    from .reporting import report_files

    run.finish(report_files(files or [], run, limits, format=format, truth=truth, full=full))


@command(
    app,
    "info",
    "hrg info wave.h5 --json",
    idle=NO_DRAWS
    | ONE_PROCESS
    | no_settings("a file is told as it is")
    | {"strict": "the status is told, not judged"},
    says={"output": "File to write the JSON report into."},
)
def info(run: Common, file: OneFile = None) -> None:
    """What a file holds: kind, validity, history, sources, figures."""
    from .answering import info_file

    run.finish(*info_file(file, run), judged=False)


@command(
    app,
    "verify",
    "hrg verify lot/",
    idle=NO_DRAWS | ONE_PROCESS | no_settings("files are held against what was written"),
    says={
        "output": "File to write the JSON report into.",
        "strict": "Files that keep no checksums (a laboratory's), too, end with status 3.",
    },
)
def verify(run: Common, files: Files = None) -> None:
    """Whether files are as they were written: checksums of every dataset, the chain of sources, a
    lot's notes; 3 when not.

    FILE: hrg files or folders; sources that lie in the same folder are followed.
    """
    from .verifying import verify_files

    run.finish(*verify_files(files or [], run))


@command(
    app,
    "rehearse",
    "hrg rehearse resonator.h5 --times 30 --jobs 2 -o rehearsal.svg",
    says={
        "output": "File for the report (.json), its picture (.svg) or both (.html).",
        "jobs": "Processes that share the rehearsals.",
    },
)
def rehearse(
    run: Common,
    files: Files = None,
    times: Annotated[
        int | None, typer.Option(help="Rehearsals (default 30).", show_default=False)
    ] = None,
    keep_file: Annotated[
        bool, typer.Option("--keep-file", help="Tell the verdict without writing it into FILE.")
    ] = False,
) -> None:
    """Whether a result's errors hold: its programme again and again on a simulated twin, through
    raw samples and the same stages.

    FILE: a resonator or calibration file, whose waves are found in its folder by their SHA-256 or
    named beside it. The verdict is written into the file's status.
    """
    from ..reporting import console
    from .rehearsing import rehearse_files

    with console.progress_bar("rehearse", run.quiet or run.json) as progress:
        report, show = rehearse_files(files or [], run, {"times": times}, keep_file, progress)
    run.finish(report, show)


@command(
    app,
    "run",
    "hrg run recordings/ -o results/ --jobs 2",
    says={
        "output": "Folder of the results; the same folder resumes.",
        "config": "TOML file with a table a stage.",
        "assignments": (
            "Change one setting of a stage, e.g. demodulate.periods_per_window=4; may be repeated."
        ),
        "seed": "Seed of every stage that draws.",
        "jobs": "Processes that share the recordings.",
    },
)
def run_(
    run: Common,
    recordings: Files = None,
    from_s: Annotated[
        float | None,
        typer.Option(help="Begin each recording at this time of its own.", show_default=False),
    ] = None,
    to_s: Annotated[
        float | None,
        typer.Option(help="End each recording at this time of its own.", show_default=False),
    ] = None,
    limits: Annotated[
        Path | None,
        typer.Option(help="TOML file with limits the results must hold.", show_default=False),
    ] = None,
    full: Annotated[
        bool,
        typer.Option("--full", help="Draw the figures of every run and file on the page, too."),
    ] = False,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="Print what would be done, and do nothing.")
    ] = False,
) -> None:
    """The whole chain on the recordings (or logs, or a folder of them) of one gyro: the answer, and
    a page to show."""
    from .running import run_files, tables_of

    part = {"from_s": from_s, "to_s": to_s}
    if run.show_config:
        tables_of(run, part)
    run.finish(*run_files(recordings or [], run, limits, full, dry_run, part))


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
    dask: Annotated[
        bool, typer.Option("--dask", help="Dask workers started here, --jobs of them.")
    ] = False,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a running Dask scheduler.", show_default=False)
    ] = None,
    ledger: Annotated[
        Path | None,
        typer.Option(help="Ledger to enter every gyro's results into.", show_default=False),
    ] = None,
) -> None:
    """The whole chain for every gyro of a lot, with a table and a page of the lot; resumes where it
    was interrupted."""
    from .batching import batch_file

    run.finish(batch_file(lot, run, dask, scheduler, ledger))


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
    says={
        "jobs": (
            "Processes that share the draws of the diagnosis and the recovery study; the others use"
            " one."
        )
    },
)
def study(
    run: Common,
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME",
            help="gauss-newton, redundancy, identification, diagnosis or recovery.",
            autocompletion=_study_names,
        ),
    ] = None,
    recordings: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="RECORDING...", help="Of recovery: one gyro's recordings.", show_default=False
        ),
    ] = None,
    effects: Annotated[
        str | None,
        typer.Option(help="Effects to hide, joined by commas (default: all).", show_default=False),
    ] = None,
    sizes: Annotated[
        str | None, typer.Option(help="Their sizes in σ, joined by commas.", show_default=False)
    ] = None,
) -> None:
    """Repeat one of the papers' experiments, or a study of this project's own methods: table and
    figures into a folder.

    recovery hides every effect in RECORDINGs of yours and tells what a diagnosis finds of it.
    """
    from .studying import run_study

    names = (
        None if effects is None else [part.strip() for part in effects.split(",") if part.strip()]
    )
    run.finish(
        *run_study(
            name,
            run,
            recordings or [],
            effects=names,
            sizes=None if sizes is None else numbers(sizes, "--sizes"),
        )
    )


@command(
    app,
    "effects",
    "hrg effects gain_mismatch",
    idle=NO_DRAWS
    | ONE_PROCESS
    | no_settings("the catalogue has no settings")
    | {"strict": "nothing is judged"},
    says={"output": "File to write the JSON report into."},
)
def effects(
    run: Common,
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME",
            help="One effect's page; all in one list otherwise.",
            autocompletion=_effect_names,
        ),
    ] = None,
) -> None:
    """The catalogue of effects: what a simulation can contain and a diagnosis can name."""
    from .answering import effects_page

    run.finish(*effects_page(name, run))
