"""The splits as vectors: what a split lost in noise still says, where its size and axis do not."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...fitting.envelopes.coordinates import SPLIT_COMPONENTS, SPLITS
from ...fitting.envelopes.inference import CLEAR, measure_along

Array = np.ndarray
Components = Mapping[str, Mapping[str, float]]


def split_components(p: Array, covariance: Array) -> dict[str, dict[str, float]]:
    """The splits as vectors: Gaussian where size and axis, lost in noise, are not.

    νδμ·(cos, sin)2mθ_μ and δω·(cos, sin)2mθ_ω.

    Parameters
    ----------
    p
        Coordinates (7,).
    covariance
        (7, 7).

    Returns
    -------
    dict
        Component -> value and standard deviation; without those that are not known.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.identification.splits import split_components
    >>> found = split_components(
    ...     np.array([0.1, 0.0, 0.01, 0.0, np.nan, 0.5, 1.0]), 1e-8 * np.eye(7)
    ... )
    >>> found["damping_split_sin_1_s"], len(found)
    ({'value': 0.01, 'std': 0.0001}, 3)
    """
    std = np.sqrt(np.maximum(0.0, np.diag(covariance)))
    return {
        name: {"value": float(p[k]), "std": float(std[k])}
        for k, name in enumerate(SPLIT_COMPONENTS, 1)
        if np.isfinite(p[k])
    }


def state_splits(
    values: Mapping[str, float], std: Mapping[str, float], p: Array, covariance: Array
) -> dict[str, Any]:
    """What the details keep of the splits: their components, and sentences on those lost in noise.

    Parameters
    ----------
    values, std
        Of the parameters by name.
    p
        Coordinates (7,).
    covariance
        (7, 7).

    Returns
    -------
    dict
        `split_components`, `split_slope_std` (of a size along the split alone, without what an
        error across it adds) and `weak_splits`.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.identification.splits import state_splits
    >>> p = np.array([0.1, 1e-4, 0.0, 0.0, 0.0, 0.5, 1.0])
    >>> values = {"damping_split_1_s": 1e-4, "damping_axis_rad": 0.0}
    >>> std = {"damping_split_1_s": 1e-4, "damping_axis_rad": 0.5}
    >>> len(state_splits(values, std, p, 1e-8 * np.eye(7))["weak_splits"])
    1
    """
    components = split_components(p, covariance)
    along = {
        size: measure_along(p[first : first + 2], covariance[first : first + 2, first : first + 2])
        for (size, _, _), first in zip(SPLITS, (1, 3), strict=True)
        if size in values
    }
    return {
        "split_components": components,
        "split_slope_std": along,
        "weak_splits": describe_weak_splits(values, std, components),
    }


def describe_weak_splits(
    values: Mapping[str, float], std: Mapping[str, float], components: Components
) -> list[str]:
    """A sentence for every split that is not clear of its noise.

    Below `CLEAR` of its standard deviations its size is Rice's and its axis has the tails of no
    Gaussian (three standard deviations of a component turn it anywhere), so the components are what
    can be held against another answer.

    Parameters
    ----------
    values, std
        Of the parameters by name.
    components
        Of the splits, by name.

    Returns
    -------
    list of str
        Empty where both splits are clear, or are not told.

    Examples
    --------
    >>> from hrg_cli.stages.identification.splits import describe_weak_splits
    >>> describe_weak_splits({"scale_factor": 0.55}, {"scale_factor": 1e-3}, {})
    []
    """
    out = []
    for size, axis, names in SPLITS:
        if not {size, axis} <= set(values) or not set(names) <= set(components):
            continue
        if values[size] >= CLEAR * std[size] or not all(components[n]["std"] > 0 for n in names):
            continue
        said = ", ".join(
            f"{n} = {components[n]['value']:.3g} ± {components[n]['std']:.1g}" for n in names
        )
        out.append(
            f"{size} is {values[size] / std[size]:.2g} σ: its errors and its axis' are not"
            f" Gaussian, its components' are: {said}"
        )
    return out
