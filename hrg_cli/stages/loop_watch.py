"""Whether a simulated gyro's loops held its wave: what a recording made on real electronics says
about itself."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from ..errors import HrgError
from .simulation_file import SimulationFile

Array = np.ndarray
HELD = 0.1
"""Relative error of the amplitude, and |r| beyond that of no loop, up to which the loops hold."""
SATURATED = 0.01
"""Part of the log with a command beyond the drive's full scale from which it is said."""


class LoopWatch:
    """Follows the true wave of the second half of a run with [electronics]."""

    def __init__(self, settings: SimulationFile) -> None:
        self._settings = settings
        self._amplitude: list[Array] = []
        self._ratio: list[Array] = []
        self._beyond, self._count = 0, 0

    def make_error(self, time_s: float) -> HrgError:
        """What is to be said where the wave has grown beyond all numbers."""
        return HrgError(
            f"simulation: run {self._settings.run_id}: the loops are unstable, the wave grows"
            f" without bound by {time_s:g} s; lower the gains or the delay, or give"
            " electronics.drive_full_scale"
        )

    def take_rows(self, rows: Mapping[str, Array]) -> None:
        """Further rows of log and truth. HrgError: the wave has grown beyond all numbers."""
        time = rows["truth_time_s"]
        a_A, a_B = rows["truth_main_amplitude"], rows["truth_quadrature_amplitude"]
        if not np.all(np.isfinite(a_A)):
            raise self.make_error(float(time[np.argmin(np.isfinite(a_A))]))
        full = self._settings.electronics.drive_full_scale if self._settings.electronics else None
        if full is not None:
            self._beyond += int(
                np.sum(np.hypot(rows["drive_main"], rows["drive_quadrature"]) > full)
            )
        self._count += len(time)
        late = (time >= self._settings.recording.duration_s / 2) & (rows["drive_main"] != 0)
        self._amplitude.append(a_A[late])
        self._ratio.append(np.abs(a_B[late] / a_A[late]))

    def list_reasons(self) -> list[str]:
        """Sentences about loops that did not hold; empty where they did."""
        c, e = self._settings.control, self._settings.electronics
        amplitude = np.concatenate(self._amplitude) if self._amplitude else np.zeros(0)
        if e is None or not len(amplitude):
            return []
        wanted = c.amplitude or self._settings.start.amplitude
        found = []
        late_s = (
            e.periods_per_update + e.drive_periods + e.delay_periods
        ) / self._settings.device.frequency_hz
        if np.abs(amplitude / wanted - 1).max() > HELD:
            found.append(
                "the loops do not hold the wave: its amplitude is at last"
                f" {amplitude.min():.3g} to {amplitude.max():.3g} of a set {wanted:.3g} (gain ×"
                f" delay: amplitude loop {c.amplitude_gain_1_s * late_s:.2g}, phase loop"
                f" {math.sqrt(2) * 2 * math.pi * e.phase_loop_hz * late_s:.2g}; unstable from π/2)"
            )
        ratio = np.concatenate(self._ratio)
        if c.quadrature_loop != "off" and ratio.max() > HELD:
            gain = 5.0 if c.quadrature_gain_1_s is None else c.quadrature_gain_1_s
            found.append(
                f"the quadrature loop does not hold the quadrature: |a_B| reaches {ratio.max():.3g}"
                " of the main amplitude in the second half (quadrature gain × delay ="
                f" {gain * late_s:.2g})"
            )
        if self._beyond > SATURATED * self._count:
            found.append(
                f"the drive saturates in {100 * self._beyond / self._count:.0f} % of the run"
                " (electronics.drive_full_scale)"
            )
        return found
