"""The generated parts of the documentation, so that its tables cannot lie."""

from __future__ import annotations

import ast
import re
from collections.abc import Callable, Iterable, Iterator
from itertools import pairwise
from pathlib import Path

import typer.main

from hrg_cli.cli import app
from hrg_cli.effects import EFFECTS
from hrg_cli.fitting import checks
from hrg_cli.records import KINDS
from hrg_cli.reporting.text import take_first_paragraph
from hrg_cli.stages.diagnosis import thresholds as diagnosis

from . import json_keys, settings_keys
from .man_page import list_commands


def tabulate_commands() -> str:
    """Every command with its help and example.

    Returns
    -------
    str
        A table in Markdown.

    Examples
    --------
    >>> from docs.handbook.pages import tabulate_commands
    >>> any(row.startswith("| `demodulate` |") for row in tabulate_commands().splitlines())
    True
    """
    group = typer.main.get_command(app)
    rows = ["| command | what it does | example |", "|---|---|---|"]
    for name, entry in list_commands(group).items():
        example = (entry.epilog or "").removeprefix("Example: ")
        rows.append(f"| `{name}` | {take_first_paragraph(entry.help)} | `{example}` |")
    return "\n".join(rows)


def describe_file_format() -> str:
    """Every dataset and attribute of every kind, from its declaration.

    Returns
    -------
    str
        A table in Markdown for each kind.

    Examples
    --------
    >>> from docs.handbook.pages import describe_file_format
    >>> print(describe_file_format().splitlines()[0])
    **recording**, made by `hrg import` or `hrg simulate`
    """
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


def tabulate_effects() -> str:
    """Every effect of the catalogue with its parameters.

    Returns
    -------
    str
        A table in Markdown, a row for each parameter.

    Examples
    --------
    >>> from docs.handbook.pages import tabulate_effects
    >>> print(tabulate_effects().splitlines()[2])
    | `gain_mismatch` | `gain` | relative gain of C over S | 1 | 0.002 |
    """
    rows = ["| effect | parameter | meaning | unit | typical size |", "|---|---|---|---|---|"]
    for effect in EFFECTS:
        named = f"`{effect.name}`"
        for parameter in effect.parameters:
            meaning = parameter.meaning.replace("|", "\\|")
            rows.append(
                f"| {named} | `{parameter.name}` | {meaning} | {parameter.units} |"
                f" {parameter.typical:g} |"
            )
            named = ""
    return "\n".join(rows)


def list_constants(path: Path) -> Iterator[tuple[str, str, str]]:
    """Every documented constant of a module, in its order.

    Parameters
    ----------
    path
        Of the module's file, which is read, not run.

    Returns
    -------
    iterator of tuple
        Of three texts.

    Examples
    --------
    >>> from pathlib import Path
    >>> from docs.handbook.pages import list_constants
    >>> from hrg_cli.stages.identification import closing
    >>> next(list_constants(Path(closing.__file__)))[:2]
    ('SURE', '3.0')
    """
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


def tabulate_thresholds() -> str:
    """Every constant that decides a verdict: the diagnosis's, then the checks' that all stages
    share.

    Returns
    -------
    str
        A table in Markdown.

    Examples
    --------
    >>> from docs.handbook.pages import tabulate_thresholds
    >>> print(tabulate_thresholds().splitlines()[0])
    | name | value | meaning |
    """
    rows = ["| name | value | meaning |", "|---|---|---|"]
    for module in (diagnosis, checks):
        rows += [
            f"| `{name}` | {value} | {meaning.replace('|', '&#124;')} |"
            for name, value, meaning in list_constants(Path(str(module.__file__)))
        ]
    return "\n".join(rows)


PARTS: dict[str, Callable[[], str]] = {
    "commands": tabulate_commands,
    "settings of the commands": settings_keys.tabulate_command_settings,
    "simulation file": settings_keys.tabulate_simulation_file,
    "lot file": settings_keys.tabulate_lot_file,
    "limits file": settings_keys.tabulate_limits_file,
    "common keys": json_keys.tabulate_common_keys,
    "JSON of the commands": json_keys.tabulate_commands,
    "tables of the JSON": json_keys.tabulate_tables,
    "file format": describe_file_format,
    "effects": tabulate_effects,
    "thresholds": tabulate_thresholds,
}


def renew_text(text: str) -> str:
    r"""A page's text with every generated part made again.

    Parameters
    ----------
    text
        Of a page; a generated part stands between two comments.

    Returns
    -------
    str
        Without a generated part, the same.

    Examples
    --------
    >>> from docs.handbook.pages import renew_text
    >>> old = "<!-- generated: effects -->\nnone\n<!-- end of generated part -->"
    >>> "`gain_mismatch`" in renew_text(old), renew_text("none")
    (True, 'none')
    """
    for name, make in PARTS.items():
        begin, end = f"<!-- generated: {name} -->", "<!-- end of generated part -->"
        found = re.search(re.escape(begin) + r".*?" + re.escape(end), text, re.S)
        if found:
            text = f"{text[: found.start()]}{begin}\n{make()}\n{end}{text[found.end() :]}"
    return text


def list_pages(places: Iterable[Path]) -> list[Path]:
    """The files named, and every Markdown page below the folders named.

    Parameters
    ----------
    places
        Files and folders.

    Returns
    -------
    list of Path
        In their order, those of a folder sorted.

    Examples
    --------
    >>> from pathlib import Path
    >>> from docs.handbook.pages import list_pages
    >>> list_pages([Path("README.md")]) == [Path("README.md")]
    True
    """
    return [
        page
        for place in places
        for page in (sorted(place.rglob("*.md")) if place.is_dir() else [place])
    ]


WHOLE: dict[str, Callable[[], str]] = {"json.schema.json": json_keys.write_schemas}
"""Files of a folder `reference` that are generated whole."""


def renew(places: Iterable[Path]) -> None:
    r"""Write the generated parts again: in the files named, and in every page of a folder named.

    Parameters
    ----------
    places
        Files and folders.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from docs.handbook.pages import renew
    >>> with TemporaryDirectory() as name:
    ...     page = Path(name) / "page.md"
    ...     _ = page.write_text("<!-- generated: effects -->\n<!-- end of generated part -->")
    ...     renew([page])
    ...     page.read_text().splitlines()[1]
    '| effect | parameter | meaning | unit | typical size |'
    """
    places = list(places)
    for place in places:
        for name, make in WHOLE.items():
            if (place / "reference").is_dir():
                (place / "reference" / name).write_text(make(), encoding="utf-8")
    for page in list_pages(places):
        text = page.read_text(encoding="utf-8")
        if renew_text(text) != text:
            page.write_text(renew_text(text), encoding="utf-8")
