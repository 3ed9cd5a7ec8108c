"""What all tables of a simulation file share: strict types, and sentences where keys do not go together."""

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
    """ValueError: none of the names is given, or several."""
    given = _list_given(table, names)
    if len(given) != 1:
        raise ValueError(
            f"one of {', '.join(names)} was expected, not {' and '.join(given) or 'none'}"
        )


def need_at_most_one(table: BaseModel, names: tuple[str, ...]) -> None:
    """ValueError: several of the names are given."""
    given = _list_given(table, names)
    if len(given) > 1:
        raise ValueError(f"{' and '.join(given)} say the same; give one")


def need_rising(time_s: list[float], values: list[float], name: str) -> None:
    """ValueError: times that do not rise, or not as many as there are values."""
    if len(time_s) != len(values):
        raise ValueError(
            f"time_s has {len(time_s)} values and {name} {len(values)}; as many were expected"
        )
    if any(later <= earlier for earlier, later in pairwise(time_s)):
        raise ValueError("time_s must rise from value to value")
