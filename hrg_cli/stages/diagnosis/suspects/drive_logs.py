"""A driven run whose log of the drive is wrong: of the other sign, of another size, late."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ....fitting.causes.extended_fit import ExtendedFit
from ....records import Wave
from . import transformations as change
from .readings import FINEST, LATEST, Reading, find_late_log_mistakes, find_least_misfit

LARGEST = 100.0
"""Times by which a log may be too large or too small."""


def find_drive_mistakes(wave: Wave, others: ExtendedFit) -> Iterator[Reading]:
    """A drive log of another sign or size, or late.

    Parameters
    ----------
    wave
        Of the run that is doubted.
    others
        The others' fit, whose coordinates are held.

    Returns
    -------
    iterator of Reading
        None of a run without a log of the drive.

    Examples
    --------
    A free run logs no drive:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.drive_logs import find_drive_mistakes
    >>> list(find_drive_mistakes(draw_waves()[1], draw_fit()))
    []
    """
    if wave.drive_main is None or wave.drive_quadrature is None:
        return
    yield Reading(
        "drive log of wrong sign",
        (change.scale_drive(wave, -1.0),),
        0,
        "with the sign of the logged commands turned",
        "turn the sign of this run's drive log",
    )
    power = find_least_misfit(
        lambda x: change.scale_drive(wave, float(np.exp(x))), others, np.log(LARGEST), FINEST
    )
    if power is not None:
        factor = float(np.exp(power))
        yield Reading(
            "drive log of wrong scale",
            (change.scale_drive(wave, factor),),
            1,
            f"with the logged commands multiplied by {factor:.4g}",
            f"multiply this run's drive log by {factor:.4g}, or find its unit",
        )
    span = float(wave.time_s[-1] - wave.time_s[0])
    late = find_least_misfit(
        lambda t: change.advance_drive(wave, t), others, LATEST * span, FINEST * span
    )
    if late is not None:
        yield find_late_log_mistakes("drive log", change.advance_drive(wave, late), late)
