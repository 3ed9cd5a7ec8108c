"""Diagnosis, before any physics is blamed: is one run, or one log, not what it says it is?

A wrong run is one without which the others agree, and which agrees with them once one mistake is
undone. Every mistake is a change of the run's wave or of its logs; all are fitted as the base model
is, and held against one another, against leaving the run out, and against the causes of the
catalogue by χ² + parameters·ln N at the noise of the best of them.
"""

from __future__ import annotations

from ...suspicion import Suspicion
from .backwards import find_backward_runs
from .mislabelled import find_mislabelled
from .quiet import QuietMistake, suspect_plain_run, suspect_quiet_run
from .repeats import find_stuck_columns, find_twin_channels
from .search import suspect_runs

__all__ = [
    "QuietMistake",
    "Suspicion",
    "find_backward_runs",
    "find_mislabelled",
    "find_stuck_columns",
    "find_twin_channels",
    "suspect_plain_run",
    "suspect_quiet_run",
    "suspect_runs",
]
