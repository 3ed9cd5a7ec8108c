"""`hrg forecast`: a resonator in, the drift to be expected out, as a table (screen,
CSV, JSON) or a figure (SVG, PNG)."""

from __future__ import annotations

import csv
import io
import json
import math
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from .. import pipeline, store
from ..errors import UsageError
from ..records import Resonator
from ..reporting import console
from ..reporting.quantities import round_with_std
from ..reporting.text import format_number
from ..stages.forecast import Forecast, forecast, summarise
from ..units import DEGREE
from .common import Common
from .frame import NO_DRAWS, ONE_PROCESS, OneFile, make_command, need_inputs
from .options import make_flags

FLAGS = (
    *("drive", "wave_angle_rad", "rate_rad_s", "duration_s", "quadrature_gain_1_s"),
    *("scale_factor", "trim", "trim_step_rad_s"),
)


@make_command(
    "forecast",
    "hrg forecast resonator.h5 --drive parametric -o forecast.svg",
    flags=make_flags(forecast, *FLAGS),
    idle=NO_DRAWS | ONE_PROCESS,
)
def main(run: Common, /, resonator: OneFile = None, **flags: Any) -> None:
    """The drift a resonator will show, alone: D over the angle, the wave's way over hours, the
    error between external fixes.

    Written as a table over time (.csv), all of it (.json) or one figure (.svg, .png), by the
    output's suffix.
    """
    run.finish(*_forecast_file(resonator, run, flags))


Show = Callable[[], None]
SUFFIXES = (".csv", ".json", ".svg", ".png")


def _forecast_file(
    file: Path | None, run: Common, flags: dict[str, Any]
) -> tuple[dict[str, Any], Show]:
    """Forecast; writes the output its suffix asks for; the command's JSON and the function that
    shows the table."""
    started = time.monotonic()
    values = run.resolve_settings(forecast, **flags)
    path = need_inputs([file] if file else [], "a resonator file")[0]
    if run.output is not None and run.output.suffix not in SUFFIXES:
        raise UsageError(
            f"{run.output}: a forecast is written as {', '.join(SUFFIXES)}; choose one of these"
            " suffixes"
        )
    made = forecast(store.read(path, Resonator), **values)
    report = {
        **pipeline.make_common_keys(
            "forecast", made.status, made.status_reasons, run.output, started
        ),
        **summarise(made),
    }
    if run.output is not None:
        with store.write_whole(run.output, run.force) as temporary:
            _write(made, report, run.output.suffix, temporary)
    return report, lambda: _show(report)


def _write(made: Forecast, report: dict[str, Any], suffix: str, path: Path) -> None:
    if suffix == ".csv":
        path.write_text(_csv(made), encoding="utf-8")
    elif suffix == ".json":
        path.write_text(
            json.dumps(console.clean(report), indent=1, ensure_ascii=False) + "\n", encoding="utf-8"
        )
    else:
        from ..reporting.figures.drawing import use_style, write_png, write_standalone_svg
        from ..reporting.figures.drift_forecast import plot_drift_forecast

        with use_style():
            plot = plot_drift_forecast(made)
        (write_standalone_svg if suffix == ".svg" else write_png)(plot, path)


def _csv(made: Forecast) -> str:
    """The table over time, SI units in the columns' names; what has no value is empty."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(made.table)
    writer.writerows(
        [f"{v:.9g}" if math.isfinite(v) else "" for v in row]
        for row in np.column_stack(list(made.table.values()))
    )
    return text.getvalue()


NAMES = {
    "damping_part_rad_s": "of the damping split, ν·δμ",
    "sin_8_theta_part_rad_s": "of the frequency split, δω²/λ (sin 8θ)",
    "mean_drift_while_turning_rad_s": "mean while turning",
    "drift_bound_rad_s": "first-order bound D_max, sum of both",
    "drift_bound_input_rad_s": "bound as input rate, D_max/K",
    "drift_largest_rad_s": "largest over the wave angle, exact",
}
"""The figures in words; λ is the rate at which the quadrature dies away."""


def _show(report: dict[str, Any]) -> None:
    hour = DEGREE / 3600
    rows = [
        (NAMES[name], round_with_std(f["value"] / hour, f["std"] / hour))
        for name, f in report["figures"].items()
    ]
    when = "run-down, after τ" if report["drive"] == "free" else f"{report['drive']} drive"
    console.print_table("", (f"drift of mθ, {when}", "°/h"), rows)
    _show_trim(report["trim"], report["trimmed"])
    head = [
        *("after a fix, s", "wave angle, °", "tangent law, °", "error of the input angle, °"),
        *("rms of all starts, °", "worst, °", "left after compensation, °"),
    ]
    table = []
    for row in report["table"]:
        time_s, way, spread, *others = (
            value / (1 if name == "time_s" else DEGREE) for name, value in row.items()
        )
        said = (format_number(value, 3) if math.isfinite(value) else "–" for value in others)
        table.append((format_number(time_s), round_with_std(way, spread), *said))
    console.print_table("", head, table)


def _show_trim(trim: dict[str, float], trimmed: bool) -> None:
    """The electric spring's size, axis and what it leaves."""
    hour = DEGREE / 3600
    rows = [
        ("size, rad/s", round_with_std(trim["size_rad_s"], trim["size_rad_s_std"])),
        ("axis, °", round_with_std(trim["axis_rad"] / DEGREE, trim["axis_rad_std"] / DEGREE)),
        (
            "on the electrodes at 0 and π/4m, rad/s",
            f"{trim['cos_rad_s']:.4g} and {trim['sin_rad_s']:.4g}",
        ),
        ("change of frequency, Hz", f"{trim['frequency_shift_hz']:.4g}"),
        ("split left, rad/s", round_with_std(trim["left_rad_s"], trim["left_rad_s_std"])),
        (
            "D_max before and after, °/h",
            (
                f"{trim['drift_bound_before_rad_s'] / hour:.4g} and"
                f" {trim['drift_bound_after_rad_s'] / hour:.4g}"
            ),
        ),
    ]
    title = "electric spring along the stiffest axis" + (" (on)" if trimmed else "")
    console.print_table("", (title, "value"), rows)
