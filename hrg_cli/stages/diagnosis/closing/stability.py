"""Diagnosis, the stability: which causes are found where the same runs are looked at otherwise."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from ....errors import name_some
from ....fitting import checks
from ....fitting.causes import extended_fit
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.checks import Check
from ..fits.refits import compute_bic, loosen
from ..search.between import begin_with_frequencies
from ..search.explain import reweight_fit
from ..search.search_case import Case
from ..search.selection import select


@dataclass(frozen=True)
class ChosenAgain:
    """The causes chosen anew from the same runs averaged to half as many rows; those of them that
    were not named, those named that are not among them nor told from one that is, and by how much
    the other list is the better one there, in χ² + rank·ln N."""

    names: tuple[str, ...]
    new: tuple[str, ...] = ()
    gone: tuple[str, ...] = ()
    better_by: float = 0.0


def choose_again(case: Case, coarser: Callable[[], ExtendedFit]) -> ChosenAgain | None:
    """The causes chosen anew from half as many rows.

    A row holds the same windows as before, so that what is in the runs is in them: where another
    list of causes explains them better, neither list has been told from the other.

    Parameters
    ----------
    case
        The causes and what they leave over.
    coarser
        Fits the base model to runs averaged to half as many rows.

    Returns
    -------
    ChosenAgain or None
        None where nothing is named, or where the base model has no fit to such rows.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.closing.stability import choose_again
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_case, draw_fit
    >>> choose_again(draw_case(), draw_fit) is None
    True
    """
    if not case.search.found:
        return None
    inquiry = case.inquiry
    try:
        base = coarser()
        if inquiry.noise.white != 1:
            base = reweight_fit(base, inquiry.noise.white)
        again = select(base, inquiry, begin_with_frequencies(base, inquiry))
    except extended_fit.DivergedError:
        return None
    names = tuple(one.name for one in again.found)
    named = {one.name for one in case.search.found}
    new = tuple(name for name in names if name not in named)
    gone = tuple(one.name for one in case.search.found if not {one.name, *one.rivals} & set(names))
    if not new or not gone:
        return ChosenAgain(names, new, gone)
    return ChosenAgain(names, new, gone, _compare(case, base, again.final))


def _compare(case: Case, base: ExtendedFit, other: ExtendedFit) -> float:
    """By how much another list of causes is better than the named one on the rows of `base`."""
    point = replace(case.search.final.point, start=base.series.envelope[:, 0].copy())
    with contextlib.suppress(extended_fit.DivergedError):
        named = loosen(extended_fit.fit(base.series, point, base.freedom))
        return compute_bic(named) - compute_bic(other)
    return 0.0


def check_chosen_again(again: ChosenAgain) -> Check:
    """Whether half as many rows show the causes that are named, and not others in their place.

    Parameters
    ----------
    again
        What they show.

    Returns
    -------
    Check
        Failed where another list explains them better.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.closing.stability import ChosenAgain, check_chosen_again
    >>> check_chosen_again(ChosenAgain(("gain_mismatch",))).passed
    True
    """
    return checks.check_at_most(
        "chosen_again",
        again.better_by,
        0.0,
        f"averaged to half as many rows these runs are explained better by {name_some(again.new)}"
        f" in the place of {name_some(again.gone)}: which causes there are is not told",
    )


def list_stability(
    again: ChosenAgain | None, ahead: Mapping[str, Any] | None
) -> list[dict[str, Any]]:
    """The causes' names where the evaluation is changed.

    Parameters
    ----------
    again
        Those chosen from half as many rows; None: nothing is named, or there is no fit.
    ahead
        The forecast, which chose causes on a part of the data; None: there is none.

    Returns
    -------
    list of dict
        `stability` of the report.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.closing.stability import list_stability
    >>> list_stability(None, None)
    []
    """
    out: list[dict[str, Any]] = []
    if again is not None:
        out.append({"change": "averaged to half as many rows", "effects": list(again.names)})
    if ahead is not None:
        part = (
            "half of the runs"
            if ahead["held_out"] == "runs"
            else f"the first {100 * ahead['train_fraction']:.0f} % of every run"
        )
        out += [{"change": part, "effects": names} for names in ahead["chosen"]]
    return out
