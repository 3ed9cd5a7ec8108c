"""MATLAB files of version 5 to 7 (scipy.io.loadmat); version 7.3 is HDF5 and read as such."""

from __future__ import annotations

import subprocess
import sys
import tempfile
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
    with tempfile.TemporaryDirectory(prefix="hrg-matlab-") as folder:
        handed = Path(folder) / "columns.npz"
        _read_in_a_child(path, handed)
        with np.load(handed, allow_pickle=False) as columns:
            arrays = {name.removeprefix("/"): columns[name] for name in columns.files}
    scalars = {name: float(arrays.pop(name)) for name in list(arrays) if arrays[name].ndim == 0}
    if not arrays:
        raise HrgError(f"{path}: holds no vector of numbers; a variable a channel was expected")
    return log_of_arrays("matlab", arrays, sample_rate_hz=rate_of(scalars))


def _read_in_a_child(path: Path, handed: Path) -> None:
    """The file's numbers into `handed` by a process of its own: damaged cells and structures make
    scipy's reader crash, now and then, not raise."""
    program = (
        f"import sys; sys.path[:0] = sys.argv[3:]; from {__name__} import hand_over; hand_over()"
    )
    limit = 60 + path.stat().st_size / 1e6
    try:
        child = subprocess.run(
            [sys.executable, "-c", program, str(path), str(handed), *sys.path],
            capture_output=True,
            text=True,
            errors="replace",
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
    if child.returncode:
        said = (child.stderr.strip().splitlines() or ["no memory"])[-1][:160]
        raise HrgError(f"{path}: cannot be read as a MATLAB file ({said}); save it again")


def hand_over() -> None:
    """Read the file sys.argv[1] and write its vectors and scalars to sys.argv[2]; what is wrong is
    the last line on standard error, with exit status 1."""
    path, handed = sys.argv[1:3]
    try:
        arrays, scalars = _numbers(path)
        columns: dict[str, Any] = {f"/{name}": value for name, value in (arrays | scalars).items()}
        np.savez(handed, **columns)
    except Exception as error:
        said = str(error).splitlines()[0] if str(error) else type(error).__name__
        print(said, file=sys.stderr)
        raise SystemExit(1) from None


def _numbers(path: str) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    """Vectors and scalars of the file by name. ValueError: a variable claims more than the file
    holds."""
    from scipy.io import loadmat, whosmat

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for name, shape, kind in whosmat(path):
            claimed = int(np.prod([int(n) for n in shape], dtype=object)) if shape else 0
            if any(int(n) < 0 for n in shape) or claimed * 2 > min(
                LARGEST_BYTES, LARGEST_RATIO * Path(path).stat().st_size
            ):
                raise ValueError(
                    f"variable {name} ({kind}) claims {claimed} values, more than the file can hold"
                )
        content = loadmat(path, squeeze_me=True, struct_as_record=True)
    arrays: dict[str, np.ndarray] = {}
    scalars: dict[str, float] = {}
    for name, value in content.items():
        if not name.startswith("__"):
            _flatten(name, value, arrays, scalars, DEPTH)
    return arrays, scalars


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
