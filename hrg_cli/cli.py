"""The command line: the commands of the chain, then those around it. Heavy imports happen inside
commands."""

from __future__ import annotations

from typing import Annotated

import typer

from .commands import around, chain, ledger, updating

app = typer.Typer(
    name="hrg",
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

app.add_typer(chain.app)
app.add_typer(updating.app)
app.add_typer(around.app)
app.add_typer(ledger.app)


def _version(wanted: bool) -> None:
    if wanted:
        from . import __version__

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
    app(prog_name="hrg")


if __name__ == "__main__":
    main()
