"""`hrg inject`: which `--set` belongs to which effect, the stage on files."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from .. import pipeline, settings
from ..effects import EFFECTS, Effect, find, load_effects
from ..errors import HrgError, UsageError
from ..reporting import console
from ..stages.inject import inject
from .common import Common
from .effects import list_effect_names
from .frame import (
    NO_DRAWS,
    ONE_PROCESS,
    EffectsFrom,
    OneFile,
    make_command,
    need_inputs,
    read_command_line,
)


@make_command(
    "inject",
    "hrg inject recording.h5 --effect gain_mismatch --set gain=0.01 -o injected.h5",
    idle=NO_DRAWS | ONE_PROCESS,
    says={
        "assignments": (
            "A parameter of the effect, PARAMETER=VALUE (EFFECT.PARAMETER=VALUE of several), or a"
            " setting; may be repeated."
        )
    },
)
def main(
    run: Common,
    /,
    recording: OneFile = None,
    effect: Annotated[
        list[str] | None,
        typer.Option(
            help="Effect to hide; may be repeated.",
            show_default=False,
            autocompletion=list_effect_names,
        ),
    ] = None,
    resonator: Annotated[
        Path | None,
        typer.Option(
            help=(
                "The identified resonator, for effects of the motion; fitted to this run by"
                " default."
            ),
            show_default=False,
        ),
    ] = None,
    effects_from: EffectsFrom = None,
) -> None:
    """An effect of the catalogue hidden in measured samples, to see whether a diagnosis finds it
    there."""
    with console.show_progress("inject", run.quiet or run.json) as progress:
        outcome = _inject_file(recording, run, effect or [], resonator, effects_from, progress)
    run.finish(outcome.json)


def _inject_file(
    recording: Path | None,
    run: Common,
    names: Sequence[str],
    resonator: Path | None,
    effects_from: Path | None,
    progress: pipeline.Progress,
) -> pipeline.Outcome:
    """Hide effects in a recording file; the record and the command's JSON."""
    extra = load_effects(effects_from) if effects_from is not None else ()
    assignments = tuple(_complete_keys(names, run.assignments, (*extra, *EFFECTS)))
    values = settings.resolve(inject, run.config, assignments)
    for name in names:
        values["effects"].setdefault(name, {})
    if run.show_config:
        run.leave_with_settings({"inject": values})
    paths = need_inputs([recording] if recording else [], "a recording file")
    output = run.need_output("injected.h5")
    beside = {} if resonator is None else {"resonator": resonator}
    further: dict[str, Any] = {"extra_effects": extra} if extra else {}
    return pipeline.run_stage(
        "inject",
        paths,
        output,
        values,
        beside=beside,
        further=further,
        force=run.force,
        command_line=read_command_line(),
        progress=progress,
    )


def _complete_keys(
    names: Sequence[str], assignments: Sequence[str], known: Sequence[Effect]
) -> list[str]:
    """The assignments with whole keys: PARAMETER=VALUE belongs to the effect that has it,
    EFFECT.PARAMETER=VALUE says which."""
    try:
        chosen = {name: [p.name for p in find(name, tuple(known)).parameters] for name in names}
    except HrgError as error:  # a word of the command line, as a wrong parameter is
        raise UsageError(f"--effect: {error}") from error
    out = []
    for text in assignments:
        key, value = settings.parse_assignment(text)
        short = key.removeprefix("inject.")
        head, dot, _ = short.partition(".")
        if settings.accepts(inject, head):
            out.append(text)
            continue
        if dot and head in chosen:
            out.append(f"effects.{short}={_toml(value)}")
            continue
        owners = [name for name, parameters in chosen.items() if short in parameters]
        if len(owners) != 1:
            has = (
                "; ".join(
                    f"{name} has {', '.join(parameters)}" for name, parameters in chosen.items()
                )
                or "no --effect is named"
            )
            found = (
                f"belongs to {' and '.join(owners)}, say which by {owners[0]}.{short}=…"
                if owners
                else f"is no parameter of the effects: {has}"
            )
            raise UsageError(f"--set {text}: {short} {found}")
        out.append(f"effects.{owners[0]}.{short}={_toml(value)}")
    return out


def _toml(value: Any) -> str:
    """A value as an assignment gives it."""
    return (
        repr(value)
        if isinstance(value, float)
        else str(value).lower()
        if isinstance(value, bool)
        else str(value)
    )
