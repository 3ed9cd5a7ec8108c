"""The command line: the commands by name, each loaded when it is called."""

from __future__ import annotations

import gc
import os
import sys
from collections.abc import Iterator, MutableMapping
from contextlib import contextmanager
from importlib import import_module
from typing import Annotated, Any, cast

import typer
import typer.core

from . import streams, threads
from .errors import NO_MEMORY, HrgError, is_no_memory

COMMANDS = {
    "import": (
        "import_",
        "A laboratory's log (CSV, .csv.gz, WAV, FLAC, MATLAB, NumPy, TDMS, Parquet, LabOne; - for"
        " standard input) to a recording.",
    ),
    "simulate": (
        "simulate",
        "Simulate recordings of a gyro described in TOML; several [[run]] tables give"
        " OUTPUT-RUN.h5 each.",
    ),
    "inject": (
        "inject",
        "An effect of the catalogue hidden in measured samples, to see whether a diagnosis finds it"
        " there.",
    ),
    "demodulate": (
        "demodulate",
        "Samples to signals per window: least squares at the oscillation frequency, which is found"
        " and followed.",
    ),
    "estimate": (
        "estimate",
        "Signals to the wave: main amplitude, quadrature, wave angle and phases with standard"
        " deviations.",
    ),
    "identify": (
        "identify",
        "Resonator parameters from free run-downs: damping and frequency split, their axes, scale"
        " factor.",
    ),
    "rate": (
        "rate",
        "The rate a free or driven run shows, with the identified resonator as reference model.",
    ),
    "calibrate": (
        "calibrate",
        "Drift D(T, angle) and scale-factor K(T, angle) tables from forced runs over temperature"
        " and rate.",
    ),
    "compensate": ("compensate", "Rate and angle of a run after the tables."),
    "diagnose": (
        "diagnose",
        "What the simulation gets wrong: the cause, its size, the extended model"
        " (OUTPUT.extended.toml) and the gain.",
    ),
    "plan": (
        "plan",
        "The next experiment: the runs of a menu that separate open causes or shrink the worst"
        " variances, as a simulation file.",
    ),
    "forecast": (
        "forecast",
        "The drift a resonator will show, alone: D over the angle, the wave's way over hours, the"
        " error between external fixes.",
    ),
    "mismatch": (
        "mismatch",
        "The signals a control system acts on: error of the amplitude, quadrature, phase and angle,"
        " with their noise and delay.",
    ),
    "update": (
        "update",
        "A calibration whose coefficients moved, brought up to date by a resonator found later;"
        " what moved is told in σ.",
    ),
    "export": (
        "export",
        "Any hrg file for other programs, by the output's suffix: CSV, JSON (.gz), Parquet, XLSX,"
        " MAT; a calibration as a C header.",
    ),
    "check": (
        "check",
        "Hold the figures of files against limits and an earlier result: exit status 0 within, 3"
        " outside.",
    ),
    "diff": ("diff", "What moved between two results of one kind, in σ of both."),
    "report": (
        "report",
        "One self-contained page (or the figures) about any set of hrg files: the answer first.",
    ),
    "info": ("info", "What a file holds: kind, validity, history, sources, figures."),
    "verify": (
        "verify",
        "Whether files are as they were written: checksums of every dataset, the chain of sources,"
        " a lot's notes; 3 when not.",
    ),
    "rehearse": (
        "rehearse",
        "Whether a result's errors hold: its programme again and again on a simulated twin, through"
        " raw samples and the same stages.",
    ),
    "run": (
        "run",
        "The whole chain on the recordings (or logs, or a folder of them) of one gyro: the answer,"
        " and a page to show.",
    ),
    "batch": (
        "batch",
        "The whole chain for every gyro of a lot, a page each, and the lot as a whole: causes in"
        " common, worst gyros, outliers; resumes where it was interrupted; 3 when a gyro does not"
        " pass.",
    ),
    "ledger": (
        "ledger",
        "Every result of every gyro over time: drift, charts, capability, gauge study.",
    ),
    "study": (
        "study",
        "Repeat one of the papers' experiments, or a study of this project's own methods: table and"
        " figures into a folder.",
    ),
    "effects": (
        "effects",
        "The catalogue of effects: what a simulation can contain and a diagnosis can name.",
    ),
}
"""Name -> module in `commands`, and the first sentence of its help, in the order of the help: so
that the list of commands is shown without loading them."""


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

    @contextmanager
    def _by_summary(self) -> Iterator[None]:
        """Commands that have a name and a summary, for lists of them."""
        whole = self.commands
        self.commands = {
            name: typer.core.TyperCommand(name, short_help=summary, rich_markup_mode=None)
            for name, (_, summary) in COMMANDS.items()
        }
        try:
            yield
        finally:
            self.commands = whole

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """The options before the command; a wrong one is told in one line."""
        with _in_one_line(ctx):
            return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        """Run the command; an option of it that there is not is told in one line."""
        with _in_one_line(ctx):
            return super().invoke(ctx)

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """The list of commands under the help."""
        with self._by_summary():
            super().format_commands(ctx, formatter)

    def shell_complete(self, ctx: Any, incomplete: str) -> list[Any]:
        """The commands and options that begin so."""
        with self._by_summary():
            return super().shell_complete(ctx, incomplete)


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
    help=(
        "Calibration of solid-state wave (hemispherical resonator) gyroscopes: from recorded"
        " samples to correction tables."
    ),
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog=(
        "The chain: simulate or import, demodulate, estimate, then identify, calibrate or diagnose,"
        " compensate, report."
    ),
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
        typer.Option(
            "--version", callback=_version, is_eager=True, help="Print the version and leave."
        ),
    ] = False,
) -> None:
    pass


def main() -> None:
    """Entry point of the `hrg` script."""
    threads.use_one()
    # no plugin of pydantic's is wanted: it would look for them in every package of the environment
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")
    streams.prepare()
    try:
        with streams.flush_at_end():
            app(prog_name="hrg")
    except HrgError as error:  # its words did not reach standard output
        print(f"hrg: {error}", file=sys.stderr, flush=True)
        raise SystemExit(1) from None
    except Exception as error:  # outside the command's own guard: while its modules are loaded
        if not is_no_memory(error):
            raise
        print(f"hrg: {NO_MEMORY}", file=sys.stderr, flush=True)
        raise SystemExit(1) from None
    finally:
        # the process ends: to look through all its modules for circles first is a sixth of a
        # short command
        gc.freeze()


if __name__ == "__main__":
    main()
