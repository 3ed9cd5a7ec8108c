"""`hrg calibrate`: forced runs to tables; or a foreign table of dwells, output against rate and
temperature, for any rate gyro."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from .. import pipeline, store
from ..errors import UsageError
from ..formats import read_table
from ..formats.unit_spellings import find_rate_factor, find_temperature_scale, split_name
from ..pipeline import Outcome
from ..records import Calibration
from ..reporting import tables
from ..stages import earth_rate
from ..stages.calibrate import calibrate, summarise
from ..stages.rate_table import rate_table
from .common import Common
from .frame import (
    JOBS_OF_REHEARSAL,
    Files,
    Rehearsals,
    make_command,
    need_inputs,
    read_command_line,
)
from .one_stage import run_stage_on_files
from .options import make_flags

OF_WAVES = (
    *("model", "harmonics", "axis", "interpolation", "nodes", "scale_factor_harmonics"),
    *("rate_rad_s", *earth_rate.OPTIONS, "ladder", "stable_only"),
)
OF_TABLE = {"output": "output_column", "rate": "rate_column", "temperature": "temperature_column"}
"""Settings of a table of dwells -> their options."""


@make_command(
    "calibrate",
    "hrg calibrate forced-*.wave.h5 -o calibration.h5 --harmonics 2 --ladder",
    flags=[
        *make_flags(calibrate, *OF_WAVES),
        *make_flags(rate_table, prefix="Of a table of dwells (CSV …): ", **OF_TABLE),
    ],
    says=JOBS_OF_REHEARSAL,
)
def main(
    run: Common,
    /,
    waves: Files = None,
    resonator: Annotated[
        list[Path] | None,
        typer.Option(
            help="Resonator file of --model physical; repeated, one a temperature (or frequency).",
            show_default=False,
        ),
    ] = None,
    rehearse: Rehearsals = None,
    **flags: Any,
) -> None:
    """Drift D(T, angle) and scale-factor K(T, angle) tables from forced runs over temperature and
    rate.

    FILE: wave files; or one foreign table of dwells of any rate gyro, with --output-column,
    --rate-column and --temperature-column.
    """
    of_table = {setting: flags.pop(option) for setting, option in OF_TABLE.items()}
    if not _is_table(waves or [], of_table):
        run_stage_on_files(
            run,
            "calibrate",
            waves or [],
            beside={"resonator": resonator or None},
            rehearse=rehearse,
            **flags,
        )
        return
    _refuse_options_of_waves(flags, resonator, rehearse)
    wanted = {**of_table, "interpolation": flags["interpolation"]}
    outcome = _calibrate_table(waves or [], run, wanted)
    run.finish(outcome.json, lambda: tables.show(outcome.record, outcome.json))


def _refuse_options_of_waves(
    flags: Mapping[str, Any], resonator: list[Path] | None, rehearse: int | None
) -> None:
    """UsageError where an option was given that a table of dwells knows nothing of."""
    strange = [
        name for name, value in flags.items() if value is not None and name != "interpolation"
    ]
    if strange or resonator:
        raise UsageError(
            f"--{(strange or ['resonator'])[0].replace('_', '-')} is for wave files; a table of"
            " dwells has no wave angle"
        )
    if rehearse is not None:
        raise UsageError("--rehearse is for wave files; a table of dwells has no runs to rehearse")


def _calibrate_table(files: list[Path], run: Common, flags: Mapping[str, Any]) -> Outcome:
    """Read the table, fit it, write the calibration; returns the record and the command's JSON."""
    started = time.monotonic()
    if (
        not flags.get("output")
        and not run.show_config
        and run.config is None
        and not any(a.startswith("output") for a in run.assignments)
    ):
        raise UsageError(
            "a table of dwells needs the column of the gyro's output; add --output-column NAME"
        )
    values = run.resolve_settings(rate_table, "calibrate", **flags)
    path = need_inputs(files, "a table of dwells")[0]
    if len(files) > 1:
        raise UsageError(f"{len(files)} tables were given, one is calibrated at a time; join them")
    output = run.need_output("calibration.h5")
    store.check_output(output, run.force)
    record: Calibration = pipeline.write_first(
        output,
        rate_table(_columns(path, values), **values),
        values,
        "calibrate",
        [path],
        force=run.force,
        command_line=read_command_line(),
    )
    return Outcome(record, pipeline.report(record, output, started, summarise(record)))


def _columns(path: Path, values: Mapping[str, Any]) -> dict[str, Any]:
    """The chosen columns under the names they were asked for (with or without their unit); rates in
    rad/s, temperatures in °C."""
    table = read_table(path)
    columns: dict[str, Any] = {str(title): table[title].to_numpy(float) for title in table}
    for role in ("output", "rate", "temperature"):
        wanted = values[role]
        if wanted is None:
            continue
        title = wanted if wanted in table else split_name(wanted)[0]
        if title not in table:
            continue
        unit = table.attrs["units"][title]
        factor, offset = 1.0, 0.0
        if unit and role == "rate":
            factor = find_rate_factor(unit)
        elif unit and role == "temperature":
            factor, offset = find_temperature_scale(unit)
        columns[wanted] = table[title].to_numpy(float) * factor + offset
    return columns


def _is_table(files: list[Path], columns: dict[str, str | None]) -> bool:
    """Whether `hrg calibrate` was given a foreign table, by its columns' flags or by what the file
    is."""
    wave = next((path for path in files if path.is_file() and store.is_hdf5(path)), None)
    named = next((name for name, value in columns.items() if value is not None), None)
    if wave is not None and named is not None:
        raise UsageError(
            f"--{named}-column is for a foreign table of dwells; {wave} is an hrg file"
        )
    return wave is None and (
        named is not None
        or any(path.suffix.lower() in (".csv", ".tsv", ".txt", ".parquet") for path in files)
    )
