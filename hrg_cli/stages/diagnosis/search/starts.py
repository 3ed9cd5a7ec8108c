"""Diagnosis, the runs' frequencies against the times at which they began: what creeps or warms up
between runs and, unlike what ages, stands still within them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ....records.time_origin import count_from_first
from ..thresholds import FREQUENCIES, MOVES_WITH_STARTS

Array = np.ndarray
FEWEST = 4
"""Runs from which a line through their frequencies says something."""


def tell_course(said: Mapping[str, Any], start_times: Sequence[str]) -> dict[str, Any]:
    """What is told of the runs' frequencies, with the line that they go along where they go with
    the times at which the runs began.

    Parameters
    ----------
    said
        Of the frequencies: `hz`, `sigma` and `sentence`.
    start_times
        Of the runs, ISO 8601; empty where one is not known.

    Returns
    -------
    dict
        The same where they agree, where a cause would make them so, where not all times are known,
        or where no line takes nearly all of their scatter.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.search.starts import tell_course
    >>> said = {"hz": [1e3, 1e3 + 1e-6, 1e3 + 2e-6, 1e3 + 4e-6], "sigma": 50.0}
    >>> said["sentence"] = "the frequencies differ; repeat a run as it was"
    >>> hours = [f"2026-05-04T{h:02}:00:00Z" for h in (8, 9, 10, 12)]
    >>> tell_course(said, hours)["sentence"].split("; ")[1]
    'they go with the times at which the runs began, by 2.78e-13 of the frequency a second'
    """
    told = dict(said)
    if told.get("sigma") is None or told["sigma"] < FREQUENCIES or told.get("would_follow"):
        return told
    if len(told["hz"]) != len(start_times):
        return told
    hz = np.asarray(told["hz"], float)
    begin_s = np.array(count_from_first(start_times))
    if len(hz) < FEWEST or not np.ptp(begin_s) > 0:
        return told
    line = np.polyfit(begin_s - begin_s.mean(), hz - hz.mean(), 1)
    left = hz - hz.mean() - np.polyval(line, begin_s - begin_s.mean())
    if np.sum(left**2) > MOVES_WITH_STARTS * np.sum((hz - hz.mean()) ** 2):
        return told
    differ = str(told["sentence"]).split("; ")[0]
    told["sentence"] = (
        f"{differ}; they go with the times at which the runs began, by"
        f" {line[0] / hz.mean():.3g} of the frequency a second; what creeps or warms up between"
        " runs does so: record them at one temperature, or repeat the first run last"
    )
    return told
