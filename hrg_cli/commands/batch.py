"""`hrg batch`: a lot's file in, a folder with every gyro's results out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any

import typer

from .. import settings
from ..errors import HrgError
from ..extras import tell_lack_of_pages
from ..ledger import database
from ..ledger.lots import enter_lot
from ..lots.batch import choose_executor, run_lot
from ..lots.lot_settings import PER_GYRO, PER_RECORDING, LotSettings, read_lot
from ..pipeline import STAGES
from ..reporting import console
from ..reporting.text import format_number
from .common import Common
from .frame import OneFile, make_command, need_inputs


@make_command(
    "batch",
    "hrg batch lot.toml -o lot/ --jobs 4",
    says={
        "output": "Folder of the lot; the same folder resumes it.",
        "config": "TOML file whose table [batch] is put over the lot's file.",
        "show_config": "Print the resolved lot as TOML and leave.",
        "seed": "Seed of every stage that draws.",
    },
)
def main(
    run: Common,
    /,
    lot: OneFile = None,
    dask: Annotated[
        bool, typer.Option("--dask", help="Dask workers started here, --jobs of them.")
    ] = False,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a running Dask scheduler.", show_default=False)
    ] = None,
    ledger: Annotated[
        Path | None,
        typer.Option(help="Ledger to enter every gyro's results into.", show_default=False),
    ] = None,
) -> None:
    """The whole chain for every gyro of a lot, a page each, and the lot as a whole: causes in
    common, worst gyros, outliers; resumes where it was interrupted; 3 when a gyro does not pass."""
    report, shown = _run_batch(lot, run, dask, scheduler, ledger)
    told = [f"{row['gyro_id'] or 'a recording'}: {row['reason']}" for row in _worst(report)]
    run.finish(report, shown, told=told)


Shown = tuple[dict[str, Any], Callable[[], None]]
"""A command's JSON, and what shows it to a person."""


def _run_batch(
    lot: Path | None, run: Common, dask: bool, scheduler: str | None, ledger: Path | None = None
) -> Shown:
    """Run a lot; the command's JSON and what shows it. Keys of the lot's file, then [batch] of
    --config, then --set, then --seed."""
    path = need_inputs([lot] if lot else [], "a lot's file (TOML)")[0]
    over = settings.load_toml(run.config).get("batch", {}) if run.config else {}
    if not isinstance(over, dict):
        raise HrgError(f"{run.config}: batch is not a table; write the lot's keys under [batch]")
    seeds = (
        f"{name}.seed={run.seed}"
        for name in PER_GYRO
        if settings.accepts(STAGES[name].load_function(), "seed")
    )
    assignments = (*run.assignments, *(seeds if run.seed is not None else ()))
    if run.show_config:
        run.leave_with_settings({"batch": _resolve_lot(read_lot(path, assignments, over))})
    folder = run.need_output("lot/")
    if ledger is not None:
        database.add_entries(
            ledger, []
        )  # what cannot be written is said before the work, not after it
    with console.show_progress("batch", run.quiet or run.json) as progress:
        report = run_lot(
            path,
            folder,
            open_executor=choose_executor(run.jobs, dask, scheduler),
            force=run.force,
            assignments=assignments,
            over=over,
            progress=progress,
        )
    if ledger is not None:
        results = [
            f"{STAGES[stage].gives}.h5" for stage in read_lot(path, assignments, over).stages
        ]
        report["ledger"] = {"path": str(ledger), **enter_lot(ledger, report, folder, results)}
    return report, lambda: _show(report, folder)


def _show(report: Mapping[str, Any], folder: Path) -> None:
    """The lot in a sentence, what its gyros have in common, the worst of them, and where the page
    is."""
    from ..reporting.lot_words import make_sentence

    console.say(make_sentence(report))
    for one in report["lot_causes"]:
        unlike = ", ".join(one["indistinguishable_from"]).replace("_", " ")
        console.say(
            f"{one['sentence']} ({format_number(abs(one['z']), 3)} σ from {one['gyros']} gyros"
            + (f"; cannot be told from {unlike}" if unlike else "")
            + ")"
        )
    if ranked := _worst(report):
        worst = [
            (r["gyro_id"] or "a recording", r["health"] or r["status"], r["reason"]) for r in ranked
        ]
        console.print_table("", ("worst", "gyro is", "why"), worst)
    pageless = tell_lack_of_pages()
    console.say(f"no page: {pageless}" if pageless else f"page: {folder / 'lot.html'}")


def _worst(report: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The gyros that are told with their reasons, the worst first."""
    from ..reporting.lot_words import WORST

    return sorted((r for r in report["rows"] if r["reason"]), key=lambda r: r["rank"])[:WORST]


def _resolve_lot(lot: LotSettings) -> dict[str, Any]:
    """The whole lot with every default of every stage, in the form of a lot's file."""
    tree = lot.model_dump(by_alias=True, exclude_unset=False)
    for name in (*PER_RECORDING, *lot.stages):
        tree[name] = lot.check_settings(name)
    tree["runs"] = {
        pattern: run.model_dump(by_alias=True, exclude_unset=True)
        for pattern, run in lot.runs.items()
    }
    return tree
