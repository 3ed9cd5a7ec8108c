"""The rate from a reference model (seed A's last task): Ω(t) fitted to a run's envelopes with the
identified resonator held.

Ω(t) is a cubic spline through its values at even nodes. The envelopes are fitted as a whole
(likelihood.py), so the drift of the wave is taken out by the model itself, not by a table; the run
keeps its own start state and frequency. The start is linear in Ω and knows no axes, so circular
orbits do no harm: in the Stokes form (PHYSICS §0), with the known resonator's part A, S₁' = A₁ +
2KΩS₂, S₂' = A₂ − 2KΩS₁, both integrated from the run's first row. Beside it stands −m·(dθ/dt)/K,
which has the drift in it.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ...errors import HrgError
from ...physics import ellipse
from ...physics.resonator import PARAMETERS, Mechanics
from ...records import Resonator, Wave, details_number
from ..checks import goodness
from . import coordinates, rows
from .coordinates import SCALE_FACTOR, SECOND_ORDER
from .envelope_runs import EnvelopeRun, from_wave
from .likelihood import triangle
from .response import Response, State, batch, real, respond
from .scaled_columns import measure_columns
from .trapezium import integrate

Array = np.ndarray
ITERATIONS = 20
ROWS_A_NODE, ROWS_A_FINER_NODE = 4, 2
"""Windows for each node of an answer at least, and of the fit with twice as many nodes that checks
it: so every answer can be checked."""
START_ROWS = 8000
"""Rows from which the start is taken at most."""
FEWEST_NODES, USUAL_NODES, MOST_NODES = 4, 20, 640
ROWS, ROWS_OF_A_NODE = 2000, 12
"""Averaged rows of the run that are fitted, at least, and for each node: a row must not span what
the nodes follow."""
HOPELESS = 1000.0
"""χ² per degree of freedom from which the fit has not found the rate at all (another resonator,
another gyro)."""
TOO_COARSE = 5.0
"""Standard deviations of a fall of χ² with twice as many nodes from which the rate changes faster
than the nodes follow."""
NO_BETTER = 0.9
"""Part of the χ² that twice as many nodes must leave at most for a poor fit to be worth still more
of them."""
AVERAGINGS, SETTLED = 4, 0.1
"""Times the rows are averaged along the rate found at most, and the part of a standard deviation it
may still move."""


@dataclass(frozen=True)
class RateEstimate:
    """Nodes (k,), rate [rad/s] with covariance (k, k), the plain estimate −m·dθ/dt/K on the nodes,
    and the fit's χ² per degree of freedom."""

    time_s: Array
    rate_rad_s: Array
    covariance: Array
    plain_rate_rad_s: Array
    chi2_per_dof: float
    dof: int
    finer_z: float = 0.0
    """By how many of its standard deviations χ² falls more than by chance with twice as many
    nodes."""
    converged: bool = True
    truncation: float = 0.0
    """What averaging along the better motion still moved, in standard deviations of a node."""
    residual: Array = field(default_factory=lambda: np.zeros((0, 4)))
    """What is left of the rows over their noise, (n, 4)."""
    most_nodes: int = MOST_NODES
    """Nodes that the run's windows carry at most."""
    window_s: float = 0.0
    """Length of a window."""

    @property
    def adequate(self) -> bool:
        """Whether χ² agrees with the noise the windows state."""
        return goodness(self.chi2_per_dof * self.dof, self.dof).passed

    @property
    def rate_rad_s_std(self) -> Array:
        """Standard deviations on the nodes."""
        return np.sqrt(np.diag(self.covariance))


def node_count(name: str, windows: int, window_s: float, nodes: int | None) -> tuple[int, int]:
    """(Nodes asked for, or to begin with; the most that so many windows carry); HrgError: more are
    asked for than that."""
    most = windows // ROWS_A_NODE
    usual = int(np.clip(most // 2, FEWEST_NODES, USUAL_NODES))
    count = nodes if nodes is not None else usual
    if count > most:
        shorter = window_s * windows / (ROWS_A_NODE * count)
        raise HrgError(
            f"{name}: {windows} good windows, at least {ROWS_A_NODE * count} were expected for"
            f" {count} nodes; ask for fewer, or demodulate with windows of at most {shorter:.2g} s"
        )
    return count, most


def rate_from_model(wave: Wave, resonator: Resonator, nodes: int | None = None) -> RateEstimate:
    """Ω(t) of a free run on `nodes` even times, given the resonator; its standard deviations are
    those of the noise alone.

    nodes None: 20, fewer for a short run, and twice as many again and again until χ² agrees with
    the stated noise and asks for no more, as far as the windows carry them. HrgError: the resonator
    has no scale factor, or too few windows for the nodes.
    """
    values = {name: value for name, (value, _, _) in resonator.parameters().items()}
    if "scale_factor" not in values:
        raise HrgError(
            f"{resonator.gyro_id or 'the resonator'}: has no scale_factor, which a rate needs;"
            " identify it with rotated runs"
        )
    run = from_wave(wave, 0.0)
    count, most = node_count(wave.run_id or "the run", len(run), run.window_s, nodes)
    checked = min(len(run) // ROWS_A_FINER_NODE, MOST_NODES)
    mechanics = Mechanics(
        **{k: values.get(k, 0.0) for k, _ in PARAMETERS}, mode_number=run.mode_number
    )
    p = coordinates.from_mechanics(mechanics)
    p[SECOND_ORDER] = details_number(resonator.details, "second_order", "value", default=1.0)

    def complete(found: RateEstimate) -> RateEstimate:
        return replace(found, most_nodes=min(most, MOST_NODES), window_s=run.window_s)

    if nodes is not None:
        found = _best(run, count, p)
        finer_count = 2 * count - 1
        return complete(
            found
            if finer_count > checked
            else _asked(found, _fit_rate(run, *_again(run, found, finer_count, p[SCALE_FACTOR]), p))
        )
    found = _first(run, count, p)
    while 2 * len(found.time_s) - 1 <= checked:
        finer_count = 2 * len(found.time_s) - 1
        # what too few nodes found is no start for more
        finer = (
            _fit_rate(run, *_again(run, found, finer_count, p[SCALE_FACTOR]), p)
            if found.adequate
            else _first(run, finer_count, p)
        )
        found = _asked(found, finer)
        enough = found.finer_z < TOO_COARSE and (
            found.adequate or finer.chi2_per_dof > NO_BETTER * found.chi2_per_dof
        )
        if enough or finer_count > most:
            break
        found = finer
    return complete(
        found
        if found.adequate
        else min(found, _best(run, len(found.time_s), p), key=lambda e: e.chi2_per_dof)
    )


def _asked(found: RateEstimate, finer: RateEstimate) -> RateEstimate:
    """The estimate, with what twice as many nodes gain."""
    fall = (found.chi2_per_dof * found.dof - finer.chi2_per_dof * finer.dof) / max(
        1.0, finer.chi2_per_dof
    )
    extra = max(1, len(finer.time_s) - len(found.time_s))
    return replace(found, finer_z=float((fall - extra) / np.sqrt(2 * extra)))


def _first(run: EnvelopeRun, nodes: int, p: Array) -> RateEstimate:
    """The fit from the Stokes start."""
    grid = np.linspace(run.time_s[0], run.time_s[-1], nodes)
    return _fit_rate(run, grid, stokes_start(run, grid, p), _plain(run, grid, p[SCALE_FACTOR]), p)


def _best(run: EnvelopeRun, nodes: int, p: Array) -> RateEstimate:
    """The best fit from the Stokes start, and where that is poor, from a constant and from the
    plain rate."""
    grid = np.linspace(run.time_s[0], run.time_s[-1], nodes)
    plain = _plain(run, grid, p[SCALE_FACTOR])
    best: RateEstimate | None = None
    for rate in (stokes_start(run, grid, p), np.full(nodes, plain.mean()), plain):
        found = _fit_rate(run, grid, rate, plain, p)
        if best is None or found.chi2_per_dof < best.chi2_per_dof:
            best = found
        if best.adequate:
            break
    assert best is not None
    return best


def _again(
    run: EnvelopeRun, found: RateEstimate, nodes: int, scale_factor: float
) -> tuple[Array, Array, Array]:
    """A finer grid, the rate found on it, and the plain rate on it."""
    grid = np.linspace(run.time_s[0], run.time_s[-1], nodes)
    return grid, found.rate_rad_s @ _cardinal(grid, found.time_s), _plain(run, grid, scale_factor)


def _plain(run: EnvelopeRun, grid: Array, scale_factor: float) -> Array:
    """−m·(dθ/dt)/K on the grid, the angle smoothed over a quarter of a node's distance."""
    angle, _ = ellipse.unwrap(*ellipse.wave(run.envelope, 1)[2:], 1)
    turned = -_smooth(angle, max(1, len(run) // (4 * len(grid)))) / scale_factor
    return np.asarray(np.gradient(np.interp(grid, run.time_s, turned), grid))


def stokes_start(run: EnvelopeRun, grid: Array, p: Array) -> Array:
    """Rate on the nodes by linear least squares on S₁ and S₂ of the run, the rest of the resonator
    known; valid through circles."""
    run = run.rows(slice(None, None, -(-len(run) // START_ROWS)))
    t = run.time_s
    s0, s1, s2, s3 = np.moveaxis(ellipse.stokes(run.envelope), -1, 0)
    nu, dc, ds, wc, ws, factor = p[:6]
    shape = 2 * factor * _cardinal(t, grid)
    std = 2 * run.std * np.sqrt(np.maximum(s0, 4 * run.std**2))
    design, target = [], []
    for value, known, turning in (
        (s1, -2 * nu * s1 - 2 * dc * s0 + 2 * ws * s3, s2),
        (s2, -2 * nu * s2 - 2 * ds * s0 - 2 * wc * s3, -s1),
    ):
        rows = (
            np.column_stack([integrate(shape * turning, t).T, value - integrate(known, t)])
            / std[:, None]
        )
        level = (1 / std) / np.linalg.norm(1 / std)
        rows -= np.outer(level, level @ rows)  # the first value is free
        design.append(rows[:, :-1])
        target.append(rows[:, -1])
    return np.asarray(
        np.linalg.lstsq(np.concatenate(design), np.concatenate(target), rcond=1e-6)[0]
    )


def _smooth(values: Array, width: int) -> Array:
    """Running mean of odd width, ends by reflection about the end value."""
    width |= 1
    half = width // 2
    padded = np.concatenate(
        [2 * values[0] - values[half:0:-1], values, 2 * values[-1] - values[-2 : -half - 2 : -1]]
    )
    return np.convolve(padded, np.ones(width) / width, "valid")


def _cardinal(time_s: Array, grid: Array) -> Array:
    """Cubic splines at times that are 1 at one node and 0 at the others, (k, n)."""
    from scipy.interpolate import CubicSpline

    return np.asarray(CubicSpline(grid, np.eye(len(grid)))(time_s)).T


def _fit_rate(whole: EnvelopeRun, grid: Array, rate: Array, plain: Array, p: Array) -> RateEstimate:
    """Gauss–Newton with step halving from a rate; the rows are averaged along the motion found
    until that moves it no more."""
    result, moved = None, np.inf
    for _ in range(AVERAGINGS):
        turn = integrate(_cardinal(whole.time_s, grid).T @ rate, whole.time_s)
        run = replace(whole, turn_rad=turn)
        offset = _offset(run, p)
        count = min(
            rows.rows_needed(p, [run], max(ROWS, ROWS_OF_A_NODE * len(grid))), rows.MOST_ROWS
        )
        start = respond(
            batch([run.rows(slice(None, None, max(1, len(run) - 1)))]),
            State(p, run.envelope[:1], np.array([[offset * run.duration_s]])),
        )
        run = rows.average_along([run], start, count)[0]
        result = _from(run, grid, rate, plain, p, offset)
        moved = float(
            np.max(np.abs(result.rate_rad_s - rate) / np.maximum(result.rate_rad_s_std, 1e-300))
        )
        rate = result.rate_rad_s
        if moved < SETTLED or len(run) == len(whole) or result.chi2_per_dof > HOPELESS:
            break
    assert result is not None
    return replace(result, truncation=0.0 if len(run) == len(whole) else moved)


def _offset(run: EnvelopeRun, p: Array) -> float:
    """Mean angular frequency above the reference of a run whose turning is known, rad/s: what its
    phase runs ahead of the model."""
    run = run.rows(slice(None, None, -(-len(run) // START_ROWS)))
    data = batch([run])
    model = respond(data, State(p, run.envelope[:1], np.zeros((1, 1)))).model[0]
    ahead = np.sum(run.envelope * model.conj(), axis=1)
    step = np.diff(run.time_s)
    near = step < 1.5 * np.median(step)
    return float(np.angle(np.sum((ahead[1:] * ahead[:-1].conj())[near])) / np.mean(step[near]))


def _solve_with_covariance(design: Array, target: Array) -> tuple[Array, Array]:
    """Least squares (k,) and its covariance (k, k) at unit noise.

    The rows are many and the unknowns few: both come from the small triangle R of [design, target],
    whose last column holds Qᵀ·target.
    """
    length = measure_columns(design)
    R = triangle(np.column_stack([design / length, target]))
    inverse = np.linalg.pinv(R[:-1, :-1], rcond=1e-12)
    return inverse @ R[:-1, -1] / length, inverse @ inverse.T / np.outer(length, length)


def _turning(time_s: Array, begin: Array, middle: Array, end: Array) -> Array:
    """∫ of each node's weight (nodes, n) from the run's first row, by Simpson's rule, which is exact
    for the cubic between two rows."""
    steps = np.cumsum((begin + 4 * middle + end) * np.diff(time_s) / 6, axis=1)
    return np.concatenate([np.zeros((len(begin), 1)), steps], axis=1)


def _from(
    run: EnvelopeRun, grid: Array, rate: Array, plain: Array, p: Array, offset: float
) -> RateEstimate:
    """The rate at the nodes by Gauss–Newton with step halving from `rate`; p: the resonator, held;
    offset: of the frequency, rad/s.

    x: the start envelope's four reals, the phase that the frequency's error makes over the run, then
    the rates.
    """
    step = np.diff(run.time_s)
    begin, end = _cardinal(run.time_s[:-1], grid), _cardinal(run.time_s[1:], grid)
    middle = _cardinal(run.time_s[:-1] + step / 2, grid)
    turning = _turning(run.time_s, begin, middle, end)
    span, count = run.time_s[-1] - run.time_s[0], len(grid)

    def at(x: Array) -> Response:
        data = batch([replace(run, turn_rad=x[5:] @ turning)])
        return respond(
            data, State(p, np.array([[x[0] + 1j * x[1], x[2] + 1j * x[3]]]), x[4:5][None])
        )

    first = run.envelope[0]
    x = np.concatenate(
        [[first[0].real, first[0].imag, first[1].real, first[1].imag, offset * span], rate]
    )
    covariance, converged = np.zeros((count, count)), False
    with np.errstate(over="ignore", invalid="ignore"):
        response = at(x)
        for _ in range(ITERATIONS):
            shared = response.turning_sensitivity(
                *(p[SCALE_FACTOR] * h[:, None] for h in (begin, middle, end))
            )
            design = real(
                np.concatenate([response.run_sensitivities(), shared])[:, 0],
                response.batch.weight[0],
            )
            residual = response.residual()[0].ravel()
            target = np.concatenate([residual.real, residual.imag])
            change, whole = _solve_with_covariance(design, target)
            covariance = whole[5:, 5:]
            size, trial = 1.0, at(x + change)
            while not trial.chi2 <= response.chi2 * (1 + 1e-9) and size > 1e-3:
                size /= 2
                trial = at(x + size * change)
            if not trial.chi2 <= response.chi2 * (1 + 1e-9):
                converged = bool(
                    np.all(np.abs(change[5:]) < SETTLED * np.sqrt(np.diag(covariance)))
                )  # nothing left to gain
                break
            x, response = x + size * change, trial
            if np.all(
                np.abs(change[5:])
                < 0.01 * np.sqrt(np.diag(covariance) * max(1.0, response.chi2 / (4 * len(run))))
            ):
                converged = True
                break
    dof = max(1, 4 * len(run) - count - 5)
    chi2 = response.chi2 / dof
    left = response.residual()[0]
    residual = np.concatenate([left.real, left.imag], axis=1)
    return RateEstimate(
        grid,
        x[5:],
        covariance * max(1.0, chi2),
        plain,
        chi2,
        dof,
        converged=converged,
        residual=residual,
    )
