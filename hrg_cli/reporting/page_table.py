"""A table of the page, and any JSON object as such tables: words, not keys; the unit behind the
number; a value and its σ as one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..limit_values import find_unit
from .figure_names import name_figure
from .figures_in_words import say_key, say_value
from .quantities import choose_unit, format_quantity, format_rounded
from .text import clean_text, format_number

DIGITS = 4
"""Of a value without a σ."""
MOST_COLUMNS, MOST_ROWS, MOST_FIGURES = 10, 60, 80
"""Of one table; a page tells, the JSON holds all."""
LONGEST = 400
"""Characters of one cell."""


@dataclass(frozen=True)
class PageTable:
    """A table: its caption, heads and rows; the first column names the row."""

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]


def format_cell(value: Any) -> str:
    """A value without a name as a person reads it.

    Parameters
    ----------
    value
        A number, a text, a truth, or a list of these.

    Returns
    -------
    str
        A dash where there is nothing.

    Examples
    --------
    >>> from hrg_cli.reporting.page_table import format_cell
    >>> format_cell(True), format_cell([1.5, None]), format_cell(None)
    ('yes', '1.5, –', '–')
    """
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    if isinstance(value, float | np.floating):
        return format_number(float(value), DIGITS)
    if isinstance(value, list | tuple):
        return clean_text(", ".join(format_cell(v) for v in value)) or "–"
    return "–" if value is None else clean_text(value)


def list_figures(caption: str, content: Any, depth: int = 0) -> list[PageTable]:
    """Tables of a JSON object: its numbers and sentences in one, each comparison in its own.

    Parameters
    ----------
    caption
        Of the first one.
    content
        The object; of anything else there are none.
    depth
        How deep it stands in another one.

    Returns
    -------
    list of PageTable
        Without what is empty.

    Examples
    --------
    >>> from hrg_cli.reporting.page_table import list_figures
    >>> (table,) = list_figures("Figures", {"duration_s": 12.5, "gaps": None})
    >>> table.caption, table.rows
    ('Figures', [('duration', '12.5 s')])
    """
    if not isinstance(content, Mapping):
        return []
    single, found = [], []
    for key, value in content.items():
        if value is None or value == [] or value == {} or _is_std(key, content):
            continue
        title = say_key(str(key))
        if isinstance(value, Mapping) and all(isinstance(v, Mapping) for v in value.values()):
            found.append(_compare(title, list(value.values()), [str(name) for name in value]))
        elif _are_objects(value):
            found.append(_compare(title, value))
        elif (
            isinstance(value, Mapping)
            and "value" not in value
            and depth < 2
            and any(isinstance(v, Mapping) or _are_objects(v) for v in value.values())
        ):
            found += list_figures(title, value, depth + 1)
        elif isinstance(value, Mapping) and "value" not in value:
            single += [
                (f"{title}: {say_key(str(k))}", _tell(str(k), value, within=str(key)))
                for k, v in value.items()
                if v is not None and not _is_std(k, value)
            ]
        else:
            single.append((title, _tell(str(key), content)))
    rows = single[:MOST_FIGURES]
    return ([PageTable(caption, ("figure", "value"), rows)] if rows else []) + found


def _compare(
    title: str, objects: Sequence[Mapping[str, Any]], names: Sequence[str] = ()
) -> PageTable:
    """Objects of one shape, a row each, named in the first column where they have names."""
    keys = list(dict.fromkeys(str(k) for one in objects for k in one if not _is_std(k, one)))
    keys = [k for k in keys if any(one.get(k) is not None for one in objects)][:MOST_COLUMNS]
    rows = [tuple(_tell(k, one) if _is_said(k, one) else "–" for k in keys) for one in objects]
    head = [say_key(k) for k in keys]
    if names:
        rows = [(say_key(name), *row) for name, row in zip(names, rows, strict=True)]
        head = ["", *head]
    return PageTable(title, head, rows[:MOST_ROWS])


def _is_said(key: str, one: Mapping[str, Any]) -> bool:
    """Whether a row's words have a cause: what a check says where it fails, or a finding where it
    stands out, is nothing where it passes or does not."""
    harmless = one.get("passed") is True or one.get("significant") is False
    return not (harmless and key in ("sentence", "why_not"))


def _are_objects(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(v, Mapping) for v in value)


def _is_std(key: Any, beside: Mapping[str, Any]) -> bool:
    """Whether a key holds the σ of a number beside it, which is told with that number."""
    value = beside.get(_named_by(str(key)))
    return isinstance(value, int | float) and not isinstance(value, bool)


def _named_by(key: str) -> str:
    return key.removesuffix("_std") if key.endswith("_std") else ""


def _tell(key: str, beside: Mapping[str, Any], within: str = "") -> str:
    """The value of a key, with the σ that stands beside it; a key without a unit has that of the
    one that holds it (`within`)."""
    value = beside.get(key)
    if isinstance(value, Mapping):
        return _tell_mapping(key, value)
    if key.endswith("_rad2_s") and isinstance(value, int | float):
        return f"{format_number(value, 3)} rad²/s"
    std = beside.get(f"{key}_std")
    name = within if within and not find_unit(key) else key
    if isinstance(value, float) and isinstance(std, int | float) and not isinstance(std, bool):
        return format_quantity(name, value, std, find_unit(name))
    if isinstance(value, bool | np.bool_) or value is None:
        return format_cell(value)
    if key == "name" and isinstance(value, str) and " " not in value:
        return name_figure(value)
    if isinstance(value, list) and len(value) > 12:
        return f"{len(value)} values, {_tell(key, {key: value[:3]})} …"
    if isinstance(value, list) and not all(isinstance(v, int | float) for v in value):
        text = format_cell(value)
    else:
        text = say_value(name, float(value) if _is_huge(value) else value, DIGITS) or "–"
    return text if len(text) <= LONGEST else text[:LONGEST] + "…"


def _tell_mapping(key: str, value: Mapping[str, Any]) -> str:
    """A figure with its own σ and unit, or a few of them in one cell."""
    if "value" not in value:
        return "; ".join(f"{say_key(str(k))} {_tell(str(k), value)}" for k in list(value)[:8])
    units = value.get("units")
    unit = clean_text(units) if units else find_unit(key)
    if value["value"] == 0 and isinstance(value.get("high"), int | float):
        return f"below {format_rounded(key, float(value['high']), unit, 2)}"
    ends = value.get("low"), value.get("high")
    if value.get("std") is None and all(isinstance(end, int | float) for end in ends):
        factor, shown = choose_unit(key, _size(value["value"]), unit)
        middle, low, high = (format_number(_size(v) * factor, 3) for v in (value["value"], *ends))
        return f"{middle} {shown} ({low} … {high})".replace("  ", " ")
    return format_quantity(key, value["value"], value.get("std"), unit)


def _size(value: Any) -> float:
    return float(value) if isinstance(value, int | float) else float("nan")


def _is_huge(value: Any) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and abs(value) > 10**12
