"""What all tables of a simulation file share: strict types, and sentences where keys do not go
together."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]


class Table(BaseModel):
    """A table of the file: strict types, no unknown key, no NaN."""

    model_config = ConfigDict(
        extra="forbid",
        frozen=True,
        strict=True,
        allow_inf_nan=False,
        use_attribute_docstrings=True,
    )


def _list_given(table: BaseModel, names: tuple[str, ...]) -> list[str]:
    """Those of the names that are given."""
    return [name for name in names if getattr(table, name) is not None]


def need_exactly_one(table: BaseModel, names: tuple[str, ...]) -> None:
    """Refuse a table that gives none of the names, or several.

    Parameters
    ----------
    table
        That was read.
    names
        Of its keys.

    Raises
    ------
    ValueError
        It does; pydantic makes a sentence of the file of it.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.simulation.strict_table import need_exactly_one
    >>> need_exactly_one(Told(time_constant_s=None, q=1e6), ("time_constant_s", "q"))
    >>> need_exactly_one(Told(time_constant_s=10.0, q=1e6), ("time_constant_s", "q"))
    Traceback (most recent call last):
    ...
    ValueError: one of time_constant_s, q was expected, not time_constant_s and q
    """
    given = _list_given(table, names)
    if len(given) != 1:
        raise ValueError(
            f"one of {', '.join(names)} was expected, not {' and '.join(given) or 'none'}"
        )


def need_at_most_one(table: BaseModel, names: tuple[str, ...]) -> None:
    """Refuse a table that gives several of the names.

    Parameters
    ----------
    table
        That was read.
    names
        Of its keys.

    Raises
    ------
    ValueError
        It does.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.simulation.strict_table import need_at_most_one
    >>> need_at_most_one(Told(split_hz=1.0, split_rad_s=None), ("split_hz", "split_rad_s"))
    >>> need_at_most_one(Told(split_hz=1.0, split_rad_s=6.28), ("split_hz", "split_rad_s"))
    Traceback (most recent call last):
    ...
    ValueError: split_hz and split_rad_s say the same; give one
    """
    given = _list_given(table, names)
    if len(given) > 1:
        raise ValueError(f"{' and '.join(given)} say the same; give one")


def need_rising(time_s: list[float], values: list[float], name: str) -> None:
    """Refuse times that do not rise, or of which there are not as many as values.

    Parameters
    ----------
    time_s
        Times (n,) [s].
    values
        (n,) of a course.
    name
        Of its key.

    Raises
    ------
    ValueError
        They are.

    Examples
    --------
    >>> from hrg_cli.stages.simulation.strict_table import need_rising
    >>> need_rising([0.0, 1.0], [20.0, 30.0], "temperature_degc")
    >>> need_rising([0.0, 0.0], [20.0, 30.0], "temperature_degc")
    Traceback (most recent call last):
    ...
    ValueError: time_s must rise from value to value
    """
    if len(time_s) != len(values):
        raise ValueError(
            f"time_s has {len(time_s)} values and {name} {len(values)}; as many were expected"
        )
    if any(later <= earlier for earlier, later in pairwise(time_s)):
        raise ValueError("time_s must rise from value to value")
