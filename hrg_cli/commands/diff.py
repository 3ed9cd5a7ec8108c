"""`hrg diff`: two results against each other."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any

import typer

from .. import store
from ..comparing import Comparison, compare
from ..errors import UsageError
from ..reporting import console
from .common import Common
from .frame import NO_DRAWS, ONE_PROCESS, make_command, need_inputs, refuse_settings
from .told_differences import (
    HEAD,
    describe_beyond,
    list_differences,
    list_lone_causes,
    list_lone_figures,
)

Shown = tuple[dict[str, Any], Callable[[], None]]


@make_command(
    "diff",
    "hrg diff old/resonator.h5 new/resonator.h5 --limit-sigma 5",
    idle=NO_DRAWS
    | ONE_PROCESS
    | refuse_settings("there is nothing to set")
    | {"strict": "--limit-sigma says what passes"},
    says={"output": "File to write the JSON report into."},
)
def main(
    run: Common,
    /,
    old: Annotated[Path | None, typer.Argument(metavar="OLD", show_default=False)] = None,
    new: Annotated[Path | None, typer.Argument(metavar="NEW", show_default=False)] = None,
    limit_sigma: Annotated[
        float | None,
        typer.Option(
            min=0.0,
            help="End with status 3 where a figure moved by more, in σ.",
            show_default=False,
        ),
    ] = None,
) -> None:
    """What moved between two results of one kind, in σ of both."""
    run.finish(*_diff_files(old, new, run, limit_sigma))


def _diff_files(
    old: Path | None, new: Path | None, run: Common, limit_sigma: float | None
) -> Shown:
    """Hold two results against each other; refused (exit 3) only where --limit-sigma is given and
    exceeded."""
    started = time.monotonic()
    paths = need_inputs([p for p in (old, new) if p is not None], "two results, OLD and NEW")
    if len(paths) != 2:
        raise UsageError("one result is named; name two, OLD and NEW")
    with ExitStack() as opened:  # the figures are few: rows stay on disk
        before, after = (
            opened.enter_context(store.open_record(p, store.find_kind(p))) for p in paths
        )
        found = compare(before, after, (str(paths[0]), str(paths[1])))
    beyond = describe_beyond(found, limit_sigma) if limit_sigma is not None else []
    report = {
        "kind": "diff",
        "status": "refused" if beyond else "valid",
        "status_reasons": beyond,
        "elapsed_s": round(time.monotonic() - started, 3),
        "largest_sigma": found.largest_sigma,
        "differences": [vars(d) for d in found.differences],
        "only_old": list(found.only_old),
        "only_new": list(found.only_new),
        "words": [{"name": n, "old": a, "new": b} for n, a, b in found.words],
    }
    return run.write_report(report), lambda: _show(found)


SHOWN = 30
"""Figures that a person is shown; the JSON holds all."""
LEAST_SIGMA = 0.01
"""A move that a person is shown: less is what rounding and the order of sums leave."""


def _show(found: Comparison) -> None:
    for name, old, new in found.words:
        console.say(f"{name}: {old} → {new}")
    known = [d for d in found.differences if d.sigma is not None]
    rows = list_differences([d for d in known if abs(d.sigma or 0.0) >= LEAST_SIGMA])
    if rows:
        console.print_table("", HEAD, rows[:SHOWN])
    elif found.is_empty:
        console.say("nothing moved")
    else:
        console.say(
            f"no figure moved by {LEAST_SIGMA:g} σ or more"
            if known
            else "no figure has a standard deviation in both"
        )
    for place, name in list_lone_figures(found):
        console.say(f"{name}: in the {place} result alone")
    for place, cause in list_lone_causes(found):
        console.say(f"cause {cause}: in the {place} result alone")
