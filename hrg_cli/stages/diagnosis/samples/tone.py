"""Diagnosis, a tone near the resonance: what beats in the envelopes at a fixed frequency, e
e^{j(ω_m − ω_r)t}, and what windows show of it."""

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
    """A tone's complex amplitudes as the cosine and sine of each channel.

    Parameters
    ----------
    vector
        e of C and S, (2,): the real part of e·e^{jωt} is what is added.

    Returns
    -------
    dict
        By the parameters of the effect `mains_tone`.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.samples.tone import split_channels
    >>> split_channels(np.array([0.1 - 0.2j, 0.3]))
    {'c_cos': 0.1, 'c_sin': 0.2, 's_cos': 0.3, 's_sin': -0.0}
    """
    return {
        "c_cos": float(vector[0].real),
        "c_sin": float(-vector[0].imag),
        "s_cos": float(vector[1].real),
        "s_sin": float(-vector[1].imag),
    }


def compute_window_response(turns: float) -> float:
    """Part that a window shows of what beats by x turns in it: sin(πx)/(πx)·(1 + E(1 + cE)/24).

    The second factor is the curvature that demodulate puts back.

    Parameters
    ----------
    turns
        x.

    Returns
    -------
    float
        1 of what stands still.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.samples.tone import compute_window_response
    >>> compute_window_response(0.0), round(compute_window_response(0.25), 3)
    (1.0, 0.951)
    """
    return float(np.sinc(turns)) * compute_curvature_gain(turns)


def compute_curvature_gain(turns: float) -> float:
    """Factor by which the curvature that demodulate puts back raises what beats in a window.

    1 + E(1 + cE)/24 with E = (2 sin(πhx)/h)² from h windows on either side.

    Parameters
    ----------
    turns
        x, of the beat in a window.

    Returns
    -------
    float
        At least 1.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.samples.tone import compute_curvature_gain
    >>> compute_curvature_gain(0.0), round(compute_curvature_gain(0.25), 3)
    (1.0, 1.057)
    """
    bend = float((2 * np.sin(np.pi * BEND * turns) / BEND) ** 2)
    return 1 + bend * (1 + CURVED * bend) / 24
