"""What `hrg run` would do, as commands that do it by hand."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..gyro import list_inputs, plan_steps
from ..pipeline import STAGES
from .common import Common


def say_by_hand(
    paths: Sequence[Path], folder: Path, tables: Mapping[str, Mapping[str, Any]], run: Common
) -> list[str]:
    """What a run would do, step by step, as commands that do it by hand.

    Each reads what is given or what a step before it wrote, with the settings of its stage.

    Parameters
    ----------
    paths
        Files and folders of the run.
    folder
        For its results.
    tables
        Resolved settings by stage.
    run
        The command's options, whose --config and --set are handed on.

    Returns
    -------
    list of str
        A line of a shell each.

    Examples
    --------
    >>> from pathlib import Path
    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from tempfile import TemporaryDirectory
    >>> from hrg_cli import Recording, store
    >>> from hrg_cli.commands.dry_run import say_by_hand
    >>> c = np.zeros(16)
    >>> recording = Recording(c=c, s=c, sample_rate_hz=8000.0, mode="free", run_id="a")
    >>> with TemporaryDirectory() as name:
    ...     file = Path(name) / "a.h5"
    ...     _ = store.write(file, recording)
    ...     lines = say_by_hand([file], Path("out"), {}, Told(assignments=(), config=None))
    >>> [line.split()[1] for line in lines[:2]]
    ['demodulate', 'estimate']
    """
    times = tables.get("rehearse", {}).get("times")
    place = _places(paths, tables)
    lines: list[str] = []
    made: set[str] = set()
    for name, inputs, output in plan_steps(paths, tables, times is not None):
        read = [str(folder / one if one in made else place.get(one, one)) for one in inputs]
        beside = STAGES[name].beside if name in STAGES else ()
        models = [m for m in beside if f"{m}.h5" in made]
        # what a diagnosis takes is a model that is believed, be it a resonator or a simulation's
        option = "model" if name == "diagnose" else None
        read += [w for m in models for w in (f"--{option or m}", str(folder / f"{m}.h5"))]
        told = ["-o", str(folder / output)] if output else ["--times", str(times)]
        lines.append(shlex.join(["hrg", name, *read, *told, *_settings(name, run)]))
        made.add(output)
    return lines


def _places(paths: Sequence[Path], tables: Mapping[str, Mapping[str, Any]]) -> dict[str, Path]:
    """Where each file that is given lies, by its name."""
    inputs = list_inputs(paths, tables.get("import", {}).get("s_file"))
    return {path.name: path for one in inputs for path in (one.path, *one.logs) if path.exists()}


def _settings(name: str, run: Common) -> list[str]:
    """The options that give a stage its settings."""
    of_stage = [text for text in run.assignments if text.startswith(f"{name}.")]
    config = [] if run.config is None else ["--config", str(run.config)]
    return config + [word for text in of_stage for word in ("--set", text)]
