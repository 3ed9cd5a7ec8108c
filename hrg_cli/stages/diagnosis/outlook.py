"""Diagnosis, the outlook: the wave beyond the rows that a fit has seen, and by how much it may miss.

Two things make a forecast miss: parameters that the first part leaves uncertain, and noise that wanders on. With t the rows fitted, f those
predicted, r the residual, C the noise's covariance, J the sensitivities and P the parameters' covariance, the best linear unbiased
prediction (Goldberger 1962) and its covariance are
    model_f + C_ft C_tt⁻¹ r_t,   (J_f − C_ft C_tt⁻¹ J_t) P (J_f − C_ft C_tt⁻¹ J_t)ᵀ + C_ff − C_ft C_tt⁻¹ C_tf.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...fitting.causes import colour, extended_fit
from ...fitting.causes.extended import Series
from ...fitting.causes.extended_fit import Fit, flat
from ...fitting.causes.sensitivities import propagation
from ...fitting.causes.wave_frame import directions, imaginary, real
from ...physics import ellipse

Array = np.ndarray
ANGLE, AMPLITUDE, QUADRATURE = "angle_deg", "amplitude_percent", "quadrature_percent"
SMALL = 1e-4
"""Difference step in the wave's frame."""


@dataclass(frozen=True)
class Errors:
    """Errors of one forecast at the rows predicted: run (k,), time (k,), δmθ [rad], δ ln a, δr (k, 3), and what each may be.

    learned (k, 3, m): what one σ of each of m independent combinations of the parameters moves them by; wandered (k, 3): σ of the noise.
    """

    run: Array
    time_s: Array
    parts: Array
    learned: Array
    wandered: Array

    @property
    def std(self) -> Array:
        """σ of the errors, (k, 3)."""
        return np.sqrt(np.sum(self.learned**2, axis=-1) + self.wandered**2)

    @property
    def square(self) -> Array:
        """The wave's squared error, (k,)."""
        return np.sum(self.parts**2, axis=1)

    def figures(self, mode_number: int) -> dict[str, Any]:
        """Root mean squares of the errors and, `expected`, of their σ: degrees of the wave angle, amplitude and quadrature in per cent."""
        return root_mean_squares(self.parts, mode_number) | {"expected": root_mean_squares(self.std, mode_number)}


def root_mean_squares(parts: Array, mode_number: int) -> dict[str, float]:
    """Of δmθ, δ ln a, δr (k, 3): degrees of the wave angle, per cent of the amplitude, all together."""
    rms = np.sqrt(np.mean(parts**2, axis=0))
    return {
        ANGLE: float(np.degrees(rms[0]) / mode_number),
        AMPLITUDE: float(100 * rms[1]),
        QUADRATURE: float(100 * rms[2]),
        "wave_percent": float(100 * np.sqrt(np.sum(rms**2))),
    }


def outlook(fit: Fit, series: Series) -> Errors:
    """Errors of the forecast of every row of `series` with weight that the fit has not seen."""
    whole = replace(fit.prediction, series=replace(series, colour=None))
    good = series.weight > 0
    run, row = np.argwhere(good).T
    seen, weight, time_s = whole.seen[run, row], series.weight[run, row], series.time_s[run, row]
    size = np.sqrt(np.sum(np.abs(seen) ** 2, axis=-1))
    unit = 1 / (weight * size)
    frame = real(directions(seen))
    free = [bool(s > 0) for s in fit.freedom.std]
    design, _, _ = extended_fit.design_of(propagation(whole), free, extended_fit.amplitude_of(series))
    J = frame @ design.reshape(len(run), 4, -1) * unit[:, None, None]
    residual = (frame @ flat(whole.series, whole.residual()).reshape(-1, 4, 1))[..., 0] * unit[:, None]
    ahead = fit.series.weight[run, row] == 0
    hat, left = np.zeros((len(run), 4)), np.zeros((len(run), 4))
    noises = fit.series.colour.noises if fit.series.colour is not None else (colour.Noise(1.0, 0.0, 0.0, 0.0),) * 4
    for k in np.unique(run):
        f, t = np.flatnonzero((run == k) & ahead), np.flatnonzero((run == k) & ~ahead)
        since = time_s - time_s[run == k].min()
        for c, noise in enumerate(noises):
            left[f, c] = (noise.white * unit[f]) ** 2
            if noise.wander_1_s == 0:
                continue
            both = np.concatenate([t, f])
            C = colour.wander(since[both], noise.wander_1_s, noise.correlation_s)
            known = C[: len(t), : len(t)] + np.diag((noise.white * unit[t]) ** 2)
            G = np.linalg.solve(known, C[: len(t), len(t) :]).T
            hat[f, c] = G @ residual[t, c]
            J[f, c] -= G @ J[t, c]
            left[f, c] += np.diag(C)[len(t) :] - np.sum(G * C[len(t) :, : len(t)], axis=1)
    D = _slopes(seen, frame, series.mode_number)[ahead]
    misfit = max(1.0, fit.chi2 / fit.dof)  # a model that misses its own first part by more than the noise is trusted that much less
    spread = _root(fit.covariance)
    parts = _parts(series.envelope[run, row], seen, series.mode_number)[ahead] - (D @ hat[ahead][..., None])[..., 0]
    wandered = np.sqrt(misfit * np.sum(D**2 * left[ahead][:, None], axis=-1))
    return Errors(run[ahead], time_s[ahead], parts, np.sqrt(misfit) * (D @ J[ahead] @ spread), wandered)


def _root(covariance: Array) -> Array:
    """Columns whose outer products sum to the covariance, which may be blind to some directions."""
    size = np.sqrt(np.diag(covariance))
    size = np.where(size > 0, size, 1.0)
    level, vectors = np.linalg.eigh(covariance / np.outer(size, size))
    return size[:, None] * vectors * np.sqrt(np.maximum(level, 0.0))


def _parts(measured: Array, said: Array, mode_number: int) -> Array:
    """Measured less said: δmθ, δ ln a, δr, (k, 3)."""
    a, b, angle, _ = ellipse.wave(measured, mode_number)
    a_said, b_said, angle_said, _ = ellipse.wave(said, mode_number)
    turn = mode_number * (angle - angle_said)
    return np.stack([(turn + np.pi / 2) % np.pi - np.pi / 2, np.log(a / a_said), b / a - b_said / a_said], axis=1)


def _slopes(u: Array, frame: Array, mode_number: int) -> Array:
    """What unit changes in the wave's frame do to mθ, ln a and r, (k, 3, 4)."""
    size = np.sqrt(np.sum(np.abs(u) ** 2, axis=-1, keepdims=True))
    steps = [SMALL * size * imaginary(frame[:, c]) for c in range(4)]
    return np.stack([_parts(u + s, u - s, mode_number) / (2 * SMALL) for s in steps], axis=-1)
