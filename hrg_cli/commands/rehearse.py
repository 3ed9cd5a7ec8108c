"""`hrg rehearse`: a result's inputs found again, its programme rehearsed, the verdict
written into its file."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from .. import pipeline, settings, store
from ..errors import UsageError
from ..records import Calibration, Diagnosis, Resonator
from ..rehearsal import rehearse_file
from ..reporting import console
from ..reporting.rehearsal_tables import tabulate_rehearsal
from ..stages.rehearse import rehearse
from .common import Common
from .frame import Files, make_command, need_inputs, read_command_line
from .options import make_flags


@make_command(
    "rehearse",
    "hrg rehearse resonator.h5 --times 30 --jobs 2 -o rehearsal.svg",
    flags=make_flags(rehearse, "times"),
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

    FILE: a resonator, calibration or diagnosis file, whose waves are found in its folder by their
    SHA-256 or named beside it. The verdict is written into the file's status.
    """
    with console.show_progress("rehearse", run.quiet or run.json) as progress:
        report, show = _rehearse_files(files or [], run, flags, keep_file, progress)
    run.finish(report, show)


RESULTS = (Resonator, Calibration, Diagnosis)
SUFFIXES = (".json", ".svg", ".html")


def _rehearse_files(
    files: Sequence[Path],
    run: Common,
    flags: Mapping[str, Any],
    keep_file: bool,
    progress: pipeline.Progress,
) -> tuple[dict[str, Any], Callable[[], None]]:
    """Rehearse the one result among the files, the others are its inputs; the command's JSON and
    the function that shows its table."""
    started = time.monotonic()
    values = run.resolve_settings(rehearse, **flags)
    if run.output is not None:
        if run.output.suffix not in SUFFIXES:
            raise UsageError(
                f"{run.output}: a rehearsal is written as {', '.join(SUFFIXES)}; choose one of"
                " these suffixes"
            )
        store.check_output(run.output, run.force)
    given = need_inputs(files, "a resonator, calibration or diagnosis file")
    results = [path for path in given if store.find_kind(path) in RESULTS]
    if len(results) != 1:
        found = "none" if not results else " and ".join(str(path) for path in results)
        raise UsageError(
            f"one resonator, calibration or diagnosis file is rehearsed at a time, {found} was"
            " given; the rest of FILE are its inputs"
        )
    judged, told = rehearse_file(
        results[0], given, values, run.jobs, progress, None if keep_file else read_command_line()
    )
    report = {
        **pipeline.make_common_keys(
            "rehearsal", judged.status, judged.status_reasons, run.output, started
        ),
        "file": str(results[0]),
        "written": not keep_file,
        **told.to_json(),
    }
    if run.output is not None:
        with store.write_whole(run.output, run.force) as temporary:
            _write(report, run.output.suffix, temporary)
    if not keep_file:
        console.tell(f"{results[0]}: the verdict ({judged.status}) was written into its status")
    return report, lambda: show(told.to_json())


def show(told: Mapping[str, Any]) -> None:
    """Print the rehearsal's tables.

    Parameters
    ----------
    told
        The rehearsal as the JSON has it.
    """
    for table in tabulate_rehearsal(told):
        console.print_table(table.caption, table.head, table.rows)


def _write(report: Mapping[str, Any], suffix: str, path: Path) -> None:
    """The report as JSON, its picture, or a page of both."""
    if suffix == ".json":
        path.write_text(
            json.dumps(console.clean(report), indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
        )
        return
    if suffix == ".html":
        from ..reporting.rehearsal_page import make_rehearsal_page

        path.write_text(make_rehearsal_page(report), encoding="utf-8")
        return
    from ..reporting.figures.drawing import use_style, write_standalone_svg
    from ..reporting.figures.rehearsal import plot_rehearsal

    with use_style():
        plot = plot_rehearsal(report)
    write_standalone_svg(plot, path)


def rehearse_outcome(
    outcome: pipeline.Outcome, output: Path, inputs: Sequence[Path], times: int, run: Common
) -> pipeline.Outcome:
    """What `--rehearse N` of a command adds to its outcome: the verdict in the file and in the
    JSON.

    Parameters
    ----------
    outcome
        Of the stage, whose file is written.
    output
        That file; the verdict is written into its status.
    inputs
        That it was made of.
    times
        Rehearsals.
    run
        The command's options.

    Returns
    -------
    Outcome
        The record as the file has it now, and the JSON with `rehearsal`.

    Raises
    ------
    HrgError
        No twin can be made of it, or too few rehearsals gave a result.
    """
    values = settings.check_settings(
        rehearse, {"times": times} | ({} if run.seed is None else {"seed": run.seed}), usage=True
    )
    with console.show_progress("rehearse", run.quiet or run.json) as progress:
        record, told = rehearse_file(
            output, inputs, values, run.jobs, progress, f"{read_command_line()} (its rehearsal)"
        )
    return pipeline.Outcome(
        record,
        {
            **outcome.json,
            "status": record.status,
            "status_reasons": list(record.status_reasons),
            "rehearsal": told.to_json(),
        },
    )
