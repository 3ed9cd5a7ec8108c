"""The ledger for other programs: JSON lines (an object a result), CSV and Parquet (a row a result
and figure)."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from ..exporting_records import import_package
from ..reporting.text import escape_for_spreadsheet
from .entry import Entry

OF_ENTRY = (
    *("gyro_id", "kind", "processed", "measured", "added", "station", "operator", "fixture"),
    *("firmware", "order", "status", "verdict", "software", "file", "sha256"),
)
OF_FIGURE = ("figure", "value", "std", "units")


def _json_lines(entries: Sequence[Entry]) -> bytes:
    """One object a line: everything that is kept of a result."""
    return "".join(
        json.dumps(asdict(entry), ensure_ascii=False, allow_nan=False) + "\n" for entry in entries
    ).encode()


def _csv_table(entries: Sequence[Entry]) -> bytes:
    """A row a result and figure."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow((*OF_ENTRY, *OF_FIGURE))
    writer.writerows(_rows(entries))
    return text.getvalue().encode()


def _parquet_table(entries: Sequence[Entry]) -> bytes:
    """The same rows, typed. HrgError: pyarrow is not installed."""
    pyarrow, parquet = import_package("pyarrow"), import_package("pyarrow.parquet")
    rows = _rows(entries)
    columns = {
        name: pyarrow.array(
            [row[k] for row in rows],
            pyarrow.float64() if name in ("value", "std") else pyarrow.string(),
        )
        for k, name in enumerate((*OF_ENTRY, *OF_FIGURE))
    }
    sink = io.BytesIO()
    parquet.write_table(pyarrow.table(columns), sink)
    return sink.getvalue()


FORMATS: Mapping[str, Callable[[Sequence[Entry]], bytes]] = {
    ".jsonl": _json_lines,
    ".csv": _csv_table,
    ".parquet": _parquet_table,
}
"""Suffix of the output -> what makes its content."""


def _rows(entries: Sequence[Entry]) -> list[list[Any]]:
    """A row a result and figure; what a spreadsheet would take for a formula is text."""
    rows = (
        (*(getattr(entry, name) for name in OF_ENTRY), name, f.value, f.std, f.units)
        for entry in entries
        for name, f in entry.figures.items()
    )
    return [[escape_for_spreadsheet(value) for value in row] for row in rows]
