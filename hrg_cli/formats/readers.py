"""The formats known, in the order they are asked; and the one way to open a foreign log."""

from __future__ import annotations

import contextlib
import os
import struct
from collections.abc import Iterator
from pathlib import Path

from ..errors import HrgError
from ..store.handles import explain_reading
from . import audio, hdf5, matlab, numpy_arrays, parquet, tdms, text_logs
from .log import Log, Reader
from .unpacked import is_packed, open_unpacked

READERS: tuple[Reader, ...] = (
    audio.READER,
    hdf5.READER,
    matlab.READER,
    tdms.READER,
    parquet.READER,
    numpy_arrays.READER,
    text_logs.READER,
)
"""To add a format: one file with a READER, one line here. The text reader stays last: it recognises
anything readable."""

EXPECTED = "a log was expected: CSV or other text, WAV, FLAC, MATLAB, NumPy, TDMS, Parquet or HDF5"


def open_log(
    path: Path | str, format: str = "", separator: str | None = None, decimal: str | None = None
) -> Log:
    """The log of a file, its format told by its content and never by its name.

    Parameters
    ----------
    path
        The file.
    format
        Its name, where it is not to be told by the content.
    separator, decimal
        Of a text log; None: found.

    Returns
    -------
    Log
        Of which no row is read yet.

    Raises
    ------
    HrgError
        Missing, not readable, of no known format, or damaged.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from hrg_cli.formats.readers import open_log
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder) / "run.log"
    ...     with path.open("wb") as file:
    ...         np.savez(file, c=np.ones(8), s=np.zeros(8), fs=1e4)
    ...     log = open_log(path)
    >>> log.format, [channel.name for channel in log.channels], log.sample_rate_hz
    ('numpy', ['c', 's'], 10000.0)
    """
    path = Path(path)
    head = _head(path)
    known = {reader.name: reader for reader in READERS}
    if format and format not in known:
        raise HrgError(f"format is {format!r}, expected one of {', '.join(known)}")
    readers = (text_logs.READER,) if is_packed(path) else READERS
    reader = known.get(format) or next((r for r in readers if r.recognises(path, head)), None)
    if reader is None and is_packed(path):
        raise HrgError(
            f"{path}: is compressed (gzip) and no text inside, which alone is read so; unpack it"
            " first"
        )
    if reader is None:
        raise HrgError(
            f"{path}: is of no format known here (it begins with {head[:8]!r}); {EXPECTED}"
        )
    with guard_reading(path, reader.name):
        return (
            reader.open(path, separator, decimal)
            if reader is text_logs.READER
            else reader.open(path)
        )


def _head(path: Path) -> bytes:
    if not path.exists():
        raise HrgError(f"{path}: no such file; name a log that a laboratory recorded")
    if path.is_dir():
        raise HrgError(f"{path}: is a folder; name a file in it")
    if not path.is_file():
        raise HrgError(f"{path}: is not a regular file; save the log to a file first")
    if not os.access(path, os.R_OK):
        raise HrgError(f"{path}: no right to read it; ask for read access")
    with explain_reading(path), open_unpacked(path) as file:
        head = file.read(4096)
    if not head:
        raise HrgError(f"{path}: is empty; {EXPECTED}")
    return head


@contextlib.contextmanager
def guard_reading(path: Path, format: str) -> Iterator[None]:
    """Every way in which a library fails on a damaged file becomes one sentence.

    Parameters
    ----------
    path
        The file that is read within.
    format
        Its name.

    Returns
    -------
    context manager
        Errors of this program pass as they are.

    Raises
    ------
    HrgError
        Any error of reading.

    Examples
    --------
    >>> from pathlib import Path
    >>> from hrg_cli.formats.readers import guard_reading
    >>> with guard_reading(Path("run.wav"), "audio"):
    ...     raise ValueError("chunk of -1 bytes")
    Traceback (most recent call last):
    ...
    hrg_cli.errors.HrgError: run.wav: cannot be read as audio (chunk of -1 bytes); it is damaged ...
    """
    try:
        yield
    except HrgError:
        raise
    except FileNotFoundError as error:
        raise HrgError(f"{path}: vanished while it was read; copy it again") from error
    except MemoryError as error:
        raise HrgError(
            f"{path}: claims more data than fits in memory; it is damaged or needs to be cut into"
            " parts"
        ) from error
    except (
        ValueError,
        OSError,
        RuntimeError,
        LookupError,
        TypeError,
        ArithmeticError,
        AttributeError,
        EOFError,
        struct.error,
        AssertionError,
        NotImplementedError,
    ) as error:
        said = str(error).strip("'\"").splitlines()[0][:140] if str(error) else type(error).__name__
        raise HrgError(
            f"{path}: cannot be read as {format} ({said}); it is damaged or of a variant not known"
            " here: export it again"
        ) from error
