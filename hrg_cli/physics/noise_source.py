"""The noise of one run of the fast engine, drawn block after block as its loop takes it."""

from __future__ import annotations

import numpy as np

from .loop_values import Disturbance
from .noise import Flicker, FlickerSeries, Noise, compute_thermal_kicks
from .resonator import Mechanics

Array = np.ndarray
_NOTHING = np.zeros((0, 2))
_NO_KNOTS = np.zeros((0, 8))


class NoiseSource:
    """Brownian kicks and electronic noise of consecutive blocks of steps, each from a stream of its
    own."""

    def __init__(
        self,
        noise: Noise,
        mechanics: Mechanics,
        h: float,
        substeps: int,
        steps: int,
        random: np.random.Generator,
        board: bool,
    ) -> None:
        # One stream each: switching one noise on leaves the draws of the others as they were.
        self._brownian, self._rough, self._white, flicker = random.spawn(4)
        self._kicks = (
            compute_thermal_kicks(mechanics, noise, h) / mechanics.omega_rad_s
            if noise.thermal_velocity2
            else None
        )
        self._drive = noise.drive_density * np.sqrt(h)
        # σ is that of a recorded sample, the mean of its substeps.
        self._std = noise.readout * np.sqrt(substeps)
        self._series = self._flicker(noise, h, substeps, steps, flicker)
        self.readout = noise.readout > 0 and (board or self._series is not None)
        """Whether the read-out's noise is drawn here, not by the pick-off chain."""
        self.electronic = self.readout or self._series is not None

    @staticmethod
    def _flicker(
        noise: Noise, h: float, substeps: int, steps: int, random: np.random.Generator
    ) -> FlickerSeries | None:
        """1/f envelopes: read-out 2S₀f_c/f a quadrature, S₀ = 2σ²/f_s; drive S_d f_c/f a
        quadrature."""
        corner = max(noise.readout_corner_hz, noise.drive_corner_hz)
        if not corner:
            return None
        readout = 4 * noise.readout**2 * h * substeps * noise.readout_corner_hz
        drive = noise.drive_density**2 * noise.drive_corner_hz
        return FlickerSeries(Flicker(np.repeat([readout, drive], 4), corner, steps * h, random), h)

    def draw_kicks(self, steps: int) -> tuple[Array, Array]:
        """Changes of the momentum (over ω) at the next steps (n, 2) by Brownian force, and by white
        drive noise; empty without.

        A velocity kick σ_v changes each quadrature of u by σ_v²/2ω² in the mean: density S_d of the
        drive makes σ_v = ωS_d√h.
        """
        brownian = (
            _NOTHING
            if self._kicks is None
            else self._brownian.standard_normal((steps, 2)) @ self._kicks.T
        )
        return brownian, self._drive * self._rough.standard_normal(
            (steps, 2)
        ) if self._drive else _NOTHING

    def draw_electronics(self, first: int, steps: int) -> Disturbance:
        """White and 1/f noise of the steps first … first + steps of the run."""
        white = self._std * self._white.standard_normal((steps, 2)) if self.readout else _NOTHING
        if self._series is None:
            return Disturbance(white, _NO_KNOTS, 1, 0)
        knots, begin = self._series.draw_over(first, steps)
        return Disturbance(white, knots, self._series.stride, begin - first)
