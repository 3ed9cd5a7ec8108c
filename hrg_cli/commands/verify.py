"""`hrg verify`: files and folders held against what was written."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from .. import signatures
from ..errors import name_some
from ..reporting import console
from ..reporting.text import drop_empty_columns
from ..verification import report, verify
from .common import Common
from .frame import NO_DRAWS, ONE_PROCESS, Files, make_command, need_inputs, refuse_settings


@make_command(
    "verify",
    "hrg verify lot/",
    idle=NO_DRAWS | ONE_PROCESS | refuse_settings("files are held against what was written"),
    says={
        "output": "File to write the JSON report into.",
        "strict": "Files that keep no checksums (a laboratory's), too, end with status 3.",
    },
)
def main(
    run: Common,
    /,
    files: Files = None,
    sign_with: Annotated[
        Path | None,
        typer.Option(
            help="Private Ed25519 key (PEM): where all is whole, each FILE is released with a"
            " signature beside it, FILE.sig.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """Whether files are as they were written: checksums of every dataset, the chain of sources, a
    lot's notes; 3 when not.

    FILE: hrg files or folders; sources that lie in the same folder are followed.
    """
    run.finish(*_verify_files(files or [], run, sign_with))


def _verify_files(
    files: Sequence[Path], run: Common, sign_with: Path | None = None
) -> tuple[dict[str, Any], Callable[[], None]]:
    """Verify, and sign what is whole; the command's JSON and its table."""
    started = time.monotonic()
    key = None if sign_with is None else signatures.read_private_key(sign_with)
    verdicts = verify(need_inputs(files, "hrg files or their folder"))
    if key is not None and all(verdict.result == "whole" for verdict in verdicts):
        for path in files:
            if path.is_file():
                signatures.sign(path, key, run.force)
    told = {**report(verdicts), "elapsed_s": round(time.monotonic() - started, 3)}

    def show() -> None:
        rows = [(v.name, v.kind, v.result, "; ".join([*v.findings, *v.notes])) for v in verdicts]
        head = ("file", "kind", "result", "what")
        console.print_table("", *drop_empty_columns(head, rows))
        absent = sorted({name for v in verdicts for name in v.not_followed})
        if absent:
            console.say(f"not in the folder, so not followed: {name_some(absent)}")

    return run.write_report(told), show
