"""The layout that reading and writing share: format, kinds by name, where a field stands in a
file."""

from __future__ import annotations

import dataclasses
from typing import Any, TypeVar

from ..records import KINDS, Column, Record

FORMAT, FORMAT_VERSION = "hrg", "1.0"
AnyRecord = TypeVar("AnyRecord", bound=Record)
BY_NAME = {cls.kind: cls for cls in KINDS}


def find_place(kind: type[Record], field_name: str, spec: Column) -> str:
    """Where a column of a kind stands in the file.

    Parameters
    ----------
    kind
        A class of records.
    field_name
        The column's name in it.
    spec
        Its declaration.

    Returns
    -------
    str
        A path in the HDF5 file.

    Examples
    --------
    >>> from hrg_cli.records import Wave
    >>> from hrg_cli.store.layout import find_place
    >>> find_place(Wave, "time_s", Wave.columns()["time_s"])
    '/wave/time_s'
    """
    return f"{spec.group or '/' + kind.kind}/{spec.name or field_name}"


def make_default(field_name: str, spec: Column) -> Any:
    """The value of an optional column that a file does not have.

    Parameters
    ----------
    field_name
        The column's name.
    spec
        Its declaration, which tells the class.

    Returns
    -------
    object
        As the class declares it.

    Examples
    --------
    >>> from hrg_cli.records import Wave
    >>> from hrg_cli.store.layout import make_default
    >>> make_default("mode_number", Wave.columns()["mode_number"])
    2
    """
    for cls in KINDS:
        for f in dataclasses.fields(cls):
            if f.metadata.get("column") is spec:
                return f.default
    raise AssertionError(field_name)


def take_first_line(error: BaseException) -> str:
    """The first line of an error's text, for a sentence.

    Parameters
    ----------
    error
        Another library's error.

    Returns
    -------
    str
        160 characters at most; the error's class where it says nothing.

    Examples
    --------
    >>> from hrg_cli.store.layout import take_first_line
    >>> take_first_line(KeyError("no such dataset")), take_first_line(OSError())
    ('no such dataset', 'OSError')
    """
    return str(error).strip("'\"").splitlines()[0][:160] if str(error) else type(error).__name__
