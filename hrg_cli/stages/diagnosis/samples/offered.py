"""Diagnosis, what the waveform offers as a cause: one entry of the report, and whether it is
one."""

from __future__ import annotations

from typing import Any

import numpy as np

from ....effects.effect import Effect

NAMED = 3.0
"""σ that the size of what the waveform offers must stand off nought."""
UNMEASURED = "not measured: a line of the averaged spectrum"


def make_entry(
    effect: Effect, z: float, parameters: dict[str, tuple[float, float, str]], gain: float
) -> dict[str, Any]:
    """A cause as the report's JSON has it: parameters as (value, σ, unit)."""
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
    """Whether an entry stands off nought, and every parameter has a size and a σ that are
    numbers."""
    values = [(p["value"], p["std"]) for p in offer["parameters"].values()]
    sizes = [size for size in offer.get("magnitude", {"": 1.0}).values() if size > 0]
    return bool(
        offer["z"] > NAMED
        and sizes
        and all(np.isfinite(v) and np.isfinite(s) and s > 0 for v, s in values)
    )
