"""The generated parts of the documentation, so that its tables cannot lie."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterable, Iterator
from itertools import pairwise
from pathlib import Path

import typer.main

from ..cli import app
from ..effects import EFFECTS
from ..fitting import checks
from ..records import KINDS
from ..reporting.text import take_first_paragraph
from ..stages.diagnosis import thresholds as diagnosis
from . import json_keys, settings_keys
from .man_page import commands_of


def commands() -> str:
    """Every command with its help and example."""
    group = typer.main.get_command(app)
    rows = ["| command | what it does | example |", "|---|---|---|"]
    for name, entry in commands_of(group).items():
        example = (entry.epilog or "").removeprefix("Example: ")
        rows.append(f"| `{name}` | {take_first_paragraph(entry.help)} | `{example}` |")
    return "\n".join(rows)


def file_format() -> str:
    """Every dataset and attribute of every kind, from its declaration."""
    parts = []
    for kind in KINDS:
        parts.append(f"**{kind.kind}**, made by `{kind.made_by}`\n")
        rows = ["| place | unit | meaning |", "|---|---|---|"]
        for field_name, spec in kind.columns().items():
            place = f"{spec.group or '/' + kind.kind}/{spec.name or field_name}"
            size = f"({', '.join(spec.dims)})" if spec.dims else "attribute"
            unit = {"any": "the signal's", None: ""}.get(spec.units, spec.units)
            rows.append(
                f"| `{place}` {size}{', optional' if spec.optional else ''} | {unit} |"
                f" {spec.meaning} |"
            )
        parts.append("\n".join(rows) + "\n")
    return "\n".join(parts).rstrip()


def effects() -> str:
    """Every effect of the catalogue with its parameters."""
    rows = ["| effect | parameter | unit | typical size |", "|---|---|---|---|"]
    for effect in EFFECTS:
        for parameter in effect.parameters:
            rows.append(
                f"| `{effect.name}` | `{parameter.name}` | {parameter.units} |"
                f" {parameter.typical:g} |"
            )
    return "\n".join(rows)


def constants(path: Path) -> Iterator[tuple[str, str, str]]:
    """Name, value as it is written and meaning of every documented constant of a module, in its
    order."""
    body = ast.parse(path.read_text(encoding="utf-8")).body
    for statement, following in pairwise(body):
        documented = (
            isinstance(following, ast.Expr)
            and isinstance(following.value, ast.Constant)
            and isinstance(following.value.value, str)
        )
        if (
            isinstance(statement, ast.Assign)
            and isinstance(statement.targets[0], ast.Name)
            and documented
        ):
            yield (
                statement.targets[0].id,
                ast.unparse(statement.value),
                " ".join(following.value.value.split()),  # type: ignore[attr-defined]
            )


def thresholds() -> str:
    """Every constant that decides a verdict: those of the diagnosis, then those of the checks that
    all stages share."""
    rows = ["| name | value | meaning |", "|---|---|---|"]
    for module in (diagnosis, checks):
        rows += [
            f"| `{name}` | {value} | {meaning.replace('|', '&#124;')} |"
            for name, value, meaning in constants(Path(str(module.__file__)))
        ]
    return "\n".join(rows)


PARTS: dict[str, Callable[[], str]] = {
    "commands": commands,
    "settings of the commands": settings_keys.command_settings,
    "simulation file": settings_keys.simulation_file,
    "lot file": settings_keys.lot_file,
    "limits file": settings_keys.limits_file,
    "common keys": json_keys.common_keys,
    "JSON of the commands": json_keys.commands,
    "tables of the JSON": json_keys.tables,
    "file format": file_format,
    "effects": effects,
    "thresholds": thresholds,
}


def renewed(text: str) -> str:
    """A page's text with every generated part made again."""
    for name, make in PARTS.items():
        begin, end = f"<!-- generated: {name} -->", "<!-- end of generated part -->"
        found = re.search(re.escape(begin) + r".*?" + re.escape(end), text, re.S)
        if found:
            text = f"{text[: found.start()]}{begin}\n{make()}\n{end}{text[found.end() :]}"
    return text


def pages(places: Iterable[Path]) -> list[Path]:
    """The files named, and every Markdown page below the folders named."""
    return [
        page
        for place in places
        for page in (sorted(place.rglob("*.md")) if place.is_dir() else [place])
    ]


WHOLE: dict[str, Callable[[], str]] = {"json.schema.json": json_keys.schemas}
"""Files of a folder `reference` that are generated whole."""


def renew(places: Iterable[Path]) -> None:
    """Write the generated parts again: in the files named, and in every page of a folder named."""
    places = list(places)
    for place in places:
        for name, make in WHOLE.items():
            if (place / "reference").is_dir():
                (place / "reference" / name).write_text(make(), encoding="utf-8")
    for page in pages(places):
        text = page.read_text(encoding="utf-8")
        if renewed(text) != text:
            page.write_text(renewed(text), encoding="utf-8")
