"""The slow model with effects: the runs side by side and their prediction.

u' = L(p, Ω) u + jδ_r u + drive(u) + Σ effects' slow terms, measured through the effects' read-outs.
The prediction is the Runge–Kutta rule of fourth order over the rows; the Jacobian follows from the
linearised equation along the prediction, so that any number of sensitivities costs one sweep. The
drive of a forced run is the logged command, turned to the wave's own direction and phase.

What moves under a force f is v, which demodulation shows as u = v + jf/2ω (`shown`): f makes the
displacement lead at once, and v alone follows it in time. From z̈ + 2Γż + Wz = Re[2jωf e^{jωt}] and
u̇ = Lu + g, (2jω + 2Γ + L)g + ġ = 2jωf, so that v̇ = Lv + f + j(Γ + L)f/ω = Lv + f − δωR f/ω: to
second order in the rates over ω, and without ḟ, however quickly the loops change it.

Where the rate changes, L = L₁ + L₂ changes with it, and u̇ = L u leaves L̇ of the displacement's
equation, L̇ + L² + 2ΓL + 2jωL = …: L̇₁ = KΩ̇J is the Euler term's own, −L̇₂/2jω a derivative, so that
it stands beside what moves at once: u = v + jL₂v/2ω, but for [L, L₂]/2ω. Without splits that is u =
(1 − K²Ω²/4ω²) v, the amplitude of constant action at the frequency √(ω² + K²Ω²).
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from ...effects.effect import Effect, frame, no_term
from ...effects.jumps import part_after
from ...physics.plant import SlowState
from ...physics.resonator import Mechanics, exponential
from ..envelopes import coordinates
from .evidence import Basis, Softened
from .wave_frame import imaginary, real, real_matrix

Array = np.ndarray
CLEAR = 10.0
"""Amplitude over σ from which a row's phase is unwrapped."""
FOLLOWING = 10.0
"""Relaxations in a run by which a held amplitude is followed."""
ALL = (slice(None, -1), slice(None), slice(1, None))
"""Rows before, middles of and rows after all steps."""
MOST_SWEEPS, DRIFTING, SETTLED = 12, 1e-2, 1e-12
"""Sweeps of a motion over all its steps at once; relative change up to which it may grow from one
to the next, and where it ends."""


@dataclass(frozen=True)
class MeasuredRuns:
    """Runs side by side (R, n), padded with weight 0: envelopes against one reference frequency and
    what the effects may look at."""

    names: tuple[str, ...]
    time_s: Array
    envelope: Array
    weight: Array
    rate_rad_s: Array
    temperature_degc: Array
    temperature_rate_degc_s: Array
    branch: Array
    """Mean of the temperature's branch over the step that follows a row."""
    table_angle_rad: Array
    phase_rad: Array
    main_drive: Array
    quadrature_drive: Array
    main_impulse: Array
    quadrature_impulse: Array
    """∫ of the two commands from the run's start: within a row a loop that settles does not run
    straight."""
    forced: Array
    held_amplitude: Array
    """Main amplitude that a drive without a log keeps up; NaN where the command is logged or the
    run is free."""
    held_slope: Array
    turn_rad_s: Array
    """Mean turn of every run's phase (R,), which the steps take exactly."""
    reference_frequency_hz: float
    mode_number: int
    has_temperature: bool = True
    drive_late_s: float = 0.0
    """How much later than the log says the commands act; what stands here of them is so already."""
    number: Array | None = None
    """Number of every run from 0 (R,), which it keeps where some are taken; None: as they stand."""
    free_phase: bool = False
    """Every row's phase is its own: what turns both channels together is neither fitted nor
    judged."""
    scatter: Softened | None = None
    """By what the waves may stand beside any prediction, since the drive's log does not hold all
    that the drive did."""
    unsettled: Basis | None = None
    """What nobody knows of these runs, on the rows with weight: residuals and sensitivities are
    taken off it."""

    @property
    def step_s(self) -> Array:
        """(R, n − 1), 0 where padded."""
        return np.diff(self.time_s, axis=1)

    def runs(self, index: Sequence[int]) -> MeasuredRuns:
        """Some of the runs."""
        index = list(index)
        cut = {f: getattr(self, f)[index] for f in _ARRAYS}
        names, turn = tuple(self.names[i] for i in index), self.turn_rad_s[index]
        return replace(
            self.alone(), names=names, turn_rad_s=turn, number=self.numbers[index], **cut
        )

    def later(self, first: int) -> MeasuredRuns:
        """The runs from one row on."""
        return replace(self.alone(), **{f: getattr(self, f)[:, first:] for f in _ARRAYS})

    def alone(self) -> MeasuredRuns:
        """The rows without what is said of all of them together: what is unsettled, and what may
        scatter."""
        return replace(self, unsettled=None, scatter=None)

    @property
    def numbers(self) -> Array:
        """Number of every run from 0, (R,)."""
        return np.arange(len(self.names)) if self.number is None else self.number

    def middle(self) -> MeasuredRuns:
        """The same quantities in the middle of the steps, (R, n − 1)."""
        cut = {
            f: (getattr(self, f)[:, 1:] + getattr(self, f)[:, :-1]) / 2
            for f in _ARRAYS
            if f not in ("branch", "forced")
        }
        h = self.step_s
        for name, integral in _INTEGRALS.items():
            ends = getattr(self, name)
            mean = np.divide(
                np.diff(getattr(self, integral), axis=1), h, out=cut[name].copy(), where=h > 0
            )
            # Simpson's rule then takes exactly the integral, however fast the quantity changes
            # within a step
            cut[name] = (6 * mean - ends[:, 1:] - ends[:, :-1]) / 4
        # likewise of the branch, which stands as its mean over the step that follows a row
        cut["branch"] = (5 * self.branch[:, :-1] - self.branch[:, 1:]) / 4
        return replace(self, forced=self.forced[:, :-1], **cut)


_ARRAYS = (
    "time_s",
    "envelope",
    "weight",
    "rate_rad_s",
    "temperature_degc",
    "temperature_rate_degc_s",
    "branch",
    "table_angle_rad",
    "phase_rad",
    "main_drive",
    "quadrature_drive",
    "main_impulse",
    "quadrature_impulse",
    "forced",
    "held_amplitude",
    "held_slope",
)

_INTEGRALS = {
    "temperature_rate_degc_s": "temperature_degc",
    "rate_rad_s": "table_angle_rad",
    "main_drive": "main_impulse",
    "quadrature_drive": "quadrature_impulse",
}

Active = tuple[tuple[Effect, Mapping[str, float]], ...]
"""Effects with all their parameters' values."""


@dataclass(frozen=True)
class Point:
    """Where a fit stands: coordinates (7,), the runs' start states (R, 2) and frequency offsets
    (R,), effects with values."""

    p: Array
    start: Array
    offset_rad_s: Array
    active: Active = ()


@dataclass(frozen=True)
class Prediction:
    """Envelopes at the rows, (R, n, 2): what moves (`motion`), and what is `seen` of it under the
    drive's force, behind the read-out."""

    series: MeasuredRuns
    point: Point
    motion: Array
    seen: Array

    def residual(self) -> Array:
        """Measured minus seen over σ as reals, (R, n, 4), linear in the phase however far it has
        run off.

        With ψ the phase between measured and seen, unwrapped: measured·e^{−jψ} − seen + jψ·seen,
        which is the plain difference for ψ → 0.
        """
        if self.series.free_phase:
            turn = np.exp(
                -1j * np.angle(np.sum(self.series.envelope * np.conj(self.seen), axis=-1))
            )
            return real(
                (self.series.envelope * turn[..., None] - self.seen) * self.series.weight[..., None]
            )
        psi = self.phase_error()[..., None]
        return real(
            (self.series.envelope * np.exp(-1j * psi) - self.seen + 1j * psi * self.seen)
            * self.series.weight[..., None]
        )

    def judged(self, change: Array) -> Array:
        """Changes (R, n, 4, K) over σ of what the fit judges: all of them, or all but a common turn
        of both channels."""
        change = change * self.series.weight[..., None, None]
        if not self.series.free_phase:
            return change
        turned = real(1j * self.seen)
        size = np.sum(turned**2, axis=-1, keepdims=True)
        unit = turned / np.sqrt(np.where(size > 0, size, 1.0))
        left = change - unit[..., None] * np.einsum("rni,rnik->rnk", unit, change)[:, :, None, :]
        # what is a turn and nothing else leaves rounding, which scaled to unit length would look
        # like a direction
        return left * (np.sum(left**2, axis=(0, 1, 2)) > 1e-12 * np.sum(change**2, axis=(0, 1, 2)))

    def phase_error(self) -> Array:
        """Phase of measured against seen, unwrapped along each run where the signal stands out of
        the noise, (R, n)."""
        overlap = np.sum(self.series.envelope * np.conj(self.seen), axis=-1)
        size = np.sqrt(np.sum(np.abs(self.seen) ** 2, axis=-1))
        clear = size * self.series.weight > CLEAR
        out = np.zeros(overlap.shape)
        for k, good in enumerate(clear):
            if good.any():
                rows = np.flatnonzero(good)
                out[k] = np.interp(
                    np.arange(len(good)), rows, np.unwrap(np.angle(overlap[k, rows]))
                )
        return np.where(np.abs(out).max(axis=1, keepdims=True) > 0.02, out, 0.0)


def mechanics(p: Array, series: MeasuredRuns) -> Mechanics:
    """The resonator of coordinates p at the reference frequency."""
    return coordinates.to_mechanics(p, series.reference_frequency_hz, series.mode_number)


def state_of(series: MeasuredRuns, point: Point) -> SlowState:
    """What the effects look at, (R, n); the effects' own changes of the environment applied."""
    state = SlowState(
        mechanics=mechanics(point.p, series),
        time_s=series.time_s,
        temperature_degc=series.temperature_degc,
        temperature_rate_degc_s=series.temperature_rate_degc_s,
        branch=series.branch,
        rate_rad_s=series.rate_rad_s,
        table_angle_rad=series.table_angle_rad,
        drive=np.zeros((*series.time_s.shape, 2), complex),
        forced=series.forced,
        phase_rad=series.phase_rad,
        omega_r_rad_s=2 * np.pi * series.reference_frequency_hz,
        run=series.numbers[:, None],
    )
    for effect, values in point.active:
        state = effect.slow_environment(values, state)
    return state


_SLICED = (
    "time_s",
    "temperature_degc",
    "temperature_rate_degc_s",
    "branch",
    "rate_rad_s",
    "table_angle_rad",
    "forced",
    "phase_rad",
)


class RungeKuttaStage:
    """Everything beside L u at one set of instants: drive and effects; sliced from whole arrays for
    one Runge–Kutta stage."""

    def __init__(self, series: MeasuredRuns, point: Point) -> None:
        self.state = state_of(series, point)
        self.of = series, point
        self.active = point.active
        self.driven = bool(np.any(series.forced))
        hz = series.reference_frequency_hz
        self.second = point.p[6] * second_order_force(point.p, hz)
        self.lead = point.p[6] * lead_of_force(hz)
        self.main, self.quadrature = series.main_drive, series.quadrature_drive
        self.holds = bool(np.any(np.isfinite(series.held_amplitude)))
        self.L = generators(series, point) if self.holds else np.empty((*series.time_s.shape, 0))
        self.held, self.held_slope = series.held_amplitude, series.held_slope
        self.follow_1_s = FOLLOWING / max(float(series.time_s.max() - series.time_s.min()), 1e-9)

    def at(self, k: int | slice) -> RungeKuttaStage:
        """The instants of columns k."""
        one = object.__new__(RungeKuttaStage)
        state = object.__new__(SlowState)
        state.__dict__.update(self.state.__dict__)
        for name in _SLICED:
            state.__dict__[name] = getattr(self.state, name)[:, k]
        state.drive = self.state.drive[:, k]
        one.state, one.active, one.driven = state, self.active, self.driven
        one.second, one.lead = self.second, self.lead
        one.main, one.quadrature, one.L = self.main[:, k], self.quadrature[:, k], self.L[:, k]
        one.holds, one.held, one.held_slope, one.follow_1_s = (
            self.holds,
            self.held[:, k],
            self.held_slope[:, k],
            self.follow_1_s,
        )
        return one

    def drive(self, v: Array) -> Array:
        """Commanded force on the envelopes: e^{jφ}(a_ΦA e_A − j a_ΦB e_B) along the wave as the
        loops see it; without a log, what holds the measured amplitude."""
        force = self._along(v, v)
        return force if self.lead == 0 else self._along(v + self.lead * force, v)

    def _along(self, u: Array, v: Array) -> Array:
        """The drive along the axes of envelopes u that move as v does."""
        turn, e_A, e_B, a_A = frame(u, self.state.phase_rad)
        main = self.main
        if self.holds:
            loss = np.real(np.sum(times(self.L, v) * e_A, axis=-1) * np.conj(turn))
            main = np.where(
                np.isfinite(self.held),
                self.held_slope - loss + self.follow_1_s * (self.held - a_A),
                main,
            )
        return turn[..., None] * (main[..., None] * e_A - 1j * self.quadrature[..., None] * e_B)

    @cached_property
    def beside_motion(self) -> Array | None:
        """jL₂/2ω (R, n, 2, 2): what the displacement shows beside the motion at a rate; None where
        no run turns."""
        series, point = self.of
        if not np.any(series.rate_rad_s):
            return None
        return lead_of_force(series.reference_frequency_hz) * _orders(series, point)[1]

    def shown(self, v: Array) -> Array:
        """The envelopes u = v + jf/2ω + jL₂v/2ω that demodulation shows of the displacement, before
        the read-outs."""
        u = v + self.lead * self.drive(v) if self.driven else v
        return u if self.beside_motion is None else u + times(self.beside_motion, v)

    def lit(self, u: Array) -> SlowState:
        """What the effects look at beside the envelopes u, with the drive these call for."""
        if not self.driven:
            return self.state
        state = copy.copy(self.state)
        state.drive = self.drive(u)
        return state

    def ordered(self, p: Array, frequency_hz: float) -> RungeKuttaStage:
        """The same with the force's second order of other coordinates."""
        one = copy.copy(self)
        one.second = p[6] * second_order_force(p, frequency_hz)
        one.lead = p[6] * lead_of_force(frequency_hz)
        return one

    def without(self, effect: Effect) -> RungeKuttaStage:
        """The same with one effect out of the equation; what it does to the environment stays."""
        one = copy.copy(self)
        one.active = tuple(pair for pair in self.active if pair[0].name != effect.name)
        return one

    def beside(self, v: Array) -> Array:
        """dv/dt beside L v."""
        state = self.lit(v)
        total = state.drive + times(self.second, state.drive) if self.driven else np.zeros_like(v)
        for effect, values in self.active:
            if effect.slow is not no_term:
                total += effect.slow(values, self.acted_on(effect, v, state), state)
        return total

    def acted_on(self, effect: Effect, v: Array, state: SlowState) -> Array:
        """Envelopes that an effect's slow term looks at: loops and forcers see the displacement, v +
        jf/2ω, the resonator moves as v does.

        With the displacement for all, driven runs whose frequency follows 40 K of temperature are
        missed by what that makes of the force's lead.
        """
        by_loops = self.driven and effect.family == "control"
        return v + self.lead * state.drive if by_loops else v

    def seen(self, v: Array) -> Array:
        """As demodulation shows it, through the read-outs."""
        u = self.shown(v)
        if self.active:
            state = self.lit(v)
            for effect, values in self.active:
                u = effect.slow_readout(values, u, state)
        return u

    @property
    def idle(self) -> bool:
        """Nothing acts beside L."""
        return not self.driven and not self.active


def second_order_force(p: Array, frequency_hz: float) -> Array:
    """−δωR/ω (2, 2): what of a force f the moving part of the envelopes feels beside f itself."""
    split = np.tensordot(p[3:5], coordinates.BASIS[3:], 1)
    return 1j * split / (2 * np.pi * frequency_hz)


def lead_of_force(frequency_hz: float) -> complex:
    """j/2ω: by which part of a force the demodulated envelopes stand beside what moves."""
    return 1j / (4 * np.pi * frequency_hz)


def generators(series: MeasuredRuns, point: Point) -> Array:
    """L (R, n, 2, 2) with the runs' frequency offsets beside their mean turn, which the steps take
    exactly."""
    first, second = _orders(series, point)
    offset = 1j * (point.offset_rad_s - series.turn_rad_s)[:, None, None, None] * np.eye(2)
    return first + second + offset


def _orders(series: MeasuredRuns, point: Point) -> tuple[Array, Array]:
    """L by plain averaging, and what the second order changes of it, (R, n, 2, 2)."""
    omega = 2 * np.pi * series.reference_frequency_hz + point.offset_rad_s[:, None]
    plain = coordinates.generator(np.append(point.p[:6], 0.0), series.rate_rad_s, 1.0)
    full = coordinates.generator(np.append(point.p[:6], 1.0), series.rate_rad_s, omega)
    return plain, point.p[6] * (full - plain)


def jump_times(series: MeasuredRuns, point: Point) -> list[float]:
    """Instants at which effects of a point make the motion jump."""
    state = state_of(series, point)
    return [
        float(effect.slow_jump(values, state)[0])
        for effect, values in point.active
        if effect.slow_jump is not None
    ]


def jump(series: MeasuredRuns, point: Point, effect: Effect, values: Mapping[str, float]) -> Array:
    """What an effect adds to the envelopes within each step by a jump at an instant, as the row
    after it sees it, (R, n − 1, 2).

    A row is the mean of its length, so the part r(t) of a jump that the row at t sees rises from 0
    to 1 within the row that holds the instant; a step brings the difference of its rows' parts,
    carried on from the instant by the resonator alone.
    """
    assert effect.slow_jump is not None
    instant, change = effect.slow_jump(values, state_of(series, point))
    t, h = series.time_s, series.step_s
    share = np.diff(part_after(t, instant), axis=1) * (h > 0)
    L = generators(series, point)[:, 1:] + 1j * series.turn_rad_s[:, None, None, None] * np.eye(2)
    near = np.where(share != 0, t[:, 1:] - instant, 0.0)
    return share[..., None] * times(
        exponential(L, near), np.broadcast_to(change, (*share.shape, 2))
    )


def times(L: Array, u: Array) -> Array:
    """L u over (..., 2, 2) and (..., 2)."""
    c, s = u[..., 0], u[..., 1]
    return np.stack(
        [L[..., 0, 0] * c + L[..., 0, 1] * s, L[..., 1, 0] * c + L[..., 1, 1] * s], axis=-1
    )


Near = tuple[Array, Array]
"""A motion close by over the same rows (R, n, 2) and its steps' propagators (R, n − 1, 4, 4)."""


class _Rule:
    """The Runge–Kutta rule of fourth order over the rows, each run's mean turn taken exactly
    (Lawson)."""

    def __init__(self, series: MeasuredRuns, point: Point) -> None:
        centre = series.middle()
        self.rows, self.halves = RungeKuttaStage(series, point), RungeKuttaStage(centre, point)
        self.L, self.M = generators(series, point), generators(centre, point)
        self.h, self.E = series.step_s[..., None], half_turns(series)[..., None]
        self.jumps = sum(
            (jump(series, point, *pair) for pair in point.active if pair[0].slow_jump is not None),
            np.zeros_like(self.h),
        )

    def step(
        self,
        u: Array,
        place: tuple[Any, Any, Any],
        stages: tuple[RungeKuttaStage, RungeKuttaStage, RungeKuttaStage] | None,
    ) -> Array:
        """From envelopes at the rows before to those after (`place`: rows before, middles, rows
        after); without stages by L alone."""
        before, k, after = place
        h, E = self.h[:, k], self.E[:, k]

        def slope(L: Array, stage: int, v: Array) -> Array:
            return times(L, v) if stages is None else times(L, v) + stages[stage].beside(v)

        k1 = slope(self.L[:, before], 0, u)
        k2 = slope(self.M[:, k], 1, E * (u + h / 2 * k1))
        k3 = slope(self.M[:, k], 1, E * u + h / 2 * k2)
        k4 = slope(self.L[:, after], 2, E * (E * u + h * k3))
        smooth = E * (E * (u + h / 6 * k1) + h / 3 * (k2 + k3)) + h / 6 * k4
        return smooth if stages is None else smooth + self.jumps[:, k]

    def linear(self) -> Array:
        """The steps' propagators of L alone, (R, n − 1, 2, 2)."""
        units = (np.broadcast_to(unit, (*self.h.shape[:2], 2)) for unit in np.eye(2, dtype=complex))
        return np.stack([self.step(unit, ALL, None) for unit in units], axis=-1)

    def settled(self, guess: Array, step: Array) -> Array | None:
        """Motion (R, n, 2) that every step of the rule holds, from a guess with its start; None
        where it is not found.

        All steps at once: what they miss of the next row is carried on by propagators (R, n − 1, 4,
        4) near theirs and taken off.
        """
        u, stages = guess, (self.rows.at(ALL[0]), self.halves, self.rows.at(ALL[2]))
        last, zero = np.inf, np.zeros((len(u), 4, 1))
        for _ in range(MOST_SWEEPS):
            missed = self.step(u[:, :-1], ALL, stages) - u[:, 1:]
            change = imaginary(accumulate_steps(step, zero, real(missed)[..., None])[..., 0])
            u = u + change
            size = float(np.max(np.abs(change))) / float(np.max(np.abs(u)))
            if not size < max(last, DRIFTING):
                return None
            if size < SETTLED:
                return u
            last = size
        return None

    def marched(self, start: Array) -> Array:
        """The same row by row."""
        motion = np.empty((*self.rows.state.time_s.shape, 2), complex)
        u = motion[:, 0] = start
        before = self.rows.at(0)
        for k in range(motion.shape[1] - 1):
            after = self.rows.at(k + 1)
            u = motion[:, k + 1] = self.step(u, (k, k, k + 1), (before, self.halves.at(k), after))
            before = after
        return motion


def accumulate_steps(step: Array, start: Array, source: Array) -> Array:
    """x (R, n, d, K) with x₀ = start and x_{k+1} = step_k x_k + source_k, (R, n − 1, d, d) and (R,
    n − 1, d, K)."""
    out = np.empty((source.shape[0], source.shape[1] + 1, *source.shape[2:]), source.dtype)
    out[:, 0] = start
    for k in range(source.shape[1]):
        np.matmul(step[:, k], out[:, k], out=out[:, k + 1])
        out[:, k + 1] += source[:, k]
    return out


def predict(series: MeasuredRuns, point: Point, near: Near | None = None) -> Prediction:
    """All runs from their start states, each step by the Runge–Kutta rule; `near` finds them
    sooner."""
    rule = _Rule(series, point)
    if rule.rows.idle or near is None:
        propagators = rule.linear()
        u = np.empty((*series.time_s.shape, 2), complex)
        u[:, 0] = point.start
        for k in range(u.shape[1] - 1):
            u[:, k + 1] = times(propagators[:, k], u[:, k])
        if rule.rows.idle:
            return Prediction(series, point, u, rule.rows.seen(u))
        step = real_matrix(propagators)
    else:
        u, step = near[0].copy(), near[1]
        u[:, 0] = point.start
    motion = rule.settled(u, step)
    if motion is None:
        motion = rule.marched(point.start)
    return Prediction(series, point, motion, rule.rows.seen(motion))


def motion_of(series: MeasuredRuns, point: Point) -> Array:
    """The motion (R, n, 2) row by row from the start states, in either direction of time."""
    return _Rule(series, point).marched(point.start)


def half_turns(series: MeasuredRuns) -> Array:
    """e^{jδh/2} of every step (R, n − 1), δ the run's mean turn."""
    return np.exp(0.5j * series.turn_rad_s[:, None] * series.step_s)
