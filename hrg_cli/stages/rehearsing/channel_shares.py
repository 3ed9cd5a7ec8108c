"""The noise of a twin's two channels: as unequal, and as much in common, as the measured run's.

The channels' noise has the covariance σ²Σ, tr Σ = 2. With Σ's eigenvalues λ₁ ≤ λ₂ and the axis e of
the larger one, noise √λ₁ σ in both channels and √(λ₂ − λ₁) σ along e have that covariance.
"""

from __future__ import annotations

import numpy as np

from ...fitting.noise.channel_noise import ALIKE, DEAD, find_shares
from ...records import Recording, Wave

Array = np.ndarray


def split_noise(wave: Wave) -> tuple[float, tuple[float, float]]:
    """What both channels of a run have alike of their noise, and what lies along one axis beside
    it.

    Parameters
    ----------
    wave
        The measured run.

    Returns
    -------
    tuple
        √λ₁, and √(λ₂ − λ₁) e (2,), both over the mean noise; 1 and nothing where the channels are
        alike, or nothing is known of them.

    Examples
    --------
    A channel that was set to zero leaves all to the other:

    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.stages.rehearsing.channel_shares import split_noise
    >>> wave = Told(channel_std=np.array([[3.0, 0.0]]), noise_correlation=None)
    >>> alike, more = split_noise(wave)
    >>> alike, round(abs(more[0]), 6), more[1]
    (0.0, 1.414214, 0.0)
    """
    of_c, of_s = find_shares(wave.channel_std)
    common = (wave.noise_correlation or 0.0) * np.sqrt(of_c * of_s)
    level, axes = np.linalg.eigh(np.array([[of_c, common], [common, of_s]]))
    low, high = (float(one) for one in level)
    if low < DEAD * high:
        low = 0.0
    if high < ALIKE * low:
        return 1.0, (0.0, 0.0)
    more = np.sqrt(high - low) * axes[:, 1]
    return float(np.sqrt(low)), (float(more[0]), float(more[1]))


def add_noise(
    recording: Recording, noise: float, more: tuple[float, float], seed: int
) -> Recording:
    """Samples with noise along one axis of the channels beside what they hold.

    Parameters
    ----------
    recording
        With channels in their own unit.
    noise
        Standard deviation of a sample along a vector of length 1.
    more
        The vector (2,).
    seed
        Of the noise.

    Returns
    -------
    Recording
        Of the same type of number.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.stages.rehearsing.channel_shares import add_noise
    >>> run = Recording(c=np.zeros(4000), s=np.zeros(4000), sample_rate_hz=4.0, mode="free")
    >>> noisy = add_noise(run, 0.5, (2.0, 0.0), 1)
    >>> round(float(np.std(noisy.c)), 1), float(np.std(noisy.s))
    (1.0, 0.0)
    """
    if not any(more):
        return recording
    drawn = noise * np.random.default_rng([seed, 1]).standard_normal(len(recording.c))
    c, s = (
        (np.asarray(channel) + size * drawn).astype(channel.dtype)
        for channel, size in zip((recording.c, recording.s), more, strict=True)
    )
    return recording.replace(c=c, s=s)
