"""Which windows of a run its rate log covers: one rule for everything that needs the rate.

A window whose rate is not finite turned by an unknown angle. Between two known rates that are a few
windows apart the rate is bridged; beyond the log's ends, and across a longer hole, nothing says how
far the table turned, so the stretches on both sides of a hole are as good as two runs: each has a
start of its own. What can take one stretch alone takes the longest.
"""

from __future__ import annotations

import numpy as np

from ...records import Wave
from ...records.windowed import FLAG_NOT_FINITE

Array = np.ndarray
BRIDGED = 5
"""Windows without a rate, between two with one, over which it is bridged."""
ROWS_AT_ONCE = 1 << 16
NO_FINITE_VALUE = "holds no finite value"
"""What the status of a run says of a log all of whose rows are NaN."""


def find_stretches(wave: Wave) -> Array:
    """The stretch of its rate log that each window is in.

    Parameters
    ----------
    wave
        Of a run; of a file nothing but rates is read.

    Returns
    -------
    ndarray
        (n,), from 1; 0 where the log does not cover the window. All are in one where no log was
        kept.

    Examples
    --------
    A rate lost for 3 windows is bridged, one lost for 8 is not:

    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli import Wave
    >>> from hrg_cli.fitting.samples.rate_log import find_stretches
    >>> rate, ones = np.full(24, 0.5), np.ones(24)
    >>> rate[4:7] = rate[12:20] = np.nan
    >>> wave = Wave(**{f.name: ones for f in fields(Wave) if f.default is MISSING} | dict(
    ...     time_s=np.arange(24.0), rate_rad_s=rate, flags=np.zeros(24, "u1"),
    ...     iterations=np.zeros(24, "i2"), window_s=1.0, reference_frequency_hz=5e3,
    ... ))
    >>> "".join(map(str, find_stretches(wave)))
    '111111111111000000002222'
    """
    if wave.rate_rad_s is None:
        return np.ones(len(wave), np.int32)
    pieces = wave.only(("rate_rad_s",)).blocks(ROWS_AT_ONCE)
    finite = [np.isfinite(np.asarray(piece.rate_rad_s, float)) for piece in pieces]
    known = np.flatnonzero(np.concatenate([np.zeros(0, bool), *finite]))
    out = np.zeros(len(wave), np.int32)
    holes = np.flatnonzero(np.diff(known) > BRIDGED + 1) + 1
    for number, rows in enumerate(np.split(known, holes) if len(known) else [], 1):
        out[rows[0] : rows[-1] + 1] = number
    return out


def find_covered(wave: Wave) -> Array:
    """Windows in the longest stretch of a run's rate log.

    Parameters
    ----------
    wave
        Of a run.

    Returns
    -------
    ndarray
        (n,) bool; all True where no log was kept.

    Examples
    --------
    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli import Wave
    >>> from hrg_cli.fitting.samples.rate_log import find_covered
    >>> rate, ones = np.full(24, 0.5), np.ones(24)
    >>> rate[12:20] = np.nan
    >>> wave = Wave(**{f.name: ones for f in fields(Wave) if f.default is MISSING} | dict(
    ...     time_s=np.arange(24.0), rate_rad_s=rate, flags=np.zeros(24, "u1"),
    ...     iterations=np.zeros(24, "i2"), window_s=1.0, reference_frequency_hz=5e3,
    ... ))
    >>> np.flatnonzero(find_covered(wave)).tolist()
    [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11]
    """
    stretch = find_stretches(wave)
    return (stretch == np.argmax(np.bincount(stretch, minlength=2)[1:]) + 1) & (stretch > 0)


def restrict_to_log(wave: Wave, inside: Array | None = None) -> Wave:
    """The wave with the windows outside one stretch of its rate log flagged as not finite, and
    their rates unknown.

    Of a file nothing but rates and flags is read.

    Parameters
    ----------
    wave
        Of a run.
    inside
        Windows of the stretch (n,) bool; None: of the longest.

    Returns
    -------
    Wave
        The same one where nothing is outside.

    Examples
    --------
    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli import Wave
    >>> from hrg_cli.fitting.samples.rate_log import restrict_to_log
    >>> rate, ones = np.full(12, 0.5), np.ones(12)
    >>> rate[:3] = np.nan
    >>> wave = Wave(**{f.name: ones for f in fields(Wave) if f.default is MISSING} | dict(
    ...     time_s=np.arange(12.0), rate_rad_s=rate, flags=np.zeros(12, "u1"),
    ...     iterations=np.zeros(12, "i2"), window_s=1.0, reference_frequency_hz=5e3,
    ... ))
    >>> restrict_to_log(wave).flags.tolist()
    [4, 4, 4, 0, 0, 0, 0, 0, 0, 0, 0, 0]
    """
    inside = find_covered(wave) if inside is None else inside
    if inside.all() or wave.rate_rad_s is None:
        return wave
    flags, rate = np.asarray(wave.flags[:]), np.asarray(wave.rate_rad_s[:], float)
    return wave.replace(
        flags=np.where(inside, flags, flags | FLAG_NOT_FINITE).astype(flags.dtype),
        rate_rad_s=np.where(inside, rate, np.nan),
    )


def describe_left_out(wave: Wave, inside: Array) -> str:
    """What to say of the windows that a run's rate log does not cover.

    Parameters
    ----------
    wave
        Of a run.
    inside
        Windows that it covers (n,) bool.

    Returns
    -------
    str
        Empty where there is nothing to say.

    Examples
    --------
    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli import Wave
    >>> from hrg_cli.fitting.samples.rate_log import describe_left_out
    >>> ones = np.ones(12)
    >>> wave = Wave(**{f.name: ones for f in fields(Wave) if f.default is MISSING} | dict(
    ...     time_s=np.arange(12.0), flags=np.zeros(12, "u1"), iterations=np.zeros(12, "i2"),
    ...     window_s=1.0, reference_frequency_hz=5e3, run_id="3",
    ... ))
    >>> describe_left_out(wave, np.arange(12) > 2)
    '3 of 12 windows of run 3 lie outside its rate log and are left out'
    """
    outside = int(np.count_nonzero(~inside))
    if not outside:
        return ""
    run = f"run {wave.run_id or '?'}"
    empty = [
        why for why in wave.status_reasons if why.startswith(f"the rate log {NO_FINITE_VALUE}")
    ]
    if empty:
        return f"{run}: {empty[0]}"
    return f"{outside} of {len(wave)} windows of {run} lie outside its rate log and are left out"
