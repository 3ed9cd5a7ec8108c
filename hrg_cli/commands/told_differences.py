"""Differences of two results for people: the names and units of the trade, not keys and SI."""

from __future__ import annotations

import re
from collections.abc import Sequence

from ..comparing import Difference
from ..limit_values import SUFFIXES
from ..reporting.figures_in_words import WORDS
from ..reporting.quantities import LABELS, RATE_OF_DECAY, quantity, round_with_std
from ..reporting.text import number, plain

HEAD = ("figure", "old", "new", "change", "moved by, σ")
OF_PARAMETERS = LABELS | {"damping_rate_1_s": RATE_OF_DECAY}
"""The damping stays a rate: a decay time would move against its own sign."""
OF_TABLES = {
    "table.drift_rad_s": "drift D, where the tables differ most",
    "table.scale_factor": "scale factor K, where the tables differ most",
}
PLACES = ("details", "final_analysis", "split_components", "values", "parameters", "allan", "gain")
"""First parts of a name that say where a figure is kept, not what it is."""


def told_differences(found: Sequence[Difference]) -> list[tuple[str, ...]]:
    """Figure, old, new, change and σ of each difference; a figure kept in two places once."""
    rows: list[tuple[str, ...]] = []
    for one in found:
        row = (
            name_of_figure(one.name),
            _said(one, one.old, one.old_std),
            _said(one, one.new, one.new_std),
            _change(one),
            number(one.sigma, 3),
        )
        if row not in rows:
            rows.append(row)
    return rows


def name_of_figure(name: str) -> str:
    """A figure's key in words, without its place and unit."""
    if name in OF_TABLES:
        return OF_TABLES[name]
    parts = name.removesuffix(".value").split(".")
    while len(parts) > 1 and parts[0] in PLACES:
        parts = parts[1:]
    if parts[0] == "effects":
        return f"{_words(parts[1])}: {' '.join(map(_words, parts[2:]))}"
    return " ".join(OF_PARAMETERS.get(part) or _words(part) for part in parts)


def _words(part: str) -> str:
    unit = next((end for end, _ in SUFFIXES if part.endswith(end)), "")
    bare = re.sub(r"_ppm$", "", part.removesuffix(unit))
    return plain(" ".join(WORDS.get(word, word) for word in bare.split("_")))


def _said(one: Difference, value: float, std: float | None) -> str:
    return quantity(one.name, value, std, one.units or "1")


def _change(one: Difference) -> str:
    """The difference with its σ: of a scale factor in ppm of the old one, of any other in its own
    unit."""
    both = abs(one.difference / one.sigma) if one.sigma else None
    if one.name.rpartition(".")[2] == "scale_factor" and one.old:
        ppm = 1e6 / one.old
        return f"{round_with_std(one.difference * ppm, both and both * abs(ppm))} ppm"
    return quantity(one.name, one.difference, both, one.units or "1")
