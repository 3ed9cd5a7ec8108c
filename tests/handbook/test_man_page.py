"""The man page is fresh, names every command, option and status, and the formatter has nothing to
say against it."""

import re
import shutil
import subprocess
from importlib import resources

import pytest
import typer.main

from docs.handbook.man_page import list_commands, write_manual
from hrg_cli.cli import app

COMMANDS = list_commands(typer.main.get_command(app))


def test_manual_is_fresh():
    packed = (resources.files("hrg_cli") / "hrg.1").read_text(encoding="utf-8")
    assert packed == write_manual(), "run `python -m docs.handbook.man_page hrg_cli/hrg.1`"


@pytest.mark.skipif(shutil.which("groff") is None, reason="groff is not installed")
def test_formatter_accepts_it_and_nothing_is_lost():
    done = subprocess.run(
        ["groff", "-man", "-Tascii", "-ww", "-P-cbou", "-rLL=200n"],
        input=write_manual(),
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stderr == ""
    text = " ".join(done.stdout.split())
    for name, command in COMMANDS.items():
        assert f"hrg {name}" in text
        assert " ".join(command.epilog.removeprefix("Example: ").split()) in text
        for parameter in command.params:
            for option in parameter.opts if parameter.param_type_name == "option" else []:
                assert option in text
    for section in ("NAME", "SYNOPSIS", "COMMANDS", "EXIT STATUS", "FILES", "ENVIRONMENT"):
        assert re.search(rf"^{section}$", done.stdout, re.M)
