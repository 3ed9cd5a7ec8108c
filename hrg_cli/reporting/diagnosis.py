"""What `hrg diagnose` shows a person: verdict, wrong values, causes, their gain on data held out, what stays open, what to run next."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .console import print_table, say
from .json_text import child
from .text import number

Rows = list[tuple[Any, ...]]
QUANTITIES = (
    ("drift_error_deg_h", "drift error, °/h"),
    ("angle_error_ppm", "error of the wave angle, ppm of a radian"),
    ("amplitude_error_ppm", "error of the amplitude, ppm"),
)


def show(report: Mapping[str, Any]) -> None:
    """Print the tables and sentences of a diagnosis's JSON."""
    say(f"verdict: {report['verdict']}")
    moved = [v for v in report["values"] if v.get("wrong")]
    if moved:
        rows: Rows = [(v["name"], v["believed"], f"{v['value']:.6g} ± {v['std']:.2g}", v["units"], f"{v['sigma']:+.4g}") for v in moved]
        print_table("", ("wrong value", "believed", "measured", "unit", "moved by, σ"), rows)
    if report["effects"]:
        rows = [(e["name"], sizes(e), f"{e['z']:.4g}", ", ".join(e["indistinguishable_from"])) for e in report["effects"]]
        print_table("", ("cause", "size", "z", "cannot be told from"), rows)
    rows = gains(report["gain"])
    if rows and (report["effects"] or report["remainder"]):
        print_table("", (f"rms on held-out {report['gain']['held_out']}", "before", "after"), rows)
    before, after = report["baseline"], report["after"]
    say(f"χ² a degree of freedom: {before['chi2_per_dof']:.4g} before, {after['chi2_per_dof']:.4g} after")
    if report["remainder"]:
        say(f"remainder: {report['remainder']['description']}")
    if report.get("forecast"):
        say(f"forecast: {report['forecast']['sentence']}")
    for name, sentence in next_experiments(report):
        say(f"next, for {name}: {sentence}")


def sizes(effect: Mapping[str, Any]) -> str:
    """An effect's fitted parameters in one line."""
    return ", ".join(f"{k} = {p['value']:.4g} ± {p['std']:.2g} {p['units']}" for k, p in effect["parameters"].items())


def gains(gain: Mapping[str, Any]) -> Rows:
    """Held-out errors before and after in physical units, with their standard deviations."""
    return [
        (words, *(f"{number(part.get(when), 4)} ± {number(part.get(f'{when}_std'), 2)}" for when in ("before", "after")))
        for key, words in QUANTITIES
        if (part := child(gain, key))
    ]


def next_experiments(report: Mapping[str, Any]) -> list[tuple[str, str]]:
    """(names, what to run) of the causes found that stand in a group with others."""
    return [
        (" or ".join([e["name"], *e["indistinguishable_from"]]), e["next_experiment"])
        for e in report["effects"]
        if e["indistinguishable_from"] and e.get("next_experiment")
    ]
