"""The body of every command that is one stage on files."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..pipeline import STAGES, Outcome, run_stage
from ..reporting import console
from .common import Common
from .frame import need_inputs, read_command_line


def run_stage_on_files(
    run: Common,
    name: str,
    inputs: list[Path],
    *,
    beside: Mapping[str, Path | list[Path] | None] | None = None,
    rehearse: int | None = None,
    **flags: Any,
) -> None:
    """Do what every command does that is one stage on files.

    Parameters
    ----------
    run
        The command's options.
    name
        Of the stage.
    inputs
        That were named.
    beside
        Further files by their argument of the stage; None: not given.
    rehearse
        So many times its result is rehearsed; None: it is not.
    **flags
        Settings given by options of the command; None: not given.

    Raises
    ------
    HrgError
        The input or the stage failed; wrong use is a UsageError.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.commands.one_stage import run_stage_on_files
    >>> run_stage_on_files(Told(resolve_settings=lambda stage: {}), "demodulate", [])
    Traceback (most recent call last):
    ...
    hrg_cli.errors.UsageError: no input is named; name a recording file
    """
    stage = STAGES[name]
    values = run.resolve_settings(stage.load_function(), **flags)
    inputs = need_inputs(inputs, f"a {stage.takes} file")
    output = run.need_output(f"{stage.gives}.h5")
    with console.show_progress(name, run.quiet or run.json) as progress:
        outcome = run_stage(
            name,
            inputs,
            output,
            values,
            beside={key: path for key, path in (beside or {}).items() if path is not None},
            force=run.force,
            command_line=read_command_line(),
            progress=progress,
        )
    if rehearse is None:
        run.finish(outcome.json, lambda: _show(outcome))
        return
    # A rehearsal needs the whole chain, the simulation and the diagnosis too, which take a second
    # to load.
    from .rehearse import rehearse_outcome
    from .rehearse import show as show_rehearsal

    whole = rehearse_outcome(outcome, output, inputs, rehearse, run)

    def show() -> None:
        _show(whole)
        show_rehearsal(whole.json["rehearsal"])

    run.finish(whole.json, show)


def _show(outcome: Outcome) -> None:
    """The outcome's table; what draws tables is loaded where one is to be seen."""
    from ..reporting import tables

    tables.show(outcome.record, outcome.json)
