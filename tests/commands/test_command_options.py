"""Options that commands take from their stages, and commands that load when they are called."""

import os
import subprocess
import sys
from pathlib import Path
from typing import get_args

import pytest
import typer
import typer.core
import typer.main
from conftest import PACKAGE

from hrg_cli import cli, front_page
from hrg_cli.commands.options import make_flags, parse_column, parse_numbers, parse_words
from hrg_cli.reporting.text import take_first_paragraph
from hrg_cli.settings import make_model
from hrg_cli.stages.calibrate import calibrate
from hrg_cli.stages.forecast import forecast
from hrg_cli.stages.identify import identify

ROOT = Path(__file__).parent.parent.parent
COMMANDS = typer.main.get_command(cli.app).commands


@pytest.mark.parametrize("name", cli.COMMANDS)
def test_the_list_of_commands_says_what_their_help_says(name):
    assert cli.COMMANDS[name][1] == take_first_paragraph(COMMANDS[name].help)
    assert COMMANDS[name].name == name


@pytest.mark.parametrize("columns", [40, 60, 80, 200])
@pytest.mark.parametrize("words_", [["--help"], ["-h"], ["-h", "--help"]])
def test_the_front_page_is_laid_out_as_the_help_of_commands_is(columns, words_, hrg, monkeypatch):
    """It is shown without the library that lays out the others."""
    monkeypatch.setenv("COLUMNS", str(columns))
    commands = {
        name: typer.core.TyperCommand(name, short_help=summary, rich_markup_mode=None)
        for name, (_, summary) in cli.COMMANDS.items()
    }
    group = typer.core.TyperGroup(
        name="hrg",
        commands=commands,
        params=typer.main.get_command(cli.app).params,
        help=front_page.SUMMARY,
        epilog=front_page.CHAIN,
        rich_markup_mode=None,
        context_settings={"help_option_names": list(front_page.ASKED)},
    )
    told = group.make_context("hrg", [], resilient_parsing=True).get_help()
    assert hrg(*words_).out == f"{told}\n"


def loaded_after(words_, **environment):
    """What the command line prints and the modules of commands that it loaded."""
    code = f"""
import sys
sys.argv = {words_!r}
from hrg_cli.cli import main
try:
    main()
except SystemExit:
    pass
print([m for m in sys.modules if m.startswith('hrg_cli.commands.') or m == 'numpy'])
"""
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True,
        text=True,
        check=True,
        env=os.environ | {"PYTHONPATH": str(PACKAGE)} | environment,
    )
    *said, loaded = done.stdout.splitlines()
    return said, loaded


def test_help_and_completion_of_commands_load_none_of_them():
    said, loaded = loaded_after(["hrg", "--help"])
    assert loaded == "[]" and sum(line.startswith("  identify ") for line in said) == 1
    said, loaded = loaded_after(
        ["hrg"],
        _HRG_COMPLETE="complete_bash",
        COMP_WORDS="hrg id",
        COMP_CWORD="1",
        _TYPER_COMPLETE_ARGS="hrg id",
    )
    assert said == ["identify"] and loaded == "[]"


def test_choices_are_completed():
    said, _ = loaded_after(
        ["hrg"], _HRG_COMPLETE="complete_bash", COMP_WORDS="hrg estimate --solver g", COMP_CWORD="3"
    )
    assert said == ["gauss-newton"]


@pytest.mark.parametrize(
    ("stage", "option"),
    [(identify, "method"), (identify, "window"), (calibrate, "model"), (forecast, "drive")],
)
def test_choices_of_an_option_are_those_of_its_stage(stage, option, hrg):
    field = make_model(stage).model_fields[option]
    told = "".join(hrg(stage.__name__, "--help").out.split())
    assert f"--{option}<{'|'.join(get_args(field.annotation))}>" in told
    shown = next(p for p in COMMANDS[stage.__name__].params if p.name == option)
    assert f"(default {field.default})." in shown.help


def test_a_choice_that_is_none_is_a_usage_error(hrg):
    told = hrg("identify", "--method", "guess", "--show-config")
    assert told.status == 2 and "likelihood" in told.err and "guess" in told.err


def test_an_option_not_given_leaves_the_say_to_the_file(hrg, tmp_path):
    (tmp_path / "c.toml").write_text('[estimate]\nsolver = "gauss-newton"\n')
    shown = hrg("estimate", "--config", tmp_path / "c.toml", "--show-config", "--json").json
    assert shown["estimate"]["solver"] == "gauss-newton"
    shown = hrg(
        *("estimate", "--config", tmp_path / "c.toml", "--solver", "levenberg-marquardt"),
        *("--show-config", "--json"),
    ).json
    assert shown["estimate"]["solver"] == "levenberg-marquardt"


def test_lists_and_columns_are_read(hrg):
    assert parse_column("3") == 3 and parse_column("time") == "time"
    assert parse_numbers("-20,0,2.5") == [-20.0, 0.0, 2.5] and parse_words("a, b,") == ["a", "b"]
    with pytest.raises(typer.BadParameter, match="joined by commas"):
        parse_numbers("1;2")
    shown = hrg("calibrate", "--nodes", "-20,0,20", "--show-config", "--json").json
    assert shown["calibrate"]["nodes"] == [-20.0, 0.0, 20.0]


def test_a_setting_without_a_meaning_makes_no_option():
    def stage(*, silent: int = 1, strange: dict[str, int] | None = None) -> None:
        """Nothing."""

    for name in ("silent", "strange"):
        with pytest.raises(TypeError):
            make_flags(stage, name)
