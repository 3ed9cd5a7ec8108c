"""The table of a lot: a row a gyro with its parameters, their errors, pass or fail, and how far it
stands from the lot."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any

from .. import store
from ..reporting.text import escape_for_spreadsheet, format_number, format_signed
from .gyro_page import label_figure
from .lot_settings import LotSettings
from .pooling import FEWEST, MAD, compute_far_limit

ROUNDING = 1e-9
"""Part of a value to which gyros agree that were given it."""
OWN_SIGMA = 2.0
"""Standard deviations of a gyro's own value within which it may be the lot's: badly measured is not
far off."""
NO_ORDER = ("damping_axis_rad", "stiffness_axis_rad")
"""Axes lie at random; none of them stands out."""


def judge_rows(
    lot: LotSettings, recordings: Sequence[Mapping[str, Any]], gyros: Sequence[Mapping[str, Any]]
) -> list[dict[str, Any]]:
    """Rows in the order of the gyros' names; every row has the same keys.

    Robust distance of a parameter x from the lot: z = (x − median)/(1.4826·MAD), MAD the median
    absolute deviation of the lot: the lot's own spread, whatever the gyro's σ says. Beyond
    `outlier_z`, or where that is not given beyond the distance that a lot of this size without
    outliers exceeds with a chance of `outlier_rate`, it is named in `outliers`, unless it is within
    `OWN_SIGMA` of its own σ. A gyro passes when all its stages gave a result of the status that the
    lot's file wants ("valid" where it says nothing; one that is refused never passes), none of its
    recordings failed and every limit holds.

    Parameters
    ----------
    lot
        Its settings.
    recordings, gyros
        What came of each.

    Returns
    -------
    list of dict
        `FIRST`, `outliers`, then of every figure value, σ and z; None what is not known.

    Examples
    --------
    The only recording of a gyro that failed:

    >>> from hrg_cli.lots.lot_settings import LotSettings
    >>> from hrg_cli.lots.lot_table import judge_rows
    >>> failed = {"gyro_id": "SN-1", "name": "a", "status": "failed", "error": "it is clipped"}
    >>> (row,) = judge_rows(LotSettings(), [failed], [])
    >>> row["gyro_id"], row["passed"], row["reason"]
    ('SN-1', False, 'a: it is clipped')
    """
    of_gyro: dict[Any, list[Mapping[str, Any]]] = {}
    for place, recording in enumerate(recordings):
        of_gyro.setdefault(recording["gyro_id"] or place, []).append(recording)
    rows = [_row(gyro, of_gyro.pop(gyro["gyro_id"], [])) for gyro in gyros]
    rows += [
        _row({"gyro_id": lost[0]["gyro_id"], "status": "failed", "error": ""}, lost)
        for lost in of_gyro.values()
    ]
    columns = list(dict.fromkeys(key for row in rows for key in row["figures"]))
    compared = [name for name in columns if name not in NO_ORDER]
    for name in compared:
        _distances(rows, name, lot.outlier_z, lot.outlier_rate / len(compared))
    for place, row in enumerate(sorted(rows, key=_badness, reverse=True), start=1):
        row["rank"] = place
        row["reason"] = _reason(row)
    return [_flat(row, columns) for row in rows]


def _row(gyro: Mapping[str, Any], recordings: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    results, answer = gyro.get("results", {}), gyro.get("answer") or {}
    failed = [r for r in recordings if r["status"] == "failed"]
    missed = [check for check in gyro.get("checks", []) if not check["passed"]]
    broken = [check["sentence"] for check in missed if check["name"] != "status"]
    refused = _list_refused(results, missed)
    lost = [r["error"] if r["name"] in r["error"] else f"{r['name']}: {r['error']}" for r in failed]
    failed_stage = [gyro["error"]] if gyro.get("error") else []
    if not results and not failed_stage and not lost:
        failed_stage.append(
            "no stage had runs to work on: identify needs free runs, calibrate forced ones"
        )
    why = [*failed_stage, *lost, *refused, *broken]
    causes, departure = answer.get("causes", []), answer.get("departure") or {}
    first = causes[0] if causes else {}
    return {
        "gyro_id": gyro["gyro_id"],
        "status": gyro["status"],
        "passed": not why,
        "why": "; ".join(why),
        "runs": len(recordings),
        "runs_failed": len(failed),
        "runs_undiagnosed": len(gyro.get("undiagnosed", ())),
        "chi2_per_dof": _number(results.get("identify", {}).get("chi2_per_dof")),
        "verdict": results.get("diagnose", {}).get("verdict", ""),
        "health": answer.get("health", ""),
        "cause": first.get("name", ""),
        "cause_size": first.get("size", ""),
        "cause_share": _number(first.get("share")),
        "causes": " ".join(c["name"] for c in causes),
        "error_before": _number(departure.get("before")),
        "error_after": _number(departure.get("after")),
        "error_of": f"{departure['words']}, {departure['unit']}" if departure else "",
        "sentence": answer.get("sentence", ""),
        "broken": refused + broken,
        "failed": failed_stage,
        "lost": lost,
        "missed": [*refused, *(answer.get("missed") or broken)],
        "figures": _figures(results),
        "distances": {},
        "far": [],
    }


def _list_refused(
    results: Mapping[str, Mapping[str, Any]], missed: Sequence[Mapping[str, Any]]
) -> list[str]:
    """Stages whose result is refused, or in doubt where the limits allow none, and why."""
    doubtful = [check["stage"] for check in missed if check["name"] == "status"]
    return [
        f"{stage} is {r['status']}: {'; '.join(r['status_reasons'])}"
        for stage, r in results.items()
        if r["status"] == "refused" or stage in doubtful
    ]


def _figures(results: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    """Parameters and figures of a gyro as (value, σ): those beside the causes of its diagnosis
    where it has one, else those identified."""
    figures: dict[str, tuple[float, float]] = {}
    parameters = {
        p["name"]: p
        for p in results.get("diagnose", {}).get("values") or []
        if not p.get("assumed")
    } or results.get("identify", {}).get("parameters", {})
    for name, parameter in parameters.items():
        figures[name] = (_number(parameter["value"]), _number(parameter["std"]))
    calibrated = results.get("calibrate", {})
    for name in ("drift_rms_rad_s", "scale_factor_rms_ppm"):
        for when, value in (calibrated.get(name) or {}).items():
            figures[f"{name}_{when}"] = (_number(value), math.nan)
    if "scale_factor" in calibrated:
        figures["calibrated_scale_factor"] = (_number(calibrated["scale_factor"]), math.nan)
    return figures


def _badness(row: Mapping[str, Any]) -> tuple[int, float, float]:
    """How bad a gyro stands: limits missed or results refused; no result; a fault; a recording
    lost; an outlier; then by its error and by how far it stands off the lot."""
    kinds = (
        bool(row["broken"]),
        row["status"] == "failed",
        row["health"] not in ("", "sound", "not examined"),
        row["runs_failed"] > 0,
        bool(row["far"]),
    )
    worst = next((len(kinds) - k for k, there in enumerate(kinds) if there), 0)
    error = row["error_before"] if row["error_of"].startswith("drift") else 0.0
    return (
        worst,
        error if math.isfinite(error) else 0.0,
        max((abs(row["distances"][name]) for name in row["far"]), default=0.0),
    )


def _reason(row: Mapping[str, Any]) -> str:
    """Why a gyro is not as it should be, shortest first: its cause, what failed, where it stands
    off the lot; empty where all is well."""
    said = []
    if row["cause"]:
        of = f" of {row['cause_size']}" if row["cause_size"] else ""
        said.append(row["cause"].replace("_", " ") + of)
        if math.isfinite(row["cause_share"]):
            error = f"{format_number(row['error_before'], 3)} {row['error_of'].partition(', ')[2]}"
            said[-1] += f", {100 * row['cause_share']:.0f} % of {error}"
    elif row["health"] == "in doubt":
        said.append(f"{row['verdict']}: no known cause")
    said += [*row["failed"], *row["missed"], *row["lost"]]
    said += [
        f"{label_figure(name)} {format_signed(row['distances'][name])} robust σ off the lot"
        for name in row["far"]
    ]
    return "; ".join(said)


def _number(value: Any) -> float:
    return float(value) if isinstance(value, int | float) else math.nan


def _distances(rows: list[dict[str, Any]], name: str, fixed: float | None, rate: float) -> None:
    values = [
        row["figures"][name][0]
        for row in rows
        if name in row["figures"] and math.isfinite(row["figures"][name][0])
    ]
    if len(values) < FEWEST:
        return
    limit = compute_far_limit(len(values), rate) if fixed is None else fixed
    middle = median(values)
    # gyros whose value is held all agree; rounding is no spread
    spread = max(MAD * median(abs(v - middle) for v in values), ROUNDING * abs(middle))
    for row in rows:
        value, std = row["figures"].get(name, (math.nan, math.nan))
        if math.isfinite(value) and spread > 0:
            row["distances"][name] = (value - middle) / spread
        if math.isfinite(std) and abs(value - middle) <= OWN_SIGMA * std:
            continue
        if abs(row["distances"].get(name, 0.0)) > limit:
            row["far"].append(name)


FIRST = (
    "gyro_id", "rank", "status", "passed", "reason", "why", "runs", "runs_failed",
    "runs_undiagnosed", "chi2_per_dof", "verdict", "health", "cause", "cause_size", "cause_share",
    "causes", "error_before", "error_after", "error_of", "sentence",
)  # fmt: skip
"""Columns before the parameters; station, fixture, … and day follow where the lot knows them."""


def _flat(row: Mapping[str, Any], columns: Sequence[str]) -> dict[str, Any]:
    flat = {key: row[key] for key in FIRST}
    flat["outliers"] = " ".join(row["far"])
    for name in columns:
        value, std = row["figures"].get(name, (math.nan, math.nan))
        flat |= {name: value, f"{name}_std": std, f"{name}_z": row["distances"].get(name, math.nan)}
    return {
        key: None if isinstance(value, float) and math.isnan(value) else value
        for key, value in flat.items()
    }


def write_table(folder: Path, rows: Sequence[Mapping[str, Any]]) -> None:
    """Write `lot.csv`, and `lot.parquet` where pyarrow is installed.

    Columns of σ or z without a single value are left out.

    Parameters
    ----------
    folder
        Of the lot.
    rows
        All of the same keys.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from hrg_cli.lots.lot_table import write_table
    >>> row = {"gyro_id": "SN-1", "scale_factor": 0.55, "scale_factor_z": None}
    >>> with TemporaryDirectory() as name:
    ...     write_table(Path(name), [row])
    ...     (Path(name) / "lot.csv").read_text().splitlines()
    ['gyro_id,scale_factor', 'SN-1,0.55']
    """
    import pandas as pd

    table = pd.DataFrame(
        [
            {
                escape_for_spreadsheet(name): escape_for_spreadsheet(value)
                for name, value in row.items()
            }
            for row in rows
        ]
    ).convert_dtypes()
    table = table.drop(
        columns=[
            name
            for name in table
            if table[name].isna().all() and str(name).endswith(("_std", "_z"))
        ]
    )
    with store.write_whole(folder / "lot.csv", force=True) as temporary:
        table.to_csv(temporary, index=False, lineterminator="\n")
    try:
        import pyarrow  # noqa: F401
    except ImportError:
        return
    with store.write_whole(folder / "lot.parquet", force=True) as temporary:
        table.to_parquet(temporary, index=False)
