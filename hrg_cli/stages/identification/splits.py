"""The splits as vectors: what a split lost in noise still says, where its size and axis do not."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...fitting.envelopes.coordinates import SPLIT_COMPONENTS, SPLITS
from ...fitting.envelopes.inference import CLEAR

Array = np.ndarray
Components = Mapping[str, Mapping[str, float]]


def split_components(p: Array, covariance: Array) -> dict[str, dict[str, float]]:
    """The splits as vectors, νδμ·(cos, sin)2mθ_μ and δω·(cos, sin)2mθ_ω, of coordinates (7,) with
    covariance (7, 7): Gaussian where size and axis, lost in noise, are not."""
    std = np.sqrt(np.maximum(0.0, np.diag(covariance)))
    return {
        name: {"value": float(p[k]), "std": float(std[k])}
        for k, name in enumerate(SPLIT_COMPONENTS, 1)
        if np.isfinite(p[k])
    }


def state_splits(
    values: Mapping[str, float], std: Mapping[str, float], p: Array, covariance: Array
) -> dict[str, Any]:
    """For the details: the splits' components and the sentences on those lost in noise."""
    components = split_components(p, covariance)
    return {
        "split_components": components,
        "weak_splits": describe_weak_splits(values, std, components),
    }


def describe_weak_splits(
    values: Mapping[str, float], std: Mapping[str, float], components: Components
) -> list[str]:
    """A sentence for every split that is not clear of its noise: below `CLEAR` of its standard
    deviations its size is Rice's and its axis has the tails of no Gaussian (three standard
    deviations of a component turn it anywhere), so the components are what can be held against
    another answer."""
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
