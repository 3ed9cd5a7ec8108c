"""Runs whose samples stand in the reverse order: their amplitude grows as the others' falls."""

from __future__ import annotations

from collections.abc import Sequence

from ....fitting.envelopes.growing import CORRECTION, find_growing
from ....records import Wave
from ...suspicion import Suspicion
from ..thresholds import GROWN


def find_backward_runs(waves: Sequence[Wave]) -> list[Suspicion]:
    """Free runs in which time runs backwards, or which are driven.

    Parameters
    ----------
    waves
        Of the runs.

    Returns
    -------
    list of Suspicion
        One of each such run; none where the runs hardly fall, and nothing tells.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.backwards import find_backward_runs
    >>> waves = list(draw_waves())
    >>> find_backward_runs(waves)
    []
    >>> waves[1] = waves[1].replace(main_amplitude=waves[1].main_amplitude[::-1])
    >>> [one.what for one in find_backward_runs(waves)]
    ['samples run backwards']
    """
    return [
        Suspicion(waves[one.run].run_id, "samples run backwards", one.evidence, CORRECTION)
        for one in find_growing(waves, GROWN)
    ]
