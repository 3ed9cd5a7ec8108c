"""A table of the page, and any JSON object as such tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .text import number, plain


@dataclass(frozen=True)
class PageTable:
    """A table: its caption, heads and rows; the first column names the row."""

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]


def cell(value: Any) -> str:
    """A value as a person reads it."""
    if isinstance(value, float | np.floating):
        return number(float(value), 7)
    if isinstance(value, list | tuple):
        return plain(", ".join(cell(v) for v in value)) or "–"
    return "–" if value is None else plain(value)


def list_figures(caption: str, content: Any, depth: int = 0) -> list[PageTable]:
    """Tables of a JSON object: its numbers and sentences in one, each comparison (objects of one
    shape) in its own."""
    if not isinstance(content, Mapping):
        return []
    single, found = [], []
    for key, value in content.items():
        title = plain(key).replace("_", " ")
        if value is None or value == [] or value == {}:
            continue
        if isinstance(value, Mapping) and all(isinstance(v, Mapping) for v in value.values()):
            head = list(dict.fromkeys(k for v in value.values() for k in v))[:10]
            rows = [(plain(name), *(_shorten(v.get(k)) for k in head)) for name, v in value.items()]
            found.append(
                PageTable(title, ("", *(plain(h).replace("_", " ") for h in head)), rows[:60])
            )
        elif isinstance(value, list) and all(isinstance(v, Mapping) for v in value):
            head = list(dict.fromkeys(k for v in value for k in v))[:10]
            found.append(
                PageTable(
                    title,
                    [plain(h).replace("_", " ") for h in head],
                    [tuple(_shorten(v.get(k)) for k in head) for v in value][:60],
                )
            )
        elif (
            isinstance(value, Mapping)
            and depth < 2
            and any(isinstance(v, Mapping) or _are_objects(v) for v in value.values())
        ):
            found += list_figures(title, value, depth + 1)
        elif isinstance(value, Mapping):
            single += [
                (f"{title}: {plain(k).replace('_', ' ')}", _shorten(v))
                for k, v in value.items()
                if v is not None
            ]
        else:
            single.append((title, _shorten(value)))
    return ([PageTable(caption, ("figure", "value"), single[:80])] if single else []) + found


def _are_objects(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(v, Mapping) for v in value)


def _shorten(value: Any) -> str:
    if isinstance(value, Mapping):
        if "value" in value:
            std = f" ± {cell(value.get('std'))}" if value.get("std") is not None else ""
            return f"{cell(value['value'])}{std} {plain(value.get('units', ''))}".strip()
        return "; ".join(f"{plain(k)} {_shorten(v)}" for k, v in list(value.items())[:8])
    if isinstance(value, list) and len(value) > 12:
        return f"{len(value)} values, {_shorten(value[:3])} …"
    text = cell(float(value) if isinstance(value, int) and abs(value) > 10**12 else value)
    return text if len(text) <= 400 else text[:400] + "…"
