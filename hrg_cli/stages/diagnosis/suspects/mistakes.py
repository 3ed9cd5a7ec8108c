"""Every mistake that a run could show: in its motion, and beside it in its thermometer."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from ....fitting.causes.extended_fit import ExtendedFit
from ....records import Wave
from .clipping import find_clipping_mistakes
from .drive_logs import find_drive_mistakes
from .rate_offsets import find_offset_mistakes
from .readings import (
    Reading,
    find_amplifier_mistakes,
    find_channel_mistakes,
    find_damping_mistakes,
    find_knock_mistakes,
    find_rate_mistakes,
    find_time_mistakes,
)
from .thermometers import find_thermometer_mistakes

Maker = Callable[[Wave, ExtendedFit], Iterator[Reading]]


def find_mistakes(wave: Wave, others: ExtendedFit) -> Iterator[Reading]:
    """Every mistake that this run's motion could show beside the others' coordinates.

    Parameters
    ----------
    wave
        Of the run that is doubted.
    others
        The others' fit, whose coordinates are held.

    Returns
    -------
    iterator of Reading
        Each made when it is asked for.

    Examples
    --------
    >>> from itertools import islice
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.mistakes import find_mistakes
    >>> [one.what for one in islice(find_mistakes(draw_waves()[1], draw_fit()), 2)]
    ['channels swapped', 'one channel inverted']
    """
    yield from find_channel_mistakes(wave, others)
    yield from find_amplifier_mistakes(wave, others)
    yield from find_clipping_mistakes(wave, others)
    yield from find_time_mistakes(wave, others)
    yield from find_rate_mistakes(wave, others)
    yield from find_offset_mistakes(wave, others)
    yield from find_drive_mistakes(wave, others)
    yield from find_knock_mistakes(wave)
    yield from find_damping_mistakes(wave, others)


def find_every_mistake(wave: Wave, others: ExtendedFit) -> Iterator[Reading]:
    """The mistakes of a run's motion, and of its thermometer where a cause follows it.

    Parameters
    ----------
    wave
        Of the run that is doubted.
    others
        The others' fit, whose coordinates are held.

    Returns
    -------
    iterator of Reading
        Those of `find_mistakes` first.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.mistakes import find_every_mistake
    >>> next(find_every_mistake(draw_waves()[1], draw_fit())).what
    'channels swapped'
    """
    yield from find_mistakes(wave, others)
    yield from find_thermometer_mistakes(wave, others)
