"""Diagnosis, a tone near the resonance: what beats in the envelopes at a fixed frequency, e e^{j(ω_m
− ω_r)t}, and what windows show of it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ....fitting.samples.envelope_motion import BEND, CURVED

Array = np.ndarray
SHOWN = 0.05
"""Part of a tone that a window must show for its true size to be told from what is seen."""
SCATTER = 0.2
"""Part of a tone's χ² that its vectors' scatter from run to run may have where its phase is the
same in all of them."""


@dataclass(frozen=True)
class Tone:
    """A tone: frequency, complex amplitudes e (R, 2) of every run at t = 0 of the run, σ (R, 2) of
    one real part in either channel, χ² it takes away.

    `standing`: as strong in the second half of the runs as in the first; a partial of the resonator
    dies away.
    """

    frequency_hz: float
    vector: Array
    std: Array
    gain: float
    standing: bool = True

    @property
    def mean(self) -> Array:
        """Mean vector (2,) of the runs, weighed by their noise."""
        weight = 1 / self.std**2
        return np.asarray(np.sum(self.vector * weight, axis=0) / weight.sum(axis=0))

    @property
    def common(self) -> bool:
        """Whether its phase at t = 0 is the same in all runs."""
        scatter = np.abs(self.vector - self.mean) ** 2 / self.std**2
        return bool(np.sum(scatter) < SCATTER * self.gain)

    def average_in_windows(self, frequency_hz: float, window_s: float) -> Tone:
        """What windows of an oscillation show of a true tone."""
        part = compute_window_response((self.frequency_hz - frequency_hz) * window_s)
        return replace(self, vector=self.vector * part, std=self.std * abs(part))

    def undo_windows(self, frequency_hz: float, window_s: float) -> Tone:
        """The tone whose part is seen; as seen where windows show next to nothing of it."""
        part = compute_window_response((self.frequency_hz - frequency_hz) * window_s)
        if abs(part) <= SHOWN:
            return self
        return replace(self, vector=self.vector / part, std=self.std / abs(part))

    def compute_envelopes(self, k: int, time_s: Array, reference_hz: float) -> Array:
        """Its envelopes (n, 2) in run k against a reference: e e^{j2π(f − f_ref)t}."""
        turn = np.exp(2j * np.pi * (self.frequency_hz - reference_hz) * time_s)
        return np.asarray(self.vector[k] * turn[:, None])


def split_channels(vector: Array) -> dict[str, float]:
    """A tone's complex amplitudes (2,) as the cosine and sine of each channel."""
    return {
        "c_cos": float(vector[0].real),
        "c_sin": float(-vector[0].imag),
        "s_cos": float(vector[1].real),
        "s_sin": float(-vector[1].imag),
    }


def compute_window_response(turns: float) -> float:
    """Part that a window shows of what beats by so many turns in it: sin(πx)/(πx)·(1 + E(1 +
    cE)/24).

    The second factor is the curvature that demodulate puts back, from h windows on either side: E =
    (2 sin(πhx)/h)².
    """
    bend = float((2 * np.sin(np.pi * BEND * turns) / BEND) ** 2)
    return float(np.sinc(turns)) * (1 + bend * (1 + CURVED * bend) / 24)
