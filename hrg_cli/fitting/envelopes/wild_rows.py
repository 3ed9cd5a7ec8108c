"""Windows of a wave that hold what no wave can: a few alone, thousands of times what all others do.
No fit survives one, and none says which it was."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ...records import FLAG_NOT_FINITE, Wave
from ..samples.wild import ABOUT, find_lonely, measure_tame

Array = np.ndarray

COLUMNS = (
    *("main_amplitude", "quadrature_amplitude", "wave_angle_rad", "phase_rad"),
    *("rate_rad_s", "temperature_degc"),
)

WILD = 1e3
"""Distance from the middle, over the largest of the others, from which a row's value is wild."""

BLOCK = 1 << 13
"""Windows that are held against one another: what is kept does not grow with the run."""


def flag_wild_rows(wave: Wave) -> tuple[Wave, str]:
    """The wave with windows flagged that hold what no wave can.

    Parameters
    ----------
    wave
        As it was read.

    Returns
    -------
    tuple of Wave and str
        The wave with those windows flagged, and the first of them in words; as it is, and nothing,
        where there is none.

    Examples
    --------
    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli import Wave
    >>> from hrg_cli.fitting.envelopes.wild_rows import flag_wild_rows
    >>> t, ones = np.arange(100.0), np.ones(100)
    >>> wave = Wave(**{f.name: ones for f in fields(Wave) if f.default is MISSING} | dict(
    ...     time_s=t, flags=np.zeros(100, "u1"), iterations=np.zeros(100, "i2"), run_id="left",
    ...     main_amplitude=np.where(t == 40, 1e9, 1.0), reference_frequency_hz=5e3, window_s=1.0,
    ... ))
    >>> flagged, said = flag_wild_rows(wave)
    >>> np.flatnonzero(flagged.flags).tolist()
    [40]
    >>> print(said[:50])
    run left: main_amplitude is 1e+09 in row 41 of its
    """
    ends = np.linspace(0, len(wave), max(1, len(wave) // BLOCK) + 1).astype(int).tolist()
    found = [one for start, stop in pairwise(ends) for one in _wild_of(wave, start, stop)]
    if not found:
        return wave, ""
    flags = np.array(wave.flags)
    for one in found:
        flags[one.rows] |= FLAG_NOT_FINITE
    first = found[0]
    row = int(first.rows[0])
    return wave.replace(flags=flags), (
        f"run {wave.run_id or '?'}: {first.name} is {float(getattr(wave, first.name)[row]):.4g}"
        f" in row {row + 1} of its wave, where the others stay within {first.tame:.4g}; such"
        " rows are left out"
    )


class _Wild(NamedTuple):
    """Wild rows of one column, and the largest size that the others beside them have."""

    name: str
    rows: Array
    tame: float


def _wild_of(wave: Wave, start: int, stop: int) -> Iterator[_Wild]:
    """The wild rows among some of a wave."""
    part = wave.rows(start, stop)
    good = np.flatnonzero(part.good())
    for name in COLUMNS:
        values = getattr(part, name)
        if values is not None:
            rows, tame = find_wild_rows(np.asarray(values)[good])
            if len(rows):
                yield _Wild(name, start + good[rows], tame)


def find_wild_rows(values: Array) -> tuple[Array, float]:
    """Places of the wild ones among values: a few alone, far beyond all others.

    Parameters
    ----------
    values
        (n,), of one column; those that are not finite count for nothing.

    Returns
    -------
    tuple of ndarray and float
        Their places, and the largest size that the others have; no place and 0 where none is wild.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.wild_rows import find_wild_rows
    >>> decay = np.exp(-0.01 * np.arange(100.0))
    >>> decay[40] = 1e9
    >>> places, tame = find_wild_rows(decay)
    >>> places.tolist(), tame
    ([40], 1.0)
    """
    known = np.isfinite(values)
    if known.sum() <= 2 * ABOUT:
        return np.zeros(0, int), 0.0
    middle = float(np.median(values[known]))
    off = np.abs(np.where(known, values, middle) - middle)
    size = max(measure_tame(off[known]), abs(middle))
    if size == 0 or not off.max() > WILD * size:
        return np.zeros(0, int), 0.0
    places = find_lonely(off > WILD * size)
    others = np.delete(values, places)
    return places, float(np.nanmax(np.abs(others)))
