"""Parquet (pyarrow): columns of numbers and of time stamps, read by row batches."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import HrgError
from .log import BLOCK_ROWS, Blocks, Channel, Log, Reader, is_rising, need_library
from .unit_spellings import split_name


def _recognises(path: Path, head: bytes) -> bool:
    """The magic number PAR1."""
    return head[:4] == b"PAR1"


def _open_parquet(path: Path) -> Log:
    """The columns of a Parquet file. HrgError: pyarrow missing, damaged, no rows."""
    try:
        import pyarrow
        from pyarrow import parquet
    except ImportError as error:
        raise need_library("pyarrow", path) from error
    with parquet.ParquetFile(path) as file:
        schema, rows = file.schema_arrow, file.metadata.num_rows
        if rows <= 0:
            raise HrgError(f"{path}: holds no rows; record again")
        head = next(file.iter_batches(batch_size=200))
        channels = []
        for index, field in enumerate(schema):
            types = pyarrow.types
            number = (
                types.is_integer(field.type)
                or types.is_floating(field.type)
                or types.is_boolean(field.type)
            )
            clock = (
                types.is_timestamp(field.type)
                or types.is_duration(field.type)
                or types.is_time(field.type)
            )
            name, unit = split_name(field.name)
            rising = number and is_rising(_numbers(head.column(index)))
            channels.append(
                Channel(
                    name,
                    unit,
                    kind="number" if number else "clock" if clock else "text",
                    length=rows,
                    rising=rising,
                )
            )
        start = _start(head, schema)
    return Log(
        format="parquet",
        channels=tuple(channels),
        read=lambda indexes: _read(path, [schema.names[i] for i in indexes]),
        rows=rows,
        start_time=start,
    )


def _start(head: Any, schema: Any) -> str:
    """ISO 8601 text of the first time stamp; empty where no column holds one."""
    import pyarrow

    for index, field in enumerate(schema):
        if pyarrow.types.is_timestamp(field.type) and head.column(index)[0].is_valid:
            stamp = np.datetime64(
                int(
                    head.column(index)
                    .cast(pyarrow.timestamp("ns", field.type.tz))
                    .cast("int64")[0]
                    .as_py()
                ),
                "ns",
            )
            text = str(np.datetime_as_string(stamp, unit="ns"))
            return text.rstrip("0").rstrip(".") + "Z"
    return ""


def _read(path: Path, names: Sequence[str]) -> Blocks:
    from pyarrow import parquet

    origins: dict[str, int] = {}
    with parquet.ParquetFile(path) as file:
        for batch in file.iter_batches(batch_size=BLOCK_ROWS, columns=sorted(set(names))):
            yield [_numbers(batch.column(name), origins, name) for name in names]


def _numbers(column: Any, origins: dict[str, int] | None = None, name: str = "") -> np.ndarray:
    """Values as numbers; nulls become NaN, time stamps seconds since the first one (kept in
    `origins` for the blocks after)."""
    import pyarrow

    types = pyarrow.types
    if (
        types.is_timestamp(column.type)
        or types.is_duration(column.type)
        or types.is_time(column.type)
    ):
        unit = getattr(column.type, "unit", "ns")
        scale = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[unit]
        whole = column.cast("int64" if column.type.bit_width == 64 else "int32")
        raw = whole.to_numpy(zero_copy_only=False)
        if column.null_count:
            return (
                np.where(np.isnan(raw), np.nan, (raw - origins.setdefault(name, 0)) * scale)
                if origins is not None
                else raw * scale
            )
        origin = origins.setdefault(name, int(raw[0])) if origins is not None and len(raw) else 0
        return np.asarray((raw - origin) * scale)
    return np.asarray(column.to_numpy(zero_copy_only=False))


READER = Reader("parquet", _recognises, _open_parquet)
