"""What a person sees of a calibration beside its residuals: the variants held against each other,
the choice, repeats, coefficients."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any

from ..units import to_deg_per_hour
from .console import print_table, say
from .quantities import round_with_std
from .text import format_number


def show(report: Mapping[str, Any]) -> None:
    """Print the tables of a calibration's JSON that it holds.

    Parameters
    ----------
    report
        The JSON.

    Examples
    --------
    >>> from hrg_cli.reporting.calibration import show
    >>> show({"noise": {"white_over_stated": 1.1, "angle_random_walk_rad_sqrt_s": None}})
    noise: 1.1 times what the windows state
    """
    for head, rows in (
        _tabulate_variants(report),
        show_bought(report),
        _tabulate_stability(report),
        _tabulate_coefficients(report),
        _show_moved(report),
    ):
        if rows:
            print_table("", head, rows)
    if hour := report.get("hour"):
        say(_tabulate_hour_more(hour))
    choice = report.get("choice")
    if choice:
        say(choice["why"].split("; ")[0])  # the table above has the rest
        for name, why in choice["not_tried"].items():
            say(f"not tried: {name}, {why}")
    noise = report.get("noise") or {}
    if noise.get("white_over_stated") is not None:
        walk = noise["angle_random_walk_rad_sqrt_s"] or 0.0  # null: no run turns, so no K is known
        beside = ""
        if walk > 0:
            size = to_deg_per_hour(walk) / 60
            beside = f" and the walk adds, beside it an angle random walk of {size:.3g} °/√h"
        say(f"noise: {noise['white_over_stated']:.3g} times what the windows state{beside}")


def _tabulate_variants(report: Mapping[str, Any]) -> tuple[tuple[str, ...], list[tuple[Any, ...]]]:
    """Every model tried: what it leaves of data left out, its coefficients, and whether it passes
    its checks."""
    rows = []
    for row in report.get("variants", []):
        drift = row["drift_rms_rad_s"]
        rows.append(
            (
                row["model"] + (" *" if row["model"] == report.get("model") else ""),
                None if drift is None else format_number(to_deg_per_hour(drift)),
                format_number(row["scale_factor_rms_ppm"]),
                format_number(row["held_out_chi2_per_row"]),
                row["coefficients"],
                "fits" if row["passed"] else _shorten_reason(row["why_not"][0]),
            )
        )
    return (
        "model (* written)",
        "drift left out, °/h",
        "scale factor, ppm",
        "χ² per row",
        "coefficients",
        "checks",
    ), rows


def show_bought(report: Mapping[str, Any]) -> tuple[tuple[str, ...], list[tuple[Any, ...]]]:
    """What each factor of the final analysis buys, as a table.

    Parameters
    ----------
    report
        JSON of a calibration.

    Returns
    -------
    tuple
        Headings, and a row a factor: by how much it lowers the errors of data left out, how clearly
        it is there, and what has to be measured for it.

    Examples
    --------
    >>> from hrg_cli.reporting.calibration import show_bought
    >>> row = dict(
    ...     name="drive", drift_bought_rad_s=None, scale_bought_ppm=12.0, z=9.0, needs="its log"
    ... )
    >>> show_bought({"factors": [row]})[1]
    [('drive', None, '12', '9', 'its log')]
    """
    rows = []
    for row in report.get("factors") or []:
        drift = row["drift_bought_rad_s"]
        rows.append(
            (
                row["name"],
                None if drift is None else format_number(to_deg_per_hour(drift), 3),
                format_number(row["scale_bought_ppm"], 3),
                format_number(row["z"], 3),
                row.get("needs"),
            )
        )
    return ("factor", "buys drift, °/h", "scale factor, ppm", "σ", "needs"), rows


def _shorten_reason(reason: str) -> str:
    """What a reason finds, without why and what to do; the JSON has all of it."""
    return re.split(r"[,;:(]", reason, maxsplit=1)[0].strip()


def _tabulate_hour_more(hour: Mapping[str, float]) -> str:
    """What one hour more of recordings brings."""
    drift = [to_deg_per_hour(hour[f"drift_std_{when}rad_s"]) for when in ("", "with_it_")]
    scale = [hour[f"scale_factor_std_{when}ppm"] for when in ("", "with_it_")]
    return (
        f"one hour more beside the {hour['recorded_s']:.4g} s recorded: σ of the drift"
        f" {drift[0]:.3g} → {drift[1]:.3g} °/h, of the scale factor {scale[0]:.3g} →"
        f" {scale[1]:.3g} ppm; what the model leaves out stays"
    )


def _tabulate_stability(report: Mapping[str, Any]) -> tuple[tuple[str, ...], list[tuple[Any, ...]]]:
    """Harmonics between programmes: own size, scatter, and the chance of that scatter if they
    repeat."""
    found = report.get("stability") or {}
    rows = []
    for row in found.get("harmonics", []):
        drift = row["kind"] == "drift"
        sizes = (
            to_deg_per_hour(row[key]) if drift else 1e6 * row[key]
            for key in ("amplitude", "scatter")
        )
        rows.append(
            (
                row["name"],
                *(format_number(size, 3) for size in sizes),
                "°/h" if drift else "ppm",
                format_number(row["p_value"], 2),
                "repeats" if row["repeats"] else "does not repeat",
            )
        )
    return (
        "harmonic",
        "size",
        "scatter",
        "unit",
        "p",
        f"between programmes ({found.get('told_by', '')})",
    ), rows


COEFFICIENTS = {
    "K_DC_rad_s": "cos 2mθ (K_DC), °/h",
    "K_DS_rad_s": "sin 2mθ (K_DS), °/h",
    "K": "K",
    "quadrature_cos_rad_s": "r·cos 2mθ, °/h",
    "quadrature_sin_rad_s": "r·sin 2mθ, °/h",
}
"""What each coefficient stands before in D, r = a_B/a_A, and its unit on the screen."""


def _tabulate_coefficients(
    report: Mapping[str, Any],
) -> tuple[tuple[str, ...], list[tuple[Any, ...]]]:
    """The resonators' coefficients over temperature or frequency, a row each."""
    rows = []
    for row in report.get("resonator") or []:
        degc, frequency = row.get("temperature_degc"), row.get("frequency_hz")
        place = f"{degc:.6g} °C" if degc is not None else f"{frequency:.10g} Hz"
        rows.append((place, *(_said(name, row[name], row[f"{name}_std"]) for name in COEFFICIENTS)))
    return ("drift coefficients at", *COEFFICIENTS.values()), rows


def _said(name: str, value: float | None, std: float) -> str:
    """A coefficient rounded by its standard deviation; a drift in °/h."""
    if value is None or not name.endswith("_rad_s"):
        return round_with_std(value, std)
    return round_with_std(to_deg_per_hour(value), to_deg_per_hour(std))


def _show_moved(report: Mapping[str, Any]) -> tuple[tuple[str, ...], list[tuple[Any, ...]]]:
    """What an update moved: each coefficient before, now, the change, each with its own standard
    deviation, the change in σ, and what became of the tables'."""
    rows = []
    for row in report.get("moved", []):
        before, now = row["before"], row["now"]
        change = None if before is None else now - before
        each = ((before, row["before_std"]), (now, row["now_std"]), (change, row["std"]))
        said = (_said(row["name"], *value) for value in each)
        rows.append(
            (COEFFICIENTS[row["name"]], *said, format_number(row["moved_sigma"], 2), row["tables"])
        )
    return ("drift coefficient", "before", "now", "change", "moved, σ", "tables"), rows
