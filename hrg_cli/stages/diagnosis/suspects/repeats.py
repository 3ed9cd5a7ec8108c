"""Columns or channels of a run that stand still: no measurement, whatever the physics."""

from __future__ import annotations

from collections.abc import Sequence

from ....fitting.envelopes.frozen import CORRECTION, find_frozen
from ....records import Wave
from ...suspicion import Suspicion


def find_stuck_columns(waves: Sequence[Wave]) -> list[Suspicion]:
    """What repeats one value where noise is stated, by run.

    Parameters
    ----------
    waves
        Of the runs.

    Returns
    -------
    list of Suspicion
        One of each column that stands still.

    Examples
    --------
    An amplitude that stays where it was in the 21st window:

    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.repeats import find_stuck_columns
    >>> wave = draw_waves()[0]
    >>> held = np.where(np.arange(50) > 20, wave.main_amplitude[20], wave.main_amplitude)
    >>> [one.what for one in find_stuck_columns([wave.replace(main_amplitude=held)])]
    ['main amplitude stuck']
    """
    return [
        Suspicion(wave.run_id, f"{one.what} stuck", one.evidence, CORRECTION)
        for wave, found in zip(waves, find_frozen(waves), strict=True)
        for one in found
    ]
