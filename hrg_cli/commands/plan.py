"""`hrg plan`: what is known and a menu in, the next runs as a simulation file out."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

import typer

from .. import pipeline, settings, store
from ..errors import HrgError, UsageError
from ..limit_values import find_unit
from ..records import Diagnosis, Resonator, Wave
from ..reporting import console
from ..reporting.figure_names import name_figure
from ..reporting.quantities import format_rounded
from ..reporting.text import format_number
from ..stages.plan import plan, summarise
from ..stages.planning.like_measured import make_menu_like
from ..stages.planning.questions import say_in_words
from .common import Common
from .frame import NO_DRAWS, ONE_PROCESS, Files, make_command, need_inputs
from .options import make_flags


@make_command(
    "plan",
    "hrg plan resonator.h5 --menu configs/menu.toml -o next.toml --runs 3",
    flags=make_flags(plan, "runs", "criterion", "causes"),
    idle=NO_DRAWS | ONE_PROCESS,
)
def main(
    run: Common,
    /,
    files: Files = None,
    menu: Annotated[
        Path | None,
        typer.Option(
            help="TOML file with the runs that are feasible (default: runs like the free ones of"
            " the diagnosis).",
            show_default=False,
        ),
    ] = None,
    **flags: Any,
) -> None:
    """The next experiment: the runs of a menu that separate open causes or shrink the worst
    variances, as a simulation file.

    FILE: a resonator or diagnosis file, then the wave files measured already.
    """
    report = _plan_next(files or [], menu, run, flags)
    run.finish(report, lambda: _show(report), told=report["impossible"])


def _show(report: Mapping[str, Any]) -> None:
    """The chosen runs, and what they are expected to bring."""
    console.print_table("", ("run", "why"), [(r["run_id"], r["reason"]) for r in report["runs"]])
    told = [
        (
            " from ".join(map(say_in_words, row["causes"])),
            *(f"{format_number(row[f'{when}_sigma'], 3)} σ" for when in ("before", "after")),
        )
        for row in report["separations"]
    ]
    if told:
        console.print_table("", ("tells", "before", "expected after"), told)
    spreads = [
        (
            name_figure(name),
            *(_write_std(name, report[when][name]) for when in ("before", "after")),
        )
        for name in report["before"]
    ]
    console.print_table("", ("standard deviation of", "before", "expected after"), spreads)
    for sentence in report["impossible"]:
        console.say(sentence.replace("; ", ";\n  ", 1))


def _write_std(name: str, std: float | None) -> str:
    """A standard deviation in the unit that its own size asks for."""
    return "–" if std is None else format_rounded(name, std, find_unit(name), 3)


def _plan_next(
    files: Sequence[Path], menu: Path | None, run: Common, flags: dict[str, Any]
) -> dict[str, Any]:
    """Plan the next runs; writes them as a simulation file; the command's JSON."""
    started = time.monotonic()
    values = run.resolve_settings(plan, **flags)
    first, *waves = need_inputs(
        files, "a resonator or diagnosis file, then the waves measured already"
    )
    known = store.read_any(first)
    if not isinstance(known, Resonator | Diagnosis):
        raise HrgError(
            f"{first}: is a {known.kind} file; make a resonator with `hrg identify` or a diagnosis"
            " with `hrg diagnose`"
        )
    offered = settings.load_toml(menu) if menu is not None else _menu_of(known, first)
    made = plan(known, offered, [store.read(path, Wave) for path in waves], **values)
    if run.output is not None:
        with store.write_whole(run.output, run.force) as temporary:
            temporary.write_text(settings.to_toml(made.file), encoding="utf-8")
    return {
        **pipeline.make_common_keys("plan", made.status, made.status_reasons, run.output, started),
        **summarise(made),
    }


def _menu_of(known: Resonator | Diagnosis, file: Path) -> dict[str, Any]:
    """Runs like those measured. UsageError: the file does not say how such a run is recorded."""
    like = make_menu_like(known) if isinstance(known, Diagnosis) else None
    if like is None:
        raise UsageError(
            f"no menu is named, and {file} does not say how free runs are recorded; add --menu FILE"
            " (configs/menu.toml is one to begin from)"
        )
    return like
