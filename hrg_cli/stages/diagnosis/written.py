"""Diagnosis, the written model: the TOML simulated as a user would, and held against the measurement and against the fit it comes from.

Raw samples of the engine that is not the fitting model, demodulated like a recording, without noise: what is left over σ must be what
the fit leaves, or the file is not the model that was fitted.
"""

from __future__ import annotations

import tomllib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...effects.effect import Effect
from ...errors import HrgError
from ...fitting.causes.extended_fit import Fit
from ...fitting.causes.wave_frame import real
from ...physics import ellipse
from ...records import collect
from ..demodulate import demodulate
from ..estimate import estimate
from ..simulate import simulate_run
from ..simulation_file import runs_of

Array = np.ndarray
MOST_SAMPLES = 30_000_000
"""Samples simulated at most, all runs together; longer runs are followed for their first part only."""
PERIODS = 2.0
"""Periods a window of the simulated samples, short beside everything that moves."""


@dataclass(frozen=True)
class Written:
    """rms over σ of measured less simulated, of measured less fitted on the same rows, and the part of the runs that was simulated."""

    rms_over_noise: float
    fitted_rms_over_noise: float
    share: float

    @property
    def ratio(self) -> float:
        """How much worse the file is than the fit."""
        return self.rms_over_noise / max(self.fitted_rms_over_noise, 1e-300)


def hold(text: str, fit: Fit, origin: Sequence[int], extra_effects: Sequence[Effect]) -> Written | None:
    """Simulate a written model and compare it at the fit's rows; None where it cannot be simulated. `origin`: the file's run of each piece."""
    table = tomllib.loads(text)
    try:
        runs = runs_of(table)
    except HrgError:
        return None
    wanted = sum(run.recording.sample_rate_hz * run.recording.duration_s for run in runs)
    share = min(1.0, MOST_SAMPLES / wanted)
    simulated = []
    for run in runs:
        short = run.recording.model_copy(update={"duration_s": run.recording.duration_s * share})
        quiet = run.model_copy(update={"recording": short, "readout": run.readout.model_copy(update={"noise": 0.0})})
        try:
            simulated.append(_envelopes(collect(simulate_run(quiet, extra_effects)), fit))
        except HrgError:
            return None
    order = list(dict.fromkeys(origin))
    left, fitted = [], []
    for k in range(len(fit.series.names)):
        t, slow, turn = simulated[order.index(origin[k])]
        rows = (fit.series.weight[k] > 0) & (fit.series.time_s[k] >= t[0]) & (fit.series.time_s[k] <= t[-1])
        at = fit.series.time_s[k][rows]
        u = _at(at, t, slow) * np.exp(1j * turn * at)[:, None]
        weight = fit.series.weight[k][rows][:, None]
        measured = fit.series.envelope[k][rows]
        left.append(real(measured - u) * weight)
        fitted.append(real(measured - fit.prediction.seen[k][rows]) * weight)
    if not sum(len(one) for one in left):
        return None
    figures = [float(np.sqrt(np.mean(np.concatenate(side) ** 2))) for side in (left, fitted)]
    return Written(figures[0], figures[1], share)


def _envelopes(recording: Any, fit: Fit) -> tuple[Array, Array, float]:
    """Times, envelopes against the fit's reference less their mean turn (n, 2), and that turn, of a simulated recording."""
    wave = collect(estimate(collect(demodulate(recording, periods_per_window=PERIODS))))
    good = wave.good()
    t = np.asarray(wave.time_s, float)[good]
    u = ellipse.envelopes(wave.main_amplitude, wave.quadrature_amplitude, wave.wave_angle_rad, wave.phase_rad, wave.mode_number)[good]
    phase = np.asarray(wave.phase_rad, float)[good]
    shift = 2 * np.pi * (float(wave.reference_frequency_hz) - fit.series.reference_frequency_hz)
    own = float((phase[-1] - phase[0]) / (t[-1] - t[0]))
    return t, u * np.exp(-1j * own * t)[:, None], own + shift


def _at(at: Array, t: Array, u: Array) -> Array:
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(t, u)(at))
