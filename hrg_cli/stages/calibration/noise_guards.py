"""How much more the angles of a calibration scatter than their windows state."""

from __future__ import annotations

import numpy as np

from ...fitting.checks import Check, at_most
from ...fitting.tables.joint import Fitted

Array = np.ndarray

LARGEST_NOISE = 2.0
"""Variance of the angles against that which the windows state, above which the result is suspect;
below, the excess is said."""


def noise_known(fitted: Fitted) -> Check:
    """The angles' white noise against what the windows state, as a ratio of variances; 0 where they
    state none."""
    ratio = noise_ratio(fitted)
    sentence = (
        f"the angles scatter {np.sqrt(ratio or 0):.3g} times as much as their windows state; the"
        " errors hold that, but what makes it is not known: look at the residual of demodulate,"
        " and run diagnose on free runs"
    )
    return at_most("noise_over_stated", 0.0 if ratio is None else ratio, LARGEST_NOISE, sentence)


def noise_ratio(fitted: Fitted) -> float | None:
    """Mean over the runs of white noise found / expected (variances): what the windows state, and
    the third of a walk's step that a block's mean holds, by which no walk is quite white; None
    where no run states one."""
    found = [
        (
            noise.white
            / (
                path.mode_number**2 * float(np.mean(path.angle_variance))
                + noise.walk * float(np.median(path.width_s)) / 3
            ),
            len(path),
        )
        for path, noise in zip(fitted.paths, fitted.noises)
        if np.mean(path.angle_variance) > 0
    ]
    return (
        float(np.average([r for r, _ in found], weights=[n for _, n in found])) if found else None
    )


def say_noise(fitted: Fitted) -> dict[str, float | None]:
    """The noise the variants were judged at: white against what the windows state, and the angle
    random walk beside it."""
    ratio = noise_ratio(fitted)
    scale_factor = fitted.layout.mean_scale_factor(fitted.solution.coefficients)
    walk = float(np.median([noise.walk for noise in fitted.noises]))  # of mθ; of the input angle:
    return {
        "white_over_stated": None if ratio is None else float(np.sqrt(ratio)),
        "angle_random_walk_rad_sqrt_s": float(np.sqrt(walk) / abs(scale_factor))
        if scale_factor
        else None,
    }
