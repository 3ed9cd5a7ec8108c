"""`hrg import`: a foreign log (or standard input) to a recording file."""

from __future__ import annotations

import contextlib
import json
import shutil
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from .. import pipeline, settings, store
from ..errors import HrgError, UsageError
from ..formats import find_second_file, import_envelope, import_log
from ..records import Record, Recording
from ..reporting.console import print_table
from .common import Common
from .frame import NO_DRAWS, ONE_PROCESS, OneFile, make_command, need_inputs, read_command_line
from .options import make_flags

FLAGS = (
    *("c", "s", "s_file", "time", "temperature", "rate", "sample_rate_hz", "mode", "mode_number"),
    *("readout", "carrier_hz", "nominal_frequency_hz", "units", "time_units", "clock_hz"),
    *("auxiliary_time", "rate_units", "temperature_units", "separator", "decimal"),
    *("constant_rate_rad_s", "constant_temperature_degc", "gyro_id", "run_id", "lot_id"),
    *("format", "from_s", "to_s"),
)
OF_ENVELOPES = (
    *("c_in_phase", "c_quadrature", "s_in_phase", "s_quadrature", "amplitude", "phase"),
    *("phase_units", "decibel", "reference_frequency_hz", "rows_per_window"),
)

LEFT_SHOWN = 20
"""Columns left that are told one by one on the screen."""


@make_command(
    "import",
    "hrg import log.csv -o recording.h5 --c 2 --s 3 --time 1 --mode free",
    flags=[
        *make_flags(import_log, *FLAGS),
        *make_flags(import_envelope, *OF_ENVELOPES, prefix="Envelope: "),
    ],
    idle=NO_DRAWS | ONE_PROCESS,
)
def main(
    run: Common,
    /,
    log: OneFile = None,
    envelope: Annotated[
        bool,
        typer.Option(
            "--envelope",
            help=(
                "The log holds demodulated signals (lock-in, FPGA, spectrum analyser): write"
                " periods."
            ),
        ),
    ] = False,
    **flags: Any,
) -> None:
    """A laboratory's log (CSV, .csv.gz, WAV, FLAC, MATLAB, NumPy, TDMS, Parquet, LabOne; - for
    standard input) to a recording.

    With --envelope, a log of demodulated signals (I and Q of one or two channels, amplitude and
    phase, or amplitude alone) to periods.

    --show-config prints the mapping as TOML; kept as a file it serves a whole lot through --config.
    """
    report = _import_file(log, run, flags, envelope)
    run.finish(report, lambda: _show(report))


def _import_file(
    log: Path | None, run: Common, flags: Mapping[str, Any], envelope: bool = False
) -> dict[str, Any]:
    """Read `log`, write the recording (of an envelope: periods), return the JSON: what was taken,
    from where, what was left out."""
    started = time.monotonic()
    function, table = (import_envelope, "envelope") if envelope else (import_log, "import")
    strange = [
        name
        for name, value in flags.items()
        if value is not None and not settings.accepts(function, name)
    ]
    if strange:
        flag = strange[0].replace("_", "-")
        told = ("demodulated signals: add --envelope", "samples; leave it out with --envelope")
        raise UsageError(f"--{flag} is for {told[envelope]}")
    values = run.resolve_settings(
        function,
        table,
        **{name: value for name, value in flags.items() if settings.accepts(function, name)},
    )
    log = need_inputs([log] if log else [], "a log, or - for standard input")[0]
    output = run.need_output("periods.h5" if envelope else "recording.h5")
    with _on_disk(log) as path:
        second = values.get("s_file")
        sources = [path] if second is None else [path, find_second_file(path, second)]
        record: Record = pipeline.write_first(
            output,
            function(path, **values),
            values,
            table,
            sources,
            force=run.force,
            command_line=read_command_line(),
        )
    facts: dict[str, Any] = {"run_id": getattr(record, "run_id", "")}
    if isinstance(record, Recording):
        with store.open_record(output, Recording) as whole:
            facts |= {
                "samples": len(whole),
                "duration_s": float(whole.times(len(whole) - 1)[-1]),
                "sample_rate_hz": whole.sample_rate_hz,
            }
    return pipeline.report(
        record, output, started, {**json.loads(getattr(record, "details", "{}")), **facts}
    )


def _show(report: Mapping[str, Any]) -> None:
    """What was taken of the log, as a table for a person."""
    columns = report.get("columns") or {}
    rows: list[tuple[Any, ...]] = [
        (role, f"column {c['column']} ({c['name']})", _unit_of(c)) for role, c in columns.items()
    ]
    if rows:
        print_table("", ("taken as", "of the log", "unit"), rows)
    left = report.get("columns_left") or []
    if left:
        shown: list[tuple[Any, ...]] = [
            (f"column {c['column']} ({c['name']})", c["units"] or "–", c["why"])
            for c in left[:LEFT_SHOWN]
        ]
        if len(left) > LEFT_SHOWN:
            shown.append((f"{len(left) - LEFT_SHOWN} more", "–", "see columns_left of --json"))
        print_table("", ("left", "unit", "why"), shown)
    names = {
        "samples": "samples",
        "rows": "rows",
        "sample_rate_hz": "rate, Hz",
        "duration_s": "length, s",
        "least_count": "least count",
    }
    facts: list[tuple[str, Any]] = [
        (text, report[key]) for key, text in names.items() if report.get(key) is not None
    ]
    print_table("", ("figure", "value"), facts + _remarks_on_log(report) + _noise_of_rows(report))


def _unit_of(column: Mapping[str, Any]) -> str:
    """The unit a column was read in, and the one it became."""
    units, taken_in = column["units"], column.get("taken_in")
    if taken_in and not units:
        return f"{taken_in} (the log names none)"
    return f"{units} → {taken_in}" if taken_in else units or "–"


def _remarks_on_log(report: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """What of the log was not as it should be, or not taken."""
    facts: list[tuple[str, Any]] = []
    gaps, cut = report.get("gaps") or {}, report.get("cut")
    if gaps.get("count"):
        facts.append(
            (
                "gaps",
                (
                    f"{gaps['count']}, the longest {gaps['longest_s']:.4g} s, the first before"
                    f" {gaps['first'][0]['before']}"
                ),
            )
        )
    if cut:
        facts.append(("part taken, s of the log", f"{cut['first_s']:.6g} to {cut['last_s']:.6g}"))
    for part in report.get("left_out") or []:
        lines = f"lines {part['first_line']} to {part['last_line']} ({part['rows']} rows)"
        if part["first_line"] == part["last_line"]:
            lines = f"line {part['first_line']}"
        facts.append(("left out", f"{lines}: {part['why']}"))
    return facts


def _noise_of_rows(report: Mapping[str, Any]) -> list[tuple[str, Any]]:
    """What was found of the noise of demodulated rows."""
    noise = report.get("noise")
    if not noise:
        return []
    return [
        ("rows of noise that count as one", noise["correlated_rows"]),
        ("rows per window", noise["rows_per_window"]),
        ("noise of a window, C and S", " and ".join(f"{v:.3g}" for v in noise["window_std"])),
        ("distance from the reference, Hz", noise["offset_hz"]),
    ]


@contextlib.contextmanager
def _on_disk(log: Path) -> Iterator[Path]:
    """The log as a file: standard input or a pipe, which can be read once only, is copied to a
    temporary one."""
    if str(log) != "-" and not log.is_fifo():
        yield log
        return
    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as opened:
        path = Path(folder) / "standard-input"
        source = sys.stdin.buffer if str(log) == "-" else opened.enter_context(open(log, "rb"))
        with open(path, "wb") as file:
            shutil.copyfileobj(source, file)
        try:
            yield path
        except HrgError as error:  # the copy's place is nothing that a person knows
            told = "standard input" if str(log) == "-" else str(log)
            error.args = (str(error).replace(str(path), told),)
            raise
