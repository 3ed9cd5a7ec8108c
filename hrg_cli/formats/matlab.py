"""MATLAB files of version 5 to 7 (scipy.io.loadmat); version 7.3 is HDF5 and read as such."""

from __future__ import annotations

import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import HrgError
from .log import Log, Reader, log_of_arrays
from .scalars import rate_of

LARGEST_BYTES = 8 << 30
LARGEST_RATIO = 1100
"""zlib reaches no more than about 1032."""
DEPTH = 4


def recognises(path: Path, head: bytes) -> bool:
    """The text header of MATLAB 5.0 files, and the byte-order word behind it."""
    return head.startswith(b"MATLAB 5.0") or (
        len(head) >= 128
        and head[126:128] in (b"IM", b"MI")
        and head[124:126] in (b"\x00\x01", b"\x01\x00")
    )


def open_matlab(path: Path) -> Log:
    """Every vector, matrix column and structure field as a column. HrgError: damaged, truncated, no
    numbers."""
    from scipy.io import loadmat, whosmat

    size = path.stat().st_size
    _try_in_a_child(path)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            for name, shape, kind in whosmat(str(path)):
                claimed = int(np.prod([int(n) for n in shape], dtype=object)) if shape else 0
                if any(int(n) < 0 for n in shape) or claimed * 2 > min(
                    LARGEST_BYTES, LARGEST_RATIO * size
                ):
                    raise HrgError(
                        f"{path}: variable {name} ({kind}) claims {claimed} values, more than the"
                        " file can hold; it is damaged"
                    )
            content = loadmat(str(path), squeeze_me=True, struct_as_record=True)
    except HrgError:
        raise
    except Exception as error:
        said = str(error).splitlines()[0][:120] if str(error) else type(error).__name__
        raise HrgError(
            f"{path}: cannot be read as a MATLAB file ({said}); it is truncated or damaged: save it"
            " again"
        ) from error
    arrays: dict[str, np.ndarray] = {}
    scalars: dict[str, float] = {}
    for name, value in content.items():
        if not name.startswith("__"):
            _flatten(name, value, arrays, scalars, DEPTH)
    if not arrays:
        raise HrgError(f"{path}: holds no vector of numbers; a variable a channel was expected")
    return log_of_arrays("matlab", arrays, sample_rate_hz=rate_of(scalars))


def _try_in_a_child(path: Path) -> None:
    """Load the file in a process of its own first: damaged cells and structures make scipy's reader
    crash, not raise."""
    program = "import sys, scipy.io; scipy.io.whosmat(sys.argv[1]); scipy.io.loadmat(sys.argv[1])"
    limit = 60 + path.stat().st_size / 1e6
    try:
        child = subprocess.run(
            [sys.executable, "-c", program, str(path)],
            capture_output=True,
            timeout=limit,
            check=False,
        )
    except subprocess.TimeoutExpired as error:
        raise HrgError(
            f"{path}: cannot be read as a MATLAB file within {limit:.0f} s; it is damaged, or"
            " unpacks to far more than its size: save it again, in parts"
        ) from error
    if child.returncode < 0:
        raise HrgError(
            f"{path}: cannot be read as a MATLAB file (scipy's reader crashed on it); it is"
            " damaged: save it again"
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
        tall = array if array.shape[0] >= array.shape[1] else array.T
        for index in range(min(tall.shape[1], 64)):
            arrays[f"{name}/{index + 1}"] = tall[:, index]


READER = Reader("matlab", recognises, open_matlab)
