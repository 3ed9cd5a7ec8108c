"""A lot in words, for its page and the terminal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .text import clean_text

WORST = 3
"""Gyros that are told first."""


def make_sentence(report: Mapping[str, Any]) -> str:
    """A lot in one or two sentences.

    Parameters
    ----------
    report
        As `run_lot` gives it.

    Returns
    -------
    str
        For a person.

    Examples
    --------
    >>> from hrg_cli.reporting.lot_words import make_sentence
    >>> rows = [{"gyro_id": f"SN-{k}", "health": "sound"} for k in (1, 2)]
    >>> make_sentence({"rows": rows, "passed": 1, "outliers": []})
    '1 of 2 gyros did not pass.'
    """
    rows, passed = report["rows"], report["passed"]
    known = [row for row in rows if row["gyro_id"]]
    failed, strays = len(known) - passed, len(rows) - len(known)
    faulty = [r for r in rows if r["health"] not in ("", "sound", "not examined")]
    text = (
        "No gyro is known"
        if not known
        else ("The gyro passed" if len(known) == 1 else f"All {len(known)} gyros passed")
        if not failed
        else f"{failed} of {len(known)} gyros did not pass"
    )
    if strays:
        text += f"; {strays} {'recording is' if strays == 1 else 'recordings are'} of no known gyro"
    if faulty:
        are = "has a fault or is" if len(faulty) == 1 else "have a fault or are"
        text += f"; {len(faulty)} {are} in doubt"
    if off := len(report["outliers"]):
        text += f"; {off} {'stands' if off == 1 else 'stand'} off the lot"
    text += "."
    common = report.get("lot_causes", [])
    told = "; ".join(clean_text(one["sentence"]) for one in common[:3])
    if common:
        text += f" In common: {told}{f' and {len(common) - 3} more' if len(common) > 3 else ''}."
    elif (report.get("lot_tests") or {}).get("gyros_diagnosed", 0) and report["lot_tests"]["pairs"]:
        text += " No cause is common to the gyros or to a group of them."
    if left := report.get("runs_undiagnosed", 0):
        text += (
            f" The diagnoses are of the free runs alone: {left} forced"
            f" {'run is' if left == 1 else 'runs are'} in none; hrg diagnose GYRO/*.wave.h5 takes"
            " all."
        )
    return text
