"""The mistake of one run whose signals were clipped, at a level that is not the other runs'."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ....effects.saturation import compute_kept
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.envelopes.envelope_runs import compute_envelopes, replace_envelopes
from ....records import Wave
from .readings import Reading, find_least_misfit

LOWEST, FINEST = 0.8, 1e-4
"""Level over the largest amplitude that is read down to which it is looked for (a square wave's is
π/4), and spacing of the last trials."""
ROUNDS = 60
"""Of A = y/N(A), each of which leaves at most 0.7 of what the last left."""


def find_clipping_mistakes(wave: Wave, others: ExtendedFit) -> Iterator[Reading]:
    """Both channels clipped at one level in this run.

    Parameters
    ----------
    wave
        Of the run that is doubted.
    others
        The others' fit, whose coordinates are held.

    Returns
    -------
    iterator of Reading
        At most one, of one number.

    Examples
    --------
    A run that nothing clipped is no better for a level:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.clipping import find_clipping_mistakes
    >>> len(list(find_clipping_mistakes(draw_waves()[1], draw_fit()))) <= 1
    True
    """
    largest = float(np.max(np.abs(compute_envelopes(wave))[wave.good()], initial=0.0))
    middle, reach = (1 + LOWEST) / 2 * largest, (1 - LOWEST) / 2 * largest

    def restore(beside: float) -> Wave:
        return restore_clipped(wave, middle + beside)

    beside = find_least_misfit(restore, others, reach, FINEST * largest)
    if beside is None or not abs(beside) < reach:
        return
    level = middle + beside
    yield Reading(
        "signals clipped",
        (restore(beside),),
        1,
        f"its channels are clipped at {level:.5g}, which the others are not: with what that took"
        " put back",
        "record this run with a lower gain or a wider range, or from where it has decayed",
    )


def restore_clipped(wave: Wave, level: float) -> Wave:
    """The wave whose channels, clipped at a level, are read as this one.

    Parameters
    ----------
    wave
        Of a run.
    level
        At which both channels were clipped, in the signals' unit; more than π/4 of the largest
        amplitude.

    Returns
    -------
    Wave
        With A of each channel from what is read, y = A N(level/A).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.clipping import restore_clipped
    >>> wave = draw_waves()[0]
    >>> restored = restore_clipped(wave, 0.95)
    >>> bool(restored.main_amplitude[0] > wave.main_amplitude[0])
    True
    """
    read = compute_envelopes(wave)
    restored = read
    for _ in range(ROUNDS):
        restored = read / compute_kept(np.abs(restored), 1 / level)
    return replace_envelopes(wave, restored)
