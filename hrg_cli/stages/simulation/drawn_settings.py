"""One run of a short simulation file, for examples and trials by hand."""

from __future__ import annotations

from typing import Any

from ..simulation_file import SimulationFile, list_runs


def draw_settings(**tables: Any) -> SimulationFile:
    """Half a second of a gyro of 1000 Hz and Q = 10⁵, sampled at 8000 Hz.

    Parameters
    ----------
    **tables
        Further tables of the file by name, such as `readout={"noise": 1e-4}`.

    Returns
    -------
    SimulationFile
        The run, checked.

    Examples
    --------
    >>> from hrg_cli.stages.simulation.drawn_settings import draw_settings
    >>> draw_settings(readout={"noise": 1e-4}).readout.noise
    0.0001
    """
    device = {"frequency_hz": 1000.0, "quality_factor": 1e5}
    recording = {"sample_rate_hz": 8000.0, "duration_s": 0.5}
    (run,) = list_runs({"device": device, "recording": recording, **tables})
    return run
