"""Diagnosis, what the waveform offers as a cause: one entry of the report, and whether it is
one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ....effects import find
from ....effects.effect import Effect
from ..thresholds import OWN_SIGMA

UNMEASURED = "not measured: a line of the averaged spectrum"


def make_entry(
    effect: Effect, z: float, parameters: dict[str, tuple[float, float, str]], gain: float
) -> dict[str, Any]:
    """A cause as the report's JSON has it.

    Parameters
    ----------
    effect
        Of the catalogue.
    z
        σ that it stands off nought.
    parameters
        Name -> value, σ, unit.
    gain
        χ² that it takes away.

    Returns
    -------
    dict
        An entry of `effects`.

    Examples
    --------
    >>> from hrg_cli.effects import find
    >>> from hrg_cli.stages.diagnosis.samples.offered import make_entry
    >>> entry = make_entry(find("saturation"), 9.0, {"inverse_level": (1.05, 0.01, "1")}, 81.0)
    >>> entry["name"], entry["parameters"]["inverse_level"]["value"]
    ('saturation', 1.05)
    """
    return {
        "name": effect.name,
        "z": z,
        "p_value": float(np.exp(-0.5 * min(z**2, 1400))),
        "delta_bic": gain,
        "parameters": {
            k: {"value": v, "std": s, "units": u} for k, (v, s, u) in parameters.items()
        },
        "indistinguishable_from": [],
        "next_experiment": effect.next_experiment,
        "view": "waveform",
    }


def measure_sigma(entry: Mapping[str, Any]) -> float:
    """How many σ the size that an entry tells stands off nought, all its parts together: √Σ(v/s)².

    Where the samples show no sign or phase it is `magnitude` that they show, and no parameter.

    Parameters
    ----------
    entry
        Of `effects`, as `make_entry` makes it.

    Returns
    -------
    float
        NaN where a part has no σ.

    Examples
    --------
    Both parts of a tone are 1.5 and 2 σ, and it is 2.5:

    >>> from hrg_cli.effects import find
    >>> from hrg_cli.stages.diagnosis.samples.offered import make_entry, measure_sigma
    >>> parts = {"c_cos": (1.5e-4, 1e-4, "1"), "c_sin": (2e-4, 1e-4, "1")}
    >>> round(measure_sigma(make_entry(find("mains_tone"), 9.0, parts, 81.0)), 6)
    2.5
    """
    told = entry["parameters"]
    pairs = [(told[p.name], p.neutral) for p in find(entry["name"]).fitted() if p.name in told]
    sizes = [(p["value"] - neutral, p["std"]) for p, neutral in pairs]
    if stds := entry.get("magnitude_std"):
        sizes = [(size, stds[name]) for name, size in entry["magnitude"].items()]
    if not all(np.isfinite(size) and np.isfinite(std) and std > 0 for size, std in sizes):
        return float("nan")
    return float(np.sqrt(sum((size / std) ** 2 for size, std in sizes)))


def is_sound(offer: Mapping[str, Any]) -> bool:
    """Whether an entry and its size stand off nought, and every parameter has a size and a σ that
    are numbers.

    Parameters
    ----------
    offer
        An entry of `effects`.

    Returns
    -------
    bool
        It may be named.

    Examples
    --------
    >>> from hrg_cli.effects import find
    >>> from hrg_cli.stages.diagnosis.samples.offered import is_sound, make_entry
    >>> sizes = {"inverse_level": (1.05, 0.01, "1")}
    >>> [is_sound(make_entry(find("saturation"), z, sizes, z**2)) for z in (1.0, 99.0)]
    [False, True]
    """
    values = [(p["value"], p["std"]) for p in offer["parameters"].values()]
    return bool(
        min(offer["z"], measure_sigma(offer)) > OWN_SIGMA
        and all(np.isfinite(v) and np.isfinite(s) and s > 0 for v, s in values)
    )
