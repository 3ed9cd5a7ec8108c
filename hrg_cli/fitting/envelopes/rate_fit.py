"""Ω(t) at given nodes: Gauss–Newton on a run's envelopes, the resonator known to its covariance.

The run itself shows some of the resonator (its decay is ν), so the resonator's coordinates are
fitted beside the rate and held by what is known of them: p = p₀ + Sz, SSᵀ their covariance, with
the rows z = 0 ± 1 (Bayes with a normal prior). With S = 0 this is the resonator held. What the run
does not show, K above all, stays where it was and is in the rate's deviations with all of its own.

A frequency that moves turns both channels' phases alike, u e^{jΦ(t)}, and commutes with all else:
Φ, a cubic spline that is 0 at the run's ends (start and mean frequency are the run's own), may be
fitted beside the rate.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...physics.resonator import Mechanics
from ...records import Resonator, read_details_number
from ..least_squares import StepTaken, descend, solve
from . import coordinates, rows
from .coordinates import COUNT, SCALE_FACTOR, SECOND_ORDER
from .envelope_runs import EnvelopeRun
from .likelihood import triangularise
from .rate_estimate import RateEstimate, build_cardinals
from .rate_start import estimate_mean_offset
from .resonator_spread import compute_vector_covariance
from .response import Response, State, make_batch, respond, stack_reals
from .trapezium import integrate

Array = np.ndarray
ITERATIONS = 20
ROUNDING = 1e-9
"""Part of χ² by which a step may raise it: rates turn the phase, whose rounding adds up over a
run."""
ROWS, ROWS_OF_A_NODE = 2000, 12
"""Averaged rows of the run that are fitted, at least, and for each node: a row must not span what
the nodes follow."""
HOPELESS = 1000.0
"""χ² per degree of freedom from which the fit has not found the rate at all (another resonator,
another gyro)."""
AVERAGINGS, SETTLED = 4, 0.1
"""Times the rows are averaged along the rate found at most, and the part of a standard deviation it
may still move."""
OWN = 5
"""Unknowns of the run before the rates: the start envelope's four reals and the phase that the
frequency's error makes over it."""


@dataclass(frozen=True)
class Reference:
    """What is known of the resonator: coordinates p (7,) and S (7, q), whose SSᵀ is their
    covariance."""

    p: Array
    spread: Array
    phase_nodes: int = 0
    """Nodes within the run of a phase that the frequency's course makes; 0: it is constant."""

    @property
    def scale_factor(self) -> float:
        """K."""
        return float(self.p[SCALE_FACTOR])


def make_reference(resonator: Resonator, mechanics: Mechanics) -> Reference:
    """The reference of a resonator; directions in which it is exact are left out.

    Parameters
    ----------
    resonator
        As it was identified, with its covariance.
    mechanics
        Its values.

    Returns
    -------
    Reference
        Coordinates (7,), and what they are uncertain by.

    Examples
    --------
    A damping known to 1e-3, all else exact: one direction, of that length.

    >>> import numpy as np
    >>> from hrg_cli import Resonator
    >>> from hrg_cli.fitting.envelopes.rate_fit import make_reference
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> held = dict(name=np.array(["damping_rate_1_s"]), units=np.array(["s-1"]), value=np.ones(1))
    >>> gyro = Resonator(std=np.array([1e-3]), covariance=np.array([[1e-6]]), **held)
    >>> known = make_reference(gyro, Mechanics(5e3, 1.0, 0.0, 0.0))
    >>> known.p[[0, 5]].tolist(), np.abs(known.spread[:, 0]).round(9).tolist()
    ([1.0, 0.55], [0.001, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    """
    p = coordinates.from_mechanics(mechanics)
    p[SECOND_ORDER] = read_details_number(resonator.details, "second_order", "value", default=1.0)
    size, direction = np.linalg.eigh(compute_vector_covariance(resonator))
    doubted = size > 1e-24 * np.sum(p[:SECOND_ORDER] ** 2)
    spread = np.zeros((COUNT, int(doubted.sum())))
    spread[:SECOND_ORDER] = direction[:, doubted] * np.sqrt(size[doubted])
    return Reference(p, spread)


def fit_rate(
    whole: EnvelopeRun, grid: Array, rate: Array, plain: Array, known: Reference
) -> RateEstimate:
    """The fit of Ω(t) from a rate.

    The rows are averaged along the motion found until that moves the answer no more.

    Parameters
    ----------
    whole
        The run with all its windows; its own table turn does not count.
    grid
        Nodes (k,) [s].
    rate
        First guess on the nodes (k,) [rad/s].
    plain
        −m·(dθ/dt)/K on the nodes, which is kept beside the answer.
    known
        The resonator.

    Returns
    -------
    RateEstimate
        On the nodes.

    Examples
    --------
    A rate that rises from 0.5 to 1.5 rad/s, from a guess of none; the resonator is known exactly:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
    >>> from hrg_cli.fitting.envelopes.rate_fit import Reference, fit_rate
    >>> t, p = np.arange(0.0, 10.0, 0.05), np.array([0.1, 0, 0, 0, 0, 0.3, 0.0])
    >>> turned = 0.5 * t + 0.05 * t**2
    >>> u = np.stack([np.cos(0.3 * turned), -np.sin(0.3 * turned)]) * np.exp((0j - 0.1) * t)
    >>> run = EnvelopeRun("", t, u.T, 0 * t + 1e-4, 0 * t, None, 5e3, 2, 0.05)
    >>> grid = np.linspace(0.0, 9.95, 4)
    >>> found = fit_rate(run, grid, 0 * grid, 0 * grid, Reference(p, np.zeros((7, 0))))
    >>> bool(np.allclose(found.rate_rad_s, 0.5 + 0.1 * grid, atol=1e-6))
    True
    """
    result, moved, phase = None, np.inf, np.zeros(len(whole))
    measured = whole.envelope
    for _ in range(AVERAGINGS):
        whole = replace(whole, envelope=measured * np.exp(-1j * phase)[:, None])
        # rows are averaged along the motion that the rate of the last round makes
        turn = integrate(build_cardinals(whole.time_s, grid).T @ rate, whole.time_s)
        run = replace(whole, turn_rad=turn)
        offset = estimate_mean_offset(run, known.p)
        count = min(
            rows.count_rows(known.p, [run], max(ROWS, ROWS_OF_A_NODE * len(grid))), rows.MOST_ROWS
        )
        start = respond(
            make_batch([run.select_rows(slice(None, None, max(1, len(run) - 1)))]),
            State(known.p, run.envelope[:1], np.array([[offset * run.duration_s]])),
        )
        run = rows.average_along([run], start, count)[0]
        result = _descend(_Problem.from_run(run, grid, known), run, rate, offset, plain)
        moved = float(
            np.max(np.abs(result.rate_rad_s - rate) / np.maximum(result.rate_rad_s_std, 1e-300))
        )
        rate = result.rate_rad_s
        phase = phase + result.phase_rad @ _build_phase(whole.time_s, known.phase_nodes)
        if moved < SETTLED or len(run) == len(whole) or result.chi2_per_dof > HOPELESS:
            break
    assert result is not None
    return replace(
        result,
        truncation=0.0 if len(run) == len(whole) else moved,
        frequency_moves_hz=float(np.ptp(np.gradient(phase, whole.time_s))) / (2 * np.pi),
    )


def _build_phase(time_s: Array, nodes: int) -> Array:
    """Splines (nodes, n) that are 1 at one of even nodes within a run, and 0 at its ends."""
    even = np.linspace(time_s[0], time_s[-1], nodes + 2)
    return build_cardinals(time_s, even)[1:-1] if nodes else np.zeros((0, len(time_s)))


@dataclass(frozen=True)
class _Point:
    """The unknowns x, what the model says there, χ² of the rows and of the resonator's departure
    from what is known of it."""

    x: Array
    response: Response
    cost: float


@dataclass(frozen=True)
class _Step:
    """Gauss–Newton's change of x and the covariance of x at unit noise."""

    change: Array
    covariance: Array


@dataclass(frozen=True)
class _Problem:
    """Rows of one run, and the nodes' weights at the begin, middle and end of its steps, (k, n−1),
    and integrated to its rows, (k, n); those of the phase's nodes at its rows, (f, n).

    Unknowns x: the run's own five, the rates at the nodes, the phases at theirs, z.
    """

    run: EnvelopeRun
    grid: Array
    known: Reference
    begin: Array
    middle: Array
    end: Array
    turning: Array
    phase: Array

    @classmethod
    def from_run(cls, run: EnvelopeRun, grid: Array, known: Reference) -> _Problem:
        """The problem of a run's averaged rows."""
        step = np.diff(run.time_s)
        begin, end = build_cardinals(run.time_s[:-1], grid), build_cardinals(run.time_s[1:], grid)
        middle = build_cardinals(run.time_s[:-1] + step / 2, grid)
        turning = _turning(run.time_s, begin, middle, end)
        phase = _build_phase(run.time_s, known.phase_nodes)
        return cls(run, grid, known, begin, middle, end, turning, phase)

    @property
    def rates(self) -> slice:
        """Places of the rates in x."""
        return slice(OWN, OWN + len(self.grid))

    @property
    def phases(self) -> slice:
        """Places of the phases in x."""
        return slice(self.rates.stop, self.rates.stop + len(self.phase))

    def evaluate(self, x: Array) -> _Point:
        """The model at the unknowns."""
        turned_back = np.exp(-1j * (x[self.phases] @ self.phase))[:, None]
        envelope, turn = self.run.envelope * turned_back, x[self.rates] @ self.turning
        data = make_batch([replace(self.run, envelope=envelope, turn_rad=turn)])
        z = x[self.phases.stop :]
        p = self.known.p + self.known.spread @ z
        start = np.array([[x[0] + 1j * x[1], x[2] + 1j * x[3]]])
        response = respond(data, State(p, start, x[4:OWN][None]))
        return _Point(x, response, response.chi2 + float(np.sum(z**2)))

    def linearise(self, point: _Point) -> _Step | None:
        """The step; None where the motion has no end."""
        x, response = point.x, point.response
        factor = response.state.p[SCALE_FACTOR]
        # Rates times K: a change of K is one of all rates alike, with the same rounding.
        turned = response.find_turning_sensitivity(
            *(h[:, None] for h in (self.begin, self.middle, self.end))
        )
        shared = response.find_coordinate_sensitivities().copy()
        shared[SCALE_FACTOR] = np.tensordot(x[self.rates], turned, 1)
        of_resonator = np.tensordot(self.known.spread.T, shared, 1)
        # u e^{−jΦ} less the model: the phase moves what is measured, the other way
        of_phase = 1j * self.phase[:, None, :, None] * response.batch.envelope
        columns = np.concatenate(
            [response.find_run_sensitivities(), factor * turned, of_phase, of_resonator]
        )
        design = stack_reals(response.batch.whiten(columns)[:, 0])
        residual = response.compute_residual()[0].ravel()
        if not (np.isfinite(design).all() and np.isfinite(residual).all()):
            return None
        z = x[self.phases.stop :]
        prior = np.eye(len(x))[self.phases.stop :]
        return _Step(
            *_solve_with_covariance(
                np.concatenate([design, prior]), np.concatenate([residual.real, residual.imag, -z])
            )
        )

    def move(self, point: _Point, step: _Step, size: float) -> _Point:
        """The point a part of the step further."""
        return self.evaluate(point.x + size * step.change)

    def is_settled(self, step: _Step, taken: StepTaken) -> bool:
        """Whether the rates move by a hundredth of σ, or, where no part of the step lowers χ², by
        less than the rows' averaging may move them.

        σ decides: χ² says nothing of a rate at a node that no row sees, which may move for ever.
        """
        std = np.sqrt(np.diag(step.covariance)[self.rates])
        moved = np.abs(step.change[self.rates])
        if taken.size == 0.0:
            return bool(np.all(moved < SETTLED * std))
        noise = np.sqrt(max(1.0, taken.after / (4 * len(self.run))))
        return bool(np.all(moved < 0.01 * std * noise))


def _descend(
    problem: _Problem, run: EnvelopeRun, rate: Array, offset: float, plain: Array
) -> RateEstimate:
    """The rate at the nodes by Gauss–Newton from `rate`; offset: of the frequency, rad/s."""
    first, span = run.envelope[0], run.time_s[-1] - run.time_s[0]
    own = [first[0].real, first[0].imag, first[1].real, first[1].imag, offset * span]
    free = len(problem.phase)
    x = np.concatenate([own, rate, np.zeros(free + problem.known.spread.shape[1])])
    rates, dof = problem.rates, max(1, 4 * len(run) - len(rate) - free - OWN)
    with np.errstate(over="ignore", invalid="ignore"):
        found = descend(problem, problem.evaluate(x), ITERATIONS, ROUNDING)
    covariance = np.zeros((len(rate), len(rate)))
    if found.step is not None:
        covariance = found.step.covariance[rates, rates]
    chi2, left = found.point.cost, found.point.response.compute_residual()[0]
    return RateEstimate(
        problem.grid,
        found.point.x[rates],
        covariance * max(1.0, chi2 / dof),
        plain,
        chi2 / dof,
        dof,
        converged=found.converged,
        residual=np.concatenate([left.real, left.imag], axis=1),
        phase_rad=found.point.x[problem.phases],
    )


def _solve_with_covariance(design: Array, target: Array) -> tuple[Array, Array]:
    """Least squares (k,) and its covariance (k, k) at unit noise.

    The rows are many and the unknowns few: both come from the small triangle R of [design, target],
    whose last column holds Qᵀ·target.
    """
    R = triangularise(np.column_stack([design, target]))
    return solve(R[:-1, :-1], R[:-1, -1], 1e-12)


def _turning(time_s: Array, begin: Array, middle: Array, end: Array) -> Array:
    """∫ of each node's weight (nodes, n) from the run's first row, by Simpson's rule, which is
    exact for the cubic between two rows."""
    steps = np.cumsum((begin + 4 * middle + end) * np.diff(time_s) / 6, axis=1)
    return np.concatenate([np.zeros((len(begin), 1)), steps], axis=1)
