"""What `hrg identify` shows a person beside the parameters: the methods side by side, intervals,
modes, and what these runs cannot tell."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..limit_values import find_unit
from .console import print_table, say
from .figures_in_words import say_key
from .quantities import choose_unit, format_quantity, round_with_std

Rows = list[tuple[Any, ...]]


def show(report: Mapping[str, Any]) -> None:
    """Print what a resonator's JSON holds beside the parameters: methods, intervals, modes, and
    what cannot be told.

    Parameters
    ----------
    report
        JSON of an identification.

    Examples
    --------
    >>> from hrg_cli.reporting.identification import show
    >>> show({"identifiability": {"flat_directions": ["K is not told: no run turns"]}})
    K is not told: no run turns
    """
    details = report.get("details", {})
    if details.get("methods"):
        print_table("", *_tabulate_methods(details["methods"], report["parameters"]))
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
                _interval(parameter, v, str(report["parameters"][parameter]["units"]))
                for parameter, v in found.items()
            ]
            print_table("", (f"{name} interval", "lower 68 … 95 %", "upper 68 … 95 %"), rows)
    for name, value in _facts(details):
        say(f"{name} = {value}")
    for sentence in [] if details.get("methods") else details.get("weak_splits", []):
        say(sentence)
    for sentence in report.get("identifiability", {}).get("flat_directions", []):
        say(sentence)


def _tabulate_methods(
    table: list[dict[str, Any]], parameters: Mapping[str, Mapping[str, Any]]
) -> tuple[tuple[str, ...], Rows]:
    """Head and rows of the comparison: every parameter that a method gives, rounded by its standard
    deviation."""
    shown = {n: str(p["units"]) for n, p in parameters.items() if n != "frequency_hz"}
    rows: Rows = []
    for row in table:
        cells = row["parameters"]
        rows.append(
            (
                row["method"],
                *(
                    format_quantity(n, cells[n]["value"], cells[n]["std"], units)
                    if n in cells
                    else None
                    for n, units in shown.items()
                ),
            )
        )
    return ("method", *(say_key(n) for n in shown)), rows


def _interval(name: str, bounds: Mapping[str, Any], units: str) -> tuple[str, str, str]:
    """A row of intervals: lower and upper ends, 68 … 95 %, in the unit that fits the larger."""
    factor, unit = choose_unit(name, float(bounds["68"][1]), units)
    ends = (f"{bounds['68'][k] * factor:.6g} … {bounds['95'][k] * factor:.6g}" for k in (0, 1))
    return f"{say_key(name)}, {unit}".removesuffix(", "), *ends  # type: ignore[return-value]


def _facts(details: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Modes, an unknown rate, and the figures of the working mode, in words."""
    found = []
    for mode in details.get("modes", []):
        found.append(
            (
                "mode",
                (
                    f"{mode['frequency_hz']:.8g} Hz, decay"
                    f" {round_with_std(mode['damping_rate_1_s'], mode['std_1_s'])} 1/s"
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
        found.append((where, format_quantity("axis_rad", axis["value"], axis["std"], "rad")))
    whole = details.get("stiffness_axis_of_crossings")
    if whole:
        found.append(
            (
                "stiffness axis of all crossings",
                format_quantity("axis_rad", whole["value"], whole["std"], "rad"),
            )
        )
    for key, words in (
        ("rate_rad_s", "fitted rate"),
        ("quadrature_damping_1_s", "damping of the quadrature"),
    ):
        if key in details:
            of = details[key]
            found.append((words, format_quantity(key, of["value"], of["std"], find_unit(key))))
    return found
