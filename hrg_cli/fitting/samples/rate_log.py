"""Which windows of a run its rate log covers: one rule for everything that needs the rate.

A window whose rate is not finite turned by an unknown angle. Between two known rates that are a few
windows apart the rate is bridged; beyond the log's ends, and across a longer hole, nothing says how
far the table turned, so the stretches on both sides of a hole are as good as two runs: each has a
start of its own. What can take one stretch alone takes the one with the most known windows.
"""

from __future__ import annotations

import numpy as np

from ...records import Wave
from ...records.windowed import FLAG_NOT_FINITE

Array = np.ndarray
BRIDGED = 5
"""Windows without a rate, between two with one, over which it is bridged."""
ROWS_AT_ONCE = 1 << 16


def find_stretches(wave: Wave) -> Array:
    """The stretch (n,) of its rate log that each window is in, from 1; 0 where the log does not
    cover it. All windows are in one where no log was kept."""
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
    """Windows (n,) bool in the longest stretch of a run's rate log; all of them where none was
    kept."""
    stretch = find_stretches(wave)
    return (stretch == np.argmax(np.bincount(stretch, minlength=2)[1:]) + 1) & (stretch > 0)


def restrict_to_log(wave: Wave, inside: Array | None = None) -> Wave:
    """The wave with the windows outside one stretch of its rate log flagged as not finite, and
    their rates unknown; of a file nothing but rates and flags is read. inside (n,): the stretch,
    by default the longest."""
    inside = find_covered(wave) if inside is None else inside
    if inside.all() or wave.rate_rad_s is None:
        return wave
    flags, rate = np.asarray(wave.flags[:]), np.asarray(wave.rate_rad_s[:], float)
    return wave.replace(
        flags=np.where(inside, flags, flags | FLAG_NOT_FINITE).astype(flags.dtype),
        rate_rad_s=np.where(inside, rate, np.nan),
    )


def describe_left_out(wave: Wave, inside: Array) -> str:
    """What to say of the windows that a run's rate log does not cover (`inside`: those it does);
    empty where there is none."""
    outside = int(np.count_nonzero(~inside))
    if not outside:
        return ""
    return (
        f"{outside} of {len(wave)} windows of run {wave.run_id or '?'} lie outside its rate log and"
        " are left out"
    )
