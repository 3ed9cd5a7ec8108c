"""Rates of increments that several windows make up, found window by window: within them the wave
may turn as far as it will."""

from __future__ import annotations

import numpy as np

from ...fitting.tables.increments import AnglePath, build_path, count_good, find_good_windows
from ...records import Calibration, Wave
from ..calibration.interpolation import compute_corrections

Array = np.ndarray


def find_block_rates(
    wave: Wave, path: AnglePath, calibration: Calibration, windows: int
) -> tuple[Array, Array]:
    """Mean rates of increments by the tables, Ω = (D − mθ̇)/K, and the K of each.

    Where their ends are means of several windows, with the angle Φ that the windows' own rates sum
    up to, Ω_i = (Φ̄_{i+1} − Φ̄_i)/Δt by the means over the blocks: the triangle of both, whatever D
    and K do under it.

    Parameters
    ----------
    wave
        The windows.
    path
        The same, averaged to the blocks; n increments.
    calibration
        The tables.
    windows
        A block.

    Returns
    -------
    tuple of ndarray
        Rates (n,) [rad/s], against the stars, and K (n,).

    Examples
    --------
    Forty windows of a wave that turns by −KΩt/m, K = 0.3 and 0.1 rad/s, ten by ten:

    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.increments import build_path
    >>> from hrg_cli.records import Wave
    >>> from hrg_cli.stages.compensation.block_rates import find_block_rates
    >>> t = np.arange(40.0)
    >>> sized = ["main_amplitude", "quadrature_amplitude"]
    >>> sized += ["wave_angle_rad", "phase_rad", "carrier_phase_rad"]
    >>> others = [*sized, *(f"{name}_std" for name in sized)]
    >>> others += ["residual_rms", "signal_std", "frequency_hz"]
    >>> wave = Wave(**dict.fromkeys(others, np.ones(40)) | dict(
    ...     time_s=t, flags=np.zeros(40, "u1"), iterations=np.zeros(40, "i4"), mode="forced",
    ...     window_s=1.0, reference_frequency_hz=5e3, wave_angle_rad=-0.3 * 0.1 / 2 * t,
    ... ))
    >>> tables = Told(
    ...     axis="frequency", details="{}",
    ...     values_at=lambda x, angle, travel: (np.zeros(len(x)), 0.3 * np.ones(len(x))),
    ... )
    >>> path = build_path(wave, harmonics=0, per_block=10, need_rate=False)
    >>> rate, scale_factor = find_block_rates(wave, path, tables, 10)
    >>> rate.round(9).tolist(), scale_factor.tolist()
    ([0.1, 0.1, 0.1], [0.3, 0.3, 0.3])
    """
    drift, scale = compute_corrections(calibration, path)
    if windows == 1:
        return _find_rates(path, drift, scale), scale
    # the wave alone is asked: no rate is read
    each = build_path(wave, harmonics=0, rate_rad_s=0.0, per_block=1)
    turned = _find_rates(each, *compute_corrections(calibration, each)) * each.interval_s
    angle_rad = np.concatenate([[0.0], np.cumsum(turned)])
    good = find_good_windows(wave)
    kept = count_good(good, windows) > 0
    block = np.flatnonzero(good) // windows
    inside = kept[block]
    number = (np.cumsum(kept) - 1)[block[inside]]
    means = np.bincount(number, angle_rad[inside]) / np.bincount(number)
    return np.asarray(np.diff(means) / path.interval_s), scale


def _find_rates(path: AnglePath, drift: Array, scale: Array) -> Array:
    """Of increments within which D and K (n,) change little or evenly."""
    return np.asarray((drift - path.turn / path.interval_s) / scale)
