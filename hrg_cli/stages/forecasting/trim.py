"""The electric spring that takes a resonator's frequency split away, as numbers without voltages.

A spring along α that softens by s [rad/s] changes the stiffness by −2ωs(I + R(2mα)): the frequency
falls by s and the split vector δω·e^{2jmθ_ω} by s·e^{2jmα}. Along the stiffest axis, α = θ_ω with s
= δω, it leaves none, whatever the wave angle, and needs no tuning (seed A, third remark after
(16)). Two sets of electrodes, at 0 and at π/4m, share it as s cos 2mα and s sin 2mα.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...fitting.envelopes.resonator_spread import find_deviation, from_vector, spread_points
from ...physics.drift import bound_drift
from ...physics.resonator import Mechanics

Array = np.ndarray


@dataclass(frozen=True)
class Trim:
    """Spring's size and axis with deviations, what the two electrode pairs do, what is left, and
    D_max before and after."""

    size_rad_s: float
    size_rad_s_std: float
    axis_rad: float
    axis_rad_std: float
    cos_rad_s: float
    sin_rad_s: float
    frequency_shift_hz: float
    left_rad_s: float
    left_rad_s_std: float
    drift_bound_before_rad_s: float
    drift_bound_after_rad_s: float


def compute_trim(
    mechanics: Mechanics,
    x: Array,
    covariance: Array,
    drive: str,
    gain_1_s: float,
    step_rad_s: float | None,
) -> tuple[Trim, Array]:
    """The electric spring that takes a frequency split away.

    Parameters
    ----------
    mechanics
        The resonator.
    x
        The same as a vector, as `make_vector` has it, (6,).
    covariance
        Of x, (6, 6).
    drive
        "free", or how the wave is driven.
    gain_1_s
        Of the quadrature loop by force [1/s].
    step_rad_s
        Smallest step of either electrode pair [rad/s]; None: as fine as is wanted.

    Returns
    -------
    tuple
        The trim, and the trimmed resonator's vector (6,). What rounding and the covariance leave is
        the trim's `left_rad_s` with its deviation, and D_max after it is of the root of their mean
        squares.

    Examples
    --------
    A split of 0.1 rad/s, trimmed in steps of 0.03:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.resonator_spread import make_vector
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> from hrg_cli.stages.forecasting.trim import compute_trim
    >>> gyro = Mechanics(1000.0, 0.2, frequency_split_rad_s=0.1)
    >>> trim, after = compute_trim(gyro, make_vector(gyro), 1e-12 * np.eye(6), "force", 0.0, 0.03)
    >>> round(trim.size_rad_s, 9), round(trim.left_rad_s, 9)
    (0.09, 0.01)
    """
    wanted = x[3:5]
    done = wanted if step_rad_s is None else np.round(wanted / step_rad_s) * step_rad_s
    trimmed = np.array([*x[:3], *(wanted - done), x[5]])
    points = spread_points(x, covariance)
    sizes, angles = np.hypot(points[:, 3], points[:, 4]), np.arctan2(points[:, 4], points[:, 3])
    angles = angles[0] + np.angle(np.exp(1j * (angles - angles[0])))
    m2 = 2 * mechanics.mode_number
    left, spread = float(np.hypot(*trimmed[3:5])), float(np.sqrt(np.trace(covariance[3:5, 3:5])))
    after = from_vector(np.array([*x[:3], np.hypot(left, spread), 0.0, x[5]]), mechanics)
    trim = Trim(
        float(np.hypot(*done)), float(find_deviation(sizes)),
        float(np.mod(np.arctan2(done[1], done[0]) / m2, 2 * np.pi / m2)),
        float(min(find_deviation(angles / m2), 2 * np.pi / m2 / np.sqrt(12))), float(done[0]),
        float(done[1]), float(-np.hypot(*done) / (2 * np.pi)), left, spread,
        float(bound_drift(mechanics, drive, gain_1_s)),
        float(bound_drift(after, drive, gain_1_s)[0]),
    )  # fmt: skip
    return trim, trimmed
