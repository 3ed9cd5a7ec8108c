"""Runs that are driven by their files and free by their waves: no drive is logged, and the
amplitude falls steadily, as a held one does not."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....fitting.envelopes.amplitude_course import ALIKE, HIGHEST_Q, read_course
from ....records import Wave
from ...suspicion import Suspicion
from ..thresholds import FALLEN


def find_mislabelled(waves: Sequence[Wave]) -> list[Suspicion]:
    """Free runs under the label of driven ones.

    Such a run falls by `FALLEN` or more, in each of its parts, and no slower than half of what the
    best resonator loses, πf/Q a second.

    Parameters
    ----------
    waves
        Of the runs.

    Returns
    -------
    list of Suspicion
        One of each.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.mislabelled import find_mislabelled
    >>> waves = draw_waves()
    >>> find_mislabelled(waves)
    []
    >>> print(find_mislabelled([waves[0].replace(mode="forced", run_id="r1")])[0].sentence)
    r1: its mode is forced, and its wave is a free one's (no drive is logged, and ...); ...
    """
    found = []
    for wave in waves:
        course = read_course(wave) if wave.mode == "forced" else None
        if course is None or course.driven or course.change > -FALLEN:
            continue
        least = np.pi * wave.reference_frequency_hz / HIGHEST_Q / 2
        if not course.changes_throughout(-max(least, -course.rate_1_s / ALIKE)):
            continue
        found.append(
            Suspicion(
                wave.run_id,
                "its mode is forced, and its wave is a free one's",
                f"no drive is logged, and its amplitude falls to {np.exp(course.change):.2g} of"
                f" itself, at {-course.rate_1_s:.3g} 1/s throughout",
                "set mode to free (--mode free at the import), or log what drove it in drive_main",
            )
        )
    return found
