"""Several results held against one file of limits: tables for the kinds, and limits outside a table
for all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from .errors import UsageError
from .limit_values import suggest
from .limits import Row, check, check_tables, is_group, list_figures
from .records import Record
from .records.replaced import find_replaced

WORDS = ("status", "verdict")
"""Limits that are words."""


def hold(records: Sequence[Record], limits: Mapping[str, Any]) -> list[list[Row]]:
    """Rows of `limits.check` for each of several results, none for one without limits.

    A limit outside a table is held against every result that has such a figure; what the table of
    its kind says of the same figure goes first. One that no result has does not pass. Of a linear
    resonator that a diagnosis beside it explains nothing is held: the diagnosis' own stands in its
    place.

    Parameters
    ----------
    records
        The results.
    limits
        Of a limits file.

    Returns
    -------
    list of list of Row
        Of each result, in their order.

    Raises
    ------
    UsageError
        As of `check`.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Resonator
    >>> from hrg_cli.holding import hold
    >>> one = np.ones(1)
    >>> found = Resonator(
    ...     name=np.array(["scale_factor"]), units=np.array(["1"]), value=0.55 * one, std=one,
    ...     covariance=np.eye(1),
    ... )
    >>> [[row.passed for row in rows] for rows in hold([found], {"scale_factor": 0.56})]
    [[True, True]]
    """
    check_tables(limits)
    outside = {name: value for name, value in limits.items() if not is_group(value)}
    known = [_names_of(record) if outside else set() for record in records]
    nowhere = {name for name in outside if not any(name in names for names in known)}
    for name in sorted(nowhere):
        if hint := suggest(name, sorted({*WORDS}.union(*known))):
            raise UsageError(f"limit {name} is no figure of these files; {hint}")
    rows, replaced = [], find_replaced(records)
    for place, (names, record) in enumerate(zip(known, records, strict=True)):
        taken = names | (nowhere if record is records[0] else set())
        table = {name: value for name, value in outside.items() if name in taken}
        own = limits.get(record.kind)
        table |= own if isinstance(own, Mapping) else {}
        wanted = table and place not in replaced
        rows.append(check(record, {record.kind: table}) if wanted else [])
    return rows


def concerns(limits: Mapping[str, Any], kind: str) -> bool:
    """Whether limits may say something of a kind of file.

    Parameters
    ----------
    limits
        Of a limits file.
    kind
        Of the file.

    Returns
    -------
    bool
        True where there is a limit outside a table.

    Examples
    --------
    >>> from hrg_cli.holding import concerns
    >>> concerns({"resonator": {"scale_factor": 0.56}}, "calibration")
    False
    """
    return kind in limits or not all(is_group(value) for value in limits.values())


def _names_of(record: Record) -> set[str]:
    """What a limit may name in a result."""
    return {*list_figures(record), "status"} | (
        {"verdict"} if record.kind == "diagnosis" else set()
    )
