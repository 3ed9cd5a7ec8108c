"""The JSON of a calibration."""

from __future__ import annotations

import json
from typing import Any

from ...records import Calibration
from ..rate_table import is_rate_table
from ..rate_table import summarise as summarise_rate_table

OF_ANALYSIS = ("loops", "readout_matrix", "factors", "significant", "correlated", "false_rate")
"""Keys of the ladder's final analysis."""
WHERE_GIVEN = ("choice", "checks", "noise", "resonator", "rate_log", "suspect_runs", "stability")
"""Keys that a calibration has where there is something to say."""
OF_VARIANT = ("coefficients", "held_out_chi2_per_row", "passed", "why_not")


def summarise(record: Calibration) -> dict[str, Any]:
    """The JSON of a calibration (docs/reference/json.md).

    Parameters
    ----------
    record
        Made by `calibrate` or `rate_table`.

    Returns
    -------
    dict
        Errors before and after, harmonics, the ladder, what each factor buys, and the models that
        were tried, where the details hold them.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.rate_table import rate_table
    >>> from hrg_cli.stages.calibration.summary import summarise
    >>> rate = np.tile([-1.0, 0.0, 1.0], 40)
    >>> output = 2.0 * rate + 1e-4 * np.random.default_rng(0).standard_normal(120)
    >>> tables = rate_table(
    ...     {"out": output, "rate": rate}, output="out", rate="rate", nominal_scale=2.0
    ... )
    >>> sorted(summarise(tables)["drift_rms_rad_s"])
    ['after', 'before', 'held_out']
    """
    if is_rate_table(record):
        return summarise_rate_table(record)
    details = json.loads(record.details)
    return {
        "drift_rms_rad_s": _before_and_after(details["figures"]["drift"]),
        "scale_factor_rms_ppm": _before_and_after(details["figures"]["scale"]),
        "harmonics": details["harmonics"],
        "scale_factor_harmonics": details["scale_factor_harmonics"],
        "scale_factor": details["scale_factor"],
        "model": record.model,
        "nodes": [float(n) for n in record.node],
        "held_out_by": details["held_out_by"],
        "ladder": [_step(s) for s in details.get("ladder", [])],
        **{key: details[key] for key in ("trade", "hour") if key in details},
        **_analysis(details),
        **{key: details[key] for key in WHERE_GIVEN if details.get(key) is not None},
        **_variants(details),
    }


def _before_and_after(figure: dict[str, Any]) -> dict[str, float | None]:
    return {key: figure[key]["value"] for key in ("before", "after", "held_out")}


def _step(row: dict[str, Any]) -> dict[str, Any]:
    """A stage of accuracy."""
    note = {"note": row["note"]} if "note" in row else {}
    return {"stage": row["stage"], **_values(row), **note}


def _analysis(details: dict[str, Any]) -> dict[str, Any]:
    if "final_analysis" not in details:
        return {}
    return {key: details["final_analysis"][key] for key in OF_ANALYSIS}


def _variants(details: dict[str, Any]) -> dict[str, Any]:
    """The models that were compared, where there were several."""
    if "variants" not in details:
        return {}
    return {
        "variants": [
            {"model": s["stage"], **{key: s[key] for key in OF_VARIANT}, **_values(s)}
            for s in details["variants"]
        ]
    }


def _values(row: dict[str, Any]) -> dict[str, Any]:
    return {
        "drift_rms_rad_s": row["drift"]["value"],
        "scale_factor_rms_ppm": row["scale"]["value"],
        "drift_interval_rad_s": [row["drift"]["low"], row["drift"]["high"]],
        "scale_factor_interval_ppm": [row["scale"]["low"], row["scale"]["high"]],
    }
