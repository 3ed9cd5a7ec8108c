"""The table of a lot: a row a gyro with its parameters, their errors, pass or fail, and how far it
stands from the lot."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from .. import store
from ..reporting.text import spreadsheet
from .lot_settings import LotSettings

FEWEST = 5
"""Gyros from which a lot has outliers."""
NO_ORDER = ("damping_axis_rad", "stiffness_axis_rad")
"""Axes lie at random; none of them stands out."""


def judged_rows(
    lot: LotSettings, recordings: Sequence[Mapping[str, Any]], gyros: Sequence[Mapping[str, Any]]
) -> list[dict[str, Any]]:
    """Rows in the order of the gyros' names; every row has the same keys.

    Robust distance of a parameter x from the lot: z = (x − median) / √((1.4826·MAD)² + σ²), MAD the
    median absolute deviation of the lot and σ the gyro's own standard deviation; beyond `outlier_z`
    it is named in `outliers`. A gyro passes when all its stages gave a result that is not refused,
    none of its recordings failed and every limit holds.
    """
    rows = [
        _row(gyro, [r for r in recordings if r["gyro_id"] == gyro["gyro_id"]]) for gyro in gyros
    ]
    known = {gyro["gyro_id"] for gyro in gyros}
    rows += [
        _row({"gyro_id": r["gyro_id"], "status": "failed", "error": ""}, [r])
        for r in recordings
        if r["gyro_id"] not in known
    ]
    columns = list(dict.fromkeys(key for row in rows for key in row["figures"]))
    for name in columns:
        _distances(rows, name, lot.outlier_z)
    return [_flat(row, columns) for row in rows]


def _row(gyro: Mapping[str, Any], recordings: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    results = gyro.get("results", {})
    figures: dict[str, tuple[float, float]] = {}
    for name, parameter in results.get("identify", {}).get("parameters", {}).items():
        figures[name] = (_number(parameter["value"]), _number(parameter["std"]))
    calibrated = results.get("calibrate", {})
    for name in ("drift_rms_rad_s", "scale_factor_rms_ppm"):
        for when, value in (calibrated.get(name) or {}).items():
            figures[f"{name}_{when}"] = (_number(value), math.nan)
    if "scale_factor" in calibrated:
        figures["calibrated_scale_factor"] = (_number(calibrated["scale_factor"]), math.nan)
    failed = [r for r in recordings if r["status"] == "failed"]
    broken = [c for c in gyro.get("checks", []) if not c["passed"]]
    why = [gyro.get("error") or ""]
    why += [r["error"] if r["name"] in r["error"] else f"{r['name']}: {r['error']}" for r in failed]
    why += [
        f"{stage} is refused: {'; '.join(r['status_reasons'])}"
        for stage, r in results.items()
        if r["status"] == "refused"
    ]
    why += [c["sentence"] for c in broken]
    if not results and not failed and not gyro.get("error"):
        why.append("no stage had runs to work on: identify needs free runs, calibrate forced ones")
    why = [sentence for sentence in why if sentence]
    return {
        "gyro_id": gyro["gyro_id"],
        "status": gyro["status"],
        "passed": not why,
        "why": "; ".join(why),
        "runs": len(recordings),
        "runs_failed": len(failed),
        "chi2_per_dof": _number(results.get("identify", {}).get("chi2_per_dof")),
        "verdict": results.get("diagnose", {}).get("verdict", ""),
        "figures": figures,
        "distances": {},
    }


def _number(value: Any) -> float:
    return float(value) if isinstance(value, int | float) else math.nan


def _distances(rows: list[dict[str, Any]], name: str, limit: float) -> None:
    values = [
        row["figures"][name][0]
        for row in rows
        if name in row["figures"] and math.isfinite(row["figures"][name][0])
    ]
    if name in NO_ORDER or len(values) < FEWEST:
        return
    middle = median(values)
    spread = 1.4826 * median(abs(v - middle) for v in values)
    for row in rows:
        value, std = row["figures"].get(name, (math.nan, math.nan))
        width = math.hypot(spread, std if math.isfinite(std) else 0.0)
        if math.isfinite(value) and width > 0:
            row["distances"][name] = (value - middle) / width
    for row in rows:
        row.setdefault("far", [])
        if abs(row["distances"].get(name, 0.0)) > limit:
            row["far"].append(name)


def _flat(row: Mapping[str, Any], columns: Sequence[str]) -> dict[str, Any]:
    flat = {
        key: row[key]
        for key in (
            "gyro_id",
            "status",
            "passed",
            "why",
            "runs",
            "runs_failed",
            "chi2_per_dof",
            "verdict",
        )
    }
    flat["outliers"] = " ".join(row.get("far", []))
    for name in columns:
        value, std = row["figures"].get(name, (math.nan, math.nan))
        flat |= {name: value, f"{name}_std": std, f"{name}_z": row["distances"].get(name, math.nan)}
    return {
        key: None if isinstance(value, float) and math.isnan(value) else value
        for key, value in flat.items()
    }


def write_table(folder: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """`lot.csv`, and `lot.parquet` where pyarrow is installed; columns without a single value are
    left out."""
    import pandas as pd

    table = pd.DataFrame(
        [{spreadsheet(name): spreadsheet(value) for name, value in row.items()} for row in rows]
    ).convert_dtypes()
    table = table.drop(
        columns=[
            name
            for name in table
            if table[name].isna().all() and str(name).endswith(("_std", "_z"))
        ]
    )
    with store.atomic_path(folder / "lot.csv", force=True) as temporary:
        table.to_csv(temporary, index=False, lineterminator="\n")
    try:
        import pyarrow  # noqa: F401
    except ImportError:
        return
    with store.atomic_path(folder / "lot.parquet", force=True) as temporary:
        table.to_parquet(temporary, index=False)
