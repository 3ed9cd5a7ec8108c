"""MATLAB files of version 5 to 7 (scipy.io.loadmat, in a process of its own: matlab_child.py);
version 7.3 is HDF5 and read as such."""

from __future__ import annotations

import json
import subprocess
import sys
from functools import partial
from pathlib import Path
from threading import Timer
from types import SimpleNamespace
from typing import IO

import numpy as np

from ..errors import HrgError
from . import matlab_child
from .log import Log, Reader, make_log
from .scalars import find_rate

LEAST_S, S_PER_BYTE = 60.0, 1e-6
"""Time after which a file is given up, and what is added for its size."""


def _recognises(path: Path, head: bytes) -> bool:
    """The text header of MATLAB 5.0 files, and the byte-order word behind it."""
    return head.startswith(b"MATLAB 5.0") or (
        len(head) >= 128
        and head[126:128] in (b"IM", b"MI")
        and head[124:126] in (b"\x00\x01", b"\x01\x00")
    )


def _open_matlab(path: Path) -> Log:
    """Every vector, matrix column and structure field as a column. HrgError: damaged, truncated, no
    numbers."""
    arrays, scalars = _read_in_a_child(path)
    if not arrays:
        raise HrgError(f"{path}: holds no vector of numbers; a variable a channel was expected")
    return make_log("matlab", arrays, sample_rate_hz=find_rate(scalars))


def _read_in_a_child(path: Path) -> tuple[dict[str, np.ndarray], dict[str, float]]:
    """The file's numbers, read by a process of its own that may crash or hang on damaged bytes, and
    that ends with this one: its standard input is a pipe that only this process holds open.
    MemoryError: there is no room for them."""
    limit_s = LEAST_S + S_PER_BYTE * path.stat().st_size
    # -P: the folder of the program, whose modules are named after formats, is not searched
    program = [sys.executable, "-P", str(matlab_child.__file__), str(path)]
    late = False

    def give_up() -> None:
        nonlocal late
        late = True
        child.kill()

    with subprocess.Popen(
        program, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    ) as child:
        timer = Timer(limit_s, give_up)
        timer.start()
        try:
            assert child.stdout is not None
            told, arrays = _receive(child.stdout)
            child.wait()  # while its standard input is open
        except (ValueError, EOFError):
            told, arrays = {}, {}
        except BaseException:
            child.kill()
            raise
        finally:
            timer.cancel()
    if late:
        raise HrgError(
            f"{path}: cannot be read as a MATLAB file within {limit_s:.0f} s; it is damaged, or"
            " unpacks to far more than its size: save it again, in parts"
        )
    if child.returncode != 0 or not told:
        raise HrgError(
            f"{path}: cannot be read as a MATLAB file (scipy's reader crashed on it); it is"
            " damaged: save it again"
        )
    if "no_memory" in told:
        raise MemoryError
    if "error" in told:
        raise HrgError(f"{path}: {told['error']}")
    return arrays, told["scalars"]


def _receive(stream: IO[bytes]) -> tuple[dict, dict[str, np.ndarray]]:
    """What the child tells, and its arrays. ValueError, EOFError: it ended before its last."""
    told = json.loads(stream.readline())
    # numpy asks what looks like a file for its position; a pipe has none
    pipe = SimpleNamespace(read=stream.read)
    read_next = partial(np.lib.format.read_array, pipe, allow_pickle=False)
    return told, {name: read_next() for name in told.get("arrays", [])}


READER = Reader("matlab", _recognises, _open_matlab)
