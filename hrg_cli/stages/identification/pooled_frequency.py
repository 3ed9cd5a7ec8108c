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
    """The runs' own frequencies as one: their weighted mean, or the plain one where they differ.

    Parameters
    ----------
    runs
        Frequencies (r,) [Hz] with their covariance and drifts.

    Returns
    -------
    PooledFrequency
        The mean [Hz], each run's weight, and what scatter and drift add to its variance.

    Examples
    --------
    Two runs 0.1 Hz apart at 1 mHz are not one frequency:

    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.stages.identification.pooled_frequency import pool_frequencies
    >>> value, covariance = np.array([5e3, 5000.1]), 1e-6 * np.eye(2)
    >>> runs = Told(value=value, covariance=covariance, drift_hz=np.zeros(2))
    >>> pooled = pool_frequencies(runs)
    >>> round(pooled.mean_hz, 6), pooled.differ, round(pooled.more_variance, 6)
    (5000.05, True, 0.005)
    """
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
    """Covariance (7, 7) with the mean frequency's before the others', so that the whole is one.

    f = b·z + its own noise. The axes that are lost in noise are wider in `covariance` than the
    slope says, and are so here.

    Parameters
    ----------
    fit
        Whose free coordinates z (k,) the frequencies follow.
    covariance
        (6, 6) of the other parameters, in their order and units.
    z
        (k, k) of z.
    runs_hz
        Frequencies of the runs.
    weight
        (r,) of each run in the mean.
    mode
        m.

    Returns
    -------
    ndarray
        (7, 7), the first row and column Hz times the parameters' units.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes import inference
    >>> from hrg_cli.fitting.envelopes.base_fit import fit_base_model
    >>> from hrg_cli.fitting.envelopes.drawn_run import draw_run_down
    >>> from hrg_cli.stages.identification.pooled_frequency import join_frequency
    >>> fit = fit_base_model([draw_run_down(0.0, 0.5, seed=1), draw_run_down(0.8, -0.5, seed=2)])
    >>> z = inference.compute_covariance_z(fit, 1.0)
    >>> own = inference.compute_parameter_covariance(fit, 1.0, 2)[1]
    >>> runs_hz = inference.estimate_run_frequencies(fit, 1.0)
    >>> whole = join_frequency(fit, own, z, runs_hz, np.full(2, 0.5), 2)
    >>> whole.shape, bool(np.all(np.linalg.eigvalsh(whole) > -1e-12))
    ((7, 7), True)
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
