"""A lot's results into the ledger: every gyro's files, with the station and so on that the lot
tells of it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..lots.lot_tasks import make_safe_name
from . import database
from .entering import make_entry
from .entry import CIRCUMSTANCES


def enter_lot(
    ledger: Path, report: Mapping[str, Any], folder: Path, results: Sequence[str]
) -> dict[str, int]:
    """Enter the results of every gyro of a lot that did not fail, all or none.

    Parameters
    ----------
    ledger
        File of the ledger.
    report
        As `run_lot` gives it; its rows may tell `CIRCUMSTANCES`.
    folder
        Of the lot.
    results
        File names in each gyro's folder.

    Returns
    -------
    dict
        How many are new, and how many were known.

    Raises
    ------
    HrgError
        As `enter`.

    Examples
    --------
    A gyro that failed has nothing to enter:

    >>> import tempfile
    >>> from pathlib import Path
    >>> from hrg_cli.ledger.lots import enter_lot
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     row = {"gyro_id": "SN-1", "status": "failed"}
    ...     enter_lot(Path(folder) / "ledger.db", {"rows": [row]}, Path(folder), ["resonator.h5"])
    {'added': 0, 'known': 0}
    """
    entries = []
    for row in report["rows"]:
        if not row["gyro_id"] or row["status"] == "failed":
            continue
        given = {name: str(row[name]) for name in CIRCUMSTANCES if row.get(name)}
        given = {"order": str(report.get("lot_id", ""))} | given
        place = folder / make_safe_name(row["gyro_id"])
        found = [place / name for name in results if (place / name).is_file()]
        entries += [make_entry(path, row["gyro_id"], given) for path in found]
    new = sum(database.add_entries(ledger, entries))
    return {"added": new, "known": len(entries) - new}
