"""What a file says of itself before its datasets are looked at: kind, attributes, provenance,
checksums."""

from __future__ import annotations

import contextlib
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ..errors import HrgError, NotHrgError
from ..records import Column, Provenance, Record, Source
from ..version import __version__
from . import checksums
from .dataset_checks import decode_text, find_item, need_inside
from .handles import Handle, explain_reading, has_signature
from .layout import BY_NAME, FORMAT, FORMAT_VERSION, find_place, make_default
from .validity import find_attribute_problem


def find_provenance(path: Path | str) -> Provenance:
    """Where a file comes from, without reading its datasets.

    Parameters
    ----------
    path
        An hrg file (HDF5).

    Returns
    -------
    Provenance
        Commands that led to it, settings of the last, sources with their digests, time and version.

    Raises
    ------
    HrgError
        The file cannot be opened, or its provenance is no JSON.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> from hrg_cli import Recording, store
    >>> path = tempfile.mkdtemp() + "/run.h5"
    >>> run = Recording(c=np.zeros(3), s=np.ones(3), sample_rate_hz=10.0, mode="free")
    >>> _ = store.write(path, run)
    >>> store.find_provenance(path).sources
    ()
    """
    with open_for_reading(Path(path)) as file:
        return read_provenance(file, Path(path))


def is_hdf5(path: Path | str) -> bool:
    """Whether the file's first bytes are those of HDF5.

    Parameters
    ----------
    path
        Any file.

    Returns
    -------
    bool
        True where they are.

    Raises
    ------
    HrgError
        They cannot be read.

    Examples
    --------
    >>> import tempfile
    >>> from hrg_cli import store
    >>> with tempfile.NamedTemporaryFile() as empty:
    ...     store.is_hdf5(empty.name)
    False
    """
    with explain_reading(Path(path)):
        return has_signature(Path(path))


def find_kind(path: Path | str) -> type[Record]:
    """The kind of record in a file.

    Parameters
    ----------
    path
        An hrg file (HDF5).

    Returns
    -------
    type
        A subclass of `Record`, for `read` and `open_record`.

    Raises
    ------
    HrgError
        Not an hrg file, another major version of the format, an unknown kind.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> from hrg_cli import Recording, store
    >>> path = tempfile.mkdtemp() + "/run.h5"
    >>> run = Recording(c=np.zeros(3), s=np.ones(3), sample_rate_hz=10.0, mode="free")
    >>> _ = store.write(path, run)
    >>> store.find_kind(path).__name__
    'Recording'
    """
    with open_for_reading(Path(path)) as file:
        return _kind(file, Path(path))


def read_texts(path: Path | str, group: str, names: Sequence[str]) -> dict[str, str]:
    """Attributes of a group, as texts; also ones that no record declares.

    Parameters
    ----------
    path
        The file.
    group
        The group's name in it.
    names
        Names of the attributes.

    Returns
    -------
    dict
        Name -> text, of those that are there.

    Raises
    ------
    HrgError
        The file cannot be opened.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> from hrg_cli import Recording, store
    >>> path = tempfile.mkdtemp() + "/run.h5"
    >>> run = Recording(c=np.zeros(3), s=np.ones(3), sample_rate_hz=10.0, mode="free")
    >>> _ = store.write(path, run)
    >>> store.read_texts(path, "recording", ["mode", "mood"])
    {'mode': 'free'}
    """
    with open_for_reading(Path(path)) as file:
        return _texts(file, group, names)


def read_heading(path: Path | str, kind: type[Record], names: Sequence[str]) -> dict[str, str]:
    """Attributes of a record, as texts; its datasets are not looked at.

    Parameters
    ----------
    path
        The record's file.
    kind
        Its class.
    names
        Field names of the attributes.

    Returns
    -------
    dict
        Name -> text, of those that are there.

    Raises
    ------
    HrgError
        The file cannot be opened, holds another kind, or an attribute is not as declared.
    NotHrgError
        It is another program's HDF5.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> from hrg_cli import Recording, store
    >>> path = tempfile.mkdtemp() + "/run.h5"
    >>> run = Recording(
    ...     c=np.zeros(3), s=np.ones(3), sample_rate_hz=10.0, mode="free", gyro_id="SN-1"
    ... )
    >>> _ = store.write(path, run)
    >>> store.read_heading(path, Recording, ["gyro_id"])
    {'gyro_id': 'SN-1'}
    """
    declared = kind.columns()
    with open_for_reading(Path(path)) as file:
        need_kind(file, Path(path), kind)
        texts = _texts(file, kind.kind, names)
        for name in texts.keys() & declared.keys():
            spec = declared[name]
            place = find_place(kind, name, spec)
            texts[name] = str(read_attribute(file, Path(path), place, name, spec))
        return texts


def find_changes(path: Path | str) -> list[str] | None:
    """What in a file differs from what was written there, by its checksums (SHA-256).

    Parameters
    ----------
    path
        An hrg file (HDF5).

    Returns
    -------
    list of str or None
        A sentence a change, none for none; None where the file keeps no checksums (a
        laboratory's).

    Raises
    ------
    HrgError
        The file cannot be opened.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> from hrg_cli import Recording, store
    >>> path = tempfile.mkdtemp() + "/run.h5"
    >>> run = Recording(c=np.zeros(3), s=np.ones(3), sample_rate_hz=10.0, mode="free")
    >>> _ = store.write(path, run)
    >>> store.find_changes(path)
    []
    """
    with open_for_reading(Path(path)) as file:
        return checksums.list_changes(file)


def find_unreadable(path: Path | str) -> list[str]:
    """What of a file's values cannot be read back.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    list of str
        A sentence a dataset; empty where all can.

    Raises
    ------
    HrgError
        It cannot be opened.

    Examples
    --------
    >>> import tempfile
    >>> import numpy as np
    >>> from hrg_cli import Recording, store
    >>> path = tempfile.mkdtemp() + "/run.h5"
    >>> run = Recording(c=np.zeros(3), s=np.ones(3), sample_rate_hz=10.0, mode="free")
    >>> _ = store.write(path, run)
    >>> store.find_unreadable(path)
    []
    """
    with open_for_reading(Path(path)) as file:
        return checksums.list_unreadable(file)


@contextlib.contextmanager
def open_for_reading(path: Path) -> Iterator[h5py.File]:
    """An HDF5 file for reading; every way h5py fails becomes a sentence.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    context manager of h5py.File
        Open inside the block.

    Raises
    ------
    HrgError
        It cannot be opened or read.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import h5py
    >>> from hrg_cli.store.headings import open_for_reading
    >>> path = Path(tempfile.mkdtemp()) / "foreign.h5"
    >>> h5py.File(path, "w").close()
    >>> with open_for_reading(path) as file:
    ...     list(file)
    []
    """
    handle = Handle(path)
    try:
        with explain_reading(path):
            yield handle.open_file()
    finally:
        handle.close()


def _texts(file: h5py.File, group: str, names: Sequence[str]) -> dict[str, str]:
    need_inside(file, Path(file.filename), group)
    held = file[group].attrs if group in file else {}
    return {name: decode_text(held[name]) for name in names if name in held}


def _kind(file: h5py.File, path: Path) -> type[Record]:
    if decode_text(file.attrs.get("format", "")) != FORMAT:
        raise NotHrgError(
            f'{path}: is HDF5 but not an hrg file (root attribute format = "hrg" is missing); run'
            " `hrg import` on a foreign log"
        )
    version = decode_text(file.attrs.get("format_version", ""))
    # A minor version adds columns, which an older reader may leave unread; a major one changes what
    # is there.
    if version.split(".")[0] != FORMAT_VERSION.split(".")[0]:
        raise HrgError(
            f"{path}: has format_version {version or 'none'}, this hrg reads {FORMAT_VERSION}; use"
            " a matching version of hrg"
        )
    kind = decode_text(file.attrs.get("kind", ""))
    if kind not in BY_NAME:
        raise HrgError(
            f"{path}: its kind is {kind!r}, expected one of {', '.join(BY_NAME)}; write the file"
            f" again with hrg {__version__}"
        )
    places = [
        (find_place(BY_NAME[kind], field_name, spec), spec)
        for field_name, spec in BY_NAME[kind].columns().items()
    ]
    # attributes are where what they belong to is, which is asked once
    for place in dict.fromkeys(at if spec.dims else at.rpartition("/")[0] for at, spec in places):
        need_inside(file, path, place)
    return BY_NAME[kind]


def need_kind(file: h5py.File, path: Path, kind: type[Record]) -> None:
    """Refuse a file that holds another kind of record.

    Parameters
    ----------
    file, path
        The file, open for reading, and its name.
    kind
        The wanted class.

    Raises
    ------
    HrgError
        It holds another.
    NotHrgError
        It is another program's HDF5.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from hrg_cli import Recording, store
    >>> from hrg_cli.store.headings import need_kind, open_for_reading
    >>> path = Path(tempfile.mkdtemp()) / "run.h5"
    >>> run = Recording(c=np.zeros(3), s=np.ones(3), sample_rate_hz=10.0, mode="free")
    >>> _ = store.write(path, run)
    >>> with open_for_reading(path) as file:
    ...     need_kind(file, path, Recording)
    """
    found = _kind(file, path)
    if found is not kind:
        raise HrgError(
            f"{path}: is a {found.kind} file, a {kind.kind} file was expected; make one with"
            f" `{kind.made_by}`"
        )


def read_attribute(file: h5py.File, path: Path, place: str, field_name: str, spec: Column) -> Any:
    """An attribute as declared; its default where it may be missing.

    Parameters
    ----------
    file, path
        The file, open for reading, and its name.
    place
        Group and name, as `find_place` has it.
    field_name, spec
        The record's field and its declaration.

    Returns
    -------
    object
        Text, a whole number or a float.

    Raises
    ------
    HrgError
        It is missing, or not as declared.

    Examples
    --------
    >>> from pathlib import Path
    >>> import h5py
    >>> from hrg_cli.records import Wave
    >>> from hrg_cli.store.headings import read_attribute
    >>> spec = Wave.columns()["mode_number"]
    >>> with h5py.File("x", "w", driver="core", backing_store=False) as file:
    ...     file.create_group("wave").attrs["mode_number"] = 3
    ...     read_attribute(file, Path("x"), "/wave/mode_number", "mode_number", spec)
    3
    """
    group, _, name = place.rpartition("/")
    holder = find_item(file, group)
    if holder is None or name not in holder.attrs:
        if spec.optional:
            return make_default(field_name, spec)
        raise HrgError(
            f"{path}: attribute {name} of {group} is missing; make the file again or add it"
        )
    value = _parsed(holder.attrs[name], spec, f"{path}: attribute {name} of {group}")
    problem = find_attribute_problem(value, spec)
    if problem is not None:
        raise HrgError(
            f"{path}: attribute {name} of {group} {problem}; correct it or make the file again"
        )
    return value


def _parsed(value: Any, spec: Column, where: str) -> Any:
    try:
        if spec.dtype == "str":
            return decode_text(value)
        number = float(np.asarray(value).reshape(()))
        if spec.dtype == "i8":
            if number != int(number):
                raise ValueError
            return int(number)
        return number
    except (TypeError, ValueError, OverflowError) as error:
        raise HrgError(f"{where} is {decode_text(value)[:60]!r}, a number was expected") from error


def read_json_list(file: h5py.File, name: str, path: Path) -> list[Any]:
    """A root attribute that holds a JSON list.

    Parameters
    ----------
    file
        Open for reading.
    name
        The attribute.
    path
        The file's name.

    Returns
    -------
    list
        Empty where it is missing or no list.

    Raises
    ------
    HrgError
        It is no JSON.

    Examples
    --------
    >>> from pathlib import Path
    >>> import h5py
    >>> from hrg_cli.store.headings import read_json_list
    >>> with h5py.File("x", "w", driver="core", backing_store=False) as file:
    ...     file.attrs["status_reasons"] = '["too short"]'
    ...     (
    ...         read_json_list(file, "status_reasons", Path("x")),
    ...         read_json_list(file, "sources", Path("x")),
    ...     )
    (['too short'], [])
    """
    text = decode_text(file.attrs.get(name, "[]"))
    try:
        value = json.loads(text)
    except ValueError as error:
        raise HrgError(f"{path}: root attribute {name} is not JSON") from error
    return value if isinstance(value, list) else []


def read_provenance(file: h5py.File, path: Path) -> Provenance:
    """What the root attributes tell of a file's origin.

    Parameters
    ----------
    file, path
        The file, open for reading, and its name.

    Returns
    -------
    Provenance
        Empty where they tell nothing.

    Raises
    ------
    HrgError
        The sources are no JSON.

    Examples
    --------
    >>> from pathlib import Path
    >>> import h5py
    >>> from hrg_cli.store.headings import read_provenance
    >>> with h5py.File("x", "w", driver="core", backing_store=False) as file:
    ...     file.attrs["history"] = "hrg identify a.h5"
    ...     read_provenance(file, Path("x")).history
    ('hrg identify a.h5',)
    """
    history = decode_text(file.attrs.get("history", ""))
    sources = []
    for entry in read_json_list(file, "sources", path):
        if isinstance(entry, dict):
            samples = entry.get("samples")
            known = tuple(map(str, samples)) if isinstance(samples, list) else ()
            name, kind, digest = (str(entry.get(key, "")) for key in ("name", "kind", "sha256"))
            sources.append(Source(name, kind, digest, known))
    return Provenance(
        history=tuple(history.splitlines()),
        settings=decode_text(file.attrs.get("settings", "")),
        sources=tuple(sources),
        created=decode_text(file.attrs.get("created", "")),
        generated_by=decode_text(file.attrs.get("generated_by", "")),
    )
