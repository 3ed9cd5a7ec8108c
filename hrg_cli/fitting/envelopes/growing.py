"""Free runs whose amplitude grows: a passive resonator's energy E = a² + q² only falls,
Ė = −4 u*·N u ≤ 0 with the damping matrix N ≥ 0 (PHYSICS §0), so time runs backwards in them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...records import Wave
from .amplitude_course import ALIKE, read_course

CORRECTION = (
    "put its samples in the order in which they were taken; if they are, look for a drive that was"
    " left on, and give it as mode forced with its log"
)
"""What to do about it."""


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
    courses = [read_course(wave) if wave.mode == "free" else None for wave in waves]
    rates = [np.nan if one is None or one.driven else one.rate_1_s for one in courses]
    falling = -np.array([rate for rate in rates if rate < 0])
    if not len(falling):
        return []
    usual = float(np.median(falling))
    return [
        Growing(run, rate, usual, course.change)
        for run, (course, rate) in enumerate(zip(courses, rates, strict=True))
        if course is not None
        and course.change > least
        and rate < ALIKE * usual
        and course.changes_throughout(usual / ALIKE)
    ]
