"""A lot's results into the ledger: every gyro's files, with the station and so on that the lot tells
of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..lots.lot_tasks import make_safe_name
from . import database
from .entering import entry_of
from .entry import CIRCUMSTANCES


def enter_lot(
    ledger: Path, report: Mapping[str, Any], folder: Path, results: Sequence[str]
) -> dict[str, int]:
    """Enter the results (file names) of every gyro of a lot that did not fail, all or none; how many
    are new and known. report: as `run_lot` gives it, whose rows may have `CIRCUMSTANCES`."""
    entries = []
    for row in report["rows"]:
        if not row["gyro_id"] or row["status"] == "failed":
            continue
        given = {name: str(row[name]) for name in CIRCUMSTANCES if row.get(name)}
        given = {"order": str(report.get("lot_id", ""))} | given
        place = folder / make_safe_name(row["gyro_id"])
        found = [place / name for name in results if (place / name).is_file()]
        entries += [entry_of(path, row["gyro_id"], given) for path in found]
    new = sum(database.add(ledger, entries))
    return {"added": new, "known": len(entries) - new}
