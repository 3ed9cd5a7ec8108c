"""Diagnosis, the base parameters as fitted, beside those that are believed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.envelopes.coordinates import COORDINATES, to_parameters
from ....fitting.envelopes.inference import widen_axes
from ....physics.resonator import PARAMETERS
from ....records import Resonator
from ..closing.sized import Sized

Array = np.ndarray
TOLD = 0.7
"""Part of its prior's σ that a number keeps where the data tell nothing of it: they hold no more
than the prior does."""
WRONG = 4.0
"""σ from which a base value counts as wrong."""


def values(
    sized: Sized, resonator: Resonator | None, of_forcers: Mapping[str, Array]
) -> list[dict[str, Any]]:
    """Base parameters as fitted; beside the user's, how many σ they moved and whether that makes
    them wrong.

    of_forcers: by how much causes of the drive that nothing excludes may move the coordinates
    (`moves_of_forcers`). That is a part of every σ, and a parameter that they may move by more than
    these runs show it to says so: it is a sum.
    """
    fit = sized.fit
    numbers, slopes = to_parameters(fit.point.p, fit.series.mode_number)
    own = fit.coordinate_covariance() * sized.factor
    shown = np.sqrt(np.maximum(np.diag(slopes @ own @ slopes.T), 0))
    for moves in of_forcers.values():
        own = own + moves @ moves.T
    covariance = slopes @ own @ slopes.T
    widen_axes(covariance, own, fit.point.p, fit.series.mode_number)
    stds = np.sqrt(np.maximum(np.diag(covariance), 0))
    period = np.pi / fit.series.mode_number
    for other in (*sized.others, *sized.in_place):
        moved = numbers - to_parameters(other.point.p, fit.series.mode_number)[0]
        moved[[2, 4]] = (moved[[2, 4]] + period / 2) % period - period / 2
        stds = np.hypot(stds, moved)
    stds[[2, 4]] = np.minimum(stds[[2, 4]], period / np.sqrt(12))
    frequency = float(np.mean(fit.frequency_hz))
    each = [fit.std_at(fit.layout.frequency(k)) for k in range(len(fit.series.names))]
    spread = float(np.std(fit.point.offset_rad_s)) / np.sqrt(len(each))
    frequency_std = (
        max(float(np.sqrt(np.sum(np.square(each))) / len(each)), spread)
        / (2 * np.pi)
        * np.sqrt(sized.factor)
    )
    given = resonator.parameters() if resonator is not None else {}
    out = []
    for place, ((name, units), value, std) in enumerate(
        zip(PARAMETERS, [frequency, *numbers], [frequency_std, *stds], strict=True)
    ):
        row: dict[str, Any] = {
            "name": name,
            "value": float(value),
            "std": float(std),
            "units": units,
        }
        if name == "scale_factor" and _is_assumed(fit):
            row |= {"std": max(abs(float(value)), float(std)), "assumed": True}
        if place and (sum_with := _in_sum(slopes[place - 1], shown[place - 1], of_forcers)):
            row["sum_with"] = sum_with
        if name in given:
            believed, believed_std, _ = given[name]
            difference = float(value) - believed
            if name.endswith("axis_rad"):
                difference = float((difference + period / 2) % period - period / 2)
            sigma = float(np.hypot(std, believed_std if np.isfinite(believed_std) else 0.0))
            row |= {"believed": believed, "sigma": difference / sigma if sigma > 0 else 0.0}
            row["wrong"] = abs(row["sigma"]) > WRONG
        out.append(row)
    return out


def _in_sum(slopes: Array, shown: float, of_forcers: Mapping[str, Array]) -> list[str]:
    """Causes that may move a parameter, of these slopes against the coordinates (7,), by more than
    what these runs show it to."""
    return [name for name, moves in of_forcers.items() if np.linalg.norm(slopes @ moves) > shown]


def _is_assumed(fit: ExtendedFit) -> bool:
    """Whether the scale factor is what mode shapes of shells make it rather than what these runs
    show: no run turns, or all alike and by little."""
    freedom, column = fit.freedom.loose or fit.freedom, fit.layout.coordinate("scale_factor")
    prior = float(freedom.std[COORDINATES.index("scale_factor")])
    return prior > 0 and (column is None or fit.std_at(column) > TOLD * prior)
