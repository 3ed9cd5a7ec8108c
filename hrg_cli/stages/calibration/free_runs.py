"""Runs that are free by their files, beside forced ones: not in the tables, and said so."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...errors import name_some
from ...fitting.envelopes.amplitude_course import HIGHEST_Q
from ...fitting.tables.increments import AnglePath

PART = 0.1
"""Of a run's length, over which its first and its last amplitude are averaged."""


def tell_free_runs(free: Sequence[AnglePath]) -> tuple[list[str], list[str]]:
    """What to note, and what to doubt, of free runs among forced ones.

    "free" is what an import takes where nothing is told; a wave whose amplitude holds is driven.

    Parameters
    ----------
    free
        The free runs.

    Returns
    -------
    tuple
        Notes, and doubts.

    Examples
    --------
    >>> import numpy as np
    >>> from types import SimpleNamespace
    >>> from hrg_cli.stages.calibration.free_runs import tell_free_runs
    >>> t = np.arange(100.0)
    >>> told = dict(run_id="r1", time_s=t, frequency_hz=5e3 + 0 * t)
    >>> notes, doubts = tell_free_runs([SimpleNamespace(main_amplitude=np.exp(-t / 600), **told)])
    >>> len(notes), doubts
    (1, [])
    >>> _, doubts = tell_free_runs([SimpleNamespace(main_amplitude=1 + 0 * t, **told)])
    >>> doubts[0].split(":")[0]
    'r1 is free by its file, and its amplitude holds as only a driven one does'
    """
    holds = [_holds(path) for path in free]
    held = [path for path, one in zip(free, holds, strict=True) if one]
    fall = [path for path, one in zip(free, holds, strict=True) if not one]
    doubts = []
    if held:
        its = ("is", "its file", "its") if len(held) == 1 else ("are", "their files", "their")
        doubts.append(
            f"{_name(held)} {its[0]} free by {its[1]}, and {its[2]} amplitude holds as only"
            " a driven one does: left out of the tables; import with --mode forced"
        )
    notes = [f"free, and not in the tables of forced runs: {_name(fall)}"] if fall else []
    return notes, doubts


def _name(paths: Sequence[AnglePath]) -> str:
    return name_some(path.run_id or "a run" for path in paths)


def _holds(path: AnglePath) -> bool:
    """Whether it falls by less than half of what the best resonator loses, πf/Q a second."""
    amplitude, rows = np.asarray(path.main_amplitude, float), max(1, int(PART * len(path.time_s)))
    first, last = float(np.mean(amplitude[:rows])), float(np.mean(amplitude[-rows:]))
    length_s = (1 - PART) * float(path.time_s[-1] - path.time_s[0])
    lost = np.pi * float(np.median(path.frequency_hz)) / HIGHEST_Q * length_s
    return abs(np.log(last / first)) < lost / 2 if first > 0 and last > 0 else False
