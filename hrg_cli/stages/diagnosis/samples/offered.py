"""Diagnosis, what the waveform offers as a cause: one entry of the report, and whether it is
one."""

from __future__ import annotations

from typing import Any

import numpy as np

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


def is_sound(offer: dict[str, Any]) -> bool:
    """Whether an entry stands off nought, and every parameter has a size and a σ that are numbers.

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
    sizes = [size for size in offer.get("magnitude", {"": 1.0}).values() if size > 0]
    return bool(
        offer["z"] > OWN_SIGMA
        and sizes
        and all(np.isfinite(v) and np.isfinite(s) and s > 0 for v, s in values)
    )
