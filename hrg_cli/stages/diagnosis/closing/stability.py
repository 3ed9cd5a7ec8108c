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
    """The causes' names where the evaluation is changed.

    Parameters
    ----------
    case
        The causes and what they leave over.
    ahead
        The forecast, which chose causes on a part of the data; None: there is none.
    coarser
        Fits the base model to runs averaged to half as many rows.

    Returns
    -------
    list of dict
        `stability` of the report; empty where nothing is named.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.closing.stability import examine_stability
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_case, draw_fit
    >>> examine_stability(draw_case(), None, draw_fit)
    []
    """
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
