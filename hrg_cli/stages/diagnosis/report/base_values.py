"""Diagnosis, the base parameters as fitted, beside those that are believed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.envelopes.coordinates import COORDINATES, to_parameters
from ....fitting.envelopes.inference import widen_axes
from ....physics.resonator import PARAMETERS
from ....records import Resonator
from ..closing.sized import Sized
from ..thresholds import WRONG_VALUE

Array = np.ndarray
AXES = [2, 4]
"""Places of the two axes among the generator's parameters."""
TOLD = 0.7
"""Part of its prior's σ that a number keeps where the data tell nothing of it: they hold no more
than the prior does."""


def list_base_values(
    sized: Sized,
    resonator: Resonator | None,
    of_summed: Mapping[str, Array],
    of_unnamed: Mapping[str, Array],
) -> list[dict[str, Any]]:
    """Base parameters as fitted; beside the user's, how many σ they moved and whether that makes
    them wrong.

    Parameters
    ----------
    sized
        The fit whose numbers are told.
    resonator
        The user's; None: there is none.
    of_summed
        By how much causes of the drive that nothing excludes may move the coordinates
        (`estimate_moves_of_summed`). That is a part of every σ, and a parameter that they may move
        by more than these runs show it to says so: it is a sum.
    of_unnamed
        The same of causes that may be there unnamed (`estimate_moves_of_unnamed`); a parameter that
        they may move so far is in doubt.

    Returns
    -------
    list of dict
        `values` of the report.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.closing.sized import Sized
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_case
    >>> from hrg_cli.stages.diagnosis.report.base_values import list_base_values
    >>> last = list_base_values(Sized.from_case(draw_case()), None, {}, {})[-1]
    >>> last["name"], round(last["value"], 2)
    ('scale_factor', 0.55)
    """
    fit = sized.fit
    numbers, slopes = to_parameters(fit.point.p, fit.series.mode_number)
    own = fit.coordinate_covariance() * sized.factor
    shown = np.sqrt(np.maximum(np.diag(slopes @ own @ slopes.T), 0))
    moves = [*of_summed.values(), *of_unnamed.values()]
    stds = _stds_of_base(sized, numbers, slopes, own, moves)
    frequency = float(np.mean(fit.frequency_hz))
    given = resonator.parameters() if resonator is not None else {}
    rows = zip(PARAMETERS, [frequency, *numbers], [_frequency_std(sized), *stds], strict=True)
    out = []
    for place, ((name, units), value, std) in enumerate(rows):
        row: dict[str, Any] = {
            "name": name,
            "value": float(value),
            "std": float(std),
            "units": units,
        }
        if name == "scale_factor" and _is_assumed(fit):
            row |= {"std": max(abs(float(value)), float(std)), "assumed": True}
        for key, movers in (("sum_with", of_summed), ("doubted_for", of_unnamed)):
            if place and (names := _list_movers(slopes[place - 1], shown[place - 1], movers)):
                row[key] = names
        if name in given:
            believed, believed_std, _ = given[name]
            period = np.pi / fit.series.mode_number if name.endswith("axis_rad") else np.inf
            row |= _compare_with_belief(float(value), float(std), believed, believed_std, period)
        out.append(row)
    return out


def _stds_of_base(
    sized: Sized, numbers: Array, slopes: Array, own: Array, moves: Sequence[Array]
) -> Array:
    """σ (6,) of the generator's parameters: of the fit's coordinates with this covariance and what
    may move them (7, k), and of what the model leaves open, by how much the numbers move where it
    is made otherwise."""
    p, mode_number = sized.fit.point.p, sized.fit.series.mode_number
    for one in moves:
        own = own + one @ one.T
    covariance = slopes @ own @ slopes.T
    widen_axes(covariance, own, p, mode_number)
    stds = np.sqrt(np.maximum(np.diag(covariance), 0))
    period = np.pi / mode_number
    for other in (*sized.others, *sized.in_place):
        moved = numbers - to_parameters(other.point.p, mode_number)[0]
        moved[AXES] = _wrap(moved[AXES], period)
        stds = np.hypot(stds, moved)
    # an axis that nothing is known of is uniform over its period
    stds[AXES] = np.minimum(stds[AXES], period / np.sqrt(12))
    return stds


def _frequency_std(sized: Sized) -> float:
    """σ of the runs' mean frequency, Hz: of their own errors, or of their spread where that is
    larger, and of what the model leaves open, by how much it moves where that is made otherwise."""
    fit = sized.fit
    runs = len(fit.series.names)
    each = [fit.std_at(fit.layout.frequency(k)) for k in range(runs)]
    by_errors = float(np.sqrt(np.sum(np.square(each))) / runs)
    by_spread = float(np.std(fit.point.offset_rad_s)) / np.sqrt(runs)
    own = max(by_errors, by_spread) / (2 * np.pi) * np.sqrt(sized.factor)
    moved = [np.mean(fit.frequency_hz - o.frequency_hz) for o in (*sized.others, *sized.in_place)]
    return float(np.linalg.norm([own, *moved]))


def _compare_with_belief(
    value: float, std: float, believed: float, believed_std: float, period: float
) -> dict[str, Any]:
    """What a row says of the value that the user believes: how many σ of both it is off; `period`:
    of an angle, else infinite."""
    difference = value - believed
    if np.isfinite(period):
        difference = float(_wrap(difference, period))
    both = float(np.hypot(std, believed_std if np.isfinite(believed_std) else 0.0))
    sigma = difference / both if both > 0 else 0.0
    return {"believed": believed, "sigma": sigma, "wrong": abs(sigma) > WRONG_VALUE}


def _wrap(difference: Any, period: float) -> Any:
    """A difference of angles within half a period of zero."""
    return (difference + period / 2) % period - period / 2


def _list_movers(slopes: Array, shown: float, movers: Mapping[str, Array]) -> list[str]:
    """Causes that may move a parameter, of these slopes against the coordinates (7,), by more than
    what these runs show it to."""
    return [name for name, moves in movers.items() if np.linalg.norm(slopes @ moves) > shown]


def _is_assumed(fit: ExtendedFit) -> bool:
    """Whether the scale factor is what mode shapes of shells make it rather than what these runs
    show: no run turns, or all alike and by little."""
    freedom, column = fit.freedom.loose or fit.freedom, fit.layout.coordinate("scale_factor")
    prior = float(freedom.std[COORDINATES.index("scale_factor")])
    return prior > 0 and (column is None or fit.std_at(column) > TOLD * prior)
