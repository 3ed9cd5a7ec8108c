"""The likelihood of free runs: every run's envelopes by the exact slow model, all runs batched, Gauss–Newton with nuisances eliminated.

A run's model is u(t) = e^{jψ(t)} Φ(t) u₀ with Φ' = L(p, Ω(t)) Φ: start state u₀ (4 reals) and the phase polynomial ψ (frequency offset,
then drift of the frequency) are the run's own; p are the coordinates of `coordinates.py`, shared. Steps are exponentials of the mean
generator (closed 2 × 2 form); a small term g(t) added to u' changes the model by Φ(t) ∫ Φ⁻¹ g dt, which gives the Jacobian, and any
further effect's sensitivity, without a second integration.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ..physics.resonator import J, exponential
from . import coordinates
from .coordinates import COUNT, product
from .envelope_runs import EnvelopeRun

Array = np.ndarray
CONVERGED = 1e-3
"""Predicted fall of χ², in units of χ²/dof, of a step after which the rest, smaller by another order, is left."""


@dataclass(frozen=True)
class Batch:
    """Runs side by side, padded to the longest: times from the run's first row, table turn, envelopes, 1/σ (0 where padded), (R, n)."""

    runs: tuple[EnvelopeRun, ...]
    time_s: Array
    turn_rad: Array
    envelope: Array
    weight: Array

    @property
    def step_s(self) -> Array:
        """Length of each step, (R, n−1), 0 where padded."""
        return np.diff(self.time_s, axis=1)

    @property
    def step_rate(self) -> Array:
        """Mean rate of each step, rad/s, (R, n−1)."""
        dt = self.step_s
        return np.divide(np.diff(self.turn_rad, axis=1), dt, out=np.zeros_like(dt), where=dt > 0)

    @property
    def step_rate_slope(self) -> Array:
        """Angular acceleration of each step, rad/s², from the neighbouring steps' mean rates, (R, n−1)."""
        middle = (self.time_s[:, 1:] + self.time_s[:, :-1]) / 2
        rate, dt = self.step_rate, np.diff(middle, axis=1)
        slope = np.divide(np.diff(rate, axis=1), dt, out=np.zeros_like(dt), where=(dt > 0) & (self.step_s[:, 1:] > 0))
        if slope.shape[1] == 0:
            return np.zeros_like(rate)
        return np.concatenate([slope[:, :1], (slope[:, 1:] + slope[:, :-1]) / 2, slope[:, -1:]], axis=1)

    @property
    def span_s(self) -> Array:
        """Duration of each run, (R,)."""
        return self.time_s[:, -1]


def batch(runs: Sequence[EnvelopeRun]) -> Batch:
    """Pad runs of any lengths to one batch; padding repeats the last row with no weight."""
    longest = max(len(r) for r in runs)

    def padded(values: Array) -> Array:
        return np.concatenate([values, np.repeat(values[-1:], longest - len(values), axis=0)])

    return Batch(
        runs=tuple(runs),
        time_s=np.stack([padded(r.time_s) - r.time_s[0] for r in runs]),
        turn_rad=np.stack([padded(r.turn_rad) - r.turn_rad[0] for r in runs]),
        envelope=np.stack([padded(r.envelope) for r in runs]),
        weight=np.stack([np.concatenate([1 / r.std, np.zeros(longest - len(r))]) for r in runs]),
    )


@dataclass(frozen=True)
class State:
    """Where the fit stands: shared coordinates p (7,), start states (R, 2) complex, phase coefficients (R, k) of (t/T)¹…(t/T)ᵏ, rad."""

    p: Array
    start: Array
    phase: Array

    def offsets_rad_s(self, span_s: Array) -> Array:
        """Mean frequency of each run above its reference, (R,) rad/s."""
        return self.phase.sum(axis=1) / span_s


@dataclass(frozen=True)
class Response:
    """The model at a state: envelopes (R, n, 2) and what its sensitivities need."""

    batch: Batch
    state: State
    model: Array
    turn: Array  # e^{jψ + mean growth}, (R, n)
    phi: Array  # traceless propagator from the first row, (R, n, 2, 2)
    half: Array  # traceless propagator of half a step, (R, n-1, 2, 2)
    second: Array  # ∂L/∂p₆ a step, (R, n-1, 2, 2)

    def sensitivity(self, left: Array, middle: Array, right: Array) -> Array:
        """Change of the envelopes (..., R, n, 2) by a term δL·u in u', given as δL (..., R, n−1, 2, 2) at the steps' ends and middle.

        Φ(t) ∫₀ᵗ Φ⁻¹ δL Φ ds u₀ by Simpson's rule a step: the error is of fourth order in |L|·step.
        """
        begin, end = self.phi[:, :-1], self.phi[:, 1:]
        mid = product(self.half, begin)
        u0 = self.state.start[:, None]
        total = pulled(begin, left, u0) + 4 * pulled(mid, middle, u0) + pulled(end, right, u0)
        increments = total * (self.batch.step_s / 6)[..., None]
        path = np.cumsum(increments, axis=-2)
        path = np.concatenate([np.zeros_like(path[..., :1, :]), path], axis=-2)
        return applied(self.phi, path) * self.turn[..., None]

    def forced(self, force: Array) -> Array:
        """Change of the envelopes (..., R, n, 2) by an additive term g (..., R, n, 2) in u' at the rows, trapezium rule."""
        flow = applied(inverse(self.phi), force / self.turn[..., None])
        path = np.cumsum((flow[..., 1:, :] + flow[..., :-1, :]) * (self.batch.step_s / 2)[..., None], axis=-2)
        path = np.concatenate([np.zeros_like(path[..., :1, :]), path], axis=-2)
        return applied(self.phi, path) * self.turn[..., None]

    @cached_property
    def _coordinates(self) -> Array:
        phi, u0, t = self.phi, self.state.start[:, None], self.batch.time_s
        middle = product(self.half, phi[:, :-1])
        back, middle_back = inverse(phi), inverse(middle)
        flow, middle_flow = applied(phi, u0), applied(middle, u0)
        at, between = applied(back, reflected(flow)), applied(middle_back, reflected(middle_flow))
        total = np.empty((4, *between.shape[1:]), complex)
        total[:3] = at[:, :, :-1] + 4 * between + at[:, :, 1:]
        total[2] *= self.batch.step_rate[..., None]
        total[3] = applied(back[:, :-1], applied(self.second, flow[:, :-1])) + applied(back[:, 1:], applied(self.second, flow[:, 1:]))
        total[3] += 4 * applied(middle_back, applied(self.second, middle_flow))
        path = np.zeros((4, *flow.shape), complex)
        np.cumsum(total * (self.batch.step_s / 6)[..., None], axis=-2, out=path[:, :, 1:])
        cos, sin, turning, second = applied(phi, path) * self.turn[..., None]
        return np.stack([-t[..., None] * self.model, -cos, -sin, 1j * cos, 1j * sin, turning, second])

    def coordinate_sensitivities(self) -> Array:
        """∂model/∂p (7, R, n, 2); to first order in |L|/ω, which is enough to converge.

        `sensitivity` of R_c, R_s, ΩJ and the second order: ν needs no integral, and a frequency split is −j times a damping split.
        """
        return self._coordinates

    def run_sensitivities(self) -> Array:
        """∂model/∂(Re u₀C, Im u₀C, Re u₀S, Im u₀S, phase coefficients), (4 + k, R, n, 2)."""
        columns = self.phi * self.turn[..., None, None]
        start = [columns[..., 0], 1j * columns[..., 0], columns[..., 1], 1j * columns[..., 1]]
        x = self.batch.time_s / self.batch.span_s[:, None]
        phase = [1j * (x**k)[..., None] * self.model for k in range(1, self.state.phase.shape[1] + 1)]
        return np.stack(start + phase)

    def residual(self) -> Array:
        """Measured minus model over σ, (R, n, 2) complex; 0 where padded."""
        return (self.batch.envelope - self.model) * self.batch.weight[..., None]

    @property
    def chi2(self) -> float:
        """Σ|residual|²."""
        return float(np.sum(np.abs(self.residual()) ** 2))


def inverse(phi: Array) -> Array:
    """Inverse of 2 × 2 matrices of determinant 1."""
    out = np.empty_like(phi)
    out[..., 0, 0], out[..., 1, 1] = phi[..., 1, 1], phi[..., 0, 0]
    out[..., 0, 1], out[..., 1, 0] = -phi[..., 0, 1], -phi[..., 1, 0]
    return out


def applied(matrix: Array, vector: Array) -> Array:
    """matrix·vector over (..., 2, 2) and (..., 2)."""
    x, y = vector[..., 0], vector[..., 1]
    out = np.empty(np.broadcast_shapes(matrix.shape[:-1], vector.shape), np.result_type(matrix, vector))
    out[..., 0] = matrix[..., 0, 0] * x + matrix[..., 0, 1] * y
    out[..., 1] = matrix[..., 1, 0] * x + matrix[..., 1, 1] * y
    return out


def reflected(vector: Array) -> Array:
    """R_c·v, R_s·v and J·v of vectors (..., 2), (3, ..., 2)."""
    x, y = vector[..., 0], vector[..., 1]
    out = np.empty((3, *vector.shape), vector.dtype)
    out[0, ..., 0], out[0, ..., 1] = x, -y
    out[1, ..., 0], out[1, ..., 1] = y, x
    out[2, ..., 0], out[2, ..., 1] = y, -x
    return out


def pulled(phi: Array, term: Array, start: Array) -> Array:
    """Φ⁻¹ δL Φ u₀, (..., 2)."""
    return applied(inverse(phi), applied(term, applied(phi, start)))


def chain(steps: Array) -> Array:
    """Running products (R, n, 2, 2) of steps (R, n−1, 2, 2), the identity first; about 2√n batched multiplications."""
    runs, count = steps.shape[:2]
    size = max(1, int(np.sqrt(count)))
    blocks = -(-count // size)
    padded = np.empty((runs, blocks * size, 2, 2), complex)
    padded[:, :count], padded[:, count:] = steps, np.eye(2)
    inner = padded.reshape(runs, blocks, size, 2, 2)
    for i in range(1, size):
        inner[:, :, i] = product(inner[:, :, i], inner[:, :, i - 1])
    before = np.empty((runs, blocks, 2, 2), complex)
    before[:, 0] = np.eye(2)
    for i in range(1, blocks):
        before[:, i] = product(inner[:, i - 1, -1], before[:, i - 1])
    products = product(inner, before[:, :, None]).reshape(runs, -1, 2, 2)[:, :count]
    return np.concatenate([np.broadcast_to(np.eye(2), (runs, 1, 2, 2)), products], axis=1)


def respond(data: Batch, state: State) -> Response:
    """Envelopes of all runs at a state."""
    omega = 2 * np.pi * np.array([r.reference_frequency_hz for r in data.runs]) + state.offsets_rad_s(data.span_s)
    rate = data.step_rate
    plain = coordinates.generator(np.append(state.p[:6], 0.0), rate, 1.0)
    full = coordinates.generator(np.append(state.p[:6], 1.0), rate, omega[:, None])
    L = plain + state.p[6] * (full - plain)
    change = (state.p[5] * data.step_s**2 / 12 * data.step_rate_slope)[..., None, None] * J
    L = L + product(change, L) - product(L, change)  # Magnus: the rate changes within a step
    mean = (L[..., 0, 0] + L[..., 1, 1]) / 2
    half = exponential(L - mean[..., None, None] * np.eye(2), data.step_s / 2)
    phi = chain(product(half, half))
    growth = np.concatenate([np.zeros((len(data.runs), 1)), np.cumsum(mean * data.step_s, axis=1)], axis=1)
    x = data.time_s / data.span_s[:, None]
    turn = np.exp(growth + 1j * sum(state.phase[:, k - 1 : k] * x**k for k in range(1, state.phase.shape[1] + 1)))
    model = applied(phi, np.broadcast_to(state.start[:, None], data.envelope.shape)) * turn[..., None]
    return Response(data, state, model, turn, phi, half, full - plain)


@dataclass(frozen=True)
class Freedom:
    """What is fitted: p = origin + directions @ z, with an optional Gaussian prior (mean, std) a direction (std inf: none)."""

    names: tuple[str, ...]
    origin: Array
    directions: Array
    prior_mean: Array
    prior_std: Array


@dataclass(frozen=True)
class Fit:
    """The optimum: state, upper-triangular square root of the information on z with the runs' nuisances eliminated, χ² and its freedom."""

    freedom: Freedom
    response: Response
    z: Array
    root: Array  # R with information RᵀR, (k, k), the prior included
    data_root: Array  # the same of the data alone
    chi2: float
    dof: int
    converged: bool
    iterations: int
    run_chi2: Array = field(default_factory=lambda: np.zeros(0))

    @property
    def p(self) -> Array:
        """Coordinates (7,)."""
        return self.response.state.p

    def covariance_z(self) -> Array:
        """Covariance of z at the nominal noise."""
        scale = np.linalg.norm(self.root, axis=0)
        scale[scale == 0] = 1.0
        inverse_root = np.linalg.pinv(self.root / scale, rcond=1e-12) / scale[:, None]
        return inverse_root @ inverse_root.T


def real(columns: Array, weight: Array) -> Array:
    """Weighted complex columns (k, n, 2) as real design matrix (4n, k)."""
    flat = (columns * weight[:, None]).reshape(len(columns), -1)
    return np.concatenate([flat.real, flat.imag], axis=1).T


def triangle(matrix: Array) -> Array:
    """The triangular factor R of matrix = QR."""
    return np.asarray(np.linalg.qr(matrix, mode="r"))


def reduced(response: Response, freedom: Freedom) -> tuple[Array, Array, list[Array]]:
    """Each run's design with its own nuisances eliminated by QR: rows of [∂/∂z | residual] stacked, and what gives the nuisance
    steps back.
    """
    shared = np.tensordot(freedom.directions.T, response.coordinate_sensitivities(), 1)
    own = response.run_sensitivities()
    residual = response.residual()
    rows, back = [], []
    k = own.shape[0]
    for run, record in enumerate(response.batch.runs):
        n = len(record)
        weight = response.batch.weight[run, :n]
        r = residual[run, :n].ravel()
        design = np.column_stack([real(own[:, run, :n], weight), real(shared[:, run, :n], weight), np.concatenate([r.real, r.imag])])
        R = triangle(design)
        back.append(R[:k])
        rows.append(R[k:, k:])
    stacked = np.concatenate(rows)
    return stacked[:, :-1], stacked[:, -1], back


def fit(data: Batch, freedom: Freedom, z: Array, start: Array, phase: Array, max_iterations: int = 30) -> Fit:
    """Gauss–Newton with step halving from z, start states (R, 2) and phases (R, k); stops with a step below 3 % of the errors."""
    prior = np.isfinite(freedom.prior_std)
    prior_rows = np.diag(np.where(prior, 1 / np.where(prior, freedom.prior_std, 1.0), 0.0))[prior]

    def cost(response: Response, z: Array) -> float:
        return response.chi2 + float(np.sum((prior_rows @ (z - freedom.prior_mean)) ** 2))

    def at(z: Array, start: Array, phase: Array) -> Response:
        return respond(data, State(freedom.origin + freedom.directions @ z, start, phase))

    response = at(z, start, phase)
    current, converged, iteration = cost(response, z), False, 0
    while iteration < max_iterations:
        iteration += 1
        design, residual, back = reduced(response, freedom)
        full = np.concatenate([design, prior_rows])
        target = np.concatenate([residual, prior_rows @ (freedom.prior_mean - z)])
        if not (np.isfinite(full).all() and np.isfinite(target).all()):
            break  # LAPACK would print its complaint among the command's results
        scale = np.linalg.norm(full, axis=0)
        scale[scale == 0] = 1.0
        step = np.linalg.lstsq(full / scale, target, rcond=1e-13)[0] / scale
        own = np.stack([np.linalg.lstsq(R[:, : len(R)], R[:, -1] - R[:, len(R) : -1] @ step, rcond=1e-14)[0] for R in back])
        predicted = float(np.sum((full @ step) ** 2)) + float(sum(np.sum((R[:, -1]) ** 2) for R in back))
        size = 1.0
        while True:
            trial_z = z + size * step
            trial = at(
                trial_z,
                response.state.start + size * (own[:, [0, 2]] + 1j * own[:, [1, 3]]),
                response.state.phase + size * own[:, 4:],
            )
            value = cost(trial, trial_z)
            if value <= current * (1 + 1e-12) + 1e-9 or size < 1e-3:
                break
            size /= 2
        if not np.isfinite(value) or value > current * (1 + 1e-6) + 1e-3:
            break
        z, response, current = trial_z, trial, value
        if predicted < CONVERGED * max(1.0, current / max(1, _dof(data, freedom, phase))):
            converged = True
            break
    if not converged:  # else the last step was too small to change it
        design, _, _ = reduced(response, freedom)
    residual = response.residual()
    return Fit(
        freedom=freedom,
        response=response,
        z=z,
        root=triangle(np.concatenate([design, prior_rows])),
        data_root=triangle(design),
        chi2=response.chi2,
        dof=_dof(data, freedom, phase),
        converged=converged,
        iterations=iteration,
        run_chi2=np.sum(np.abs(residual) ** 2, axis=(1, 2)),
    )


def _dof(data: Batch, freedom: Freedom, phase: Array) -> int:
    rows = sum(len(r) for r in data.runs)
    return max(1, 4 * rows - len(data.runs) * (4 + phase.shape[1]) - len(freedom.names))


def free(names: Sequence[str], origin: Array, prior: dict[str, tuple[float, float]] | None = None) -> Freedom:
    """Coordinates fitted one by one, the others held at `origin` (7,)."""
    index = [coordinates.COORDINATES.index(n) for n in names]
    prior = prior or {}
    held = np.array(origin, float)
    held[index] = 0.0
    return Freedom(
        names=tuple(names),
        origin=held,
        directions=np.eye(COUNT)[:, index],
        prior_mean=np.array([prior.get(n, (0.0, np.inf))[0] for n in names]),
        prior_std=np.array([prior.get(n, (0.0, np.inf))[1] for n in names]),
    )
