"""`hrg report`: one page about files, or its figures as pictures in a folder."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from pydantic import Field

from .. import pipeline, settings, store
from ..holding import concerns, hold
from .frame import NO_DRAWS, ONE_PROCESS, Common, Files, make_command, need_inputs
from .options import make_flags


def report(
    files: Sequence[Path],
    output: Path,
    force: bool = False,
    limits: Mapping[str, Any] | None = None,
    *,
    format: Annotated[
        Literal["html", "png"], Field(description="one page, or the figures alone into a folder")
    ] = "html",
    truth: Annotated[
        bool, Field(description="show a simulation's truth beside the estimates")
    ] = False,
    full: Annotated[
        bool, Field(description="draw the figures of every file behind the answer")
    ] = False,
) -> list[Path]:
    """Write the page or the figures of files.

    Parameters
    ----------
    files
        Of hrg, of any kind.
    output
        The page, or the folder for figures.
    force
        It may be replaced.
    limits
        Held against the files on the page, by kind.

    Returns
    -------
    list of Path
        What was written.

    Raises
    ------
    HrgError
        A file is damaged or not of hrg, or the output exists.
    """
    from ..reporting.page import build_report, write_figures

    if format == "png":
        return write_figures(files, output, force, truth=truth)
    store.check_output(output, force)
    limits = limits or {}
    limited = [path for path in files if concerns(limits, store.find_kind(path).kind)]
    with ExitStack() as opened:
        # a limit asks for a few figures: a recording's samples stay where they are
        records = [
            opened.enter_context(store.open_record(path, store.find_kind(path))) for path in limited
        ]
        held = hold(records, limits)
    page = build_report(files, truth=truth, full=full, rows=[row for rows in held for row in rows])
    with store.write_whole(output, force) as temporary:
        temporary.write_text(page, encoding="utf-8")
    return [output]


@make_command(
    "report",
    "hrg report run.h5 wave.h5 resonator.h5 -o report.html",
    flags=make_flags(report, "format", "truth", "full"),
    idle=NO_DRAWS | ONE_PROCESS | {"strict": "the page of a suspect result is a valid page"},
)
def main(
    run: Common,
    /,
    files: Files = None,
    limits: Annotated[
        Path | None,
        typer.Option(help="TOML file with limits to show the results against.", show_default=False),
    ] = None,
    **flags: Any,
) -> None:
    """One self-contained page (or the figures) about any set of hrg files: the answer first."""
    run.finish(_report_files(files or [], run, limits, **flags))


def _report_files(
    files: Sequence[Path], run: Common, limits: Path | None = None, **flags: Any
) -> dict[str, Any]:
    """Report on files; the command's JSON."""
    from ..reporting.page import find_worst_status

    started = time.monotonic()
    values = run.resolve_settings(report, **flags)
    paths = need_inputs(files, "the files to report on")
    output = run.need_output("report.html")
    made = report(
        paths,
        output,
        run.force,
        settings.load_toml(limits) if limits is not None else None,
        **values,
    )
    worst, reasons = find_worst_status(paths)
    return {
        **pipeline.make_common_keys("report", "valid", (), output, started),
        "files": [str(path) for path in made],
        "reported": {"status": worst, "status_reasons": reasons},
    }
