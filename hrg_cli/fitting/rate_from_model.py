"""The rate from a reference model (seed A's last task): Ω(t) fitted to a run's envelopes with the identified resonator held.

Ω(t) is a cubic spline through its values at even nodes. The envelopes are fitted as a whole (likelihood.py), so the drift of the
wave is taken out by the model
itself, not by a table; the run keeps its own start state and frequency. Beside it stands −m·(dθ/dt)/K, which has the drift in it.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from ..errors import HrgError
from ..physics import ellipse
from ..physics.resonator import Mechanics
from ..records import Resonator, Wave
from . import coordinates, propagator
from .envelope_runs import EnvelopeRun, from_wave
from .likelihood import Batch, State, batch, real, respond

Array = np.ndarray
ITERATIONS = 8
ROWS_A_NODE = 6


@dataclass(frozen=True)
class RateEstimate:
    """Nodes (k,), rate [rad/s] with covariance (k, k), the plain estimate −m·dθ/dt/K on the nodes, and the fit's χ² a degree of freedom."""

    time_s: Array
    rate_rad_s: Array
    covariance: Array
    plain_rate_rad_s: Array
    chi2_per_dof: float

    @property
    def rate_rad_s_std(self) -> Array:
        """Standard deviations on the nodes."""
        return np.sqrt(np.diag(self.covariance))


def rate_from_model(wave: Wave, resonator: Resonator, nodes: int = 20) -> RateEstimate:
    """Ω(t) of a free run on `nodes` even times, given the resonator; its standard deviations are those of the noise alone.

    HrgError: the resonator has no scale factor, or too few windows for the nodes.
    """
    values = {name: value for name, (value, _, _) in resonator.parameters().items()}
    if "scale_factor" not in values:
        raise HrgError(f"{resonator.gyro_id or 'the resonator'}: has no scale_factor, which a rate needs; identify it with rotated runs")
    run = from_wave(wave, 0.0)
    if len(run) < ROWS_A_NODE * nodes:
        raise HrgError(
            f"{wave.run_id or 'the run'}: {len(run)} windows, at least {ROWS_A_NODE * nodes} were expected for {nodes} nodes; ask for fewer"
        )
    mechanics = Mechanics(**{k: values.get(k, 0.0) for k in ("frequency_hz", *_SHARED)}, mode_number=run.mode_number)
    p = coordinates.from_mechanics(mechanics)
    angle, _ = ellipse.unwrap(*ellipse.wave(run.envelope, 1)[2:], 1)
    run = dataclasses.replace(run, turn_rad=-(_smooth(angle, max(1, len(run) // (4 * nodes)))) / p[5])
    offset = propagator.mean_frequency(run)
    run = propagator.thinned([run], p, np.array([offset]), max(2 * ROWS_A_NODE * nodes, 400))[0]
    grid = np.linspace(run.time_s[0], run.time_s[-1], nodes)
    plain = np.gradient(np.interp(grid, run.time_s, run.turn_rad), grid)
    return _fitted(run, grid, plain, p, offset)


_SHARED = ("damping_rate_1_s", "damping_split_1_s", "damping_axis_rad", "frequency_split_rad_s", "stiffness_axis_rad", "scale_factor")


def _smooth(values: Array, width: int) -> Array:
    """Running mean of odd width, ends by reflection about the end value."""
    width |= 1
    half = width // 2
    padded = np.concatenate([2 * values[0] - values[half:0:-1], values, 2 * values[-1] - values[-2 : -half - 2 : -1]])
    return np.convolve(padded, np.ones(width) / width, "valid")


def _cardinal(time_s: Array, grid: Array) -> Array:
    """Cubic splines at times that are 1 at one node and 0 at the others, (k, n)."""
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(grid, np.eye(len(grid)))(time_s)).T


def _fitted(run: EnvelopeRun, grid: Array, plain: Array, p: Array, offset: float) -> RateEstimate:
    step = np.diff(run.time_s)
    begin, end = _cardinal(run.time_s[:-1], grid), _cardinal(run.time_s[1:], grid)
    middle = _cardinal(run.time_s[:-1] + step / 2, grid)
    turning = np.concatenate([np.zeros((len(grid), 1)), np.cumsum((begin + 4 * middle + end) * step / 6, axis=1)], axis=1)
    rate, start, phase = plain.copy(), run.envelope[:1].copy(), np.array([[offset * (run.time_s[-1] - run.time_s[0])]])
    data: Batch = batch([run])
    residual, covariance = np.zeros(0), np.zeros((len(grid),) * 2)
    for _ in range(ITERATIONS):
        data = batch([dataclasses.replace(run, turn_rad=rate @ turning)])
        response = respond(data, State(p, start, phase))
        shared = response.turning_sensitivity(*(p[5] * h[:, None] for h in (begin, middle, end)))
        own = response.run_sensitivities()
        design = real(np.concatenate([own, shared])[:, 0], data.weight[0])
        residual = response.residual()[0].ravel()
        scale = np.linalg.norm(design, axis=0)
        scale[scale == 0] = 1.0
        inverse = np.linalg.pinv(design / scale, rcond=1e-12)
        change = inverse @ np.concatenate([residual.real, residual.imag]) / scale
        start = start + change[[0, 2]] + 1j * change[[1, 3]]
        phase = phase + change[4 : 4 + phase.shape[1]]
        rate = rate + change[4 + phase.shape[1] :]
        covariance = (inverse @ inverse.T / np.outer(scale, scale))[4 + phase.shape[1] :, 4 + phase.shape[1] :]
        if np.all(np.abs(change[4 + phase.shape[1] :]) < 0.01 * np.sqrt(np.diag(covariance))):
            break
    final = respond(batch([dataclasses.replace(run, turn_rad=rate @ turning)]), State(p, start, phase))
    dof = max(1, 4 * len(run) - len(grid) - 4 - phase.shape[1])
    return RateEstimate(grid, rate, covariance * max(1.0, final.chi2 / dof), plain, final.chi2 / dof)
