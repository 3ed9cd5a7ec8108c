"""Whose recording a file is, and where it was made: told by the file, by the lot's file, or, where
the file cannot be read, by its name and its neighbours."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from .. import store
from ..errors import HrgError, NotHrgError
from ..formats.hdf5 import SIGNATURE
from ..records import Recording
from .groups import GROUPED_BY

LOOKED_AT_BYTES = 1 << 20
"""Head and tail of a damaged file in which a gyro's name is looked for; HDF5 keeps texts there."""
HDF5_SUFFIXES = (".h5", ".hdf5")
SHORTEST = 2
"""Characters of a gyro's name from which it is found by chance no more."""


@dataclass(frozen=True)
class Told:
    """What a recording says of itself: gyro, day of its start (empty: not said), and the keys that
    group gyros."""

    gyro_id: str
    day: str
    groups: Mapping[str, str]


def read_gyro_id(file: Path) -> Told | None:
    """What an hrg recording says of itself, by its attributes alone.

    Parameters
    ----------
    file
        A recording or a laboratory's log.

    Returns
    -------
    Told or None
        None of a log, which names no gyro in a way that is known here.

    Raises
    ------
    HrgError
        The file cannot be opened.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> from hrg_cli import Recording, store
    >>> from hrg_cli.lots.identity import read_gyro_id
    >>> c = np.zeros(16)
    >>> recording = Recording(c=c, s=c, sample_rate_hz=8000.0, mode="free", gyro_id="SN-1")
    >>> with TemporaryDirectory() as name:
    ...     _ = store.write(Path(name) / "run.h5", recording)
    ...     read_gyro_id(Path(name) / "run.h5").gyro_id
    'SN-1'
    """
    if not _may_be_hdf5(file):
        if file.suffix.lower() in HDF5_SUFFIXES:
            raise HrgError(
                f"{file}: is no HDF5 file, as its name says it is; copy it again, or give a log"
                " a name of its own kind (.csv)"
            )
        return None
    try:
        texts = store.read_heading(file, Recording, ("gyro_id", "start_time", *GROUPED_BY))
    except NotHrgError:
        return None
    gyro, start = texts.pop("gyro_id", ""), texts.pop("start_time", "")
    day = start[:10] if re.match(r"\d{4}-\d{2}-\d{2}", start) else ""
    return Told(gyro, day, {key: value for key, value in texts.items() if value})


def _may_be_hdf5(file: Path) -> bool:
    """Whether a file starts as HDF5 does, or cannot even be looked at."""
    try:
        with open(file, "rb") as opened:
            return opened.read(len(SIGNATURE)) == SIGNATURE
    except OSError:
        return True


def is_readable(file: Path) -> bool:
    """Whether every column of a recording is as declared.

    Parameters
    ----------
    file
        An hrg recording.

    Returns
    -------
    bool
        False where it cannot be opened, or a column is missing or of another shape.

    Examples
    --------
    >>> from pathlib import Path
    >>> from hrg_cli.lots.identity import is_readable
    >>> is_readable(Path("nowhere.h5"))
    False
    """
    try:
        with store.open_record(file, Recording):
            return True
    except HrgError:
        return False


def find_owner(file: Path, readable: Mapping[Path, str]) -> tuple[str, str]:
    """Whose a recording is that cannot be read, and what tells it.

    Parameters
    ----------
    file
        The recording.
    readable
        The gyro of every recording of the lot that could be read.

    Returns
    -------
    tuple of str
        Gyro, and by what it was told in words; two empty texts where nothing does.

    Examples
    --------
    >>> from pathlib import Path
    >>> from hrg_cli.lots.identity import find_owner
    >>> find_owner(Path("lot/SN-7_run2.h5"), {Path("lot/SN-7_run1.h5"): "SN-7"})
    ('SN-7', "by its file's name")
    """
    try:
        gyro = store.read_texts(file, Recording.kind, ("gyro_id",)).get("gyro_id", "")
        if gyro:
            return gyro, "its gyro_id can still be read"
    except HrgError:
        pass
    known = sorted({gyro for gyro in readable.values() if len(gyro) >= SHORTEST}, key=len)
    named = [gyro for gyro in known if _names(file.stem, gyro)]
    if named:
        return named[-1], "by its file's name"
    siblings = {
        gyro
        for path, gyro in readable.items()
        if path.parent == file.parent and _family(path.stem) == _family(file.stem) != ""
    }
    if len(siblings) == 1:
        return siblings.pop(), "by the names of the files beside it"
    inside = _names_held(file, known)
    if len(inside) == 1:
        return inside.pop(), "by the name in what is left of the file"
    around = [gyro for path, gyro in readable.items() if path.parent == file.parent]
    if len(around) > 1 and len(set(around)) == 1:
        return around[0], "by the files of its folder"
    return "", ""


def _names(stem: str, gyro: str) -> bool:
    """Whether a file's name holds a gyro's as a word of its own."""
    return bool(
        re.search(rf"(?<![A-Za-z0-9]){re.escape(gyro)}(?![A-Za-z0-9])", stem, re.IGNORECASE)
    )


def _family(stem: str) -> str:
    """A file's name less the number of its run: what the runs of one gyro have in common."""
    return re.sub(r"[-_. ]*(?:run)?[-_. ]*\d+$", "", stem, flags=re.IGNORECASE)


def _names_held(file: Path, known: Sequence[str]) -> set[str]:
    """The gyros whose names what is left of a file holds as texts of their own."""
    try:
        with open(file, "rb") as opened:
            data = opened.read(LOOKED_AT_BYTES)
            size = opened.seek(0, 2)
            if size > 2 * LOOKED_AT_BYTES:
                opened.seek(size - LOOKED_AT_BYTES)
                data += opened.read()
    except OSError:
        return set()
    if not known:
        return set()
    names = b"|".join(re.escape(gyro.encode()) for gyro in reversed(known))
    found = re.finditer(rb"\x00(" + names + rb")(?![A-Za-z0-9_.\- ])", data)
    return {match[1].decode() for match in found}


def group_keys(own: Mapping[str, str], told: Sequence[Told]) -> dict[str, str]:
    """The keys that group a gyro: what the lot's file says, else what all its recordings agree on.

    Parameters
    ----------
    own
        What the lot's file says of it.
    told
        What its recordings do.

    Returns
    -------
    dict
        Key of `GROUPED_BY` -> value, without those of which nothing is said.

    Examples
    --------
    >>> from hrg_cli.lots.identity import Told, group_keys
    >>> runs = [Told("SN-1", "", {"station": station, "operator": "Ada"}) for station in "12"]
    >>> group_keys({"fixture": "A"}, runs)
    {'fixture': 'A', 'operator': 'Ada'}
    """
    out = {}
    for key in GROUPED_BY:
        said = {one.groups[key] for one in told if one.groups.get(key)}
        value = own.get(key) or (said.pop() if len(said) == 1 else "")
        if value:
            out[key] = value
    return out
