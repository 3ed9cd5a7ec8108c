"""A rate log with a constant too much in it: a rate sensor's bias, or a turn of the Earth left
out."""

from __future__ import annotations

from collections.abc import Iterator

from ....fitting.causes.extended_fit import ExtendedFit
from ....records import Wave
from . import transformations as change
from .readings import SCALE_FACTOR, Reading, find_least_misfit, has_varying_rate

FARTHEST_RAD, FINEST_RAD = 3.0, 1e-3
"""Turn of the wave over the run by which the offset is sought, and to which it is found: within the
finer one χ² is a parabola."""


def find_offset_mistakes(wave: Wave, others: ExtendedFit) -> Iterator[Reading]:
    """A constant beside the log.

    Of a constant rate it is its scale that is wrong, which is the same.

    Parameters
    ----------
    wave
        Of the run that is doubted.
    others
        The others' fit, whose coordinates are held.

    Returns
    -------
    iterator of Reading
        At most one; none of a constant rate.

    Examples
    --------
    A sensor's bias of 0.1 rad/s:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_swing
    >>> from hrg_cli.stages.diagnosis.suspects.rate_offsets import find_offset_mistakes
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import offset_rate
    >>> [one.found[:24] for one in find_offset_mistakes(offset_rate(draw_swing(), 0.1), draw_fit())]
    ['its rate log reads +0.09']
    """
    if not has_varying_rate(wave):
        return
    # K ∫Ω dt is the turn of twice the pattern's angle in the envelopes' plane (physics, §1)
    turn_s = abs(others.coordinate(SCALE_FACTOR)) * float(wave.time_s[-1] - wave.time_s[0])
    if turn_s == 0:
        return
    offset = find_least_misfit(
        lambda rate: change.offset_rate(wave, -rate),
        others,
        FARTHEST_RAD / turn_s,
        FINEST_RAD / turn_s,
    )
    if offset is None:
        return
    yield Reading(
        "rate log offset",
        (change.offset_rate(wave, -offset),),
        1,
        f"its rate log reads {offset:+.4g} rad/s beside what its wave shows: without that",
        f"take {offset:.4g} rad/s off this run's rate log: a sensor's bias, or a rotation that the"
        " other logs hold",
    )
