"""What `hrg identify` shows a person beside the parameters: the methods side by side, intervals,
modes, and what these runs cannot tell."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .console import print_table, say

Rows = list[tuple[Any, ...]]


def show(report: Mapping[str, Any]) -> None:
    """Print the further tables and sentences of a resonator's JSON."""
    details = report.get("details", {})
    if details.get("methods"):
        print_table("", *methods(details["methods"], list(report["parameters"])))
        for row in details["methods"]:
            said = [*row["warnings"], *row.get("weak_splits", [])]
            for sentence in [row["refused"]] if row["refused"] else said:
                say(f"{row['method']}: {sentence}")
    intervals = {
        "profile": details.get("profile"),
        "bootstrap": (details.get("bootstrap") or {}).get("intervals"),
    }
    for name, found in intervals.items():
        if found:
            rows = [
                (parameter, *(f"{v['68'][k]:.6g} … {v['95'][k]:.6g}" for k in (0, 1)))
                for parameter, v in found.items()
            ]
            print_table("", (f"{name} interval", "lower 68 … 95 %", "upper 68 … 95 %"), rows)
    for name, value in _facts(details):
        say(f"{name} = {value}")
    for sentence in [] if details.get("methods") else details.get("weak_splits", []):
        say(sentence)
    for sentence in report.get("identifiability", {}).get("flat_directions", []):
        say(sentence)


def methods(table: list[dict[str, Any]], names: list[str]) -> tuple[tuple[str, ...], Rows]:
    """Head and rows of the comparison: value ± standard deviation of every parameter that a method
    gives."""
    shown = [n for n in names if n != "frequency_hz"]
    rows: Rows = []
    for row in table:
        cells = row["parameters"]
        rows.append(
            (
                row["method"],
                *(
                    f"{cells[n]['value']:.5g} ± {cells[n]['std']:.1g}" if n in cells else None
                    for n in shown
                ),
            )
        )
    return ("method", *shown), rows


def _facts(details: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Modes, an unknown rate, and the figures of the working mode, in words."""
    found = []
    for mode in details.get("modes", []):
        found.append(
            (
                "mode",
                (
                    f"{mode['frequency_hz']:.8g} Hz, decay {mode['damping_rate_1_s']:.5g} ±"
                    f" {mode['std_1_s']:.1g} 1/s"
                ),
            )
        )
    for axis in details.get("stiffness_axes", []):
        where = (
            f"stiffness axis where a_B/a_A of {axis['run_id'] or 'a run'} turns back"
            f" ({axis['side']} side, {axis['passages']} times)"
            if "side" in axis
            else "stiffness axis where a_B changes sign"
        )
        found.append((where, f"{axis['value']:.6g} ± {axis['std']:.1g} rad"))
    whole = details.get("stiffness_axis_of_crossings")
    if whole:
        found.append(
            ("stiffness axis of all crossings", f"{whole['value']:.6g} ± {whole['std']:.2g} rad")
        )
    for key, words in (
        ("rate_rad_s", "fitted rate, rad/s"),
        ("quadrature_damping_1_s", "damping of the quadrature, 1/s"),
    ):
        if key in details:
            found.append((words, f"{details[key]['value']:.6g} ± {details[key]['std']:.2g}"))
    return found
