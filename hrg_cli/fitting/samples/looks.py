"""Looks along a recording before it is demodulated: a few stretches of its samples, and what they
show without any transform: dead channels, rails, the step of the values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...errors import HrgError
from ...least_count import count_values, find_least_count
from ...records import Recording
from ...records.recording import ONE_CHANNEL
from ..medians import find_median
from .stillness import FEWEST, find_still, mark_stretches

Array = np.ndarray

LOOKS, LOOK_SAMPLES = 16, 1 << 14
"""Places along an even recording where the frequency is found, and samples a look."""

UNEVEN_LOOKS, UNEVEN_SAMPLES = 24, 1024
"""The same for uneven sampling, whose transforms are direct sums."""

STEP_LOOKS = 4
"""Looks, about, whose values show the converter's step."""

APART = 0.1
"""Part of the time that a look's samples take, were they together, from which a step between two is
a gap: beyond it the oscillation's peak has others beside it, one a turn over the gap, that noise
takes for it."""

STILL = 8
"""Part of a look in which both channels repeat one value from which it is bad: before the frequency
is known nothing else tells how long an oscillation may."""

MOST_PATCHED = 0.2
"""Part of a look's values that may be bad for it to serve with their mean in their place."""


@dataclass(frozen=True)
class Look:
    """One stretch of samples."""

    time_s: Array
    y: Array  # (2, n) physical units
    raw: tuple[Array, Array]


def take_looks(
    recording: Recording, even: bool, name: str, most: tuple[int, int] | None = None
) -> list[Look]:
    """Looks spread evenly along a recording.

    Those without a bad sample; else the longest finite stretches, cut to one length; else, few
    samples being bad, looks whose bad samples hold the mean.

    Parameters
    ----------
    recording
        Of both channels.
    even
        Whether it is sampled evenly; looks at uneven times are more and shorter.
    name
        Of the recording, for what is said of it.
    most
        Looks at most, and samples in each; None: as many as noise asks for.

    Returns
    -------
    list of Look
        One at least, in the order of time.

    Raises
    ------
    HrgError
        Hardly any finite sample, or fewer than six of any kind.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.fitting.samples.looks import take_looks
    >>> c = np.cos(0.7 * np.arange(100_000))
    >>> looks = take_looks(Recording(c=c, s=c, sample_rate_hz=1e5, mode="free"), True, "run")
    >>> len(looks), looks[0].y.shape
    (6, (2, 16384))
    """
    n = len(recording.c)
    usual = (LOOKS, LOOK_SAMPLES) if even else (UNEVEN_LOOKS, UNEVEN_SAMPLES)
    count, length = usual if most is None else most
    length = min(n, length)
    if n < 6:
        raise HrgError(
            f"{name}: has {n} samples; an oscillation cannot be found in fewer than 6: record"
            " longer"
        )
    looks, patched, stretches, standing = [], [], [], []
    places = np.linspace(0, n - length, min(count, max(1, n // length))).astype(int)
    for a in dict.fromkeys(places.tolist()):
        look = _take_look(recording, a, a + length)
        bad = ~np.isfinite(look.y)
        if not bad.any():
            standing.append(look)
        still = find_still(look.raw[0], look.raw[1], max(FEWEST, length // STILL))
        bad |= mark_stretches(still, length)
        if not bad.any():
            looks.append(look)
            continue
        stretches.append(_cut_look(look, _find_longest(~bad.any(0))))
        if bad.mean() < MOST_PATCHED:
            patched.append(_patch_look(look, bad))
    shortest = max(64, length // 8)
    stretches = [look for look in stretches if len(look.time_s) >= shortest]
    if stretches and not looks:
        # the spectra of all looks are averaged, so all have one length
        common = min(len(look.time_s) for look in stretches)
        looks = [_cut_look(look, slice(0, common)) for look in stretches]
    # of channels that stand still throughout something else is said
    looks = looks or patched or standing
    if not looks:
        raise HrgError(
            f"{name}: has hardly any finite sample (NaN or infinite values); finite values of both"
            " channels were expected: check it"
        )
    return looks


def _take_look(recording: Recording, first: int, last: int) -> Look:
    """Samples first … last in physical units and as they were written."""
    raw = (np.asarray(recording.c[first:last]), np.asarray(recording.s[first:last]))
    y = np.stack(
        [
            raw[0] * recording.c_scale_factor + recording.c_add_offset,
            raw[1] * recording.s_scale_factor + recording.s_add_offset,
        ]
    )
    return Look(recording.times(first, last).astype(float), y.astype(float), raw)


def _cut_look(look: Look, part: slice) -> Look:
    """A part of the look's samples."""
    return Look(look.time_s[part], look.y[:, part], (look.raw[0][part], look.raw[1][part]))


def _patch_look(look: Look, bad: Array) -> Look:
    """The look with each channel's bad samples (2, n) at the mean of its good ones: they add no
    line of their own to a spectrum."""
    y = look.y.copy()
    for k in range(2):
        y[k, bad[k]] = y[k, ~bad[k]].mean()
    return Look(look.time_s, y, look.raw)


def _find_longest(good: Array) -> slice:
    """The longest run of true."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(int)))
    if not len(edges):
        return slice(0, 0)
    k = int(np.argmax(edges[1::2] - edges[::2]))
    return slice(int(edges[2 * k]), int(edges[2 * k + 1]))


def keep_together(look: Look) -> Look:
    """The longest part of a look without a gap.

    Parameters
    ----------
    look
        One stretch of samples, at uneven times.

    Returns
    -------
    Look
        The same where it has none.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.looks import Look, keep_together
    >>> t = np.concatenate([np.arange(10.0), np.arange(14.0, 34.0)])
    >>> part = keep_together(Look(t, np.zeros((2, 30)), (t, t)))
    >>> float(part.time_s[0]), len(part.time_s)
    (14.0, 20)
    """
    steps = np.diff(look.time_s)
    near = steps <= APART * len(steps) * float(find_median(steps))
    part = _find_longest(near)
    return look if near.all() else _cut_look(look, slice(part.start, part.stop + 1))


def measure_span(look: Look) -> float:
    """Time from a look's first sample to its last.

    Parameters
    ----------
    look
        One stretch of samples.

    Returns
    -------
    float
        s.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.looks import Look, measure_span
    >>> t = np.arange(2.0, 3.01, 0.1)
    >>> round(measure_span(Look(t, np.zeros((2, 11)), (t, t))), 9)
    1.0
    """
    return float(look.time_s[-1] - look.time_s[0])


def find_dead_channels(looks: Sequence[Look], name: str, known: Sequence[str]) -> tuple[str, ...]:
    """Sentences, one for every channel that does not move; an S that was not recorded is no dead
    one.

    Parameters
    ----------
    looks
        Along the recording.
    name
        Of the recording, for what is said of it.
    known
        The recording's own reasons, of which one may tell that S was not recorded.

    Returns
    -------
    tuple of str
        Mostly empty.

    Raises
    ------
    HrgError
        Both channels are dead.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.fitting.samples.looks import find_dead_channels, take_looks
    >>> c = np.cos(0.7 * np.arange(1000))
    >>> run = Recording(c=c, s=np.full(1000, 2.5), sample_rate_hz=1e5, mode="free")
    >>> find_dead_channels(take_looks(run, True, "run"), "run", ())
    ('channel S is constant at 2.5; it may be dead',)
    """
    spread = np.array([max(float(np.ptp(look.y[k])) for look in looks) for k in range(2)])
    level = [float(looks[0].y[k, 0]) for k in range(2)]
    # a spread that the rounding of the scale factor alone can leave of one value
    dead = [k for k in range(2) if spread[k] <= 1e-14 * abs(level[k])]
    if len(dead) == 2:
        what = "all zero" if not any(level) else "constant"
        raise HrgError(
            f"{name}: both channels are {what}; an oscillation was expected: check the pick-off and"
            " the converter"
        )
    if any(reason.startswith(ONE_CHANNEL) for reason in known):
        dead = [k for k in dead if k != 1]
    return tuple(
        f"channel {'CS'[k]} is {'all zero' if level[k] == 0 else f'constant at {level[k]:g}'};"
        " it may be dead"
        for k in dead
    )


def find_least_counts(recording: Recording, looks: Sequence[Look]) -> tuple[float, float]:
    """Step of each channel's values, as the recording says or as its values show.

    Parameters
    ----------
    recording
        Of both channels.
    looks
        Along it; about `STEP_LOOKS` of them are asked.

    Returns
    -------
    tuple of float
        Of C and S, unit of the signals; 0 where the values are a continuum.

    Examples
    --------
    Counts of 0.1 mV:

    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.fitting.samples.looks import find_least_counts, take_looks
    >>> c = np.round(1000 * np.cos(0.7 * np.arange(5000))).astype("i2")
    >>> run = Recording(c=c, s=c, c_scale_factor=1e-4, s_scale_factor=1e-4, sample_rate_hz=1e5,
    ...                 mode="free")
    >>> find_least_counts(run, take_looks(run, True, "run"))
    (0.0001, 0.0001)
    """
    if recording.least_count:
        return recording.least_count, recording.least_count
    scales = (recording.c_scale_factor, recording.s_scale_factor)
    some = looks[:: max(1, len(looks) // STEP_LOOKS)]
    c, s = (abs(scales[k]) * find_least_count(look.raw[k] for look in some) for k in range(2))
    return c, s


def find_rails(channel: Array, raws: list[Array]) -> tuple[float, float]:
    """Raw values at which samples are stuck; an integer's own range counts always.

    Parameters
    ----------
    channel
        The recorded values, for their type.
    raws
        Stretches of them.

    Returns
    -------
    tuple of float
        Lowest and highest; infinite where none is.

    Examples
    --------
    A sine of amplitude 1 clipped at 0.8:

    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.looks import find_rails
    >>> c = np.minimum(np.cos(0.0123 * np.arange(20_000)), 0.8)
    >>> find_rails(c, [c])
    (-inf, 0.8)
    """
    low, high = -np.inf, np.inf
    if np.issubdtype(channel.dtype, np.integer):
        info = np.iinfo(channel.dtype)
        # A converter that saturates gives its type's last code, or one of fewer bits its own last:
        # found from the values below.
        low, high = float(info.min), float(info.max)
    for raw in raws:
        values = raw.astype(float)
        if _is_stuck_at_top(values):
            high = min(high, float(np.nanmax(values)))
        if _is_stuck_at_top(-values):
            low = max(low, float(np.nanmin(values)))
    return low, high


def _is_stuck_at_top(values: Array) -> bool:
    """Whether more samples share the highest value than a sine of that size leaves there: √(2/A)/π
    of all, A its amplitude in steps.

    Sampling commensurate with the oscillation repeats values too; so either a run of equal samples
    must be longer than the rounded top of the sine allows, or the next lower values must be much
    rarer.
    """
    values = values[np.isfinite(values)]
    # Of a few samples, or of distinct ones, the highest says nothing; the test below is dear.
    if len(values) < 8 or np.count_nonzero(values == values.max()) < 5:
        return False
    distinct, counts = count_values(values)
    if len(distinct) < 8:
        return False
    amplitude = max(1.0, float(np.ptp(distinct)) / 2 / max(float(np.diff(distinct).min()), 1e-300))
    # A sin x is within one step of its top for |x − π/2| < √(2/A), which is √(2/A)/π of a period.
    share = np.sqrt(2 / amplitude) / np.pi
    top = values == distinct[-1]
    if counts[-1] < 5 or counts[-1] < 3 * share * len(values):
        return False
    edges = np.flatnonzero(np.diff(np.concatenate([[False], top, [False]]).astype(int)))
    longest = int((edges[1::2] - edges[::2]).max())
    crossings = max(1, int((np.diff(np.sign(values - values.mean())) > 0).sum()))
    return (
        longest >= 3 + 2 * share * len(values) / crossings or counts[-1] > 3 * counts[-6:-1].max()
    )
