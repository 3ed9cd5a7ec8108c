"""Samples that no wave can hold: a few alone, many times what stands about them. A bit that flipped
or a word that was torn makes such a number; unnamed, it is all that a spectrum shows, and at even
distances such numbers are lines.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from ...records import Recording
from ..medians import find_median
from .looks import Look

Array = np.ndarray

WILD = 10.0
"""Distance from the middle, over the largest of the others in the looks, from which a sample is
wild."""

CALM = 3.0
"""The same, up to which all samples about a wild one are: a wave that comes to such a size between
two looks has others between."""

USUAL = 0.9
"""Part of a look's distances from the middle that the usual one exceeds."""

MOST_TOGETHER, ABOUT = 3, 8
"""Wild samples at most that stand within so many samples of one another: an oscillation so far
above what the looks hold (a strike between them) has more."""

MOST_KEPT = 1000
"""Wild samples whose places are kept."""


class TameChannel:
    """A channel whose wild samples read as NaN; sliced as an array is, by slices without a step."""

    def __init__(self, values: Any, middle: float, tame: float) -> None:
        self._values, self._middle = values, middle
        self.tame = tame
        """The largest distance from the middle, raw, that the looks' other samples have."""
        self.wild: dict[int, float] = {}
        """Raw values of the wild samples read so far, by their places."""
        self.dtype, self.shape = values.dtype, values.shape

    def __len__(self) -> int:
        return len(self._values)

    def __getitem__(self, rows: slice) -> Array:
        part = np.asarray(self._values[rows])
        limit = WILD * self.tame
        if not len(part) or (
            part.max() <= self._middle + limit and part.min() >= self._middle - limit
        ):
            return part
        # samples beyond the slice decide as well which within it stand alone: what is wild must not
        # hang on how a recording is cut into blocks
        first, last, _ = rows.indices(len(self))
        start = max(0, first - ABOUT)
        about = np.asarray(self._values[start : last + ABOUT], dtype=float)
        off = np.abs(about - self._middle)
        places = start + find_lonely(off > limit, off <= CALM * self.tame)
        places = places[(places >= first) & (places < last)]
        if not len(places):
            return part
        out = part.astype(float)
        self.wild |= dict(
            zip(places[: MOST_KEPT - len(self.wild)].tolist(), out[places - first].tolist())
        )
        out[places - first] = np.nan
        return out


def find_lonely(beyond: Array, calm: Array | None = None) -> Array:
    """Places of the true values that have at most `MOST_TOGETHER` about them.

    Parameters
    ----------
    beyond
        (n,) bool.
    calm
        Which of the others are as they usually are (n,) bool; where one about a place is neither,
        that is not alone. None: all are.

    Returns
    -------
    ndarray
        (k,), rising.

    Examples
    --------
    One alone, and ten together:

    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.wild import find_lonely
    >>> beyond = np.zeros(100, bool)
    >>> beyond[20] = beyond[50:60] = True
    >>> find_lonely(beyond).tolist()
    [20]
    """
    places = np.flatnonzero(beyond)
    alone = _count_about(places, places) <= MOST_TOGETHER
    if calm is not None:
        alone &= _count_about(np.flatnonzero(~(beyond | calm)), places) == 0
    return np.asarray(places[alone])


def _count_about(found: Array, places: Array) -> Array:
    """How many of some places, rising, are within `ABOUT` of each of others."""
    first = np.searchsorted(found, places - ABOUT, "left")
    return np.asarray(np.searchsorted(found, places + ABOUT, "right") - first)


def measure_tame(off: Array) -> float:
    """The largest of the distances from the middle, but for as many as may be wild together.

    Parameters
    ----------
    off
        Distances (n,), more than `MOST_TOGETHER`.

    Returns
    -------
    float
        Their unit.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.wild import measure_tame
    >>> measure_tame(np.array([1.0, 0.5, 2.0, 9e9, 1.5, 9e9, 9e9]))
    2.0
    """
    return float(np.partition(off, -MOST_TOGETHER - 1)[-MOST_TOGETHER - 1])


def mask_wild(recording: Recording, looks: Sequence[Look]) -> Recording:
    """The recording with its wild samples as NaN, by what its looks hold.

    Parameters
    ----------
    recording
        Of both channels.
    looks
        Along it.

    Returns
    -------
    Recording
        Its channels read as NaN where a sample is wild; the same one where nothing can be.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.fitting.samples.looks import take_looks
    >>> from hrg_cli.fitting.samples.wild import mask_wild
    >>> c = np.cos(0.7 * np.arange(5000))
    >>> torn = c.copy()
    >>> torn[1234] = 7e22
    >>> run = Recording(c=torn, s=c, sample_rate_hz=1e5, mode="free")
    >>> masked = mask_wild(run, take_looks(run, True, "run"))
    >>> np.flatnonzero(np.isnan(masked.c[:])).tolist()
    [1234]
    """
    c, s = _tame_channel(recording.c, looks, 0), _tame_channel(recording.s, looks, 1)
    if c is recording.c and s is recording.s:
        return recording
    return dataclasses.replace(recording, c=c, s=s)


def _tame_channel(values: Any, looks: Sequence[Look], k: int) -> Any:
    """The channel behind a `TameChannel`; as it is where its looks tell no size, or its type holds
    nothing wild."""
    raws = [raw[np.isfinite(raw)].astype(float) for raw in (look.raw[k] for look in looks)]
    raws = [raw for raw in raws if len(raw) > 2 * ABOUT]
    if not raws:
        return values
    middle = float(find_median([find_median(raw) for raw in raws]))
    with np.errstate(over="ignore"):
        sizes = [np.abs(raw - middle) for raw in raws]
    tame = max(measure_tame(_drop_lonely(off)) for off in sizes)
    return (
        TameChannel(values, middle, tame) if 0 < WILD * tame < _find_reach(values.dtype) else values
    )


def _drop_lonely(off: Array) -> Array:
    """A look's distances from the middle without those that stand alone, however many these are."""
    usual = float(np.partition(off, int(USUAL * len(off)))[int(USUAL * len(off))])
    return np.delete(off, find_lonely(off > WILD * usual, off <= CALM * usual))


def _find_reach(dtype: np.dtype) -> float:
    """The largest distance that two values can have."""
    if np.issubdtype(dtype, np.integer):
        return float(np.iinfo(dtype).max) - float(np.iinfo(dtype).min)
    return float("inf")


def tell_wild(recording: Recording) -> str:
    """Tell the wild samples met in words: the first of them, and how many more.

    Parameters
    ----------
    recording
        Of `mask_wild`, of which samples have been read.

    Returns
    -------
    str
        Empty where none was met.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.fitting.samples.looks import take_looks
    >>> from hrg_cli.fitting.samples.wild import mask_wild, tell_wild
    >>> c = np.cos(0.7 * np.arange(5000))
    >>> torn = c.copy()
    >>> torn[1234] = 7e22
    >>> run = Recording(c=torn, s=c, sample_rate_hz=1e5, mode="free")
    >>> masked = mask_wild(run, take_looks(run, True, "run"))
    >>> _ = masked.c[:]
    >>> tell_wild(masked)
    'sample 1235 of channel C, at 0.01234 s, is 7e+22 where the others stay within 1.002'
    """
    rate = [recording.c_scale_factor, recording.s_scale_factor]
    offset = [recording.c_add_offset, recording.s_add_offset]
    units = [recording.c_units, recording.s_units]
    found = [
        (place, k, raw, channel)
        for k, channel in enumerate((recording.c, recording.s))
        if isinstance(channel, TameChannel)
        for place, raw in channel.wild.items()
    ]
    if not found:
        return ""
    place, k, raw, channel = min(found, key=lambda one: one[:2])
    unit = f" {units[k]}" if units[k] not in ("", "1") else ""
    more = f", and {len(found) - 1} more such" if len(found) > 1 else ""
    return (
        f"sample {place + 1} of channel {'CS'[k]}, at"
        f" {float(recording.times(place, place + 1)[0]):.6g} s, is"
        f" {raw * rate[k] + offset[k]:.4g}{unit} where the others stay within"
        f" {channel.tame * abs(rate[k]):.4g}{unit}{more}"
    )
