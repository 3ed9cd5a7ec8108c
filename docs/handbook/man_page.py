"""The man page, made from the commands themselves: `python -m docs.handbook.man_page
hrg_cli/hrg.1` renews it."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import typer.main

from hrg_cli.cli import app
from hrg_cli.commands import frame
from hrg_cli.version import __version__

EXIT_STATUSES = (
    ("0", "Done, and the result is valid (or suspect, without --strict)."),
    (
        "1",
        (
            "The input or the run failed. One line says which file, what was found and what was"
            " expected; no output exists."
        ),
    ),
    ("2", "Usage: no such command, option or value."),
    ("3", "Finished, but the result is refused (or suspect, with --strict)."),
)
FILES = (
    (
        "*.h5",
        (
            "Every record is an HDF5 file with its history, settings, sources, status and reasons"
            " in root attributes."
        ),
    ),
    (
        "*.toml",
        (
            "Settings (--config), simulations, lots, limits and menus of runs; hrg never executes"
            " what they hold."
        ),
    ),
)
ENVIRONMENT = (
    ("NO_COLOR", "When set, nothing is coloured."),
    ("OMP_NUM_THREADS", "Threads of numerical libraries (default: 1, which is quickest here)."),
    ("SOURCE_DATE_EPOCH", "Seconds since 1970 that files bear as the time of their making."),
)


def write_manual() -> str:
    """The page in the language of man(7).

    Returns
    -------
    str
        The text of `hrg_cli/hrg.1`.

    Examples
    --------
    >>> from docs.handbook.man_page import write_manual
    >>> print(write_manual().splitlines()[1])
    .SH NAME
    """
    group: Any = typer.main.get_command(app)
    return "\n".join(_lines(group, __version__)) + "\n"


def _lines(group: Any, version: str) -> Iterator[str]:
    yield f'.TH HRG 1 "" "hrg {version}" "User commands"'
    yield ".SH NAME"
    yield rf"hrg \- {_text(group.help)}"
    yield ".SH SYNOPSIS"
    yield r".B hrg"
    yield r"\fICOMMAND\fR [\fIOPTION\fR]... [\fIFILE\fR]..."
    yield ".SH DESCRIPTION"
    yield _text(group.epilog)
    yield (
        "Every step reads and writes files that carry their own history, settings, units and"
        " validity."
    )
    yield "Progress and messages go to standard error, results to standard output."
    yield ".SH COMMANDS"
    for name, command in list_commands(group).items():
        yield from _command(name, command)
    yield ".SH OPTIONS OF EVERY COMMAND"
    yield (
        "Where one of these means something else, the command says so above; one without effect in"
        " a command is taken there, and said."
    )
    common = _common()
    for parameter in common.params:
        if parameter.name not in ("install_completion", "show_completion"):
            yield from _option(common, parameter)
    for title, rows in (
        ("EXIT STATUS", EXIT_STATUSES),
        ("FILES", FILES),
        ("ENVIRONMENT", ENVIRONMENT),
    ):
        yield f".SH {title}"
        for term, meaning in rows:
            yield from (".TP", rf".B {_text(term)}", _text(meaning))
    yield ".SH COMPLETION"
    yield r".B hrg \-\-install\-completion"
    yield "makes the shell complete commands, options, effects and studies."


def list_commands(group: Any) -> dict[str, Any]:
    """Every command by what is typed after `hrg`, those of a group by both words.

    Parameters
    ----------
    group
        Of click: the program, or a command that has others below it.

    Returns
    -------
    dict
        What is typed -> click's command.

    Examples
    --------
    >>> import typer.main
    >>> from hrg_cli.cli import app
    >>> from docs.handbook.man_page import list_commands
    >>> {"demodulate", "ledger add"} <= set(list_commands(typer.main.get_command(app)))
    True
    """
    found: dict[str, Any] = {}
    for name, command in group.commands.items():
        below = list_commands(command) if hasattr(command, "commands") else {"": command}
        found |= {f"{name} {word}".strip(): entry for word, entry in below.items()}
    return found


def _command(name: str, command: Any) -> Iterator[str]:
    arguments = [p for p in command.params if p.param_type_name == "argument"]
    yield f".SS {_text(name)}"
    yield rf".B hrg {_text(name)}"
    yield " ".join(
        [r"[\fIOPTION\fR]...", *(rf"\fI{_text(p.metavar or p.name.upper())}\fR" for p in arguments)]
    )
    for paragraph in (command.help or "").split("\n\n"):
        yield from (".PP", _text(" ".join(paragraph.split())))
    shared = {parameter.name: parameter.help for parameter in _common().params}
    for parameter in command.params:
        if parameter.param_type_name == "argument" or parameter.hidden:
            continue
        if shared.get(parameter.name) != parameter.help:
            yield from _option(command, parameter)
    if command.epilog:
        yield from (
            ".PP",
            "Example:",
            ".PP",
            ".RS",
            ".nf",
            _text(command.epilog.removeprefix("Example: ")),
            ".fi",
            ".RE",
        )


def _common() -> Any:
    """A command that has nothing but the options of every command."""

    def nothing(run: Any) -> None:
        """Nothing."""

    return frame.make_command("bare", "")(nothing)


def _option(command: Any, parameter: Any) -> Iterator[str]:
    written, _ = parameter.get_help_record(command.context_class(command))
    yield from (".TP", rf"\fB{_text(written)}\fR", _text(parameter.help or ""))


PLAIN = {
    "°": " deg",
    "…": "...",
    "–": "-",
    "−": "-",
    "×": "x",
    "²": "^2",
    "θ": "theta",
    "Ω": "Omega",
    "χ": "chi",
    "σ": "sigma",
}
"""A terminal without Unicode shows these so."""


def _text(text: str) -> str:
    """Text in which nothing is a request or an escape of the formatter."""
    text = " ".join(str(text).split()).replace("\\", r"\e").replace("-", r"\-")
    text = "".join(c if ord(c) < 128 else PLAIN.get(c, "?") for c in text)
    return rf"\&{text}" if text[:1] in (".", "'") else text


if __name__ == "__main__":
    Path(sys.argv[1]).write_text(write_manual(), encoding="utf-8")
