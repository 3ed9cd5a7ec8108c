"""A run-down drawn by the equation that the fits solve, for examples and trials by hand."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...physics.resonator import exponentiate
from .coordinates import build_generator
from .envelope_runs import EnvelopeRun

NOISE = 1e-4
"""Standard deviation of one real component, of a wave of amplitude 1."""
FREQUENCY_HZ = 5000.0
WINDOW_S = 0.05
WINDOWS = 401


def draw_run_down(
    mode_angle_rad: float,
    rate_rad_s: float = 0.0,
    p: Sequence[float] = (0.1, 0.0, 0.0, 0.0, 0.0, 0.55, 1.0),
    *,
    run_id: str = "",
    seed: int = 0,
) -> EnvelopeRun:
    """Twenty seconds of a free wave at a constant rate, m = 2, amplitude 1, noise 10⁻⁴.

    Parameters
    ----------
    mode_angle_rad
        mθ [rad] at the start.
    rate_rad_s
        Ω [rad/s].
    p
        Coordinates (7,) of the resonator: ν, two of νδμ, two of δω [1/s], K, the scale of the
        second order.
    run_id
        The run's name.
    seed
        Of its noise; runs of one programme need one each.

    Returns
    -------
    EnvelopeRun
        401 windows of 50 ms.

    Examples
    --------
    The wave turns by mθ = −KΩt against the case and falls by e^{−νt}:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.drawn_run import draw_run_down
    >>> run = draw_run_down(0.0, rate_rad_s=0.1)
    >>> c, s = run.envelope[-1].real
    >>> float(np.arctan2(s, c).round(2)), float(np.hypot(c, s).round(2))
    (-1.1, 0.14)
    """
    time_s = WINDOW_S * np.arange(WINDOWS)
    omega = 2 * np.pi * FREQUENCY_HZ
    generator = build_generator(np.array(p, float), np.array(rate_rad_s), omega)
    start = np.array([np.cos(mode_angle_rad), np.sin(mode_angle_rad)])
    real, imaginary = NOISE * np.random.default_rng(seed).standard_normal((2, WINDOWS, 2))
    return EnvelopeRun(
        run_id,
        time_s,
        exponentiate(generator, time_s) @ start + real + 1j * imaginary,
        np.full(WINDOWS, NOISE),
        rate_rad_s * time_s,
        None,
        FREQUENCY_HZ,
        2,
        WINDOW_S,
    )
