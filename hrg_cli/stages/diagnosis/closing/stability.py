"""Diagnosis, the stability: which causes are found where the same runs are looked at otherwise."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from typing import Any

from ....fitting.causes import extended_fit
from ....fitting.causes.extended_fit import ExtendedFit
from ..search.search_case import Case
from ..search.selection import select


def examine_stability(
    case: Case, ahead: Mapping[str, Any] | None, coarser: Callable[[], ExtendedFit]
) -> list[dict[str, Any]]:
    """The causes' names where the runs are averaged to half as many rows, and on a part of the data
    (`ahead`: the forecast, which chose them there)."""
    if not case.search.found:
        return []
    out: list[dict[str, Any]] = []
    with contextlib.suppress(extended_fit.DivergedError):
        again = select(coarser(), case.inquiry)
        out.append(
            {
                "change": "averaged to half as many rows",
                "effects": [f.variant.effect.name for f in again.found],
            }
        )
    if ahead is not None:
        part = (
            "half of the runs"
            if ahead["held_out"] == "runs"
            else f"the first {100 * ahead['train_fraction']:.0f} % of every run"
        )
        out += [{"change": part, "effects": names} for names in ahead["chosen"]]
    return out
