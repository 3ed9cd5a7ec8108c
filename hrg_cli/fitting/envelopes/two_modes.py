"""A record in which only the two modes' frequencies and decays can be seen: u(t) = c₁ e^{λ₁t} + c₂
e^{λ₂t} in each channel.

One channel (the other dead or proportional), or two channels that are not an orthogonal pair (a
bell before two microphones), give the split and both decays; axes and the split of the channels'
view mean nothing there. λ by linear prediction, then Gauss–Newton, complex throughout because the
model is analytic in λ.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..least_squares import StepTaken, descend, fit_columns, invert_scaled
from .envelope_runs import EnvelopeRun

Array = np.ndarray
LARGEST_GROWTH = 300.0
"""Most of ln|u| by which an exponential may grow over the run: its square is still a number."""
MOST_STEPS = 40
FLAT = 1e-9
"""Part of χ² by which a whole step lowers it at the optimum."""
CONVERGED = 1e-3
"""Fall of χ² still to come, in units of χ²/dof, that is left."""


@dataclass(frozen=True)
class Modes:
    """λ (k,) complex 1/s against the reference, standard deviation of a real part (k,), amplitudes
    (k, channels), χ²/dof, the misfit over the noise (n, 2·channels), and whether the fit settled.
    """

    exponent: Array
    std: Array
    amplitude: Array
    chi2_per_dof: float
    dof: int
    residual: Array
    converged: bool


def merge_channels(run: EnvelopeRun) -> tuple[Array, Array] | None:
    """The channels of a run made one where they are one signal, and its standard deviation.

    They are where the weaker principal component of the envelopes over σ holds no more than noise,
    or a millionth of the stronger one.

    Parameters
    ----------
    run
        Envelopes (n, 2), σ (n,) and the channels' shares of the noise.

    Returns
    -------
    tuple of ndarray or None
        Envelopes (n, 1) along the direction that carries the run and their σ (n,); None where they
        are two signals.

    Examples
    --------
    A channel of 3 and one of 4 times a signal are one of 5 times:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.two_modes import merge_channels
    >>> t = np.linspace(0.0, 10.0, 201)
    >>> u = np.outer(np.exp(-0.1 * t), [3.0, 4.0])
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-3, 0 * t, None, 5e3, 2, 0.05)
    >>> u, std = merge_channels(run)
    >>> u.shape, round(float(abs(u[0, 0])), 9), round(float(std[0]), 9)
    ((201, 1), 5.0, 0.001)
    """
    weighted = run.envelope / run.std[:, None]
    gram = weighted.conj().T @ weighted
    size, vector = np.linalg.eigh(gram)
    n = len(run)
    one = size[0] < 2 * n * (1 + 6 / np.sqrt(n)) or size[0] < 1e-6 * size[1]
    if not one:
        return None
    # the noise along the direction: a channel that is dead has none, and all of it is the other's
    share = float(np.abs(vector[:, 1]) ** 2 @ np.asarray(run.shares))
    return run.envelope @ vector[:, 1:].conj(), np.sqrt(max(share, 1e-12)) * run.std


def predict(u: Array, time_s: Array, std: Array, count: int) -> Array:
    """First λ of damped exponentials by linear prediction, u(t + count·h) = Σ aᵢ u(t + i·h).

    The lag h is that of a dozen whose exponentials leave least.

    Parameters
    ----------
    u
        Envelopes (n, channels).
    time_s
        (n,).
    std
        Standard deviation (n,) of a real component.
    count
        Exponentials.

    Returns
    -------
    ndarray
        (count,) complex [1/s]: −ν, and the angular frequency above the reference.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.two_modes import predict
    >>> t = np.linspace(0.0, 10.0, 201)
    >>> slow, quick = np.exp((-0.1 - 1j) * t), np.exp((-0.2 + 2j) * t)
    >>> np.sort(predict((slow + quick)[:, None], t, 0 * t + 1e-3, 2).imag).round(3).tolist()
    [-1.0, 2.0]
    """
    step = float(np.median(np.diff(time_s)))
    even = np.arange(time_s[0], time_s[-1], step)
    grid = np.stack(
        [np.interp(even, time_s, x.real) + 1j * np.interp(even, time_s, x.imag) for x in u.T],
        axis=-1,
    )
    weight = 1 / np.interp(even, time_s, std)
    best, best_cost = np.zeros(count, complex), np.inf
    # λ = ln(root)/lag magnifies the noise of a short lag, and a long lag wraps frequencies beyond
    # 1/2lag: the data say which of a dozen is best
    lags = np.unique(np.geomspace(1, max(2, len(even) // (2 * count)), 12).astype(int))
    for lag in lags:
        rows = len(even) - count * lag
        if rows < 4 * count:
            continue
        stack = np.stack(
            [
                (grid[i * lag : i * lag + rows] * weight[count * lag :, None]).ravel()
                for i in range(count + 1)
            ],
            axis=-1,
        )
        solution = fit_columns(stack[:, :-1], stack[:, -1])
        roots = np.roots(np.concatenate([[1.0], -solution[::-1]]))
        if np.any(np.abs(roots) < 1e-12):
            continue
        exponent = np.log(roots) / (lag * step)
        # a root outside the circle by noise alone is a mode that grows: it would outweigh all rows
        exponent = np.minimum(exponent.real, 0.5 / (time_s[-1] - time_s[0])) + 1j * exponent.imag
        cost = _solve(u, time_s, std, exponent)[1]
        if cost < best_cost:
            best, best_cost = exponent, cost
    return best


def _solve(u: Array, time_s: Array, std: Array, exponent: Array) -> tuple[Array, float]:
    """Amplitudes (k, channels) and χ² at given λ."""
    basis = np.exp(np.outer(time_s - time_s[0], exponent)) / std[:, None]
    target = u / std[:, None]
    amplitude = fit_columns(basis, target, 1e-10)
    return amplitude, float(np.sum(np.abs(target - basis @ amplitude) ** 2))


def identify(run: EnvelopeRun, u: Array, count: int = 2) -> Modes:
    """Damped exponentials, common to all channels, by least squares.

    u(t) = Σ c e^{λt}, c of each channel its own.

    Parameters
    ----------
    run
        Times and σ of the rows.
    u
        Envelopes (n, channels) of the run, or a combination of them.
    count
        Exponentials.

    Returns
    -------
    Modes
        The quickest first, with standard deviations widened where χ² per degree of freedom is above
        1.

    Examples
    --------
    Two modes 3 rad/s apart in one channel, with decay rates of 0.2 and 0.1 1/s:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.two_modes import identify
    >>> t = np.linspace(0.0, 10.0, 201)
    >>> slow, quick = np.exp((-0.1 - 1j) * t), np.exp((-0.2 + 2j) * t)
    >>> u = np.stack([slow + quick, 0 * t], axis=1)
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-3, 0 * t, None, 5e3, 2, 0.05)
    >>> found = identify(run, run.envelope[:, :1])
    >>> found.exponent.real.round(6).tolist(), found.exponent.imag.round(6).tolist()
    ([-0.2, -0.1], [2.0, -1.0])
    """
    t, std = run.time_s, run.std
    # real numbers seen less real numbers fitted: a complex λ each, and an amplitude a channel
    dof = max(1, 2 * u.size - 2 * count * (u.shape[1] + 1))
    problem = _Exponentials(u, t, std, dof)
    found = descend(problem, problem.evaluate(predict(u, t, std, count)), MOST_STEPS)
    here = found.point
    covariance = np.zeros((count, count)) if found.step is None else found.step.covariance
    factor = max(1.0, here.cost / dof)
    left = (u - np.exp(np.outer(t - t[0], here.exponent)) @ here.amplitude) / std[:, None]
    order = np.argsort(-here.exponent.imag)
    return Modes(
        here.exponent[order],
        np.sqrt(np.maximum(0.0, np.diag(covariance)) * factor)[order],
        here.amplitude[order],
        here.cost / dof,
        dof,
        np.concatenate([left.real, left.imag], axis=1),
        found.converged,
    )


@dataclass(frozen=True)
class _Point:
    """λ (k,), the amplitudes (k, channels) that fit best with them, and χ²."""

    exponent: Array
    amplitude: Array
    cost: float


@dataclass(frozen=True)
class _Step:
    """Step of λ (k,), the covariance (k, k) of their real parts with the amplitudes free, and the
    fall of χ² that the linear form promises."""

    exponent: Array
    covariance: Array
    predicted: float


@dataclass(frozen=True)
class _Exponentials:
    """Damped exponentials common to all channels of u (n, channels), each channel with amplitudes
    of its own (variable projection: these are solved at every λ)."""

    u: Array
    time_s: Array
    std: Array
    dof: int

    def evaluate(self, exponent: Array) -> _Point:
        """The point at λ; one that would grow beyond all numbers grows by e³⁰⁰."""
        most = LARGEST_GROWTH / max(float(self.time_s[-1] - self.time_s[0]), 1e-300)
        exponent = np.minimum(exponent.real, most) + 1j * exponent.imag
        return _Point(exponent, *_solve(self.u, self.time_s, self.std, exponent))

    def linearise(self, point: _Point) -> _Step:
        """The step with the amplitudes free; the model is analytic in λ, so complex columns do for
        real and imaginary parts alike."""
        count, x = len(point.exponent), self.time_s - self.time_s[0]
        basis = np.exp(np.outer(x, point.exponent)) / self.std[:, None]
        residual = (self.u / self.std[:, None] - basis @ point.amplitude).T.ravel()
        own = np.kron(np.eye(self.u.shape[1]), basis)
        shared = np.concatenate([x[:, None] * basis * one for one in point.amplitude.T])
        design = np.concatenate([own, shared], axis=1)
        inverse = invert_scaled(design)
        whole = inverse @ residual
        covariance = np.real(inverse @ inverse.conj().T)
        return _Step(
            whole[-count:],
            covariance[-count:, -count:],
            float(np.sum(np.abs(design @ whole) ** 2)),
        )

    def move(self, point: _Point, step: _Step, size: float) -> _Point:
        """The point a part of the step further: from a start by linear prediction a whole one may
        overshoot."""
        return self.evaluate(point.exponent + size * step.exponent)

    def is_settled(self, step: _Step, taken: StepTaken) -> bool:
        """Whether χ² has stopped falling; a part of a step may gain little far from the optimum, so
        that beside it the linear form must promise no more either."""
        if taken.size == 1.0:
            return taken.fall < FLAT * taken.before
        return step.predicted < CONVERGED * max(1.0, taken.after / self.dof)


def are_resolved(two: Modes, one: Modes, rounding: float = 0.0) -> bool:
    """Whether the second mode is there.

    It is where χ² falls by far more than chance and the modes are apart by more than their errors;
    what is smaller than the steps of values that noise does not spread is a line of their rounding.

    Parameters
    ----------
    two, one
        Fits of the same envelopes with two exponentials and with one.
    rounding
        Step of values that noise does not spread, in the envelopes' unit; 0: there is none.

    Returns
    -------
    bool
        False where one mode does as well.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.two_modes import are_resolved, identify
    >>> t = np.linspace(0.0, 10.0, 201)
    >>> slow, quick = np.exp((-0.1 - 1j) * t), np.exp((-0.2 + 2j) * t)
    >>> u = np.stack([slow + quick, slow], axis=1)
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-3, 0 * t, None, 5e3, 2, 0.05)
    >>> both = run.envelope[:, :1]
    >>> are_resolved(identify(run, both, 2), identify(run, both, 1))
    True
    """
    if not float(np.abs(two.amplitude).max(axis=1).min()) > rounding:
        return False
    gain = one.chi2_per_dof * one.dof - two.chi2_per_dof * two.dof
    apart = abs(two.exponent[0].imag - two.exponent[1].imag) > 4 * float(np.hypot(*two.std))
    return bool(gain > 50 * max(1.0, two.chi2_per_dof) and apart)
