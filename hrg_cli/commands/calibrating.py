"""The body of `hrg calibrate` on a foreign table of dwells: output against rate and temperature,
for any rate gyro."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from .. import pipeline, store
from ..errors import UsageError
from ..formats import read_table
from ..formats.quantities import rate_factor, split_name, temperature_scale
from ..pipeline import Outcome
from ..records import Calibration
from ..stages.calibrate import summary
from ..stages.rate_table import rate_table
from .frame import Common, command_line, existing


def calibrate_table(files: list[Path], run: Common, flags: Mapping[str, Any]) -> Outcome:
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
    values = run.settings(rate_table, "calibrate", **flags)
    path = existing(files, "a table of dwells")[0]
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
        command_line=command_line(),
    )
    return Outcome(record, pipeline.report(record, output, started, summary(record)))


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
            factor = rate_factor(unit)
        elif unit and role == "temperature":
            factor, offset = temperature_scale(unit)
        columns[wanted] = table[title].to_numpy(float) * factor + offset
    return columns


def is_table(files: list[Path], columns: dict[str, str | None]) -> bool:
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
