"""Free runs whose amplitude grows: a passive resonator's energy E = a² + q² only falls,
Ė = −4 u*·N u ≤ 0 with the damping matrix N ≥ 0 (PHYSICS §0), so time runs backwards in them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...records import Wave

Array = np.ndarray

PARTS, PIECES = 3, 12
"""Parts of a run that must each grow, and pieces of it whose medians are looked at."""
ALIKE = 3.0
"""Times by which the dampings of two wave angles differ at most, split by half of their mean."""
CORRECTION = (
    "put its samples in the order in which they were taken; if they are, look for a drive that was"
    " left on, and give it as mode forced with its log"
)
"""What to do about it."""
READ = (
    *("time_s", "flags", "iterations", "wave_angle_rad"),
    *("main_amplitude", "quadrature_amplitude", "drive_main"),
)
BLOCK, SAMPLE = 1 << 16, 1 << 14
"""Rows that are read at a time; rows of a run that are looked at."""


@dataclass(frozen=True)
class Growing:
    """A run by its place, the rate 1/s at which its amplitude grows, that at which the others'
    falls, and ln of the growth over the run."""

    run: int
    rate_1_s: float
    others_1_s: float
    grown: float

    @property
    def evidence(self) -> str:
        """The figures that show it."""
        return (
            f"its amplitude grows {np.exp(self.grown):.3g} times, at {self.rate_1_s:.3g}"
            f" 1/s, as the others' falls at {self.others_1_s:.3g} 1/s: no damping is negative"
        )


def find_growing(waves: Sequence[Wave], least: float) -> list[Growing]:
    """The free runs that grow in each of their parts about as fast as most of the others fall.

    Parameters
    ----------
    waves
        Of one gyro.
    least
        ln of the growth over a run from which no read-out makes it.

    Returns
    -------
    list of Growing
        In the order of the runs; empty where no other run falls, and nothing tells which way time
        runs.

    Examples
    --------
    The second of three runs is played backwards:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.growing import find_growing
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> one, other = draw_waves()[:2]
    >>> fallen = np.exp(-np.linspace(0, 1, len(one)))
    >>> waves = [one.replace(main_amplitude=course) for course in (fallen, fallen[::-1], fallen)]
    >>> [(found.run, round(found.grown, 1)) for found in find_growing(waves, 0.1)]
    [(1, 0.9)]
    """
    courses = [_read_course(wave) for wave in waves]
    rates = [np.nan if course is None else _measure_rate(*course) for course in courses]
    falling = -np.array([rate for rate in rates if rate < 0])
    if not len(falling):
        return []
    usual = float(np.median(falling))
    return [
        Growing(run, rate, usual, rate * float(np.ptp(course[0])))
        for run, (course, rate) in enumerate(zip(courses, rates, strict=True))
        if course is not None
        and rate * np.ptp(course[0]) > least
        and usual / ALIKE < rate < ALIKE * usual
        and _grows_throughout(*course, usual / ALIKE)
    ]


def _read_course(wave: Wave) -> tuple[Array, Array] | None:
    """Times and ln of the amplitude √(a² + q²), medians of `PIECES` pieces; None of a run that is
    driven, or holds too few windows."""
    if wave.mode != "free":
        return None
    every, rows = max(1, len(wave) // SAMPLE), []
    for part in wave.only(READ).blocks(BLOCK):
        if part.drive_main is not None and np.any(np.nan_to_num(part.drive_main)):
            return None
        good = np.flatnonzero(part.good())[::every]
        a, q = (
            np.asarray(column, float)[good]
            for column in (part.main_amplitude, part.quadrature_amplitude)
        )
        rows.append(np.stack([np.asarray(part.time_s, float)[good], np.hypot(a, q)]))
    time_s, size = np.concatenate(rows, axis=1) if rows else np.zeros((2, 0))
    known = size > 0
    if np.count_nonzero(known) < 2 * PIECES:
        return None
    pieces = np.array_split(np.stack([time_s[known], np.log(size[known])]), PIECES, axis=1)
    middles = np.array([np.median(piece, axis=1) for piece in pieces])
    return middles[:, 0], middles[:, 1]


def _measure_rate(time_s: Array, log_size: Array) -> float:
    """Slope of the line through them, 1/s."""
    return float(np.polyfit(time_s - time_s[0], log_size, 1)[0])


def _grows_throughout(time_s: Array, log_size: Array, least_1_s: float) -> bool:
    """Whether it grows at that rate in each part: a knock, or a beat, grows in one."""
    parts = zip(np.array_split(time_s, PARTS), np.array_split(log_size, PARTS), strict=True)
    return all(_measure_rate(t, x) > least_1_s for t, x in parts)
