"""Any kind of file for other programs: CSV, JSON, Parquet, Excel, MATLAB; `.gz` compresses the text
formats.

One row of the table is one row of the record (a window, a parameter, a node and angle); columns
carry their units in their names as in the file. Attributes and provenance go where the format has a
place: JSON, a second sheet, further MATLAB variables, Parquet's metadata.
"""

from __future__ import annotations

import gzip
import io
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from .errors import HrgError, UsageError
from .extras import tell_how_to_install
from .records import Array, Calibration, Record, Recording
from .reporting.text import escape_for_spreadsheet

FORMATS = (".csv", ".json", ".parquet", ".xlsx", ".mat")
HEADER = ".h"
"""What calibrations alone go to besides."""
EXCEL_ROWS = 1_048_575
"""Rows that a sheet takes below its head."""
LONGEST_CELL = 32_000
"""Characters of a text that a cell takes."""


def find_format(output: Path) -> tuple[str, bool]:
    """The format of an export, by its output's name.

    Parameters
    ----------
    output
        Its path.

    Returns
    -------
    tuple
        The ending, and whether it is compressed.

    Raises
    ------
    UsageError
        A binary format with .gz.

    Examples
    --------
    >>> from pathlib import Path
    >>> from hrg_cli.exporting_records import find_format
    >>> find_format(Path("wave.csv.gz"))
    ('.csv', True)
    """
    packed = output.suffix == ".gz"
    suffix = output.with_suffix("").suffix if packed else output.suffix
    if packed and suffix not in (".csv", ".json"):
        raise UsageError(
            f"{output}: .gz goes with .csv and .json; the other formats are compressed by"
            " themselves"
        )
    return suffix, packed


def export_record(record: Record, output: Path) -> bytes:
    """A record in the format of its output's name.

    Parameters
    ----------
    record
        Of any kind.
    output
        Its path, whose ending says the format; nothing is written.

    Returns
    -------
    bytes
        The file's content.

    Raises
    ------
    UsageError
        An unknown ending.
    HrgError
        A package is missing, or a sheet has not rows enough.

    Examples
    --------
    >>> import numpy as np
    >>> from pathlib import Path
    >>> from hrg_cli import Recording
    >>> from hrg_cli.exporting_records import export_record
    >>> run = Recording(c=np.array([0.5, 0.25]), s=np.zeros(2), sample_rate_hz=4.0, mode="free")
    >>> print(export_record(run, Path("run.csv")).decode(), end="")
    time_s,c,s
    0.0,0.5,0.0
    0.25,0.25,0.0
    """
    suffix, packed = find_format(output)
    if suffix not in _WRITERS:
        endings = (*FORMATS, HEADER) if isinstance(record, Calibration) else FORMATS
        raise UsageError(
            f"{output}: cannot export as {suffix or 'a file without an ending'}; end its name in"
            f" {', '.join(endings)}"
        )
    content = _WRITERS[suffix](record)
    return gzip.compress(content, mtime=0) if packed else content


def list_columns(record: Record) -> dict[str, Array]:
    """The table of a record: equally long columns, one name a number.

    Parameters
    ----------
    record
        Of any kind; of a calibration a row is a node and an angle.

    Returns
    -------
    dict
        Name -> (rows,); of a column of several numbers a row each becomes a column.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.exporting_records import list_columns
    >>> run = Recording(c=np.array([0.5, 0.25]), s=np.zeros(2), sample_rate_hz=4.0, mode="free")
    >>> {name: column.tolist() for name, column in list_columns(run).items()}
    {'time_s': [0.0, 0.25], 'c': [0.5, 0.25], 's': [0.0, 0.0]}
    """
    if isinstance(record, Recording):
        c, s = record.physical(0, len(record))
        return {"time_s": record.times(0, len(record)), "c": c, "s": s}
    if isinstance(record, Calibration):
        node, angle = np.meshgrid(
            np.asarray(record.node), np.asarray(record.wave_angle_rad), indexing="ij"
        )
        name = "temperature_degc" if record.axis == "temperature" else "frequency_hz"
        tables = ("drift_rad_s", "drift_rad_s_std", "scale_factor", "scale_factor_std")
        return {name: node.ravel(), "wave_angle_rad": angle.ravel()} | {
            n: np.asarray(getattr(record, n)).ravel() for n in tables
        }
    first = next((spec.dims[0] for spec in record.columns().values() if spec.dims), "row")
    found: dict[str, Array] = {}
    for name, spec in record.columns().items():
        value = getattr(record, name)
        if value is None or not spec.dims or spec.dims[0] != first:
            continue
        flat = (
            np.asarray(value).reshape(len(value), -1)
            if np.ndim(value) > 1
            else np.asarray(value)[:, None]
        )
        names = [name] if flat.shape[1] == 1 else [f"{name}_{k + 1}" for k in range(flat.shape[1])]
        found |= dict(zip(names, flat.T))
    return found


def list_attributes(record: Record) -> dict[str, Any]:
    """What stands beside a record's table: kind, status, attributes, where it comes from.

    Parameters
    ----------
    record
        Of any kind.

    Returns
    -------
    dict
        Name -> a number, a text or a list of texts.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.exporting_records import list_attributes
    >>> run = Recording(c=np.zeros(2), s=np.zeros(2), sample_rate_hz=4.0, mode="free", run_id="a")
    >>> found = list_attributes(run)
    >>> found["kind"], found["run_id"], found["sample_rate_hz"]
    ('recording', 'a', 4.0)
    """
    plain: dict[str, Any] = {
        "kind": record.kind,
        "status": record.status,
        "status_reasons": list(record.status_reasons),
    }
    for name, spec in record.columns().items():
        value = getattr(record, name)
        if spec.dims is None and value is not None and spec.group != "/truth":
            plain[name] = value.item() if hasattr(value, "item") else value
    provenance = record.provenance
    return plain | {
        "created": provenance.created,
        "generated_by": provenance.generated_by,
        "history": list(provenance.history),
    }


def _csv(record: Record) -> bytes:
    text = io.StringIO()
    _frame(record).to_csv(text, index=False, lineterminator="\n")
    return text.getvalue().encode()


def _json(record: Record) -> bytes:
    tree = list_attributes(record) | {
        "columns": {name: _listed(values) for name, values in list_columns(record).items()}
    }
    return (
        json.dumps(_finite(tree), ensure_ascii=False, allow_nan=False, indent=1) + "\n"
    ).encode()


def _parquet(record: Record) -> bytes:
    pyarrow, parquet = import_package("pyarrow"), import_package("pyarrow.parquet")
    table = pyarrow.Table.from_pandas(_frame(record), preserve_index=False)
    about = json.dumps(_finite(list_attributes(record)), ensure_ascii=False).encode()
    table = table.replace_schema_metadata({**(table.schema.metadata or {}), b"hrg": about})
    sink = io.BytesIO()
    parquet.write_table(table, sink)
    return sink.getvalue()


def _xlsx(record: Record) -> bytes:
    openpyxl = import_package("openpyxl")
    columns = list_columns(record)
    rows = len(next(iter(columns.values()), ()))
    if rows > EXCEL_ROWS:
        raise HrgError(
            f"the {record.kind} has {rows} rows, a sheet takes {EXCEL_ROWS}; export it as .parquet"
            " or .csv"
        )
    book = openpyxl.Workbook(write_only=True)
    sheet = book.create_sheet(record.kind)
    sheet.append(list(columns))
    for row in zip(*(_listed(values) for values in columns.values())):
        sheet.append([_safe(value) for value in row])
    about = book.create_sheet("about")
    for name, value in list_attributes(record).items():
        for part in value if isinstance(value, list) else [value]:
            about.append([name, _safe(part)])
    sink = io.BytesIO()
    book.save(sink)
    return sink.getvalue()


def _mat(record: Record) -> bytes:
    from scipy.io import savemat

    variables: dict[str, Any] = {}
    for name, spec in record.columns().items():
        value = getattr(record, name)
        if value is not None and spec.dims and spec.group != "/truth":
            array = np.asarray(value[:])
            variables[name] = array.astype(object) if array.dtype.kind in "OU" else array
    about = {
        name: "\n".join(map(str, v)) if isinstance(v, list) else v
        for name, v in list_attributes(record).items()
    }
    if isinstance(record, Recording):
        variables |= {name: values for name, values in list_columns(record).items()}
    sink = io.BytesIO()
    savemat(
        sink,  # type: ignore[arg-type]
        {record.kind: variables, "about": about},
        do_compression=True,
        long_field_names=True,
    )
    return sink.getvalue()


_WRITERS: Mapping[str, Callable[[Record], bytes]] = {
    ".csv": _csv,
    ".json": _json,
    ".parquet": _parquet,
    ".xlsx": _xlsx,
    ".mat": _mat,
}


def _frame(record: Record) -> Any:
    """The table for what spreadsheets open: texts of a file are none of their formulas."""
    import pandas as pd

    columns = list_columns(record)
    texts = {
        name: [escape_for_spreadsheet(value) for value in values.tolist()]
        for name, values in columns.items()
        if values.dtype.kind in "OU"
    }
    return pd.DataFrame(columns | texts)


def import_package(package: str) -> Any:
    """A package that a format needs.

    Parameters
    ----------
    package
        Its name, or a module's in it.

    Returns
    -------
    module
        Imported.

    Raises
    ------
    HrgError
        It is not installed.

    Examples
    --------
    >>> from hrg_cli.exporting_records import import_package
    >>> import_package("json.decoder").__name__
    'json.decoder'
    """
    from importlib import import_module

    try:
        return import_module(package)
    except ImportError as error:
        raise HrgError(f"this format needs {tell_how_to_install(package.split('.')[0])}") from error


def _listed(values: Array) -> list[Any]:
    return [v.decode() if isinstance(v, bytes) else v for v in np.asarray(values).tolist()]


def _finite(value: Any) -> Any:
    """JSON-able: NaN and infinity as null."""
    if isinstance(value, dict):
        return {k: _finite(v) for k, v in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(v) for v in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


def _safe(value: Any) -> Any:
    """A cell: text that a sheet would take for a formula stays text; what is not finite stays
    empty."""
    if isinstance(value, float) and not np.isfinite(value):
        return None
    if isinstance(value, str):
        return escape_for_spreadsheet(value)[:LONGEST_CELL]
    return value if isinstance(value, int | float | bool) or value is None else str(value)
