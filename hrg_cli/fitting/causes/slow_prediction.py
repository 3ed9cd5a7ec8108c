"""The slow model with effects, predicted over the rows of the runs.

u' = L(p, Ω) u + jδ_r u + drive(u) + Σ effects' slow terms, measured through the effects' read-outs.
The prediction is the Runge–Kutta rule of fourth order over the rows; the Jacobian follows from the
linearised equation along the prediction, so that any number of sensitivities costs one sweep. The
drive of a forced run is the logged command, turned to the wave's own direction and phase.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...physics.resonator import J, exponentiate
from ..noise import channel_noise
from . import fast_march
from .fast_march import RuleSteps
from .fit_point import Point
from .measured_runs import MeasuredRuns
from .slow_equation import (
    RungeKuttaStage,
    apply_generators,
    find_effect_turns,
    find_steady_generators,
    predict_jumps,
)
from .turned_motion import find_slope, turn_motion
from .wave_frame import make_real_matrix, to_complex, to_reals

Array = np.ndarray
CLEAR = 10.0
"""Amplitude over σ from which a row's phase is unwrapped."""
ALL = (slice(None, -1), slice(None), slice(1, None))
"""Rows before, middles of and rows after all steps."""
ROUNDING = 1e-13
"""Part of a turn that a step may miss and need not be put right."""
MOST_SWEEPS, DRIFTING, SETTLED = 12, 1e-2, 1e-12
"""Sweeps of a motion over all its steps at once; relative change up to which it may grow from one
to the next, and where it ends."""
FARTHEST, BENT = 4.0, 1e-3
"""Relative change beyond which rows are marched one by one, and from which a wave is turned instead
of added to."""
SLOPES_COST, MOST_SLOPES = 6, 2
"""Sweeps that the slopes of all steps take as long as, and how often they are found anew."""


@dataclass(frozen=True)
class Prediction:
    """Envelopes at the rows, (R, n, 2): what moves (`motion`), and what is `seen` of it under the
    drive's force, behind the read-out."""

    series: MeasuredRuns
    point: Point
    motion: Array
    seen: Array

    @property
    def by_log(self) -> Array:
        """What is seen under the logged commands alone, without what may have walked beside
        them."""
        walk = self.series.walk
        return self.seen if walk is None else self.seen - walk.moved

    def compute_residual(self) -> Array:
        """Measured minus what the log foretells over σ as reals, (R, n, 4), linear in the phase
        however far it has run off.

        With ψ the phase between measured and foretold, unwrapped: measured·e^{−jψ} − foretold +
        jψ·foretold, which is the plain difference for ψ → 0.
        """
        series, foretold = self.series, self.by_log
        measured = series.envelope
        if series.free_phase:
            seen, said = (channel_noise.whiten(series.whitening, u) for u in (measured, foretold))
            turn = np.exp(-1j * np.angle(np.sum(seen * np.conj(said), axis=-1)))
            return to_reals(series.whiten(measured * turn[..., None] - foretold))
        psi = self.compute_phase_error()[..., None]
        return to_reals(
            series.whiten(measured * np.exp(-1j * psi) - foretold + 1j * psi * foretold)
        )

    def whiten_judged(self, change: Array) -> Array:
        """Changes (R, n, 4, K) over σ of what the fit judges: all of them, or all but a common turn
        of both channels."""
        change = self.series.whiten_reals(change)
        if not self.series.free_phase:
            return change
        turned = to_reals(1j * channel_noise.whiten(self.series.whitening, self.seen))
        size = np.sum(turned**2, axis=-1, keepdims=True)
        unit = turned / np.sqrt(np.where(size > 0, size, 1.0))
        left = change - unit[..., None] * np.einsum("rni,rnik->rnk", unit, change)[:, :, None, :]
        # what is a turn and nothing else leaves rounding, which scaled to unit length would look
        # like a direction
        return left * (np.sum(left**2, axis=(0, 1, 2)) > 1e-12 * np.sum(change**2, axis=(0, 1, 2)))

    def compute_phase_error(self) -> Array:
        """Phase of measured against foretold, unwrapped along each run where the signal stands out
        of the noise, (R, n)."""
        overlap = np.sum(self.series.envelope * np.conj(self.by_log), axis=-1)
        size = np.sqrt(np.sum(np.abs(self.by_log) ** 2, axis=-1))
        clear = size * self.series.weight > CLEAR
        out = np.zeros(overlap.shape)
        for k, good in enumerate(clear):
            if good.any():
                rows = np.flatnonzero(good)
                out[k] = np.interp(
                    np.arange(len(good)), rows, np.unwrap(np.angle(overlap[k, rows]))
                )
        # up to 0.02 rad the plain difference is linear but for ψ²/2 = 2e-4 of the wave: 20 σ of a
        # quiet one, which must not come in at once, as a wall that no step of a fit gets over
        far = np.clip(np.abs(out).max(axis=1, keepdims=True) / 0.02 - 1, 0.0, 1.0)
        return out * far**2 * (3 - 2 * far)


Near = tuple[Array, Array]
"""A motion close by over the same rows (R, n, 2) and its steps' propagators (R, n − 1, 4, 4)."""


class Rule:
    """The Runge–Kutta rule of fourth order over the rows, the steady part of each run's generators
    taken exactly (Lawson 1967), and what it misses of a turn that changes put right."""

    def __init__(self, series: MeasuredRuns, point: Point) -> None:
        self.rows = RungeKuttaStage(series, point)
        self.halves = RungeKuttaStage(series.middles, point)
        L = self.rows.build_generators()
        steady = find_steady_generators(series, L)
        self.L = L - steady[:, None]
        self.M = self.halves.build_generators() - steady[:, None]
        self.turn = find_effect_turns(self.rows, series)
        self.h = series.step_s[..., None]
        self.E = exponentiate(steady[:, None] + self.turn, series.step_s / 2)
        self.righted = right_turns(self.L, self.M, series.step_s)
        self.jumps = sum(
            (
                predict_jumps(series, point, *pair)
                for pair in point.active
                if pair[0].slow_jump is not None
            ),
            np.zeros_like(self.h),
        )
        if series.walk is not None:
            self.jumps = self.jumps + series.walk.all_jumps
        self.fast = (
            fast_march.compile_march() if self.rows.driven and not self.rows.active else None
        )
        """The rule compiled, where nothing acts beside the drive."""

    def step(
        self,
        u: Array,
        place: tuple[Any, Any, Any],
        stages: tuple[RungeKuttaStage, RungeKuttaStage, RungeKuttaStage] | None,
    ) -> Array:
        """From envelopes at the rows before to those after (`place`: rows before, middles, rows
        after); without stages by L alone."""
        before, k, after = place
        h, E, turn = self.h[:, k], self.E[:, k], self.turn[:, k]

        def slope(L: Array, stage: int, v: Array) -> Array:
            beside = apply_generators(L - turn, v)
            return beside if stages is None else beside + stages[stage].compute_source(v)

        k1 = slope(self.L[:, before], 0, u)
        k2 = slope(self.M[:, k], 1, apply_generators(E, u + h / 2 * k1))
        k3 = slope(self.M[:, k], 1, apply_generators(E, u) + h / 2 * k2)
        k4 = slope(self.L[:, after], 2, apply_generators(E, apply_generators(E, u) + h * k3))
        smooth = (
            apply_generators(E, apply_generators(E, u + h / 6 * k1) + h / 3 * (k2 + k3))
            + h / 6 * k4
        )
        if self.righted is not None:
            smooth = apply_generators(self.righted[:, k], smooth)
        return smooth if stages is None else smooth + self.jumps[:, k]

    def compute_propagators(self) -> Array:
        """The steps' propagators of L alone, (R, n − 1, 2, 2)."""
        units = (np.broadcast_to(unit, (*self.h.shape[:2], 2)) for unit in np.eye(2, dtype=complex))
        return np.stack([self.step(unit, ALL, None) for unit in units], axis=-1)

    def settle(self, near: Near, start: Array) -> Array | None:
        """Motion (R, n, 2) from `start` (R, 2) that every step of the rule holds, from one near it;
        None where it is not found.

        All steps at once: what they miss of the next row is carried on by propagators near theirs
        and taken off. Propagators that gain little are those of another motion, and found anew.
        """
        u, step = near
        stages = (self.rows.select_instants(ALL[0]), self.halves, self.rows.select_instants(ALL[2]))
        last, found_anew = np.inf, 0
        for _ in range(MOST_SWEEPS):
            missed = self.step(u[:, :-1], ALL, stages) - u[:, 1:]
            off = to_reals(start - u[:, 0])[..., None]
            change = to_complex(accumulate_steps(step, off, to_reals(missed)[..., None])[..., 0])
            size = float(np.max(np.abs(change))) / float(np.max(np.abs(u)))
            if not size < min(max(last, DRIFTING), FARTHEST):
                return None
            if size > BENT:
                u, step = turn_motion(u, change, step)
            else:
                u = u + change
            if size < SETTLED:
                return u
            if found_anew < MOST_SLOPES and _count_sweeps(last, size) > SLOPES_COST:
                step = find_slope(lambda v: self.step(v, ALL, stages), u[:, :-1])
                found_anew += 1
            last = size
        return None

    def carry(self, start: Array) -> tuple[Array, Array]:
        """The motion from `start` (R, 2) by L alone, and the steps' propagators of it."""
        propagators = self.compute_propagators()
        u = np.empty((*self.rows.state.time_s.shape, 2), complex)
        u[:, 0] = start
        for k in range(u.shape[1] - 1):
            u[:, k + 1] = apply_generators(propagators[:, k], u[:, k])
        return u, propagators

    def march(self, start: Array) -> Array:
        """The same row by row."""
        if self.rows.idle:
            return self.carry(start)[0]
        motion = np.empty((*self.rows.state.time_s.shape, 2), complex)
        u = motion[:, 0] = start
        if self.fast is not None:
            jumps = self.jumps + np.zeros_like(motion[:, 1:])
            righted = np.eye(2) + np.zeros_like(self.E) if self.righted is None else self.righted
            self.fast(
                self.rows.to_instants(self.L),
                self.halves.to_instants(self.M),
                RuleSteps(self.h[..., 0], self.E, righted, jumps),
                self.rows.to_constants(),
                motion,
            )
            return motion
        before = self.rows.select_instants(0)
        for k in range(motion.shape[1] - 1):
            after = self.rows.select_instants(k + 1)
            u = motion[:, k + 1] = self.step(
                u, (k, k, k + 1), (before, self.halves.select_instants(k), after)
            )
            before = after
        return motion


def right_turns(rows: Array, middles: Array, step_s: Array) -> Array | None:
    """What the rule of fourth order leaves to be done of a turn kJ after every step, e^{iθ}/P.

    Of u' = k(t)Ju it makes P = 1 + ih(k₀ + 4k + k₁)/6 − h²k(k₀ + k + k₁)/6 − ih³k²(k₀ + k₁)/12 +
    h⁴k₀k²k₁/24 where θ = h(k₀ + 4k + k₁)/6 is right: on a table that swings the wave grows by
    (h³kʺ)²/1152 a step, which rows of a seventh of the swing's period took for a change of the
    damping.

    Parameters
    ----------
    rows, middles
        Generators without their steady part at the rows (R, n, 2, 2) and in the steps' middles (R,
        n − 1, 2, 2) [1/s].
    step_s
        Lengths of the steps (R, n − 1).

    Returns
    -------
    ndarray or None
        (R, n − 1, 2, 2); None where nothing is left that is more than rounding.

    Examples
    --------
    Of a turn that begins and ends at 1 rad/s and does 2 rad/s between:

    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.slow_prediction import right_turns
    >>> from hrg_cli.physics.resonator import J
    >>> righted = right_turns(np.array([[J, J]]), np.array([[2 * J]]), np.array([[0.1]]))
    >>> round(float(np.linalg.det(righted[0, 0]).real - 1) * 1e4, 2)
    -10.99
    >>> right_turns(np.zeros((1, 2, 2, 2)), np.zeros((1, 1, 2, 2)), np.ones((1, 1))) is None
    True
    """
    of_rows, k = (np.real(L[..., 0, 1] - L[..., 1, 0]) / 2 for L in (rows, middles))
    first, last, h = of_rows[:, :-1], of_rows[:, 1:], step_s
    angle = h * (first + 4 * k + last) / 6
    made = 1 + 1j * angle - h**2 * k * (first + k + last) / 6
    made = made - 1j * h**3 * k**2 * (first + last) / 12 + h**4 * first * k**2 * last / 24
    left = np.exp(1j * angle) / made
    if np.all(np.abs(left - 1) < ROUNDING):
        return None
    return left.real[..., None, None] * np.eye(2) + left.imag[..., None, None] * J


def _count_sweeps(last: float, size: float) -> float:
    """Sweeps that are left at the rate of the last one; none is known to be left after the
    first."""
    return float(np.log(SETTLED / size) / np.log(size / last)) if size < last < np.inf else 0.0


def accumulate_steps(step: Array, start: Array, source: Array) -> Array:
    """x with x₀ = start and x_{k+1} = step_k x_k + source_k.

    Parameters
    ----------
    step
        (R, n − 1, d, d).
    start
        (R, d, K), or what broadcasts to it.
    source
        (R, n − 1, d, K).

    Returns
    -------
    ndarray
        (R, n, d, K).

    Examples
    --------
    What halves from step to step and gets 1 each time goes to 2:

    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.slow_prediction import accumulate_steps
    >>> half, one = np.full((1, 3, 1, 1), 0.5), np.ones((1, 3, 1, 1))
    >>> accumulate_steps(half, np.zeros((1, 1)), one).ravel().tolist()
    [0.0, 1.0, 1.5, 1.75]
    """
    out = np.empty((source.shape[0], source.shape[1] + 1, *source.shape[2:]), source.dtype)
    out[:, 0] = start
    for k in range(source.shape[1]):
        np.matmul(step[:, k], out[:, k], out=out[:, k + 1])
        out[:, k + 1] += source[:, k]
    return out


def predict(series: MeasuredRuns, point: Point, near: Near | None = None) -> Prediction:
    """All runs from their start states, each step by the Runge–Kutta rule.

    Parameters
    ----------
    series
        The runs, R of n rows.
    point
        Coordinates, starts, offsets and effects.
    near
        A motion close by and its steps' propagators, by which this one is found sooner.

    Returns
    -------
    Prediction
        What moves and what is seen.

    Examples
    --------
    A wave 3 rad/s above the reference that decays by 0.1 1/s:

    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.fit_point import Point
    >>> from hrg_cli.fitting.causes.measured_runs import MeasuredRuns
    >>> from hrg_cli.fitting.causes.slow_prediction import predict
    >>> needed = [f.name for f in fields(MeasuredRuns) if f.default is MISSING]
    >>> t, none = np.linspace(0.0, 10.0, 101)[None], np.zeros((1, 101))
    >>> series = MeasuredRuns(**dict.fromkeys(needed, none) | dict(
    ...     names=("left",), time_s=t, reference_frequency_hz=5e3, mode_number=2,
    ...     turn_rad_s=np.zeros(1), held_amplitude=none + np.nan,
    ... ))
    >>> start, offset = np.array([[1.0, 0.2j]]), np.array([3.0])
    >>> found = predict(series, Point(np.array([0.1, 0, 0, 0, 0, 0.5, 0]), start, offset))
    >>> bool(np.allclose(found.seen, np.exp((3j - 0.1) * t)[..., None] * start))
    True
    """
    rule = Rule(series, point)
    if rule.fast is not None:
        marched = rule.march(point.start)
        return Prediction(series, point, marched, rule.rows.read_out(marched))
    if rule.rows.idle or near is None:
        u, propagators = rule.carry(point.start)
        if rule.rows.idle:
            return Prediction(series, point, u, rule.rows.read_out(u))
        near = u, make_real_matrix(propagators)
    found = rule.settle(near, point.start)
    motion = rule.march(point.start) if found is None else found
    return Prediction(series, point, motion, rule.rows.read_out(motion))


def march_motion(series: MeasuredRuns, point: Point) -> Array:
    """The motion row by row from the start states, in either direction of time.

    Parameters
    ----------
    series
        The runs, R of n rows.
    point
        Coordinates, starts, offsets and effects.

    Returns
    -------
    ndarray
        (R, n, 2) complex.

    Examples
    --------
    There and back again:

    >>> from dataclasses import MISSING, fields, replace
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.fit_point import Point
    >>> from hrg_cli.fitting.causes.measured_runs import MeasuredRuns
    >>> from hrg_cli.fitting.causes.slow_prediction import march_motion
    >>> needed = [f.name for f in fields(MeasuredRuns) if f.default is MISSING]
    >>> t, none = np.linspace(0.0, 10.0, 101)[None], np.zeros((1, 101))
    >>> series = MeasuredRuns(**dict.fromkeys(needed, none) | dict(
    ...     names=("left",), time_s=t, reference_frequency_hz=5e3, mode_number=2,
    ...     turn_rad_s=np.zeros(1), held_amplitude=none + np.nan,
    ... ))
    >>> p = np.array([0.1, 0.02, 0, 0.3, 0, 0.5, 0])
    >>> point = Point(p, np.array([[1.0, 0.2j]]), np.zeros(1))
    >>> there = march_motion(series, point)
    >>> back = march_motion(replace(series, time_s=t[:, ::-1]), replace(point, start=there[:, -1]))
    >>> bool(np.allclose(back[:, -1], point.start)), bool(np.allclose(there[:, -1], point.start))
    (True, False)
    """
    return Rule(series, point).march(point.start)
