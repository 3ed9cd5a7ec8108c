"""One frequency of all runs, and its place in the covariance of the parameters."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...fitting.envelopes import inference
from ...fitting.envelopes.likelihood import Fit

Array = np.ndarray
FREQUENCIES_DIFFER = 4
"""Scatter of the runs' frequencies, in their typical σ, above which they are not one."""


@dataclass(frozen=True)
class PooledFrequency:
    """One frequency of all runs: their weighted mean, or the plain one where they differ by more
    than their errors; then their scatter is in its variance, as their drift always is."""

    runs: inference.Frequencies
    weight: Array
    """(r,) of each run in the mean."""
    mean_hz: float
    more_variance: float
    """What scatter and drift add to the mean's own."""
    differ: bool
    drift_hz: float

    def list_details(self) -> dict[str, Any]:
        """What the record keeps of it."""
        std = np.sqrt(np.diag(self.runs.covariance))
        return {
            "run_frequency_hz": [float(f) for f in self.runs.value],
            "run_frequency_std_hz": [float(f) for f in std],
            "runs_differ_in_frequency": self.differ,
            "run_frequency_drift_hz": [float(d) for d in self.runs.drift_hz],
            "frequency_note": _frequency_note(self.differ, self.drift_hz),
        }


def pool_frequencies(runs: inference.Frequencies) -> PooledFrequency:
    """One frequency of the runs' own."""
    frequency, std = runs.value, np.sqrt(np.diag(runs.covariance))
    scatter = float(np.std(frequency, ddof=1)) if len(frequency) > 1 else 0.0
    differ = scatter > FREQUENCIES_DIFFER * float(np.median(std))
    weight = np.ones(len(frequency)) if differ else 1 / np.maximum(std, 1e-15) ** 2
    weight /= weight.sum()
    drift = float(np.sqrt(np.mean(runs.drift_hz**2)))
    more = (scatter**2 if differ else 0.0) + drift**2 / 12
    return PooledFrequency(runs, weight, float(weight @ frequency), more, differ, drift)


def join_frequency(
    fit: Fit, covariance: Array, z: Array, runs_hz: inference.Frequencies, weight: Array, mode: int
) -> Array:
    """Covariance (7, 7) with the mean frequency's before the others': f = b·z + its own noise, so
    that the whole is a covariance.

    covariance (6, 6) of the others, z's covariance z (k, k); the axes that are lost in noise are
    wider there than the slope says, and are so here.
    """
    through = inference.differentiate_parameters(fit, mode)
    by_z = weight @ runs_hz.by_z
    plain = np.sqrt(np.maximum(0.0, np.einsum("ij,jk,ik->i", through, z, through)))
    wider = np.divide(
        np.sqrt(np.maximum(0.0, np.diag(covariance))), plain, out=np.ones(6), where=plain > 0
    )
    full = np.zeros((7, 7))
    full[1:, 1:] = covariance
    full[0, 0] = weight**2 @ runs_hz.own_variance + by_z @ z @ by_z
    full[0, 1:] = full[1:, 0] = wider * (through @ z @ by_z)
    return full


def _frequency_note(differ: bool, drift_hz: float) -> str:
    """What frequency_hz and its standard deviation are here."""
    parts = ["frequency_hz is the mean over the runs"]
    if differ:
        parts.append(
            "the runs differ by more than their errors: its standard deviation is their scatter"
        )
    if drift_hz > 0:
        parts.append(
            f"the frequency moves by {drift_hz:.2g} Hz within a run: its standard deviation holds"
            " that range (over √12)"
        )
    return "; ".join(parts)
