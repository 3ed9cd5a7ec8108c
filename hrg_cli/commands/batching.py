"""The body of `hrg batch`: a lot's file in, a folder with every gyro's results out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from .. import settings
from ..errors import HrgError
from ..ledger import database
from ..ledger.lots import enter_lot
from ..lots.batch import executor_for, run_lot
from ..lots.lot_settings import PER_GYRO, PER_RECORDING, LotSettings, read_lot
from ..pipeline import STAGES
from ..reporting import console
from .frame import Common, existing


def batch_file(
    lot: Path | None, run: Common, dask: bool, scheduler: str | None, ledger: Path | None = None
) -> dict[str, Any]:
    """Run a lot; the command's JSON. Keys of the lot's file, then [batch] of --config, then --set,
    then --seed."""
    path = existing([lot] if lot else [], "a lot's file (TOML)")[0]
    over = settings.load_toml(run.config).get("batch", {}) if run.config else {}
    if not isinstance(over, dict):
        raise HrgError(f"{run.config}: batch is not a table; write the lot's keys under [batch]")
    seeds = (
        f"{name}.seed={run.seed}"
        for name in PER_GYRO
        if settings.accepts(STAGES[name].function(), "seed")
    )
    assignments = (*run.assignments, *(seeds if run.seed is not None else ()))
    if run.show_config:
        run.leave_with_settings({"batch": resolved(read_lot(path, assignments, over))})
    folder = run.need_output("lot/")
    if ledger is not None:
        database.add(ledger, [])  # what cannot be written is said before the work, not after it
    with console.progress_bar("batch", run.quiet or run.json) as progress:
        report = run_lot(
            path,
            folder,
            open_executor=executor_for(run.jobs, dask, scheduler),
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
    return report


def resolved(lot: LotSettings) -> dict[str, Any]:
    """The whole lot with every default of every stage, in the form of a lot's file."""
    tree = lot.model_dump(by_alias=True, exclude_unset=False)
    for name in (*PER_RECORDING, *lot.stages):
        tree[name] = lot.values(name)
    tree["runs"] = {
        pattern: run.model_dump(by_alias=True, exclude_unset=True)
        for pattern, run in lot.runs.items()
    }
    return tree
