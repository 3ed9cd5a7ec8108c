"""read_table: any foreign log as a plain table, its columns named as the log names them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ..errors import HrgError, name_some
from .readers import guard_reading, open_log

LARGEST_TABLE = 1 << 28
"""Most values a table may hold in memory."""


def read_table(
    path: Path | str, *, separator: str | None = None, decimal: str | None = None
) -> Any:
    """Any foreign log as a plain table, its columns named as the log names them.

    Parameters
    ----------
    path
        The log, of any format that `import_log` reads.
    separator, decimal
        Of a text log; None: found.

    Returns
    -------
    pandas.DataFrame
        All columns of numbers or times (times in seconds); units stand in `attrs["units"]`.

    Raises
    ------
    HrgError
        Not readable, no numbers, a broken line, columns of different length, or more than 2^28
        values.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from hrg_cli.formats.table import read_table
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "rates.csv"
    ...     with path.open("w") as log:
    ...         print("time [min];table [deg/s]", "0;1,5", "1;3,0", sep=chr(10), file=log)
    ...     table = read_table(path)
    >>> table["table"].tolist(), table.attrs["units"]
    ([1.5, 3.0], {'time': 'min', 'table': 'deg/s'})
    """
    import pandas as pd

    path = Path(path)
    log = open_log(path, "", separator, decimal)
    chosen = [i for i, channel in enumerate(log.channels) if channel.kind != "text"]
    lengths = {log.channels[i].length for i in chosen}
    if len(lengths) > 1:
        shown = name_some(f"{log.channels[i].name} {log.channels[i].length}" for i in chosen)
        raise HrgError(
            f"{path}: its columns differ in length ({shown}); columns of one length were expected"
        )
    blocks, size = [], 0
    with guard_reading(path, log.format):
        for block in log.read(chosen):
            size += sum(len(column) for column in block)
            if size > LARGEST_TABLE:
                raise HrgError(
                    f"{path}: holds more than {LARGEST_TABLE} values; import it with `hrg import`,"
                    " which streams"
                )
            blocks.append(block)
    names = [log.channels[i].name for i in chosen]
    titles = [
        name if names.count(name) == 1 else f"{name} ({i + 1})" for i, name in zip(chosen, names)
    ]
    joined = [
        np.concatenate([b[k] for b in blocks]) if blocks else np.empty(0)
        for k in range(len(chosen))
    ]
    scaled = [
        (
            v * log.channels[i].scale_factor + log.channels[i].add_offset
            if log.channels[i].scale_factor != 1 or log.channels[i].add_offset
            else v
        )
        for i, v in zip(chosen, joined)
    ]
    table = pd.DataFrame({title: values for title, values in zip(titles, scaled)})
    table.attrs["units"] = {title: log.channels[i].units for title, i in zip(titles, chosen)}
    return table
