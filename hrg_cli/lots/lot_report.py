"""The report of a lot: its status and why, and every gyro's row."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from .lot_settings import LotSettings

MOST_NAMED, MOST_TOLD = 6, 20
"""Gyros that a sentence names; gyros that did not pass of which each has a sentence of its own."""


def make_paths_plain(result: Mapping[str, Any], folder: Path, lot_file: Path) -> dict[str, Any]:
    """A result whose sentences name files relative to the lot.

    So the table does not depend on where it lies.

    Parameters
    ----------
    result
        Of a recording or a gyro.
    folder
        Of the lot.
    lot_file
        Beside which its recordings lie.

    Returns
    -------
    dict
        The same with every text in it shortened.

    Examples
    --------
    >>> from pathlib import Path
    >>> from hrg_cli.lots.lot_report import make_paths_plain
    >>> told = {"error": "/data/SN-1.h5: it is clipped", "runs": ["/out/SN-1/a.wave.h5"]}
    >>> make_paths_plain(told, Path("/out"), Path("/data/lot.toml"))
    {'error': 'SN-1.h5: it is clipped', 'runs': ['SN-1/a.wave.h5']}
    """

    def strip(value: Any) -> Any:
        if isinstance(value, str):
            for root in (folder.absolute(), folder, lot_file.parent.absolute(), lot_file.parent):
                value = value.replace(f"{root}/", "") if str(root) != "." else value
            return value
        if isinstance(value, Mapping):
            return {key: strip(inner) for key, inner in value.items()}
        return [strip(inner) for inner in value] if isinstance(value, list) else value

    return {key: strip(value) for key, value in result.items()}


def read_measured(
    rows: Sequence[Mapping[str, Any]], gyros: Sequence[Mapping[str, Any]]
) -> list[dict[str, tuple[float, float]]]:
    """Every figure of these gyros with its error, from the table.

    Parameters
    ----------
    rows
        Of the table.
    gyros
        In whose order they are wanted.

    Returns
    -------
    list of dict
        Of each gyro, name -> (value, σ), NaN where σ is not known; without figures it does not
        have.

    Examples
    --------
    >>> from hrg_cli.lots.lot_report import read_measured
    >>> row = {"gyro_id": "SN-1", "scale_factor": 0.55, "scale_factor_std": 1e-5}
    >>> read_measured([row | {"scale_factor_z": 0.2}], [{"gyro_id": "SN-1"}])
    [{'scale_factor': (0.55, 1e-05)}]
    """
    of = {row["gyro_id"]: row for row in rows}
    names = [key.removesuffix("_z") for key in (rows[0] if rows else {}) if key.endswith("_z")]
    return [
        {
            name: (row[name], math.nan if row[f"{name}_std"] is None else row[f"{name}_std"])
            for name in names
            if (row := of[gyro["gyro_id"]])[name] is not None
        }
        for gyro in gyros
    ]


def make_lot_report(
    lot: LotSettings, rows: list[dict[str, Any]], recordings: list[dict[str, Any]]
) -> dict[str, Any]:
    """The report of a lot: its status and why, how many gyros passed, and every gyro's row.

    Parameters
    ----------
    lot
        Its settings.
    rows
        Of the table.
    recordings
        What came of each.

    Returns
    -------
    dict
        Refused: a gyro did not pass, or a recording cannot be read; suspect: one has a fault,
        stands off the lot, or has a result in doubt.

    Examples
    --------
    >>> from hrg_cli.lots.lot_report import make_lot_report
    >>> from hrg_cli.lots.lot_settings import LotSettings
    >>> row = {"gyro_id": "SN-1", "rank": 1, "passed": False, "reason": "it is clipped"}
    >>> row |= {"status": "failed", "health": "", "outliers": "", "runs_undiagnosed": 0}
    >>> report = make_lot_report(LotSettings(), [row], [])
    >>> report["status"], report["status_reasons"], report["passed"]
    ('refused', ['SN-1: it is clipped'], 0)
    """
    passed = [row for row in rows if row["passed"]]
    worst = sorted((row for row in rows if not row["passed"]), key=lambda row: row["rank"])
    reasons = [f"{row['gyro_id'] or 'a recording'}: {row['reason']}" for row in worst[:MOST_TOLD]]
    if untold := sum(bool(row["gyro_id"]) for row in worst[MOST_TOLD:]):
        reasons.append(f"{untold} more gyros did not pass; lot.csv says why")
    known = sum(bool(row["gyro_id"]) for row in rows)
    unreadable = [r for r in recordings if r.get("unreadable")]
    doubts = {
        ("has a fault or is in doubt", "have a fault or are in doubt"): [
            r for r in passed if r["health"] not in ("", "sound", "not examined")
        ],
        ("stands off the lot", "stand off the lot"): [r for r in passed if r["outliers"]],
        ("has a suspect result", "have a suspect result"): [
            r for r in passed if r["status"] == "suspect"
        ],
    }
    for (one, several), ones in doubts.items():
        if ones:
            named = sorted(ones, key=lambda row: row["rank"])[:MOST_NAMED]
            more = f" and {len(ones) - len(named)} more" if len(ones) > len(named) else ""
            reasons.append(
                f"{len(ones)} of {known} gyros {one if len(ones) == 1 else several}:"
                f" {', '.join(str(row['gyro_id']) for row in named)}{more}"
            )
    refused = worst or unreadable or not rows
    return {
        "kind": "lot",
        "status": "refused" if refused else "suspect" if any(doubts.values()) else "valid",
        "status_reasons": reasons,
        "lot_id": lot.lot_id,
        "gyros": known,
        "passed": len(passed),
        "recordings": len(recordings),
        "recordings_failed": sum(r["status"] == "failed" for r in recordings),
        "unreadable": [
            {key: r[key] for key in ("name", "gyro_id", "told_by", "error")} for r in unreadable
        ],
        "runs_undiagnosed": sum(row["runs_undiagnosed"] for row in rows),
        "outliers": [row["gyro_id"] for row in rows if row["outliers"]],
        "outlier_rate": None if lot.outlier_z is not None else lot.outlier_rate,
        "worst": [row["gyro_id"] for row in sorted(rows, key=lambda row: row["rank"])[:3]],
        "rows": rows,
    }
