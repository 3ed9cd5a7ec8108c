"""Sampling rates as laboratories name them among the single numbers of a file."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

_RATE = re.compile(r"^(fs|f_s|samp\w*[_ ]?(rate|freq\w*)(_hz)?|rate_hz)$", re.IGNORECASE)
_STEP = re.compile(
    r"^(dt|d_t|ts|tinterval|x?increment|delta[_ ]?[xt]|samp\w*[_"
    r" ]?(interval|period|time)(_s)?|wf_increment)$",
    re.IGNORECASE,
)


def find_rate(scalars: Mapping[str, float]) -> float | None:
    """The sampling rate [Hz] among named numbers (paths count by their last part); None where there
    is none."""
    for pattern, invert in ((_RATE, False), (_STEP, True)):
        for name, value in scalars.items():
            if pattern.match(name.split("/")[-1]) and math.isfinite(value) and value > 0:
                return 1 / value if invert else value
    return None
