"""Columns or channels of a run that stand still, or repeat each other: no measurement, whatever the
physics."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....fitting.envelopes.frozen import CORRECTION, find_frozen
from ....records import Wave
from ...suspicion import Suspicion
from ..thresholds import ONE_NOISE

QUIET = 1e-9
"""Noise of a window over the largest amplitude below which it is the arithmetic's."""


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


def find_twin_channels(waves: Sequence[Wave]) -> list[Suspicion]:
    """Runs in which one pick-off was recorded as both channels, by run: two share no noise.

    Parameters
    ----------
    waves
        Of the runs.

    Returns
    -------
    list of Suspicion
        One of each such run.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.repeats import find_twin_channels
    >>> wave = draw_waves()[0]
    >>> found = [find_twin_channels([wave.replace(noise_correlation=r)]) for r in (0.9, -1.0)]
    >>> [[one.what for one in of_wave] for of_wave in found]
    [[], ['one pick-off recorded as both channels']]
    """
    return [
        Suspicion(
            wave.run_id,
            "one pick-off recorded as both channels",
            f"their noise is one, correlated by {wave.noise_correlation:.6g}",
            "name the other channel at the import, or record the run again",
        )
        for wave in waves
        if abs(wave.noise_correlation or 0.0) > ONE_NOISE and _is_noisy(wave)
    ]


def _is_noisy(wave: Wave) -> bool:
    """Whether its windows state more than rounding."""
    std, size = (np.asarray(one, float) for one in (wave.signal_std, wave.main_amplitude))
    return bool(np.nanmedian(std) > QUIET * np.nanmax(np.abs(size)))
