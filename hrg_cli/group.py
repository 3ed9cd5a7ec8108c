"""The commands as typer's group, each loaded when it is called."""

from __future__ import annotations

from collections.abc import Iterator, MutableMapping
from contextlib import contextmanager
from importlib import import_module
from typing import Annotated, Any, cast

import typer
import typer.core

from .front_page import ASKED, CHAIN, COMMANDS, OPTIONS, SUMMARY, compose_front_page

Misuse = cast("type[Exception]", typer.BadParameter.__mro__[1])
"""What typer raises for a command, option or value that there is not."""


class Loaded(MutableMapping[str, Any]):
    """The commands of a table; one is loaded when it is asked for."""

    def __init__(self, table: dict[str, tuple[str, str]]) -> None:
        self._modules = {name: module for name, (module, _) in table.items()}
        self._known: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in self._known:
            self._known[name] = import_module(f"hrg_cli.commands.{self._modules[name]}").main
        return self._known[name]

    def __setitem__(self, name: str, command: Any) -> None:
        self._modules[name], self._known[name] = name, command

    def __delitem__(self, name: str) -> None:
        del self._modules[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._modules)

    def __len__(self) -> int:
        return len(self._modules)

    def __contains__(self, name: object) -> bool:
        return name in self._modules


class Commands(typer.core.TyperGroup):
    """The group whose commands are loaded when they are called; its help and its completion know
    the table alone."""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**{**attributes, "commands": None})
        self.commands = Loaded(COMMANDS)

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """The options before the command; a wrong one is told in one line."""
        with _in_one_line(ctx):
            return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        """Run the command; an option of it that there is not is told in one line."""
        with _in_one_line(ctx):
            return super().invoke(ctx)

    def format_help(self, _: Any, formatter: Any) -> None:
        """The page that `hrg --help` shows without this group, too."""
        formatter.write(compose_front_page())

    def shell_complete(self, ctx: Any, incomplete: str) -> list[Any]:
        """The commands and options that begin so, by the table alone."""
        whole = self.commands
        self.commands = {
            name: typer.core.TyperCommand(name, short_help=summary, rich_markup_mode=None)
            for name, (_, summary) in COMMANDS.items()
        }
        try:
            return super().shell_complete(ctx, incomplete)
        finally:
            self.commands = whole


@contextmanager
def _in_one_line(ctx: Any) -> Iterator[None]:
    """Wrong use is told as every other failure is: one line, here with where help is, and status
    2."""
    try:
        yield
    except Misuse as error:
        if type(error).__name__ == "NoArgsIsHelpError":
            raise
        from .commands.guard import USAGE, leave

        found: Any = error
        leave(_say_misuse(found.format_message(), (found.ctx or ctx).command_path), USAGE)


def _say_misuse(said: str, command: str) -> str:
    """The line of a wrong use: the command, what is wrong, what may be meant, where help is."""
    said = said.rstrip(".").replace(": Value error, ", ": ").replace(". Did you", "; did you")
    wrong, meant, options = said.partition(" (Possible options: ")
    if meant:
        said = f"{wrong}; did you mean {' or '.join(options.rstrip(')').split(', '))}?"
    name = command.removeprefix("hrg").strip()
    said = f"{said[:1].lower()}{said[1:]}"
    return f"{f'{name}: ' if name else ''}{said}; see `{command} -h`"


app = typer.Typer(
    name="hrg",
    cls=Commands,
    help=SUMMARY,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": list(ASKED)},
    epilog=CHAIN,
)


def _version(wanted: bool) -> None:
    if wanted:
        from .version import __version__

        print(f"hrg {__version__}")
        raise typer.Exit()


@app.callback()
def _root(
    version: Annotated[
        bool,
        typer.Option("--version", callback=_version, is_eager=True, help=OPTIONS["--version"]),
    ] = False,
) -> None:
    pass
