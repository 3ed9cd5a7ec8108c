"""What the tables in a diagnosis' JSON must hold for those who read them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

NUMBER = (int, float)
ROWS: Mapping[str, Mapping[str, type | tuple[type, ...]]] = {
    "values": {"name": str, "value": NUMBER, "std": NUMBER},
    "effects": {"name": str},
    "not_separable": {"effects": list},
    "wander": {"component": str},
}
"""By table, what each of its rows holds; a table may be missing."""


def find_report_problem(text: str) -> str | None:
    """What is wrong with the tables of a diagnosis' JSON object.

    Parameters
    ----------
    text
        The object's JSON.

    Returns
    -------
    str or None
        In words; None where its tables are as they are read.

    Examples
    --------
    >>> from hrg_cli.store.report_checks import find_report_problem
    >>> find_report_problem('{"effects": [{"name": "gain_step"}]}')
    >>> find_report_problem('{"effects": [{}]}')
    'is damaged: a row of effects has no name'
    """
    report = json.loads(text)
    for table, needed in ROWS.items():
        rows = report.get(table) or []
        if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
            return f"is damaged: {table} is no list of objects"
        for row in rows:
            for key, kind in needed.items():
                if not isinstance(row.get(key), kind) or isinstance(row[key], bool):
                    return f"is damaged: a row of {table} has no {key}"
    wrong = next((row["name"] for row in report.get("effects") or [] if _no_sizes(row)), None)
    return None if wrong is None else f"is damaged: the parameters of {wrong[:60]!r} are none"


def _no_sizes(row: Mapping[str, Any]) -> bool:
    """Whether the parameters of a cause are no table of values and standard deviations."""
    sizes = row.get("parameters") or {}
    return not isinstance(sizes, dict) or not all(
        isinstance(size, dict) and isinstance(size.get(key), (*NUMBER, type(None)))
        for size in sizes.values()
        for key in ("value", "std")
    )
