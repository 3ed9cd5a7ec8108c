"""The JSON of a calibration."""

from __future__ import annotations

import json
from typing import Any

from ...records import Calibration
from ..rate_table import is_rate_table
from ..rate_table import summary as table_summary


def summary(record: Calibration) -> dict[str, Any]:
    """The JSON of a calibration (docs/reference/json.md)."""
    if is_rate_table(record):
        return table_summary(record)
    details = json.loads(record.details)
    figures = details["figures"]
    out = {
        "drift_rms_rad_s": {
            key: figures["drift"][key]["value"] for key in ("before", "after", "held_out")
        },
        "scale_factor_rms_ppm": {
            key: figures["scale"][key]["value"] for key in ("before", "after", "held_out")
        },
        "harmonics": details["harmonics"],
        "scale_factor_harmonics": details["scale_factor_harmonics"],
        "scale_factor": details["scale_factor"],
        "model": record.model,
        "nodes": [float(n) for n in record.node],
        "held_out_by": details["held_out_by"],
        "ladder": [
            {"stage": s["stage"], **_values(s), **({"note": s["note"]} if "note" in s else {})}
            for s in details.get("ladder", [])
        ],
    }
    out |= {key: details[key] for key in ("trade", "hour") if key in details}
    if "final_analysis" in details:
        analysis = details["final_analysis"]
        out |= {
            key: analysis[key]
            for key in (
                "loops",
                "readout_matrix",
                "factors",
                "significant",
                "correlated",
                "false_rate",
            )
        }
    out |= {
        key: details[key]
        for key in ("choice", "checks", "noise", "resonator", "rate_log")
        if details.get(key) is not None
    }
    if details.get("stability") is not None:
        out["stability"] = details["stability"]
    if "variants" in details:
        own = ("coefficients", "held_out_chi2_per_row", "passed", "why_not")
        out["variants"] = [
            {"model": s["stage"], **{key: s[key] for key in own}, **_values(s)}
            for s in details["variants"]
        ]
    return out


def _values(row: dict[str, Any]) -> dict[str, Any]:
    return {
        "drift_rms_rad_s": row["drift"]["value"],
        "scale_factor_rms_ppm": row["scale"]["value"],
        "drift_interval_rad_s": [row["drift"]["low"], row["drift"]["high"]],
        "scale_factor_interval_ppm": [row["scale"]["low"], row["scale"]["high"]],
    }
