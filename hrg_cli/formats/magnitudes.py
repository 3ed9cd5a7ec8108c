"""Amplitudes that were recorded alone: the length of a phasor with noise is longer than the phasor.

Rice (1944): of R = |a + n|, n with σ² in either direction, ⟨R²⟩ = a² + 2σ², and R itself scatters
by σ where a stands clear of the noise, by 0.65 σ where a is gone. So a window's amplitude is √(⟨R²⟩
− 2σ²), and σ is what makes the scatter that was seen (Koay & Basser 2006).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .row_noise import RowNoise

Array = np.ndarray
NEAR = 32
"""Rows whose mean square stands for the amplitude of each."""
LEAST_SCATTER = 2 - np.pi / 2
"""Variance of R over σ² where there is no amplitude (Rayleigh)."""


def find_magnitude_noise(looks: Sequence[Array], seen: RowNoise) -> RowNoise:
    """The noise of the phasors, from that of their lengths.

    Parameters
    ----------
    looks
        Rows (1, n), real and not negative.
    seen
        Noise of these rows as they are.

    Returns
    -------
    RowNoise
        Variance and density larger, both alike.

    Examples
    --------
    Lengths of phasors that are nothing but noise of 1 scatter by √(2 − π/2) = 0.66; most of the
    noise is found again:

    >>> import numpy as np
    >>> from hrg_cli.formats.magnitudes import find_magnitude_noise
    >>> from hrg_cli.formats.row_noise import RowNoise
    >>> n = np.random.default_rng(0).standard_normal((2, 20_000))
    >>> lengths = np.hypot(*n)[None] + 0j
    >>> variance = np.array([[lengths.real.var(), 0.0]])
    >>> found = find_magnitude_noise([lengths], RowNoise(variance, variance, True))
    >>> round(float(variance[0, 0]) ** 0.5, 2), bool(0.9 < found.variance[0, 0] ** 0.5 < 1.0)
    (0.66, True)
    """
    from scipy.optimize import brentq

    scatter = float(seen.variance[0].sum())
    power = np.concatenate([_smooth_power(look[0]) for look in looks])
    if not scatter > 0 or not len(power):
        return seen

    def excess(variance: float) -> float:
        return variance * float(np.mean(_scatter_of_length(power / variance - 2))) - scatter

    most = scatter / LEAST_SCATTER
    larger = (most if excess(most) <= 0 else brentq(excess, scatter, most, rtol=1e-6)) / scatter
    return replace(seen, density=larger * seen.density, variance=larger * seen.variance)


def _smooth_power(rows: Array) -> Array:
    """Mean squares of neighbouring rows."""
    square = np.abs(rows[np.isfinite(rows)]) ** 2
    pieces = max(1, len(square) // NEAR)
    return np.array([part.mean() for part in np.array_split(square, pieces) if len(part)])


def _scatter_of_length(ratio2: Array) -> Array:
    """Variance of R over σ² at (a/σ)²: 2 + r² − ⟨R⟩²/σ², ⟨R⟩ = σ√(π/2) L₁⸝₂(−r²/2)."""
    from scipy.special import ive

    half = np.maximum(ratio2, 0.0) / 2
    laguerre = (1 + half) * ive(0, half / 2) + half * ive(1, half / 2)
    # differences of large squares: beyond r = 30 the variance is 1 to a thousandth
    scatter = 2 + 2 * half - np.pi / 2 * laguerre**2
    return np.where(half > 450, 1.0, scatter)


def find_amplitudes(power: Array, noise: RowNoise, rows: int) -> tuple[Array, Array]:
    """Amplitudes of windows and their standard deviations, √((a² + σ²)/a²) of the noise's.

    Parameters
    ----------
    power
        Mean of R² in each window (n,).
    noise
        Of the phasors' rows.
    rows
        In a window.

    Returns
    -------
    tuple of ndarray
        (n,) and (n,), in the rows' unit; 0 where noise alone would give so much.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.formats.magnitudes import find_amplitudes
    >>> from hrg_cli.formats.row_noise import RowNoise
    >>> variance = np.array([[1.0, 0.0]])
    >>> amplitude, std = find_amplitudes(
    ...     np.array([11.0, 1.9]), RowNoise(variance, variance, True), 4
    ... )
    >>> amplitude.tolist(), std.round(3).tolist()
    ([3.0, 0.0], [0.527, 0.5])
    """
    variance = float(noise.variance[0].sum())
    square = np.maximum(power - 2 * variance, 0.0)
    of_window = float(noise.density[0].sum()) / rows
    of_square = 4 * of_window * (square + variance)
    amplitude = np.sqrt(square)
    return amplitude, np.sqrt(of_square) / (2 * np.maximum(amplitude, of_square**0.25))
