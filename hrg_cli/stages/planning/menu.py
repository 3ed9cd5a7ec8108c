"""Plan, the menu: feasible runs in the tables of a simulation file, without the device, which the
resonator gives.

[[run]] tables as in a simulation file; [grid] maps dotted keys to lists, of which every combination
is a run, e.g. `"start.wave_angle_rad" = [0.0, 0.4]`. All other tables hold for every run.
`readout.noise` and `recording.sample_rate_hz` set how well a run is measured,
`recording.duration_s` how long it lasts.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from typing import Any

from ...errors import HrgError
from ...settings import assign
from ..simulation_file import SimulationFile, list_runs

MOST_RUNS = 400


def make_candidates(
    menu: Mapping[str, Any], device: Mapping[str, Any]
) -> tuple[dict[str, Any], dict[str, dict[str, Any]], dict[str, SimulationFile]]:
    """The runs of a menu, each whole and checked.

    Parameters
    ----------
    menu
        [[run]] tables, or a [grid]; all other tables hold for every run.
    device
        Table of the resonator.

    Returns
    -------
    tuple
        The common tables with the device, name -> its own table, and name -> the whole run.

    Raises
    ------
    HrgError
        A [device] or [effects] in the menu, no run, more than are weighed, one that cannot be
        simulated, or one without noise.

    Examples
    --------
    >>> from hrg_cli.stages.planning.menu import make_candidates
    >>> menu = {
    ...     "recording": {"sample_rate_hz": 20_000.0, "duration_s": 3.0},
    ...     "readout": {"noise": 1e-4},
    ...     "grid": {"start.wave_angle_rad": [0.0, 0.4]},
    ... }
    >>> device = {"frequency_hz": 5000.0, "quality_factor": 1e6}
    >>> _, tables, runs = make_candidates(menu, device)
    >>> list(runs), tables["run002"]["start"]
    (['run001', 'run002'], {'wave_angle_rad': 0.4})
    >>> make_candidates(menu | {"readout": {}}, device)
    Traceback (most recent call last):
    ...
    hrg_cli.errors.HrgError: the menu's run run001 is measured without noise; ...
    """
    for name in ("device", "effects"):
        if name in menu:
            raise HrgError(f"the menu holds [{name}], which the resonator gives; leave it out")
    common = {key: value for key, value in menu.items() if key not in ("run", "grid")} | {
        "device": dict(device)
    }
    listed = menu.get("run", [])
    if not isinstance(listed, list):
        raise HrgError("run is not an array of tables in the menu; write each run under [[run]]")
    tables = [*(dict(run) for run in listed), *_grid(menu.get("grid", {}))]
    if not tables:
        raise HrgError("the menu holds no run; add [[run]] tables or a [grid]")
    if len(tables) > MOST_RUNS:
        raise HrgError(
            f"the menu holds {len(tables)} runs, at most {MOST_RUNS} are weighed; shorten its grid"
        )
    named = [{"run_id": f"run{number:03d}"} | table for number, table in enumerate(tables, 1)]
    checked = {run.run_id: run for run in list_runs({**common, "run": named}, "the menu")}
    silent = next(
        (
            run.run_id
            for run in checked.values()
            if run.readout.noise == 0 and run.readout.adc_bits == 0
        ),
        None,
    )
    if silent is not None:
        raise HrgError(
            f"the menu's run {silent} is measured without noise; give [readout] noise, else nothing"
            " limits it"
        )
    return common, {str(table["run_id"]): table for table in named}, checked


def _grid(grid: Any) -> list[dict[str, Any]]:
    if not isinstance(grid, Mapping) or not all(
        isinstance(values, list) and values for values in grid.values()
    ):
        raise HrgError(
            '[grid] of the menu maps dotted keys to lists, e.g. "start.wave_angle_rad" = [0.0, 0.4]'
        )
    if not grid:
        return []
    runs = []
    for values in itertools.product(*grid.values()):
        run: dict[str, Any] = {}
        for key, value in zip(grid, values):
            assign(run, key, value)
        runs.append(run)
    return runs
