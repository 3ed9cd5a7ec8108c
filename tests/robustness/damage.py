"""Damages as data: drawn by a generator, applied to a copy of a good file, kept in the corpus as
they are.

A damage is a list [kind, …] of plain values, so that a failing input is a line of JSON: of HDF5 the
structure is damaged (types, shapes, values, links, chunks, attributes), of TOML and text the
tokens, of anything the bytes.
"""

from __future__ import annotations

import functools
import os
import re
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from hrg_cli.errors import HrgError
from hrg_cli.store.heaps import check_heaps
from robustness import mutation

Damage = list[Any]
LARGEST = 1 << 20
"""Values of a dataset that is damaged once more."""
NUMBERS: dict[str, float] = {
    "nan": np.nan, "inf": np.inf, "-inf": -np.inf, "0": 0.0, "-1": -1.0, "1e300": 1e300, "-1e300": -1e300, "1e-320": 1e-320,
    "2**63": float(2**63), "1e9": 1e9, "0.5": 0.5,
}  # fmt: skip
TEXTS = (
    "",
    "nan",
    "{",
    "[]",
    "null",
    "*/ int owned(void){return 1;} /*",
    "=cmd|' /C calc'!A0",
    "\x1b[31m\n\r",
    "x" * 5000,
    "../..",
    "\\\n",
)
TYPES = ("?", "f2", "c16", ">f8", "u8", "i1", "S4", "V8")
SHAPES = ("empty", "scalar", "shorter", "longer", "two", "one row")
VALUES = ("put", "all", "reversed", "shuffled", "first", "scaled")
LINKS = ("missing", "dangling", "external", "group", "cycle", "huge", "unwritten", "bomb")
TOKENS = (
    "nan",
    "inf",
    "-1",
    "0",
    "1e400",
    "9" * 5000,
    "true",
    '"x"',
    "[]",
    "{}",
    "1e-320",
    "99999999999999999999",
    "'\x00'",
    "1e12",
    "",
)


def draw(rng: np.random.Generator, path: Path) -> list[Damage]:
    """One to three damages that suit the file's content."""
    suffix = path.suffix
    drawn = []
    for _ in range(int(rng.integers(1, 4))):
        if suffix == ".h5" and rng.random() < 0.8:
            drawn.append(_draw_hdf5(rng, path))
        elif suffix in (".toml", ".csv", ".txt") and rng.random() < 0.7:
            drawn.append(["token", int(rng.integers(1 << 30)), str(rng.choice(TOKENS))])
        else:
            drawn.append(["bytes", int(rng.integers(1 << 30))])
    return drawn


def _draw_hdf5(rng: np.random.Generator, path: Path) -> Damage:
    datasets, holders = places(path)
    place = str(rng.choice(datasets)) if datasets else "/"
    kind = str(
        rng.choice(
            ["type", "shape", "value", "value", "value", "link", "attribute", "attribute", "text"]
        )
    )
    seed = int(rng.integers(1 << 30))
    if kind == "type":
        return [kind, place, str(rng.choice(TYPES))]
    if kind == "shape":
        return [kind, place, str(rng.choice(SHAPES))]
    if kind == "value":
        return [kind, place, str(rng.choice(VALUES)), str(rng.choice(list(NUMBERS))), seed]
    if kind == "link":
        return [kind, place, str(rng.choice(LINKS))]
    holder, name = holders[int(rng.integers(len(holders)))]
    if kind == "attribute":
        return [kind, holder, name, str(rng.choice([*NUMBERS, "missing", "array", "bytes"]))]
    return [kind, holder, name, str(rng.choice(TEXTS))]


@functools.cache
def places(path: Path) -> tuple[list[str], list[tuple[str, str]]]:
    """The datasets of a file, and its attributes as (holder, name); none where it cannot be
    opened."""
    datasets: list[str] = []
    holders: list[tuple[str, str]] = []
    try:
        with h5py.File(path) as file:
            holders += [("/", name) for name in file.attrs]

            def visit(name: str, item: Any) -> None:
                if isinstance(item, h5py.Dataset) and "This is a netCDF" not in str(
                    item.attrs.get("NAME", "")
                ):
                    datasets.append(f"/{name}")
                own = [
                    key
                    for key in item.attrs
                    if key
                    not in (
                        "DIMENSION_LIST",
                        "REFERENCE_LIST",
                        "CLASS",
                        "NAME",
                        "_Netcdf4Dimid",
                    )
                ]
                holders.extend((f"/{name}", key) for key in own)

            file.visititems(visit)
    except (OSError, RuntimeError, KeyError):
        pass
    return datasets, holders or [("/", "kind")]


def apply(path: Path, damages: list[Damage]) -> None:
    """Damage a file in place; a damage that no longer fits (the place is gone already) does
    nothing.

    What HDF5 holds of a file that it was made to write although it was damaged can crash it
    later: that happens in a process of its own.
    """
    if not any(kind in HDF5 for kind, *_ in damages[1:]):
        _apply(path, damages)
        return
    child = os.fork()
    if child == 0:
        try:
            _apply(path, damages)
        finally:
            os._exit(0)
    os.waitpid(child, 0)


def _apply(path: Path, damages: list[Damage]) -> None:
    for kind, *rest in damages:
        if kind == "bytes":
            path.write_bytes(mutation.damaged(path.read_bytes(), np.random.default_rng(rest[0])))
        elif kind == "token":
            _token(path, *rest)
        else:
            try:
                check_heaps(path)  # an earlier damage may be one that HDF5 never comes back from
                with h5py.File(path, "r+") as file:
                    HDF5[kind](file, *rest)
            except (
                HrgError,
                OSError,
                RuntimeError,
                KeyError,
                AttributeError,
                ValueError,
                TypeError,
                OverflowError,
                IndexError,
                MemoryError,
            ):
                continue


def _token(path: Path, seed: int, new: str) -> None:
    text = path.read_bytes().decode("utf-8", "replace")
    found = list(re.finditer(r"-?[\w.+]+", text))
    if found:
        match = found[seed % len(found)]
        text = text[: match.start()] + new + text[match.end() :]
    path.write_text(text, encoding="utf-8", errors="replace")


def _content(file: h5py.File, place: str) -> np.ndarray:
    """The values of a dataset; ValueError where an earlier damage made it huge, or another
    thing."""
    if not isinstance(file[place], h5py.Dataset) or (file[place].size or 0) > LARGEST:
        raise ValueError(place)
    return np.asarray(file[place][()])


def _replace(file: h5py.File, place: str, data: Any) -> None:
    attributes = {
        key: value
        for key, value in file[place].attrs.items()
        if key in ("units", "long_name", "scale_factor", "add_offset")
    }
    del file[place]
    dataset = file.create_dataset(place, data=data)
    dataset.attrs.update(attributes)


def _type(file: h5py.File, place: str, kind: str) -> None:
    values = _content(file, place)
    _replace(
        file,
        place,
        (
            np.zeros(np.shape(values), kind)
            if kind in ("S4", "V8")
            else np.asarray(values).astype(kind)
        ),
    )


def _shape(file: h5py.File, place: str, how: str) -> None:
    values = _content(file, place)
    made = {
        "empty": lambda: values[:0],
        "scalar": lambda: values.reshape(-1)[0],
        "shorter": lambda: values[:-1],
        "longer": lambda: np.concatenate([values, values[-1:]]),
        "two": lambda: np.stack([values, values], -1),
        "one row": lambda: values[:1],
    }
    _replace(file, place, made[how]())


def _value(file: h5py.File, place: str, how: str, number: str, seed: int) -> None:
    values = _content(file, place)
    rng = np.random.default_rng(seed)
    what = NUMBERS[number]
    if values.dtype.kind in "iu":
        what = float(
            np.clip(np.nan_to_num(what), np.iinfo(values.dtype).min, np.iinfo(values.dtype).max - 1)
        )
    if how == "put":
        values.reshape(-1)[int(rng.integers(values.size))] = what
    elif how == "all":
        values[...] = what
    elif how == "reversed":
        values = values[::-1]
    elif how == "shuffled":
        rng.shuffle(values)
    elif how == "first":
        values[:1] = what
    else:
        with np.errstate(all="ignore"):
            values = values * np.asarray(what, values.dtype)
    _replace(file, place, values)


def _link(file: h5py.File, place: str, how: str) -> None:
    group, _, name = place.rpartition("/")
    holder, dataset = file[group or "/"], file[place]
    shape, kind = dataset.shape, dataset.dtype
    attributes = {
        key: value
        for key, value in dataset.attrs.items()
        if key in ("units", "scale_factor", "add_offset")
    }
    del holder[name]
    if how == "dangling":
        holder[name] = h5py.SoftLink("/nowhere")
    elif how == "external":
        holder[name] = h5py.ExternalLink("/etc/hostname", "/x")
    elif how == "group":
        holder.create_group(name)
    elif how == "cycle":
        holder[name] = h5py.SoftLink(place)
    elif how == "huge":
        holder.create_dataset(name, shape=(1 << 40,), dtype=kind, chunks=(1 << 16,))
    elif how == "unwritten":
        holder.create_dataset(name, shape=shape, dtype=kind)
    elif how == "bomb":
        holder.create_dataset(
            name,
            shape=(1 << 26, *shape[1:]),
            dtype=kind,
            chunks=(1 << 20, *shape[1:]),
            compression="gzip",
        )
    if name in holder and isinstance(holder.get(name, getlink=True), h5py.HardLink):
        holder[name].attrs.update(attributes)


def _attribute(file: h5py.File, holder: str, name: str, what: str) -> None:
    attributes = file[holder].attrs
    del attributes[name]
    if what == "array":
        attributes[name] = np.arange(3.0)
    elif what == "bytes":
        attributes[name] = np.bytes_(b"\xff\xfe\x00")
    elif what != "missing":
        attributes[name] = NUMBERS[what]


def _text(file: h5py.File, holder: str, name: str, what: str) -> None:
    file[holder].attrs[name] = what


HDF5 = {
    "type": _type,
    "shape": _shape,
    "value": _value,
    "link": _link,
    "attribute": _attribute,
    "text": _text,
}
