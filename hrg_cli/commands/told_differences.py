"""Differences of two results for people: the names and units of the trade, not keys and SI."""

from __future__ import annotations

from collections.abc import Sequence

from ..comparing import Difference
from ..reporting.figure_names import name_of_figure
from ..reporting.quantities import quantity, round_with_std
from ..reporting.text import number

HEAD = ("figure", "old", "new", "change", "moved by, σ")


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
