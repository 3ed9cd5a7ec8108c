"""The generated parts of README.md, so that its tables cannot lie: `python -m hrg_cli.reporting.handbook README.md` renews them."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from pathlib import Path

from ..records import KINDS


def commands() -> str:
    """Every command with its help and example."""
    import typer.main

    from ..cli import app

    group = typer.main.get_command(app)
    rows = ["| command | what it does | example |", "|---|---|---|"]
    for name, entry in group.commands.items():  # type: ignore[attr-defined]
        example = (entry.epilog or "").removeprefix("Example: ")
        rows.append(f"| `{name}` | {(entry.help or '').splitlines()[0]} | `{example}` |")
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
            rows.append(f"| `{place}` {size}{', optional' if spec.optional else ''} | {unit} | {spec.meaning} |")
        parts.append("\n".join(rows) + "\n")
    return "\n".join(parts).rstrip()


def effects() -> str:
    """Every effect of the catalogue with its parameters."""
    from ..effects import EFFECTS

    rows = ["| effect | parameter | unit | typical size |", "|---|---|---|---|"]
    for effect in EFFECTS:
        for parameter in effect.parameters:
            rows.append(f"| `{effect.name}` | `{parameter.name}` | {parameter.units} | {parameter.typical:g} |")
    return "\n".join(rows)


PARTS: dict[str, Callable[[], str]] = {"commands": commands, "file format": file_format, "effects": effects}


def renewed(text: str) -> str:
    """README text with every generated part made again."""
    for name, make in PARTS.items():
        begin, end = f"<!-- generated: {name} -->", "<!-- end of generated part -->"
        found = re.search(re.escape(begin) + r".*?" + re.escape(end), text, re.S)
        if found:
            text = f"{text[: found.start()]}{begin}\n{make()}\n{end}{text[found.end() :]}"
    return text


if __name__ == "__main__":
    path = Path(sys.argv[1])
    path.write_text(renewed(path.read_text(encoding="utf-8")), encoding="utf-8")
