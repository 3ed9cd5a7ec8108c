"""One pick-off recorded as both channels, told by its noise: two pick-offs may show the same
oscillation (a wave at 45° of its pattern does), and never the same noise.
"""

from __future__ import annotations

import numpy as np

from ...records import Recording

Array = np.ndarray

EXACT = 1e-9
"""Power of what one channel has beside the other, over its noise, up to which they are the same
numbers."""

ROUNDED = 1e-3
"""Power of the rounding over the noise below which what one channel has beside the other may be its
own rounding; above it two channels might share a noise and round it each for itself."""

NOISY = 4.0
"""Power of a channel's noise over its rounding below which it shows no noise."""

LEAST = 1e-8
"""Noise over the oscillation below which it is the arithmetic's, of samples that were simulated
without any."""


def tell_twins(
    recording: Recording,
    correlation: float | None,
    noise2: Array,
    strength2: float,
    least_count: tuple[float, float],
) -> tuple[str, ...]:
    r"""A sentence where one channel is the other one, multiplied by a number.

    With the correlation ρ of the channels' noise, the power that one has beside the other is
    2(1 − |ρ|) of it at least: nothing, or both roundings Σ q²/12σ².

    Parameters
    ----------
    recording
        Of both channels, for their number format.
    correlation
        ρ, of their noise.
    noise2
        Variance (2,) of their noise a sample, unit² of the signals.
    strength2
        The stronger channel's variance.
    least_count
        Step q of each channel's values; 0: none.

    Returns
    -------
    tuple of str
        Empty where both have noise of their own, or none at all.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.fitting.samples.twin_channels import tell_twins
    >>> run = Recording(c=np.zeros(9), s=np.zeros(9), sample_rate_hz=9.0, mode="free")
    >>> told = [
    ...     tell_twins(run, correlation, np.array([1e-8, 4e-8]), 0.5, (0.0, 0.0))
    ...     for correlation in (0.9, -1.0)
    ... ]
    >>> print(*told, sep="\n")
    ()
    ('channel S holds the samples of channel C, multiplied by -2, noise and all: ...',)
    """
    if correlation is None or not (noise2 > LEAST**2 * strength2).all():
        return ()
    rounding2 = np.array(
        [
            max(step**2 / 12, strength2 * _find_epsilon(channel) ** 2)
            for step, channel in zip(least_count, (recording.c, recording.s), strict=True)
        ]
    )
    share = rounding2 / noise2
    own = 2 * max(1 - abs(correlation), 0.0)
    limit = 2 * float(share.sum()) if share.sum() < ROUNDED else 0.0
    if (share * NOISY > 1).any() or own > max(EXACT, limit):
        return ()
    factor = float(np.copysign(np.sqrt(noise2[1] / noise2[0]), correlation))
    times = "" if abs(factor - 1) < np.sqrt(own) + EXACT else f", multiplied by {factor:.4g}"
    return (
        f"channel S holds the samples of channel C{times}, noise and all: one pick-off was recorded"
        " twice, and nothing tells how the wave stands; name the other one, or record the run"
        " again",
    )


def _find_epsilon(channel: Array) -> float:
    """The rounding of one of its values over that; of codes their step says it."""
    kind = channel.dtype
    return float(np.finfo(kind).eps) if np.issubdtype(kind, np.floating) else 0.0
