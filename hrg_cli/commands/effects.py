"""`hrg effects`: the catalogue of effects, or one effect's page."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Annotated, Any

import typer

from ..effects import EFFECTS, format_page
from ..reporting import console
from .common import Common
from .frame import NO_DRAWS, ONE_PROCESS, make_command, refuse_settings


def list_effect_names(incomplete: str) -> list[str]:
    """Names of effects, for the shell's completion.

    Parameters
    ----------
    incomplete
        What is typed so far.

    Returns
    -------
    list of str
        Of the catalogue.

    Examples
    --------
    >>> from hrg_cli.commands.effects import list_effect_names
    >>> list_effect_names("table_")
    ['table_rate_error', 'table_wobble']
    """
    return [effect.name for effect in EFFECTS if effect.name.startswith(incomplete)]


@make_command(
    "effects",
    "hrg effects gain_mismatch",
    idle=NO_DRAWS
    | ONE_PROCESS
    | refuse_settings("the catalogue has no settings")
    | {"strict": "nothing is judged"},
    says={"output": "File to write the JSON report into."},
)
def main(
    run: Common,
    /,
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME",
            help="One effect's page; all in one list otherwise.",
            autocompletion=list_effect_names,
        ),
    ] = None,
) -> None:
    """The catalogue of effects: what a simulation can contain and a diagnosis can name."""
    run.finish(*_show_effects(name, run))


def _show_effects(name: str | None, run: Common) -> tuple[dict[str, Any], Callable[[], None]]:
    """The catalogue of effects, or one effect's page."""
    started = time.monotonic()
    report: dict[str, Any] = {"kind": "effects", "status": "valid", "status_reasons": []}
    if name is not None:
        text = format_page(name)
        report |= {"name": name, "page": text}
    else:
        listed = [
            {
                "name": e.name,
                "family": e.family,
                "parameters": [p.name for p in e.parameters],
                "title": e.page.splitlines()[0],
            }
            for e in EFFECTS
        ]
        text = "\n".join(f"{e['name']:30}{e['family']:12}{e['title']}" for e in listed)
        report |= {"effects": listed}
    report["elapsed_s"] = round(time.monotonic() - started, 3)
    return run.write_report(report), lambda: console.say(text)
