"""Every option of the command line that a text names is one of a command: in messages, help, README
and documentation."""

import re
from pathlib import Path

import typer.main

from hrg_cli import cli

ROOT = Path(__file__).parent.parent.parent
COMMANDS = typer.main.get_command(cli.app).commands


def options_of(command):
    own = {word for p in command.params for word in (*p.opts, *p.secondary_opts)}
    for below in getattr(command, "commands", {}).values():
        own |= options_of(below)
    return own | {"--help"}


OPTIONS = {"--version", "--install-completion", "--show-completion"}.union(
    *map(options_of, COMMANDS.values())
)
FLAG = re.compile(r"(?<![\w/=-])--[a-z][a-z0-9-]*[a-z0-9]")
OTHERS = {"--cores": "snakemake"}
"""Options of other programmes, each named beside its own."""
NO_OPTIONS = "hrg_cli/reporting/figures/drawing.py"
"""Where such words are variables of a style sheet."""
TEXTS = [
    ROOT / "README.md",
    *(ROOT / "docs").rglob("*.md"),
    *(path for path in (ROOT / "hrg_cli").rglob("*.py") if path != ROOT / NO_OPTIONS),
]


def test_every_option_that_a_text_names_exists():
    named = {
        (flag, str(path.relative_to(ROOT)))
        for path in TEXTS
        for flag in FLAG.findall(path.read_text(encoding="utf-8"))
    }
    assert len({flag for flag, _ in named}) > 40
    assert len({path for _, path in named}) > 30
    assert sorted((flag, path) for flag, path in named if flag not in OPTIONS | set(OTHERS)) == []


def test_options_of_other_programmes_stand_beside_their_programme():
    for path in TEXTS:
        text = path.read_text(encoding="utf-8")
        for flag, programme in OTHERS.items():
            assert text.count(flag) == text.count(f"{programme} {flag}"), path
