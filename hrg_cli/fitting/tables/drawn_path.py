"""A run of a gyro on a turning table drawn as its blocks, for examples and trials by hand."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from .increments import AnglePath

NOISE = 1e-6
"""Standard deviation of a block's angle [rad]."""
HALF_FACTOR = 0.275
"""K/m of K = 0.55 and m = 2."""


def draw_path(
    rate_rad_s: float = 0.0,
    random: np.random.Generator | None = None,
    blocks: int = 600,
    **columns: Any,
) -> AnglePath:
    """A forced run without drift: a block per second at a constant rate, 20 °C, 5000 Hz, K = 0.55.

    Parameters
    ----------
    rate_rad_s
        Ω [rad/s].
    random
        What the angles' noise of 10⁻⁶ rad is drawn from; None: there is none.
    blocks
        How many.
    **columns
        Fields of the path that are otherwise, those of blocks as an array (blocks,) or one number.

    Returns
    -------
    AnglePath
        The wave turns by θ = −KΩt/m.

    Examples
    --------
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> path = draw_path(0.1, blocks=3, ratio=0.6, forced=False)
    >>> path.angle_rad.round(4).tolist(), path.ratio.tolist(), path.forced
    ([0.0, -0.0275, -0.055], [0.6, 0.6, 0.6], False)
    """
    t, one = np.arange(float(blocks)), np.ones(blocks)
    angle = -HALF_FACTOR * rate_rad_s * t + 0.0  # no negative nought
    if random is not None:
        angle = angle + NOISE * random.standard_normal(blocks)
    path = AnglePath(
        run_id="",
        forced=True,
        mode_number=2,
        start_time="",
        time_s=t,
        width_s=one,
        angle_rad=angle,
        angle_variance=NOISE**2 * one,
        rate_integral_rad=rate_rad_s * t,
        temperature_degc=20 * one,
        frequency_hz=5e3 * one,
        ratio=0 * t,
        main_amplitude=one,
        phase_rate_rad_s=0 * t,
        drive_main=None,
        drive_quadrature=None,
        rows=blocks,
        row_s=1.0,
    )
    of_blocks = {name for name, value in vars(path).items() if isinstance(value, np.ndarray)}
    return replace(
        path, **{k: v * one if k in {*of_blocks, "drive_main"} else v for k, v in columns.items()}
    )
