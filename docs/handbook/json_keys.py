"""The documentation of what commands print with --json, and its JSON schema, made from the models
of `reporting.json_shapes`."""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from typing import Any, Union

from pydantic import TypeAdapter

from hrg_cli.reporting.json_shapes import SHAPES, Common
from hrg_cli.reporting.text import take_first_paragraph

WORDS = {
    "number": "number",
    "integer": "whole number",
    "string": "text",
    "boolean": "true or false",
    "null": "null",
}


def make_schema(command: str) -> dict[str, Any]:
    """The JSON schema of a command's object.

    Parameters
    ----------
    command
        As typed after `hrg`.

    Returns
    -------
    dict
        Of its only shape, or of any of its several.

    Examples
    --------
    >>> from docs.handbook.json_keys import make_schema
    >>> "status" in make_schema("demodulate")["properties"]
    True
    """
    shapes = SHAPES[command]
    whole: Any = shapes[0] if len(shapes) == 1 else Union[shapes]  # noqa: UP007
    return TypeAdapter(whole).json_schema(by_alias=True)


def write_schemas() -> str:
    """The schemas of all commands as one JSON text: command -> schema.

    Returns
    -------
    str
        The text of `docs/reference/json.schema.json`.

    Examples
    --------
    >>> import json
    >>> from docs.handbook.json_keys import write_schemas
    >>> "demodulate" in json.loads(write_schemas())
    True
    """
    every = {command: make_schema(command) for command in SHAPES}
    return json.dumps(every, indent=1, ensure_ascii=False) + "\n"


def tabulate_common_keys() -> str:
    """The keys that every command's object has.

    Returns
    -------
    str
        A table in Markdown.

    Examples
    --------
    >>> from docs.handbook.json_keys import tabulate_common_keys
    >>> print(tabulate_common_keys().splitlines()[0])
    | key | value | meaning |
    """
    return _keys(Common.model_json_schema(), set())


def tabulate_commands() -> str:
    """Every command's own keys, its tables linked.

    Returns
    -------
    str
        A heading and a table in Markdown for each.

    Examples
    --------
    >>> from docs.handbook.json_keys import tabulate_commands
    >>> "### hrg demodulate" in tabulate_commands().splitlines()
    True
    """
    parts = []
    for command, shapes in SHAPES.items():
        parts.append(f"### hrg {command}")
        for shape in shapes:
            about = re.sub(
                rf"`hrg {command}`[.:]?\s*", "", take_first_paragraph(shape.__doc__), count=1
            )
            if about:
                parts.append(f"{about[:1].upper()}{about[1:]}")
            own = shape.model_json_schema(by_alias=True)
            parts.append(_keys(own, set(Common.model_fields)))
    return "\n\n".join(parts)


def tabulate_tables() -> str:
    """Every table that the commands' objects hold, once.

    Returns
    -------
    str
        A heading and a table in Markdown for each, in the order of their names.

    Examples
    --------
    >>> from docs.handbook.json_keys import tabulate_tables
    >>> tabulate_tables().startswith("### ")
    True
    """
    found: dict[str, Mapping[str, Any]] = {}
    for shapes in SHAPES.values():
        for shape in shapes:
            found |= shape.model_json_schema(by_alias=True).get("$defs", {})
    return "\n\n".join(
        f"### {name}\n\n{take_first_paragraph(found[name].get('description'))}\n\n"
        + _keys(found[name], set())
        for name in sorted(found)
    )


def _keys(table: Mapping[str, Any], without: set[str]) -> str:
    rows = ["| key | value | meaning |", "|---|---|---|"]
    for name, entry in table["properties"].items():
        if name in without:
            continue
        absent = "" if name in table.get("required", []) else " (may be absent)"
        meaning = take_first_paragraph(entry.get("description"))
        cells = (f"`{name}`{absent}", _describe_value(entry), meaning)
        rows.append("| " + " | ".join(cell.replace("|", "&#124;") for cell in cells) + " |")
    return "\n".join(rows) if len(rows) > 2 else "The common keys alone."


def _describe_value(entry: Mapping[str, Any]) -> str:
    """What a key holds, its tables linked."""
    if "$ref" in entry:
        name = entry["$ref"].rpartition("/")[2]
        return f"[{name}](#{name.lower()})"
    if "anyOf" in entry:
        return " or ".join(_describe_value(one) for one in entry["anyOf"])
    if "enum" in entry or "const" in entry:
        return ", ".join(f'"{word}"' for word in entry.get("enum", [entry.get("const")]))
    if entry.get("type") == "array":
        return f"list of: {_describe_value(entry['items'])}" if entry.get("items") else "list"
    if entry.get("type") == "object":
        inner = entry.get("additionalProperties")
        return (
            f"by name: {_describe_value(inner)}"
            if isinstance(inner, Mapping) and inner
            else "table"
        )
    return WORDS.get(entry.get("type", ""), "any value")
