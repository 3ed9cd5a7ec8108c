"""A program of its own that reads a MATLAB file and hands its numbers over on standard output.

Damaged cells and structures make scipy's reader crash, not raise, and not every time; what crashes
here takes nothing with it. First a line of JSON, `{"arrays": [names], "scalars": {name: value}}`,
`{"error": sentence}` or `{"no_memory": true}`, then the arrays one after another as `.npy`. It
ends when standard input does: whoever started it holds that open. It imports nothing of the
package, so that it can be run from its file.
"""

from __future__ import annotations

import json
import os
import signal
import sys
import threading
import warnings
from pathlib import Path
from typing import Any

import numpy as np

LARGEST_BYTES = 8 << 30
LARGEST_RATIO = 1100
"""zlib reaches no more than about 1032."""
DEPTH = 4
"""Structures within structures that are opened."""
MOST_COLUMNS = 64
"""Columns of one matrix that are handed over."""


class ClaimError(Exception):
    """A variable claims more than its file can hold."""


def _read_numbers(path: Path) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    """Vectors, matrix columns and structure fields by name, and single numbers by name."""
    from scipy.io import loadmat, whosmat

    for name, shape, kind in whosmat(str(path)):
        _check_claim(name, shape, kind, path.stat().st_size)
    arrays: dict[str, np.ndarray] = {}
    scalars: dict[str, float] = {}
    for name, value in loadmat(str(path), squeeze_me=True, struct_as_record=True).items():
        if not name.startswith("__"):
            _flatten(name, value, arrays, scalars, DEPTH)
    return arrays, scalars


def _check_claim(name: str, shape: tuple[int, ...], kind: str, file_bytes: int) -> None:
    claimed = int(np.prod([int(n) for n in shape], dtype=object)) if shape else 0
    possible = min(LARGEST_BYTES, LARGEST_RATIO * file_bytes)
    if any(int(n) < 0 for n in shape) or claimed * 2 > possible:
        raise ClaimError(
            f"variable {name} ({kind}) claims {claimed} values, more than the file can hold; it is"
            " damaged"
        )


def _flatten(
    name: str, value: Any, arrays: dict[str, np.ndarray], scalars: dict[str, float], depth: int
) -> None:
    array = np.asarray(value)
    if array.dtype.names and depth:
        if array.size == 1:
            for field in array.dtype.names:
                _flatten(
                    f"{name}/{field}", array.reshape(())[()][field], arrays, scalars, depth - 1
                )
        return
    if array.dtype.kind not in "iufb":
        return
    if array.size == 1:
        scalars[name] = float(array.reshape(()))
    elif array.ndim == 1 and array.size:
        arrays[name] = array
    elif array.ndim == 2:
        for index, column in enumerate(split_columns(array), start=1):
            arrays[f"{name}/{index}"] = column


def split_columns(matrix: np.ndarray) -> list[np.ndarray]:
    """The first columns of a matrix, whichever way it lies: a channel is longer than there are
    channels.

    Parameters
    ----------
    matrix
        (n, k) or (k, n).

    Returns
    -------
    list of ndarray
        Of at most 64 columns (n,).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.formats.matlab_child import split_columns
    >>> [len(column) for column in split_columns(np.zeros((2, 1000)))]
    [1000, 1000]
    """
    tall = matrix if matrix.shape[0] >= matrix.shape[1] else matrix.T
    return [tall[:, index] for index in range(min(tall.shape[1], MOST_COLUMNS))]


def _said(error: Exception) -> str:
    """What a person is told of an error of the reader."""
    if isinstance(error, ClaimError):
        return str(error)
    words = str(error).splitlines()[0][:120] if str(error) else type(error).__name__
    return f"cannot be read as a MATLAB file ({words}); it is truncated or damaged: save it again"


def _hand_over(path: Path) -> None:
    """Read the file and write what it holds on standard output."""
    out = sys.stdout.buffer
    warnings.simplefilter("ignore")
    try:
        arrays, scalars = _read_numbers(path)
    except MemoryError:
        out.write(json.dumps({"no_memory": True}).encode() + b"\n")
        return
    except Exception as error:  # any: the reader's errors on damaged bytes are of every kind
        out.write(json.dumps({"error": _said(error)}).encode() + b"\n")
        return
    out.write(json.dumps({"arrays": list(arrays), "scalars": scalars}).encode() + b"\n")
    for array in arrays.values():
        np.lib.format.write_array(out, np.ascontiguousarray(array), allow_pickle=False)


def _end_with_parent() -> None:
    """End at Ctrl-C, also within the reader, and when standard input ends, as it does with the
    process that holds its other end."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)

    def watch() -> None:
        os.read(0, 1)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


if __name__ == "__main__":
    _end_with_parent()
    _hand_over(Path(sys.argv[1]))
