"""How a run's amplitude √(a² + q²) grows or falls, in medians of a few pieces: whether it is driven
or free, and which way time runs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...records import Wave

Array = np.ndarray

PARTS, PIECES = 3, 12
"""Parts of a run that must each change, and pieces of it whose medians are looked at."""
ALIKE = 3.0
"""Times by which the dampings of two wave angles differ at most, split by half of their mean."""
HIGHEST_Q = 1e8
"""Quality factor that no gyro exceeds by much: the best fused silica has 1e7 to 1e8."""
READ = (
    *("time_s", "flags", "iterations", "wave_angle_rad"),
    *("main_amplitude", "quadrature_amplitude", "drive_main"),
)
BLOCK, SAMPLE = 1 << 16, 1 << 14
"""Rows that are read at a time; rows of a run that are looked at."""


@dataclass(frozen=True)
class AmplitudeCourse:
    """Times and ln of the amplitude (`PIECES`,), and whether a drive is logged."""

    time_s: Array
    log_size: Array
    driven: bool

    @property
    def rate_1_s(self) -> float:
        """Slope of the line through ln of the amplitude, 1/s; negative where it falls."""
        return _measure_rate(self.time_s, self.log_size)

    @property
    def change(self) -> float:
        """ln of its growth from the first piece to the last, along that line."""
        return self.rate_1_s * float(np.ptp(self.time_s))

    def changes_throughout(self, rate_1_s: float) -> bool:
        """Whether it changes in each part at a rate or faster: a knock, or a beat, does in one.

        Parameters
        ----------
        rate_1_s
            Its sign is the change's.

        Returns
        -------
        bool
            In each of `PARTS` parts.
        """
        pieces = (np.array_split(one, PARTS) for one in (self.time_s, self.log_size))
        return all(_measure_rate(t, x) / rate_1_s > 1 for t, x in zip(*pieces, strict=True))


def read_course(wave: Wave) -> AmplitudeCourse | None:
    """The course of a run's amplitude, read block by block.

    Parameters
    ----------
    wave
        Of the run.

    Returns
    -------
    AmplitudeCourse or None
        None where there are too few good windows.

    Examples
    --------
    A damping of 0.5 1/s over a second:

    >>> from hrg_cli.fitting.envelopes.amplitude_course import read_course
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> course = read_course(draw_waves()[0])
    >>> course.driven, course.changes_throughout(-0.3), round(course.rate_1_s, 1)
    (False, True, -0.5)
    """
    every, rows, driven = max(1, len(wave) // SAMPLE), [], False
    for part in wave.only(READ).blocks(BLOCK):
        driven |= part.drive_main is not None and bool(np.any(np.nan_to_num(part.drive_main)))
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
    return AmplitudeCourse(middles[:, 0], middles[:, 1], driven)


def _measure_rate(time_s: Array, log_size: Array) -> float:
    return float(np.polyfit(time_s - time_s[0], log_size, 1)[0])
