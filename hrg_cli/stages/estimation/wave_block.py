"""A block's record: the solutions with their standard deviations, the signals' pooled noise, and
the frequency as the reference's and the slope of φ, f = f_r + φ̇/2π.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np

from ...fitting.ellipse.continuity import estimate_local_slope
from ...fitting.ellipse.uncertainty import compute_standard_deviations
from ...records import FLAG_CLIPPED, FLAG_GAP, FLAG_NOT_FINITE, Array, Periods, Wave
from .solution import find_finite

DIRTY = FLAG_CLIPPED | FLAG_GAP | FLAG_NOT_FINITE
UNKNOWN = 100.0
"""A signal's standard deviation so many times the usual one says that it was not measured."""


def write_block(
    block: Periods, x: Array, misfit: Array, iterations: Array, carrier_known: bool
) -> Wave:
    """The record of a block's solutions with their standard deviations, without its frequency.

    Parameters
    ----------
    block
        The windows.
    x
        (n, 5): a_A, a_B, mθ, φ, ψ.
    misfit
        rms of each window, (n,), in the signals' unit.
    iterations
        Of each window, (n,).
    carrier_known
        ψ was not estimated.

    Returns
    -------
    Wave
        Its frequency is NaN.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording, collect, demodulate
    >>> from hrg_cli.stages.estimation.wave_block import write_block
    >>> t = np.arange(4000) / 1e4
    >>> noise = 1e-3 * np.random.default_rng(0).standard_normal((2, 4000))
    >>> c, s = np.array([[1.0], [0.5]]) * np.cos(2e3 * np.pi * t) + noise
    >>> block = collect(demodulate(Recording(c=c, s=s, sample_rate_hz=1e4, mode="free")))
    >>> n = len(block)
    >>> x = np.tile([1.0, 0.0, 0.4, 0.0, 0.0], (n, 1))
    >>> wave = write_block(block, x, np.zeros(n), np.ones(n, int), True)
    >>> float(wave.wave_angle_rad[0]), bool(wave.wave_angle_rad_std[0] > 0)
    (0.2, True)
    """
    variances = np.asarray(block.signals_std, float) ** 2
    std = compute_standard_deviations(x, variances, carrier_known, block.noise_correlation or 0.0)
    # With a carrier the envelope is the mean of two sidebands.
    noise2, channel2 = (
        one / (1 if block.readout == "direct" else 2) for one in _pool_noise(variances)
    )
    flags = np.asarray(block.flags).astype(np.uint8)
    flags[~find_finite(x)] |= FLAG_NOT_FINITE
    shared = (
        name
        for name in Wave.columns()
        if name in Periods.columns() and name not in ("flags", "residual_rms")
    )
    passed: dict[str, Any] = {name: getattr(block, name) for name in shared}
    m = block.mode_number
    return Wave(
        **passed,
        main_amplitude=x[:, 0],
        quadrature_amplitude=x[:, 1],
        wave_angle_rad=x[:, 2] / m,
        phase_rad=x[:, 3],
        carrier_phase_rad=x[:, 4],
        main_amplitude_std=std[:, 0],
        quadrature_amplitude_std=std[:, 1],
        wave_angle_rad_std=std[:, 2] / m,
        phase_rad_std=std[:, 3],
        carrier_phase_rad_std=std[:, 4],
        residual_rms=misfit,
        signal_std=np.sqrt(noise2),
        channel_std=np.sqrt(channel2),
        iterations=iterations,
        flags=flags,
        frequency_hz=np.full(len(x), np.nan),
        status=block.status,
        status_reasons=block.status_reasons,
        provenance=block.provenance,
    )


def _pool_noise(variances: Array) -> tuple[Array, Array]:
    """Mean variance of all signals (n,), and of either channel's (n, 2), of which the first half
    are C's; without those of which nothing is known (the phase of a bare amplitude)."""
    count = variances.shape[1] // 2
    channels = (variances[:, :count], variances[:, count:])
    each = np.stack([one @ np.full(count, 1 / count) for one in channels], axis=-1)
    mean = each @ np.full(2, 0.5)
    # of nearly all blocks no signal's is unknown, which one fast pass shows
    if variances.max() <= UNKNOWN * variances.min():
        return mean, each
    least = functools.reduce(np.minimum, variances.T)
    if np.all(mean <= UNKNOWN * least) or not least.any():
        return mean, each
    known = variances <= UNKNOWN**2 * np.median(variances, axis=1, keepdims=True)
    mean = _mean_of(variances, known, mean)
    parts = zip(channels, (known[:, :count], known[:, count:]), strict=True)
    return mean, np.stack([_mean_of(one, sure, mean) for one, sure in parts], axis=-1)


def _mean_of(variances: Array, known: Array, otherwise: Array) -> Array:
    """Mean (n,) over what is known in every row, `otherwise` (n,) where nothing is."""
    return np.asarray(
        np.divide(
            (variances * known).sum(axis=1),
            known.sum(axis=1),
            out=otherwise.copy(),
            where=known.any(axis=1),
        )
    )


def add_frequency(before: Wave | None, wave: Wave, after: Wave | None, half_width: int) -> Wave:
    """The wave with its frequency: f = f_r + φ̇/2π, φ̇ over the neighbouring windows.

    The slope goes across the blocks' borders. Clipped rows and rows beside gaps weigh next to
    nothing, but where there are no others they still tell the frequency.

    Parameters
    ----------
    before
        The block before; None: there is none.
    wave
        The block.
    after
        The block behind it; None: there is none.
    half_width
        Windows to either side that the slope is taken over.

    Returns
    -------
    Wave
        `wave` with `frequency_hz`.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.estimation.wave_block import add_frequency
    >>> from hrg_cli.stages.rehearsing.drawn_input import draw_input
    >>> wave = draw_input().wave
    >>> found = add_frequency(None, wave, None, 10)
    >>> bool(np.all(np.abs(found.frequency_hz - 500.0) < 0.01))
    True
    """
    parts = (
        [wave]
        if before is None
        else [before.rows(max(0, len(before) - half_width), len(before)), wave]
    )
    if after is not None:
        parts.append(after.rows(0, half_width))
    time_s, phase, flags = (
        np.concatenate([getattr(p, name) for p in parts])
        for name in ("time_s", "phase_rad", "flags")
    )
    weights = np.where(
        np.isfinite(phase) & np.isfinite(time_s), np.where(flags & DIRTY, 1e-6, 1.0), 0.0
    )
    slope = estimate_local_slope(time_s, phase, weights, half_width)
    first = 0 if before is None else len(parts[0])
    return wave.replace(
        frequency_hz=wave.reference_frequency_hz + slope[first : first + len(wave)] / (2 * np.pi)
    )
