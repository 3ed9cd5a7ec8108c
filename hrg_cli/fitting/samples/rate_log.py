"""Which windows of a run its rate log covers: one rule for everything that needs the rate.

A window whose rate is not finite turned by an unknown angle. Between two known rates that are a few
windows apart the rate is bridged; beyond the log's ends, and across a longer hole, nothing says how
far the table turned, so one stretch remains: the one with the most known windows.
"""

from __future__ import annotations

import numpy as np

from ...records import Wave
from ...records.windowed import FLAG_NOT_FINITE

Array = np.ndarray
BRIDGED = 5
"""Windows without a rate, between two with one, over which it is bridged."""
ROWS_AT_ONCE = 1 << 16


def covered(wave: Wave) -> Array:
    """Windows (n,) bool that a run's rate log covers; all of them where none was kept."""
    if wave.rate_rad_s is None:
        return np.ones(len(wave), bool)
    pieces = wave.only(("rate_rad_s",)).blocks(ROWS_AT_ONCE)
    finite = [np.isfinite(np.asarray(piece.rate_rad_s, float)) for piece in pieces]
    known = np.flatnonzero(np.concatenate([np.zeros(0, bool), *finite]))
    inside = np.zeros(len(wave), bool)
    if len(known):
        stretches = np.split(known, np.flatnonzero(np.diff(known) > BRIDGED + 1) + 1)
        longest = max(stretches, key=len)
        inside[longest[0] : longest[-1] + 1] = True
    return inside


def within_log(wave: Wave, inside: Array | None = None) -> Wave:
    """The wave with the windows that its rate log does not cover flagged as not finite; of a file
    nothing but rates and flags is read. inside (n,): `covered`, where that is known."""
    inside = covered(wave) if inside is None else inside
    if inside.all():
        return wave
    flags = np.asarray(wave.flags[:])
    return wave.replace(flags=np.where(inside, flags, flags | FLAG_NOT_FINITE).astype(flags.dtype))


def left_out(wave: Wave, inside: Array) -> str:
    """What to say of the windows that a run's rate log does not cover (`inside`: those it does);
    empty where there is none."""
    outside = int(np.count_nonzero(~inside))
    if not outside:
        return ""
    return (
        f"{outside} of {len(wave)} windows of run {wave.run_id or '?'} lie outside its rate log and"
        " are left out"
    )
