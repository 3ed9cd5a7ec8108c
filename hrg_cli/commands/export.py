"""`hrg export`: a calibration's tables as CSV, JSON or C header, and every kind of file
in the formats of other programs."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Any

import typer

from .. import signatures, store
from ..errors import UsageError
from ..exporting import export
from ..exporting_records import FORMATS, export_record, find_format
from ..records import Calibration
from .common import Common
from .frame import NO_DRAWS, ONE_PROCESS, OneFile, make_command, need_inputs
from .options import make_flags


@make_command(
    "export",
    "hrg export calibration.h5 -o table.h --fixed-point-bits 16",
    flags=make_flags(export, "fixed_point_bits", "precision"),
    idle=NO_DRAWS | ONE_PROCESS,
)
def main(
    run: Common,
    /,
    file: OneFile = None,
    verify_with: Annotated[
        Path | None,
        typer.Option(
            help="Public Ed25519 key (PEM) that FILE.sig must be of: only what its owner released"
            " is exported.",
            show_default=False,
        ),
    ] = None,
    sign_with: Annotated[
        Path | None,
        typer.Option(
            help="Private Ed25519 key (PEM): a signature of the output goes into OUTPUT.sig.",
            show_default=False,
        ),
    ] = None,
    **flags: Any,
) -> None:
    """Any hrg file for other programs, by the output's suffix: CSV, JSON (.gz), Parquet, XLSX, MAT;
    a calibration as a C header."""
    run.finish(_export_file(file, run, verify_with, sign_with, **flags))


OF_TABLES = (".csv", ".json", ".h")
"""Formats that a calibration has a form of its own for: what is needed to apply it."""


def _export_file(
    file: Path | None,
    run: Common,
    verify_with: Path | None = None,
    sign_with: Path | None = None,
    **flags: Any,
) -> dict[str, Any]:
    """Export a file; the command's JSON. The output's suffix names the format."""
    started = time.monotonic()
    values = run.resolve_settings(export, **flags)
    path = need_inputs([file] if file else [], "an hrg file")[0]
    output = run.need_output(
        "table.csv, table.json, table.parquet, table.xlsx, table.mat or (a calibration) table.h"
    )
    suffix, packed = find_format(output)
    store.check_output(output, run.force)
    key = None
    if sign_with is not None:
        key = signatures.read_private_key(sign_with)
        store.check_output(signatures.place_signature(output), run.force)
    if verify_with is not None:
        signatures.need_signed(path, signatures.read_public_key(verify_with))
    record = store.read_any(path)
    errors: dict[str, float] = {}
    if (
        isinstance(record, Calibration)
        and (suffix in OF_TABLES or record.status == "refused")
        and not packed
    ):
        made = export(record, suffix, **values)
        content, errors = made.text.encode(), made.errors
    elif suffix == ".h":
        raise UsageError(
            f"{path}: is a {record.kind} file; a C header is made of a calibration, the others go"
            f" to {', '.join(FORMATS)}"
        )
    else:
        content = export_record(record, output)
    with store.write_whole(output, run.force) as temporary:
        temporary.write_bytes(content)
    if key is not None:
        signatures.sign(output, key, run.force)
    report = {
        "kind": "table",
        "status": record.status,
        "status_reasons": list(record.status_reasons),
        "output": str(output),
    }
    return {**report, "elapsed_s": round(time.monotonic() - started, 3), **errors}
