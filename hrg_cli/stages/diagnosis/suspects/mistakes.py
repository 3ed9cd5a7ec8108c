"""Every mistake that a run's motion could show."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from ....fitting.causes.extended_fit import ExtendedFit
from ....records import Wave
from .drive_logs import of_the_drive
from .rate_offsets import of_an_offset
from .readings import (
    Reading,
    of_a_knock,
    of_the_channels,
    of_the_damping,
    of_the_rate,
    of_the_time,
)

Maker = Callable[[Wave, ExtendedFit], Iterator[Reading]]


def find_mistakes(wave: Wave, others: ExtendedFit) -> Iterator[Reading]:
    """Every mistake that this run's motion could show beside the others' coordinates."""
    yield from of_the_channels(wave, others)
    yield from of_the_time(wave, others)
    yield from of_the_rate(wave, others)
    yield from of_an_offset(wave, others)
    yield from of_the_drive(wave, others)
    yield from of_a_knock(wave)
    yield from of_the_damping(wave, others)
