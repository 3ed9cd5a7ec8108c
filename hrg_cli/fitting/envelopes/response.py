"""The envelopes that a state of the slow model gives in all runs at once, and their sensitivities.

A run's model is u(t) = e^{jψ(t)} Φ(t) u₀ with Φ' = L(p, Ω(t)) Φ: start state u₀ (4 reals) and the
phase polynomial ψ (frequency offset, then drift of the frequency) are the run's own; p are the
coordinates of `coordinates.py`, shared. Steps are exponentials of the mean generator (closed 2 × 2
form), runs of a steady rate a single one; a small term g(t) added to u' changes the model by Φ(t) ∫
Φ⁻¹ g dt, which gives the Jacobian, and a changed rate's sensitivity, without a second integration.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ..noise import channel_noise
from . import coordinates, matrices
from .coordinates import COUNT, SCALE_FACTOR, SECOND_ORDER
from .envelope_runs import EnvelopeRun
from .matrices import Matrix, Vector, apply, multiply

Array = np.ndarray
STEADY_RAD = 1e-9
"""Table angle by which a run may depart from a constant rate and still count as steady."""


@dataclass(frozen=True)
class Batch:
    """Runs side by side, padded to the longest: times from the run's first row, table turn,
    envelopes, 1/σ (0 where padded), (R, n); the channels' noise of every run (R, 2, 2), None where
    both have the same in all."""

    runs: tuple[EnvelopeRun, ...]
    time_s: Array
    turn_rad: Array
    envelope: Array
    weight: Array
    whitening: Array | None = None

    def whiten(self, change: Array) -> Array:
        """Changes of the envelopes (..., R, n, 2) over their noise: of unit variance in either
        channel, and none in common."""
        return channel_noise.whiten(self.whitening, change) * self.weight[..., None]

    @cached_property
    def step_s(self) -> Array:
        """Length of each step, (R, n−1), 0 where padded."""
        return np.diff(self.time_s, axis=1)

    @cached_property
    def step_rate(self) -> Array:
        """Mean rate of each step, rad/s, (R, n−1)."""
        dt = self.step_s
        return np.divide(np.diff(self.turn_rad, axis=1), dt, out=np.zeros_like(dt), where=dt > 0)

    @cached_property
    def steady_rate(self) -> Array | None:
        """Rate of each run, (R,) rad/s, where every run's rate is constant; else None."""
        rate = self.turn_rad[:, -1] / self.span_s
        return (
            rate
            if np.all(np.abs(self.turn_rad - rate[:, None] * self.time_s) < STEADY_RAD)
            else None
        )

    @cached_property
    def step_rate_slope(self) -> Array:
        """Angular acceleration of each step, rad/s², from the neighbouring steps' mean rates, (R,
        n−1)."""
        middle = (self.time_s[:, 1:] + self.time_s[:, :-1]) / 2
        rate, dt = self.step_rate, np.diff(middle, axis=1)
        slope = np.divide(
            np.diff(rate, axis=1),
            dt,
            out=np.zeros_like(dt),
            where=(dt > 0) & (self.step_s[:, 1:] > 0),
        )
        if slope.shape[1] == 0:
            return np.zeros_like(rate)
        return np.concatenate(
            [slope[:, :1], (slope[:, 1:] + slope[:, :-1]) / 2, slope[:, -1:]], axis=1
        )

    @property
    def span_s(self) -> Array:
        """Duration of each run, (R,)."""
        return self.time_s[:, -1]


def make_batch(runs: Sequence[EnvelopeRun]) -> Batch:
    """Runs of any lengths as one batch, the shorter ones padded by their last row with no weight.

    Parameters
    ----------
    runs
        At least one.

    Returns
    -------
    Batch
        Times and table turns counted from each run's first row.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.response import make_batch
    >>> t = np.arange(10.0, 13.0)
    >>> run = EnvelopeRun("", t, np.ones((3, 2)), 0 * t + 0.1, 0 * t, None, 5e3, 2, 1.0)
    >>> data = make_batch([run, run.select_rows(slice(0, 2))])
    >>> data.time_s.tolist(), data.weight.tolist()
    ([[0.0, 1.0, 2.0], [0.0, 1.0, 1.0]], [[10.0, 10.0, 10.0], [10.0, 10.0, 0.0]])
    """
    longest = max(len(r) for r in runs)

    def pad(values: Array) -> Array:
        return np.concatenate([values, np.repeat(values[-1:], longest - len(values), axis=0)])

    return Batch(
        runs=tuple(runs),
        time_s=np.stack([pad(r.time_s) - r.time_s[0] for r in runs]),
        turn_rad=np.stack([pad(r.turn_rad) - r.turn_rad[0] for r in runs]),
        envelope=np.stack([pad(r.envelope) for r in runs]),
        weight=np.stack([np.concatenate([1 / r.std, np.zeros(longest - len(r))]) for r in runs]),
        whitening=channel_noise.stack_matrices([r.whitening for r in runs]),
    )


@dataclass(frozen=True)
class State:
    """Where the fit stands: shared coordinates p (7,), start states (R, 2) complex, phase
    coefficients (R, k) of (t/T)¹…(t/T)ᵏ, rad."""

    p: Array
    start: Array
    phase: Array

    def compute_offsets_rad_s(self, span_s: Array) -> Array:
        """Mean frequency of each run above its reference, (R,) rad/s."""
        return self.phase.sum(axis=1) / span_s


@dataclass(frozen=True)
class Response:
    """The model at a state: envelopes (R, n, 2) and what its sensitivities need."""

    batch: Batch
    state: State
    model: Array
    turn: Array  # e^{jψ + mean growth}, (R, n)
    phi: Matrix  # traceless propagator from the first row, (R, n)
    middle: Matrix  # the same to the middles of the steps, (R, n-1)
    flow: Vector  # phi·u₀, (R, n)
    second: Matrix  # ∂L/∂p₆ a step, (R, n-1) or the same for all, (R, 1)

    @cached_property
    def _pulled(
        self,
    ) -> tuple[tuple[Vector, Vector, Vector], tuple[Vector, Vector, Vector], Vector]:
        """Φ⁻¹ E Φ u₀ of E = R_c, R_s, J at the rows (R, n) and between them (R, n − 1), and Φ u₀
        there."""
        between = apply(self.middle, (self.state.start[:, :1], self.state.start[:, 1:]))
        return (
            matrices.reflect_and_pull(self.phi, self.flow),
            matrices.reflect_and_pull(self.middle, between),
            between,
        )

    def _carried(self, left: Vector, middle: Vector, right: Vector) -> Array:
        """Φ(t) ∫₀ᵗ of what stands at the steps' ends and middles (..., R, n − 1): change of the
        envelopes (..., R, n, 2).

        Simpson's rule a step: the error is of fourth order in |L|·step.
        """
        sixth = self.batch.step_s / 6
        path = []
        for x, y, z in zip(left, middle, right, strict=True):
            total = np.zeros((*y.shape[:-1], y.shape[-1] + 1), complex)
            np.cumsum((x + 4 * y + z) * sixth, axis=-1, out=total[..., 1:])
            path.append(total * self.turn)
        return np.stack(apply(self.phi, (path[0], path[1])), axis=-1)

    def find_turning_sensitivity(self, begin: Array, middle: Array, end: Array) -> Array:
        """Change of the envelopes (k, R, n, 2) by a rate times K that grows by (k, R, n − 1) at the
        steps' ends and middles."""
        at, between, _ = self._pulled
        return self._carried(
            (begin * at[2][0][:, :-1], begin * at[2][1][:, :-1]),
            (middle * between[2][0], middle * between[2][1]),
            (end * at[2][0][:, 1:], end * at[2][1][:, 1:]),
        )

    @cached_property
    def _coordinates(self) -> Array:
        at, between, flow = self._pulled
        out = np.empty((COUNT, *self.model.shape), complex)
        out[0] = -self.batch.time_s[..., None] * self.model
        for row, left, mid in zip((1, 2, 5), at, between, strict=True):
            rate = self.batch.step_rate if row == 5 else -1.0
            out[row] = self._carried(
                (rate * left[0][:, :-1], rate * left[1][:, :-1]),
                (rate * mid[0], rate * mid[1]),
                (rate * left[0][:, 1:], rate * left[1][:, 1:]),
            )
        np.multiply(out[1:3], -1j, out=out[3:5])  # a frequency split is −j times a damping split
        ends = []
        for part in (slice(None, -1), slice(1, None)):
            back, (x, y) = (
                matrices.invert_unimodular(matrices.take_columns(self.phi, part)),
                self.flow,
            )
            ends.append(apply(back, apply(self.second, (x[:, part], y[:, part]))))
        out[6] = self._carried(
            ends[0],
            apply(matrices.invert_unimodular(self.middle), apply(self.second, flow)),
            ends[1],
        )
        return out

    def find_coordinate_sensitivities(self) -> Array:
        """∂model/∂p (7, R, n, 2); to first order in |L|/ω, which is enough to converge.

        R_c, R_s, ΩJ and the second order are carried; ν needs no integral, and a frequency split is
        −j times a damping split.
        """
        return self._coordinates

    def find_run_sensitivities(self, further_orders: int = 0) -> Array:
        """∂model/∂(Re u₀C, Im u₀C, Re u₀S, Im u₀S, phase coefficients and `further_orders` of
        them), (4 + k, R, n, 2)."""
        orders = self.state.phase.shape[1] + further_orders
        out = np.empty((4 + orders, *self.model.shape), complex)
        for column, rows in ((0, (0, 2)), (2, (1, 3))):
            for part, row in enumerate(rows):
                out[column, ..., part] = self.phi[row] * self.turn
        np.multiply(out[[0, 2]], 1j, out=out[1:4:2])
        x = self.batch.time_s / self.batch.span_s[:, None]
        for k in range(1, orders + 1):
            out[3 + k] = 1j * (x**k)[..., None] * self.model
        return out

    def compute_residual(self) -> Array:
        """Measured minus model over σ, (R, n, 2) complex; 0 where padded."""
        return self.batch.whiten(self.batch.envelope - self.model)

    @cached_property
    def chi2(self) -> float:
        """Σ|residual|²."""
        flat = self.compute_residual().ravel()
        return float(np.vdot(flat, flat).real)


def respond(data: Batch, state: State) -> Response:
    """Envelopes of all runs at a state.

    u(t) = e^{jψ(t)} Φ(t) u₀ with Φ' = L(p, Ω(t))Φ. Where the rate changes within a step, Magnus'
    series is taken to its second term, h³/12 [L', L].

    Parameters
    ----------
    data
        The runs: their times and table turns count, not their envelopes.
    state
        Shared coordinates, start states and phases.

    Returns
    -------
    Response
        The model (R, n, 2) and what its sensitivities are made of.

    Examples
    --------
    A decay by 0.1 1/s while a table of 1 rad/s turns the wave back by K = 0.5 of its own turn:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.response import State, make_batch, respond
    >>> t = np.linspace(0.0, 10.0, 101)
    >>> run = EnvelopeRun("", t, np.ones((101, 2)), 0 * t + 1e-4, t, None, 5e3, 2, 0.1)
    >>> state = State(np.array([0.1, 0, 0, 0, 0, 0.5, 0]), np.array([[1, 0j]]), np.zeros((1, 1)))
    >>> u = respond(make_batch([run]), state).model[0]
    >>> np.allclose(u[:, 0], np.exp(-0.1 * t) * np.cos(0.5 * t))
    True
    >>> np.allclose(u[:, 1], -np.exp(-0.1 * t) * np.sin(0.5 * t))
    True
    """
    omega = 2 * np.pi * np.array(
        [r.reference_frequency_hz for r in data.runs]
    ) + state.compute_offsets_rad_s(data.span_s)
    steady = data.steady_rate
    rate = data.step_rate if steady is None else steady[:, None]
    plain = coordinates.compute_entries(np.append(state.p[:6], 0.0), rate, omega[:, None])
    full = coordinates.compute_entries(np.append(state.p[:6], 1.0), rate, omega[:, None])
    second = _apply_to_entries(lambda a, b: a - b, full, plain)
    mean, L = matrices.split_trace(
        _apply_to_entries(lambda a, b: a + state.p[SECOND_ORDER] * b, plain, second)
    )
    if steady is not None:
        phi, growth = matrices.exponentiate(L, data.time_s), mean * data.time_s
        centre = (data.time_s[:, 1:] + data.time_s[:, :-1]) / 2
        middle = matrices.exponentiate(L, centre)
    else:
        # The rate changes within a step: the second term of Magnus' series is h³/12 [L', L], here
        # c·[J, L] added to L, with L' = K·dΩ/dt·J the generator's slope over the step h.
        c = state.p[SCALE_FACTOR] * data.step_s**2 / 12 * data.step_rate_slope
        L = (
            L[0] + c * (L[1] + L[2]),
            L[1] - 2 * c * L[0],
            L[2] - 2 * c * L[0],
            L[3] - c * (L[1] + L[2]),
        )
        half = matrices.exponentiate(L, data.step_s / 2)
        phi = matrices.chain(multiply(half, half))
        middle = multiply(half, matrices.take_columns(phi, slice(None, -1)))
        growth = np.concatenate(
            [np.zeros((len(data.runs), 1)), np.cumsum(mean * data.step_s, axis=1)], axis=1
        )
    x = data.time_s / data.span_s[:, None]
    turn = np.exp(
        growth
        + 1j * sum(state.phase[:, k - 1 : k] * x**k for k in range(1, state.phase.shape[1] + 1))
    )
    flow = apply(phi, (state.start[:, :1], state.start[:, 1:]))
    model = np.stack([flow[0] * turn, flow[1] * turn], axis=-1)
    return Response(data, state, model, turn, phi, middle, flow, second)


def _apply_to_entries(rule: Callable[[Array, Array], Array], a: Matrix, b: Matrix) -> Matrix:
    """A rule entry by entry."""
    return rule(a[0], b[0]), rule(a[1], b[1]), rule(a[2], b[2]), rule(a[3], b[3])


def stack_reals(columns: Array) -> Array:
    """Complex columns as a real design matrix.

    Parameters
    ----------
    columns
        (k, n, 2) over their noise.

    Returns
    -------
    ndarray
        (4n, k): all real parts first, row by row, both channels of a row side by side.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.response import stack_reals
    >>> stack_reals(np.array([[[1 + 5j, 2 + 6j], [3 + 7j, 4 + 8j]]]))[:, 0].tolist()
    [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0]
    """
    flat = columns.reshape(len(columns), -1)
    return np.concatenate([flat.real, flat.imag], axis=1).T
