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
    """The sampling rate among a file's named numbers.

    Parameters
    ----------
    scalars
        Name -> number; of a path the last part counts. Rates go before steps.

    Returns
    -------
    float or None
        Hz; None where no name tells one, or its number is none.

    Examples
    --------
    >>> from hrg_cli.formats.scalars import find_rate
    >>> find_rate({"bench/dt": 1e-4, "gain": 2.0}), find_rate({"gain": 2.0})
    (10000.0, None)
    """
    for pattern, invert in ((_RATE, False), (_STEP, True)):
        for name, value in scalars.items():
            if pattern.match(name.split("/")[-1]) and math.isfinite(value) and value > 0:
                return 1 / value if invert else value
    return None
