"""How a field of a record is declared: a dataset or an attribute of a file, with its unit, its
meaning, its dimensions and the values it may hold."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

Array = np.ndarray

GROWING = ("row", "auxiliary_row", "truth_row")
"""Leading dimensions along which a stream is appended."""

SIZES: dict[str, tuple[int, ...]] = {"channel": (2,), "signal": (4, 8)}
"""Sizes a named dimension may have; the others are free. A dimension `x_2` has the size of `x`."""


@dataclass(frozen=True)
class Valid:
    """What values a column or attribute may hold; every reader and the writer hold it to this
    (`store/validity.py`).

    missing: where NaN may stand for a value that is not known: "never", "flagged" (rows whose flags
    are not 0 or whose fit did not converge), "anywhere"; infinity never may. raw: any number, as a
    converter gave it. above, at_least, at_most: bounds of every value. rising: strictly, from row
    to row. one_of: the texts that are known. json: a text that is a JSON "object" or "list".
    """

    missing: Literal["never", "flagged", "anywhere"] = "never"
    raw: bool = False
    infinite: bool = False
    above: float | None = None
    at_least: float | None = None
    at_most: float | None = None
    rising: bool = False
    one_of: tuple[str, ...] = ()
    json: Literal["", "object", "list"] = ""


FINITE = Valid()

RAW = Valid(raw=True)

FARTHEST = 1e12
"""Of times, nodes, angles, rates and temperatures in their own unit (30 000 years in s): beyond it
nothing was measured, and squares of differences run out of numbers."""

SQUARABLE = 1e150
"""The largest deviation whose square is still a number."""

RISING = Valid(rising=True, at_least=-FARTHEST, at_most=FARTHEST)

FLAGGED = Valid(missing="flagged")

NEAR_OR_FLAGGED = Valid(missing="flagged", at_least=-FARTHEST, at_most=FARTHEST)

FLAGGED_STD = Valid(missing="flagged", at_least=0, at_most=SQUARABLE)

LOGGED = Valid(missing="anywhere")

NEAR_LOGGED = Valid(missing="anywhere", at_least=-FARTHEST, at_most=FARTHEST)

SCATTER = Valid(at_least=0, at_most=SQUARABLE)

POSITIVE = Valid(above=0)

ORDER = Valid(at_least=1, at_most=1000)

JSON_OBJECT, JSON_LIST = Valid(json="object"), Valid(json="list")

MODE, READOUT = Valid(one_of=("free", "forced")), Valid(one_of=("direct", "carrier"))

STANDS_FOR = Valid(one_of=("mean", "middle"))


@dataclass(frozen=True)
class Column:
    """How one field of a record is kept: a dataset (`dims` not None) or an attribute of the
    group."""

    units: str | None
    meaning: str
    dims: tuple[str, ...] | None
    group: str | None
    name: str | None
    dtype: str
    optional: bool
    packed: bool = True
    """Compressed where that saves space; not where it would cost more than all the work on the
    values."""
    valid: Valid = FINITE


def column(
    units: str,
    meaning: str,
    dims: tuple[str, ...] = ("row",),
    *,
    group: str | None = None,
    name: str | None = None,
    dtype: str = "f8",
    optional: bool = False,
    packed: bool = True,
    valid: Valid = FINITE,
) -> Any:
    """Declare a dataset of a record.

    Parameters
    ----------
    units
        Canonical unit; "any" for the channel's own.
    meaning
        For the handbook.
    dims
        Names of its dimensions.
    group
        Of the file; None: the record's own.
    name
        In the file; None: the field's.
    dtype
        In the file.
    optional
        Whether it may be missing.
    packed
        Whether it is compressed.
    valid
        Which values it may have.

    Returns
    -------
    dataclasses.Field
        With its declaration as metadata.

    Examples
    --------
    >>> from hrg_cli.records.columns import column
    >>> spec = column("rad s-1", "rate", optional=True).metadata["column"]
    >>> spec.units, spec.dims, spec.optional
    ('rad s-1', ('row',), True)
    """
    spec = Column(units, meaning, dims, group, name, dtype, optional, packed, valid)
    return (
        field(default=None, metadata={"column": spec})
        if optional
        else field(metadata={"column": spec})
    )


def attribute(
    meaning: str,
    *,
    default: Any = dataclasses.MISSING,
    dtype: str = "str",
    group: str | None = None,
    name: str | None = None,
    valid: Valid = FINITE,
) -> Any:
    """Declare an attribute of a record's group.

    Parameters
    ----------
    meaning
        For the handbook.
    default
        Where a file lacks it; none: it must be there.
    dtype
        In the file.
    group
        Of the file; None: the record's own.
    name
        In the file; None: the field's.
    valid
        Which values it may have.

    Returns
    -------
    dataclasses.Field
        With its declaration as metadata.

    Examples
    --------
    >>> from hrg_cli.records.columns import attribute
    >>> spec = attribute("the gyro", default="").metadata["column"]
    >>> spec.dims, spec.optional
    (None, True)
    """
    optional = default is not dataclasses.MISSING
    return field(
        default=default,
        metadata={"column": Column(None, meaning, None, group, name, dtype, optional, valid=valid)},
    )
