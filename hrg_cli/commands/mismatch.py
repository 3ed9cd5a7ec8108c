"""`hrg mismatch`: the signals a control system acts on, from a wave file to CSV or
JSON."""

from __future__ import annotations

import csv
import io
import json
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from .. import pipeline, store
from ..errors import UsageError
from ..records import Wave
from ..reporting import console
from ..reporting.text import format_number
from ..stages.mismatch import Mismatch, mismatch
from ..units import to_deg_per_hour
from .common import Common
from .frame import NO_DRAWS, ONE_PROCESS, OneFile, make_command, need_inputs
from .options import make_flags


@make_command(
    "mismatch",
    "hrg mismatch wave.h5 --main-amplitude 1.0 -o mismatch.csv",
    flags=make_flags(mismatch, "main_amplitude", "computing_s"),
    idle=NO_DRAWS | ONE_PROCESS,
)
def main(run: Common, /, wave: OneFile = None, **flags: Any) -> None:
    """The signals a control system acts on: error of the amplitude, quadrature, phase and angle,
    with their noise and delay."""
    run.finish(*_compute_mismatch(wave, run, flags))


def _compute_mismatch(
    file: Path | None, run: Common, flags: dict[str, Any]
) -> tuple[dict[str, Any], Callable[[], None]]:
    """Write the signals; the command's JSON and the function that shows their noise and delay."""
    started = time.monotonic()
    values = run.resolve_settings(mismatch, **flags)
    path = need_inputs([file] if file else [], "a wave file")[0]
    output = run.need_output("mismatch.csv")
    if output.suffix not in (".csv", ".json"):
        raise UsageError(
            f"{output}: mismatch signals are written as .csv or .json; choose one of these suffixes"
        )
    wave = store.read(path, Wave)
    made = mismatch(wave, **values)
    with store.write_whole(output, run.force) as temporary:
        temporary.write_text(
            _csv(made.columns) if output.suffix == ".csv" else _json(made.columns), encoding="utf-8"
        )
    report = {
        **pipeline.make_common_keys("mismatch", wave.status, wave.status_reasons, output, started),
        "rows": len(made.columns["time_s"]),
        "delay_s": made.delay_s,
        "noise_density": made.noise_density,
        "latency": made.latency,
    }
    return report, lambda: _show(made, wave.units)


def _show(made: Mismatch, units: str) -> None:
    """Noise and delay of the signals, and the angle's rate over more and more windows."""
    rows = []
    for name, density in made.noise_density.items():
        unit = "rad" if name.endswith("_rad") else "amplitude" if units == "1" else units
        size = float(np.sqrt(np.mean(made.columns[f"{name}_std"] ** 2)))
        words = name.removesuffix("_rad").replace("_", " ")
        rows.append(
            (words, f"{format_number(size, 3)} {unit}", f"{format_number(density, 3)} {unit}/√Hz")
        )
    head = ("signal", "noise of a window", "density")
    console.print_table(f"known {made.delay_s:.4g} s after the wave was so", head, rows)
    slopes = [
        (
            int(row["windows"]),
            format_number(row["latency_s"], 3),
            *(
                format_number(to_deg_per_hour(row[key]), 3)
                for key in ("rate_noise_rad_s", "rate_noise_found_rad_s")
            ),
        )
        for row in made.latency
    ]
    titles = ("rate of the angle over windows", "latency, s", "noise, °/h", "scatter found, °/h")
    console.print_table("", titles, slopes)


def _csv(columns: dict[str, np.ndarray]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(
        [f"{v:.9g}" if np.isfinite(v) else "" for v in row]
        for row in np.column_stack(list(columns.values()))
    )
    return text.getvalue()


def _json(columns: dict[str, np.ndarray]) -> str:
    return (
        json.dumps(
            console.clean({name: values.tolist() for name, values in columns.items()}),
            allow_nan=False,
        )
        + "\n"
    )
