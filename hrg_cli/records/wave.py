"""The standing wave over time: what `hrg estimate` makes of the signals."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .columns import (
    FLAGGED,
    FLAGGED_STD,
    LOGGED,
    NEAR_OR_FLAGGED,
    Array,
    Valid,
    attribute,
    column,
)
from .windowed import Windowed


@dataclass(frozen=True, kw_only=True, repr=False)
class Wave(Windowed):
    """The standing wave per window: main amplitude, quadrature, wave angle, phases, with standard
    deviations.

    C0 = e^{jφ}(a_A cos mθ + j a_B sin mθ), S0 = e^{jφ}(a_A sin mθ − j a_B cos mθ); θ and φ
    unwrapped within the run; φ against the reference frequency. `covariance` is kept for the four
    of (a_A, a_B, θ, φ) only where it is not diagonal.
    """

    kind: ClassVar[str] = "wave"
    made_by: ClassVar[str] = "hrg estimate"
    main_amplitude: Array = column("any", "main amplitude a_A", valid=FLAGGED)
    quadrature_amplitude: Array = column("any", "quadrature amplitude a_B, signed", valid=FLAGGED)
    wave_angle_rad: Array = column(
        "rad", "wave angle θ, physical angle, unwrapped", valid=NEAR_OR_FLAGGED
    )
    phase_rad: Array = column(
        "rad", "phase φ against the reference frequency, unwrapped", valid=NEAR_OR_FLAGGED
    )
    carrier_phase_rad: Array = column(
        "rad", "carrier phase ψ (0 with direct read-out)", valid=NEAR_OR_FLAGGED
    )
    main_amplitude_std: Array = column("any", "its standard deviation", valid=FLAGGED_STD)
    quadrature_amplitude_std: Array = column("any", "its standard deviation", valid=FLAGGED_STD)
    wave_angle_rad_std: Array = column("rad", "its standard deviation", valid=FLAGGED_STD)
    phase_rad_std: Array = column("rad", "its standard deviation", valid=FLAGGED_STD)
    carrier_phase_rad_std: Array = column("rad", "its standard deviation", valid=FLAGGED_STD)
    residual_rms: Array = column(
        "any",
        "rms of the redundant equations' residual (0 where there is no redundancy)",
        valid=FLAGGED_STD,
    )
    signal_std: Array = column(
        "any",
        "standard deviation of one signal coefficient, pooled over the window's signals",
        valid=FLAGGED_STD,
    )
    channel_std: Array | None = column(
        "any",
        "standard deviation of one signal coefficient of channel C and of S",
        ("row", "channel"),
        optional=True,
        valid=FLAGGED_STD,
    )
    iterations: Array = column(
        "1",
        "residual evaluations of the solver (0: closed form; negative: not converged)",
        dtype="i2",
    )
    frequency_hz: Array = column(
        "Hz",
        "oscillation frequency: reference + dφ/dt / 2π, smoothed over neighbouring windows",
        valid=LOGGED,
    )
    units: str = attribute("unit of the amplitudes", default="1", name="amplitude_units")
    carrier_phase_difference_rad: float | None = attribute(
        "the carrier's phase ψ of S less that of C, taken off where it is more than 5 standard"
        " deviations",
        default=None,
        dtype="f8",
    )
    carrier_phase_difference_std: float | None = attribute(
        "its standard deviation", default=None, dtype="f8", valid=Valid(at_least=0)
    )

    def good(self) -> Array:
        """Rows that are neither flagged nor failed.

        Returns
        -------
        ndarray
            True for a good row, bool (n,).
        """
        flags, iterations = np.asarray(self.flags), np.asarray(self.iterations)
        return (flags == 0) & (iterations >= 0) & np.isfinite(np.asarray(self.wave_angle_rad))
