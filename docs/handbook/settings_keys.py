"""The tables of TOML keys in the documentation, made from the models that check the files."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from hrg_cli.cli import COMMANDS
from hrg_cli.commands.report import report
from hrg_cli.exporting import export
from hrg_cli.formats import import_envelope, import_log
from hrg_cli.limit_values import QUANTITIES, SUFFIXES, UNITS
from hrg_cli.lots.lot_settings import LotSettings
from hrg_cli.pipeline import STAGES
from hrg_cli.reporting.text import take_first_paragraph
from hrg_cli.settings import make_model
from hrg_cli.stages.calibrate import calibrate
from hrg_cli.stages.forecast import forecast
from hrg_cli.stages.mismatch import mismatch
from hrg_cli.stages.plan import plan
from hrg_cli.stages.rate_table import rate_table
from hrg_cli.stages.rehearse import rehearse
from hrg_cli.stages.simulate import simulate
from hrg_cli.stages.simulation_file import SimulationFile
from hrg_cli.studies.diagnosis import diagnosis_study
from hrg_cli.studies.gauss_newton import gauss_newton_study
from hrg_cli.studies.identification import identification_study
from hrg_cli.studies.programmes import programmes_study
from hrg_cli.studies.recovery import recovery_study
from hrg_cli.studies.redundancy import redundancy_study

FUNCTIONS: dict[str, list[tuple[str, Callable[..., Any]]]] = {
    "import": [("import", import_log), ("envelope", import_envelope)],
    "simulate": [("simulate", simulate)],
    "calibrate": [("calibrate", calibrate), ("calibrate", rate_table)],
    "plan": [("plan", plan)],
    "forecast": [("forecast", forecast)],
    "mismatch": [("mismatch", mismatch)],
    "export": [("export", export)],
    "report": [("report", report)],
    "rehearse": [("rehearse", rehearse)],
    "study": [
        ("gauss_newton_study", gauss_newton_study),
        ("redundancy_study", redundancy_study),
        ("identification_study", identification_study),
        ("programmes_study", programmes_study),
        ("diagnosis_study", diagnosis_study),
        ("recovery_study", recovery_study),
    ],
}
"""Command -> its tables: (name in the TOML, function whose signature is the model)."""
ALTERNATIVES = {
    "import_envelope": "with `--envelope`",
    "rate_table": "of a table of dwells of any rate gyro",
}
"""When a second function of a command takes the settings."""


def _list_tables(name: str) -> list[tuple[str, Callable[..., Any]]]:
    """(Table, function) of every table of settings that a command reads; none: it has no
    settings."""
    if name in FUNCTIONS:
        return FUNCTIONS[name]
    return [(name, STAGES[name].load_function())] if name in STAGES else []


def tabulate_command_settings() -> str:
    """Every key of every command's table.

    Returns
    -------
    str
        A heading and a table in Markdown for each.

    Examples
    --------
    >>> from docs.handbook.settings_keys import tabulate_command_settings
    >>> "### `hrg demodulate`: `[demodulate]`" in tabulate_command_settings().splitlines()
    True
    """
    parts = []
    for command in COMMANDS:
        for table, function in _list_tables(command):
            schema = make_model(function).model_json_schema()
            if not schema["properties"]:
                continue
            when = ALTERNATIVES.get(function.__name__)
            parts.append(
                f"### `hrg {command}`: `[{table}]`{f' {when}' if when else ''}\n\n"
                + _keys(schema, schema.get("$defs", {}))
            )
    return "\n\n".join(parts)


def tabulate_simulation_file() -> str:
    """Every table and key of a simulation file.

    Returns
    -------
    str
        Headings and tables in Markdown.

    Examples
    --------
    >>> from docs.handbook.settings_keys import tabulate_simulation_file
    >>> "### `[device]`" in tabulate_simulation_file().splitlines()
    True
    """
    return _tables(SimulationFile)


def tabulate_lot_file() -> str:
    """Every table and key of a lot's file.

    Returns
    -------
    str
        Headings and tables in Markdown.

    Examples
    --------
    >>> from docs.handbook.settings_keys import tabulate_lot_file
    >>> "### `[[gyro]]`" in tabulate_lot_file().splitlines()
    True
    """
    return _tables(LotSettings)


def _tables(model: Any) -> str:
    """A file's model: the keys at its top, then each table by its dotted name."""
    schema = model.model_json_schema(by_alias=True)
    defs = schema["$defs"]
    tables = list(_nested(schema, defs, ""))
    top = {
        name: entry
        for name, entry in schema["properties"].items()
        if name.split(".")[0] not in {place.split(".")[0].strip("[]") for place, _ in tables}
    }
    parts = [_keys({**schema, "properties": top}, defs)] if top else []
    for place, table in tables:
        text = take_first_paragraph(table.get("description")).replace(f"{place}: ", "", 1)
        parts.append(f"### `{place}`\n\n{text[:1].upper()}{text[1:]}\n\n{_keys(table, defs)}")
    return "\n\n".join(parts)


def _nested(
    table: Mapping[str, Any], defs: Mapping[str, Any], prefix: str
) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """(Place, schema) of the tables below a table: `[device.temperature]`, `[[gyro]]`,
    `[runs.NAME]`."""
    for name, entry in table["properties"].items():
        for place, below in _models(entry, defs, f"{prefix}{name}"):
            kind = below["properties"].get("kind", {}).get("const")
            choice = f' with kind = "{kind}"' if kind else ""
            yield (f"[[{place}]]" if entry.get("type") == "array" else f"[{place}]") + choice, below
            yield from _nested(below, defs, f"{place}.")


def _models(
    entry: Mapping[str, Any], defs: Mapping[str, Any], place: str
) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """The models that a key's value may be, with the place where they stand."""
    if "$ref" in entry:
        yield place, defs[entry["$ref"].rpartition("/")[2]]
    for one in [*entry.get("anyOf", []), *entry.get("oneOf", [])]:
        yield from _models(one, defs, place)
    if entry.get("type") == "array":
        yield from _models(entry["items"], defs, place)
    if isinstance(entry.get("additionalProperties"), Mapping):
        yield from _models(entry["additionalProperties"], defs, f"{place}.NAME")


def _keys(table: Mapping[str, Any], defs: Mapping[str, Any]) -> str:
    rows = ["| key | value | default | meaning |", "|---|---|---|---|"]
    needed = table.get("required", [])
    for name, entry in table["properties"].items():
        if (name == "kind" and "const" in entry) or list(_models(entry, defs, "")):
            continue
        meaning = take_first_paragraph(entry.get("description"))
        cells = (f"`{name}`", _describe_value(entry), _default(entry, name in needed), meaning)
        rows.append("| " + " | ".join(cell.replace("|", "&#124;") for cell in cells) + " |")
    return "\n".join(rows) if len(rows) > 2 else "Tables alone."


WORDS = {
    "number": "number",
    "integer": "whole number",
    "string": "text",
    "boolean": "true or false",
    "object": "table",
}


def _describe_value(entry: Mapping[str, Any]) -> str:
    """What a key takes, from its JSON schema: type, choices, bounds."""
    if "anyOf" in entry:
        kinds = [_describe_value(one) for one in entry["anyOf"] if one.get("type") != "null"]
        return " or ".join(dict.fromkeys(kinds))
    if "enum" in entry or "const" in entry:
        return ", ".join(f'"{word}"' for word in entry.get("enum", [entry.get("const")]))
    if entry.get("type") == "array":
        low, high = entry.get("minItems"), entry.get("maxItems")
        count, rest = (
            (f"{low} ", "") if low and low == high else ("", ", one or more" if low else "")
        )
        return f"list of {count}{_plural(_describe_value(entry['items']))}{rest}"
    if entry.get("type") == "object":
        inner = entry.get("additionalProperties")
        below = (
            "" if not isinstance(inner, Mapping) else _describe_value(inner).partition(" or ")[0]
        )
        return f"table of {_plural(below)}" if below else "table"
    return WORDS.get(entry.get("type", ""), "any value") + _bounds(entry)


def _plural(words: str) -> str:
    first, comma, rest = words.partition(",")
    if first.startswith(('"', "true", "list of", "table of")):
        return first.replace("list of", "lists of").replace("table of", "tables of") + comma + rest
    return f"{first}s{comma}{rest}"


def _bounds(entry: Mapping[str, Any]) -> str:
    signs = {
        "exclusiveMinimum": ">",
        "minimum": "≥",
        "exclusiveMaximum": "<",
        "maximum": "≤",
    }
    found = [f"{sign} {entry[key]:.6g}" for key, sign in signs.items() if key in entry]
    return f", {' and '.join(found)}" if found else ""


def _default(entry: Mapping[str, Any], needed: bool) -> str:
    value = entry.get("default")
    if needed or "default" not in entry:
        return "needed" if needed else ""
    if value is None:
        return "–"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float | int):
        return f"{value:.9g}"
    return f"`{value!r}`".replace("'", '"')


def tabulate_limits_file() -> str:
    """What may limit a figure: its quantities, told by the end of its name, with their units.

    Returns
    -------
    str
        A table in Markdown.

    Examples
    --------
    >>> from docs.handbook.settings_keys import tabulate_limits_file
    >>> print(tabulate_limits_file().splitlines()[0])
    | a figure's name ends in | it is | in | and may be written in |
    """
    rows = ["| a figure's name ends in | it is | in | and may be written in |", "|---|---|---|---|"]
    for suffix, quantity in [*SUFFIXES, ("anything else", "a ratio")]:
        base = quantity.partition(" in ")[0]
        spellings = ", ".join(f"`{unit}`" for unit in QUANTITIES[base] if unit)
        name = suffix if " " in suffix else f"`{suffix}`"
        rows.append(f"| {name} | {base} | {UNITS[quantity] or '1'} | {spellings} |")
    return "\n".join(rows)
