"""How often diagnose names what is hidden, by its size: every effect of the catalogue on two random
devices, and twenty clean programmes, from raw samples (some 25 minutes on two cores).

python benchmarks/bench_power.py

The sizes are in σ of an ideal detector that knows the one effect it looks for (`hrg study
diagnosis` makes the same with figures).
"""

import os
from typing import Any

from hrg_cli.studies.diagnosis import diagnosis_study, tabulate


def show(study: dict[str, Any]) -> str:
    """The study's table in Markdown, and what it says of the clean programmes."""
    heads, rows = tabulate(study)
    lines = [heads, ["---"] * len(heads), *rows]
    table = "\n".join("| " + " | ".join(map(str, line)) + " |" for line in lines)
    everything = study["all"]
    named = "; ".join(
        f"of {size:g} σ {interval(everything['named'][f'{size:g}'])}" for size in study["sizes"]
    )
    return (
        f"{table}\n\nNamed first, or in a group of at most three: {named}. Errors of the sizes over"
        f" their σ: {everything['error_rms']:.2f} rms, {everything['within_1_96']:.0%} within"
        f" 1.96. Alarms in clean programmes: {interval(study['controls']['alarms'])}."
    )


def interval(share: list[float | None]) -> str:
    """A share with its 95 % interval and of how many it is."""
    value, low, high, tries = share
    return f"{value:.0%} ({low:.0%} to {high:.0%} of {tries})"


if __name__ == "__main__":
    print(show(diagnosis_study(jobs=os.cpu_count() or 1)))
