"""Plan, the menu where none is given: runs like those that a diagnosis was made of.

What a bench did it can do again: its free runs as they were, and the longest of them from four wave
angles, at rest and turned both ways as fast as any run was. What else a bench can do, only a menu
says.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...records import Diagnosis
from ...settings import parse_toml
from ..simulation_file import SimulationFile, list_runs

ANGLES = 4
"""Wave angles to begin from, spread over the period π/m after which a wave is the same again."""
USUAL_RATE_RAD_S = 1.0
"""Rate that is offered where no run was turned: without one K and the read-out's faults stay
hidden."""
MOST_AGAIN = 40
"""Measured runs that are offered once more."""
OF_A_RUN = {"start", "environment", "readout", "recording"}
"""Tables that say how a run is made; of its device and loops only the measurement knows."""


def make_menu_like(diagnosis: Diagnosis) -> dict[str, Any] | None:
    """The menu of runs like the free ones that were diagnosed.

    Parameters
    ----------
    diagnosis
        With the extended model that it keeps.

    Returns
    -------
    dict or None
        The runs once more, and the longest of them from several wave angles, at rest and turned
        both ways; None where no run was free, since what driven runs need of their loops no model
        tells.

    Raises
    ------
    HrgError
        The model it keeps is damaged.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.planning.like_measured import make_menu_like
    >>> lines = (
    ...     "device = {frequency_hz = 5000.0, quality_factor = 1e6}", "readout = {noise = 1e-4}",
    ...     "recording = {sample_rate_hz = 20000.0, duration_s = 3.0}",
    ... )
    >>> menu = make_menu_like(Told(extended_model=chr(10).join(lines)))
    >>> sorted({run["environment"]["rate_rad_s"] for run in menu["run"] if "environment" in run})
    [-1.0, 0.0, 1.0]
    """
    if not diagnosis.extended_model:
        return None
    made = list_runs(parse_toml(diagnosis.extended_model), "the extended model that it keeps")
    free = [run for run in made if run.control.mode == "free"]
    if not free:
        return None
    longest = max(free, key=lambda run: run.recording.duration_s)
    fastest = max(map(_fastest, made)) or USUAL_RATE_RAD_S
    like = _tables(longest)
    again = [{"run_id": f"{run.run_id}-again"} | _tables(run) for run in free[:MOST_AGAIN]]
    return {
        "recording": like["recording"],
        "readout": like["readout"],
        "run": [*again, *_grid(longest, fastest)],
    }


def _tables(run: SimulationFile) -> dict[str, Any]:
    """What the file says of how a run is made, without what it leaves at its default."""
    return run.model_dump(include=OF_A_RUN, exclude_unset=True)


def _grid(longest: SimulationFile, fastest: float) -> list[dict[str, Any]]:
    """Every wave angle at rest and turned both ways, begun at the amplitude and temperature of the
    longest run."""
    period = math.pi / longest.device.mode_number
    return [
        {
            "run_id": f"{math.degrees(angle):.3g}-deg{words}",
            "start": {"amplitude": longest.start.amplitude, "wave_angle_rad": angle},
            "environment": {"temperature_degc": _temperature(longest), "rate_rad_s": rate},
        }
        for angle in (k * period / ANGLES for k in range(ANGLES))
        for words, rate in (("", 0.0), ("-turning", fastest), ("-turning-back", -fastest))
    ]


def _fastest(run: SimulationFile) -> float:
    """The largest rate of a run, in either direction."""
    course = getattr(run.environment.rate, "rate_rad_s", [0.0])
    return float(np.abs(run.environment.rate_rad_s + np.asarray(course)).max())


def _temperature(run: SimulationFile) -> float:
    """The mean temperature of a run."""
    course = getattr(run.environment.temperature, "temperature_degc", None)
    return run.environment.temperature_degc if course is None else float(np.mean(course))
