"""Windows of a wave that hold what no wave can: a few alone, thousands of times what all others do. No
fit survives one, and none says which it was."""

from __future__ import annotations

import numpy as np

from ...records import FLAG_NOT_FINITE, Wave
from ..samples.wild import ABOUT, MOST_TOGETHER, WILD, find_lonely

Array = np.ndarray

COLUMNS = (
    *("main_amplitude", "quadrature_amplitude", "wave_angle_rad", "phase_rad"),
    *("rate_rad_s", "temperature_degc"),
)


def flag_wild_rows(wave: Wave) -> tuple[Wave, str]:
    """The wave with such windows flagged, and the first of them in words; as it is, and nothing,
    where there is none."""
    good = np.flatnonzero(wave.good())
    if len(good) <= 2 * ABOUT:
        return wave, ""
    flags, said = None, ""
    for name in COLUMNS:
        values = getattr(wave, name)
        if values is None:
            continue
        rows, tame = find_wild_rows(np.asarray(values)[good])
        if not len(rows):
            continue
        flags = np.array(wave.flags) if flags is None else flags
        flags[good[rows]] |= FLAG_NOT_FINITE
        row = good[rows[0]]
        said = said or (
            f"run {wave.run_id or '?'}: {name} is {float(values[row]):.4g} in row {row + 1} of its"
            f" wave, where the others stay within {tame:.4g}; such rows are left out"
        )
    return (wave, "") if flags is None else (wave.replace(flags=flags), said)


def find_wild_rows(values: Array) -> tuple[Array, float]:
    """Places of the wild ones among values (n,), and the largest size that the others have."""
    known = np.isfinite(values)
    if known.sum() <= 2 * ABOUT:
        return np.zeros(0, int), 0.0
    middle = float(np.median(values[known]))
    off = np.abs(np.where(known, values, middle) - middle)
    size = max(float(np.partition(off[known], -MOST_TOGETHER - 1)[-MOST_TOGETHER - 1]), abs(middle))
    if size == 0 or not off.max() > WILD * size:
        return np.zeros(0, int), 0.0
    places = find_lonely(off > WILD * size)
    others = np.delete(values, places)
    return places, float(np.nanmax(np.abs(others)))
