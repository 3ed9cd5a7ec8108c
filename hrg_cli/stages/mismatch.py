"""The mismatch signals a control system acts on, from the estimate of the wave: what seed B's
computing component hands to the loops.

Amplitude loop: A₀ − a_A. Quadrature loop: a_B. Phase loop: the wave's phase against the reference
oscillator, φ taken to (−π, π]. Angle: θ and its rate over the last two windows, for a loop that
holds the wave (force to rebalance). Each has the noise of its window and is known only when the
window has ended and the computer has worked: its delay is half a window and the time of computing.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
from pydantic import Field

from ..errors import HrgError
from ..records import Wave

Array = np.ndarray


@dataclass(frozen=True)
class Mismatch:
    """A column a signal and its standard deviation (rows: windows), the loops' delay [s], and each
    signal's noise density."""

    columns: dict[str, Array]
    delay_s: float
    noise_density: dict[str, float]
    """One-sided, the signal's unit/√Hz, up to half the rate of windows."""
    latency: list[dict[str, float]]
    """Rate of the wave angle as the slope over n windows: its latency against its noise, expected
    and found."""


def mismatch(
    wave: Wave,
    *,
    main_amplitude: Annotated[
        float | None,
        Field(gt=0, description="set amplitude; the run's median where not given"),
    ] = None,
    computing_s: Annotated[
        float, Field(ge=0, description="time from a window's end until its signals are there")
    ] = 0.0,
) -> Mismatch:
    """Mismatch signals of the good windows: what control loops act on.

    A₀ − a_A, a_B, φ and θ of each window (seed B's computing component), known half a window and
    the computing time late.

    Parameters
    ----------
    wave
        A run, (n,) rows.

    Returns
    -------
    Mismatch
        A column (n,) a signal with its standard deviation, the delay [s], the noise densities.

    Raises
    ------
    HrgError
        There is no good window.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Wave
    >>> from hrg_cli.stages.mismatch import mismatch
    >>> t, ones = np.arange(0.0, 5.0, 0.05), np.ones(100)
    >>> wave = Wave(
    ...     time_s=t, flags=np.zeros(100, "u1"), main_amplitude=1.01 * ones,
    ...     quadrature_amplitude=0 * t, wave_angle_rad=0.1 * ones, phase_rad=0 * t,
    ...     carrier_phase_rad=0 * t, main_amplitude_std=1e-5 * ones,
    ...     quadrature_amplitude_std=1e-5 * ones, wave_angle_rad_std=1e-5 * ones,
    ...     phase_rad_std=1e-5 * ones, carrier_phase_rad_std=0 * t, residual_rms=0 * t,
    ...     signal_std=1e-5 * ones, iterations=np.zeros(100, "i4"), frequency_hz=1e3 * ones,
    ...     reference_frequency_hz=1e3, window_s=0.05, mode="forced",
    ... )
    >>> signals = mismatch(wave, main_amplitude=1.0)
    >>> round(float(signals.columns["amplitude_error"][0]), 3)
    -0.01
    """
    good = np.asarray(wave.good())
    if not good.any():
        raise HrgError(
            f"run {wave.run_id or '?'}: no good window, so no signal for a loop; look at its flags"
            " with `hrg info`"
        )
    t, a_A, a_B, angle, phase = (
        np.asarray(v, float)[good]
        for v in (
            wave.time_s,
            wave.main_amplitude,
            wave.quadrature_amplitude,
            wave.wave_angle_rad,
            wave.phase_rad,
        )
    )
    stds = {
        "amplitude_error": wave.main_amplitude_std,
        "quadrature": wave.quadrature_amplitude_std,
        "phase_error_rad": wave.phase_rad_std,
        "wave_angle_rad": wave.wave_angle_rad_std,
    }
    wanted = float(np.median(a_A)) if main_amplitude is None else main_amplitude
    values = {
        "amplitude_error": wanted - a_A,
        "quadrature": a_B,
        "phase_error_rad": np.pi - np.mod(np.pi - phase, 2 * np.pi),
        "wave_angle_rad": angle,
    }
    delay = wave.window_s / 2 + computing_s
    columns: dict[str, Array] = {"time_s": t, "available_s": t + delay}
    for name, value in values.items():
        columns[name], columns[f"{name}_std"] = value, np.asarray(stds[name], float)[good]
    step = np.diff(t, prepend=np.nan)
    std = columns["wave_angle_rad_std"]
    columns["angle_rate_rad_s"] = np.diff(angle, prepend=np.nan) / step
    columns["angle_rate_rad_s_std"] = np.hypot(std, np.concatenate([[np.nan], std[:-1]])) / step
    spacing = float(np.median(np.diff(t))) if len(t) > 1 else wave.window_s
    density = {
        name: float(np.sqrt(np.mean(columns[f"{name}_std"] ** 2) * 2 * spacing)) for name in values
    }
    return Mismatch(columns, delay, density, _latency(t, angle, std, wave.window_s, computing_s))


def _latency(
    t: Array, angle: Array, std: Array, window_s: float, computing_s: float
) -> list[dict[str, float]]:
    """Least-squares slope of θ over n = 2, 4, 8 … windows: known n/2 windows late, with the noise
    √(12/(n³ − n))·σ/step.

    Found: the scatter of the slopes of neighbouring stretches, their second differences over √6,
    which a rate that moves evenly leaves out.
    """
    step = float(np.median(np.diff(t))) if len(t) > 1 else window_s
    rows, n = [], 2
    while 6 * n <= len(t):
        x = (np.arange(n) - (n - 1) / 2) * step
        slopes = angle[: len(angle) // n * n].reshape(-1, n) @ x / (x @ x)
        rows.append(
            {
                "windows": float(n),
                "latency_s": float((n - 1) * step / 2 + window_s / 2 + computing_s),
                "rate_noise_rad_s": float(np.sqrt(np.mean(std**2) / (x @ x))),
                "rate_noise_found_rad_s": float(np.sqrt(np.mean(np.diff(slopes, 2) ** 2) / 6)),
            }
        )
        n *= 2
    return rows
