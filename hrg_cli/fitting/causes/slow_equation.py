"""The slow model with effects beside L: the drive along the wave, what demodulation shows of the
motion, the effects' terms, jumps.

What moves under a force f is v, which demodulation shows as u = v + jf/2ω (`compute_displacement`):
f makes the displacement lead at once, and v alone follows it in time. From z̈ + 2Γż + Wz = Re[2jωf
e^{jωt}] and u̇ = Lu + g, (2jω + 2Γ + L)g + ġ = 2jωf, so that v̇ = Lv + f + j(Γ + L)f/ω = Lv + f −
δωR f/ω: to second order in the rates over ω, and without ḟ, however quickly the loops change it.

Where the rate changes, L = L₁ + L₂ changes with it, and u̇ = L u leaves L̇ of the displacement's
equation, L̇ + L² + 2ΓL + 2jωL = …: L̇₁ = KΩ̇J is the Euler term's own, −L̇₂/2jω a derivative, so
that it stands beside what moves at once: u = (1 + A)v, A = jL₂/2ω. Without splits that is u = (1 −
K²Ω²/4ω²) v, the amplitude of constant action at the frequency √(ω² + K²Ω²). At a constant rate u̇ =
Lu is v̇ = (L + [L, A])v.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from functools import cached_property

import numpy as np

from ...effects.effect import INSTANT, OF_EVERY_RUN, RUN, Effect, find_frame_about, no_term
from ...effects.envelope_jumps import find_part_after
from ...physics.plant import SlowState
from ...physics.resonator import exponentiate
from ..envelopes import coordinates
from .fast_march import Constants, Instants
from .fit_point import Point, build_state
from .measured_runs import MeasuredRuns

Array = np.ndarray
SMALL_MOVE = 1e-4
"""Of the motion, by which its change is taken to differentiate a force: halfway between rounding
and the third order."""
CLEAR_PART = 1e-8
"""Of the largest energy of a run, from which a row has a phase."""
FOLLOWING = 10.0
"""Relaxations in a run by which a held amplitude is followed."""


_SLICED = (
    "time_s",
    "temperature_degc",
    "temperature_rate_degc_s",
    "branch",
    "rate_rad_s",
    "table_angle_rad",
    "forced",
    "phase_rad",
    "begun_s",
)


class RungeKuttaStage:
    """Everything beside L u at one set of instants: drive and effects; sliced from whole arrays for
    one Runge–Kutta stage."""

    def __init__(self, series: MeasuredRuns, point: Point) -> None:
        self.state = build_state(series, point)
        self.of = series, point
        self.active = point.active
        self.driven = bool(np.any(series.forced))
        hz = series.reference_frequency_hz
        self.second = point.p[coordinates.SECOND_ORDER] * compute_second_order_force(point.p, hz)
        self.own_lead = compute_lead(hz)
        self.lead = point.p[coordinates.SECOND_ORDER] * self.own_lead
        self.main, self.quadrature = series.main_drive, series.quadrature_drive
        self.holds = bool(np.any(np.isfinite(series.held_amplitude)))
        self.plain, self.second_order = _orders(series, point)
        self.turns = bool(np.any(series.rate_rad_s))
        self.L = np.empty((*series.time_s.shape, 0))
        if self.holds:
            self.L = self.build_generators() - build_mean_turns(series)[:, None]
        self.fastest_1_s = float(np.max(np.abs(self.plain), initial=0.0))
        self.frame_turn = series.frame_turn
        self.held, self.held_slope = series.held_amplitude, series.held_slope
        self.follow_1_s = FOLLOWING / max(float(series.time_s.max() - series.time_s.min()), 1e-9)

    def build_generators(self) -> Array:
        """`build_generators` at these instants, from what is at hand of it."""
        return _shift_generators(*self.of, self.plain, self.second_order)

    def select_instants(self, k: int | slice) -> RungeKuttaStage:
        """The instants of columns k."""
        one = object.__new__(RungeKuttaStage)
        state = object.__new__(SlowState)
        state.__dict__.update(self.state.__dict__)
        for name in _SLICED:
            state.__dict__[name] = getattr(self.state, name)[:, k]
        state.drive = self.state.drive[:, k]
        # a run's number is the same at all its rows, of which a single one has no axis
        run = self.state.run
        state.run = run[:, 0] if run is not None and isinstance(k, int) else run
        one.state, one.active, one.driven = state, self.active, self.driven
        one.second, one.lead, one.fastest_1_s = self.second, self.lead, self.fastest_1_s
        one.main, one.quadrature = self.main[:, k], self.quadrature[:, k]
        one.L, one.plain = self.L[:, k], self.plain[:, k]
        one.frame_turn = None if self.frame_turn is None else self.frame_turn[:, k]
        if self.driven:
            one.known_turn = self.known_turn[:, k]
            one.beside_frame = tuple(part[:, k] for part in self.beside_frame)
        one.holds, one.held, one.held_slope, one.follow_1_s = (
            self.holds,
            self.held[:, k],
            self.held_slope[:, k],
            self.follow_1_s,
        )
        return one

    def to_instants(self, L: Array) -> Instants:
        """The same in numbers and arrays alone, for a march without causes."""
        shape = L.shape[:2]

        def whole(values: Array) -> Array:
            return np.array(np.broadcast_to(values, shape), float)

        return Instants(
            L=L,
            main=whole(self.main),
            quadrature=whole(self.quadrature),
            phase_rad=whole(self.state.phase_rad),
            held=whole(self.held),
            held_slope=whole(self.held_slope),
            turned=np.zeros((*shape, 2)) if self.frame_turn is None else self.frame_turn,
            follow_1_s=float(self.follow_1_s),
        )

    def to_constants(self) -> Constants:
        """What all instants share of that."""
        return Constants(self.second, complex(self.lead))

    @cached_property
    def known_turn(self) -> Array:
        """e^{jφ} of the phase near which the wave's own is taken."""
        return np.exp(1j * self.state.phase_rad)

    @cached_property
    def beside_frame(self) -> tuple[Array, ...]:
        """Cosine and sine (..., 1) and e^{jφ} of how the drive's frame stands beside the wave's;
        none where it is the wave's."""
        if self.frame_turn is None:
            return ()
        angle, phase = self.frame_turn[..., :1], self.frame_turn[..., 1]
        return np.cos(angle), np.sin(angle), np.exp(1j * phase)

    def compute_drive(self, v: Array) -> Array:
        """Commanded force on the envelopes: e^{jφ}(a_ΦA e_A − j a_ΦB e_B) along the wave as the
        loops see it; without a log, what holds the measured amplitude."""
        # one iteration: the loops see u, which the force itself moves; the next would be (1/ωτ)² of
        # it
        force = self._along(v, v)
        return force if self.lead == 0 else self._along(v + self.lead * force, v)

    def compute_main_command(self, v: Array) -> Array:
        """a_ΦA of the drive on the envelopes: as logged, or what holds the measured amplitude."""
        return self._hold(find_frame_about(v, self.known_turn), v)

    def _hold(self, frame: tuple[Array, ...], v: Array) -> Array:
        """The main command in the frame of envelopes that move as v does."""
        if not self.holds:
            return self.main
        # the amplitude's own equation solved for the force, and a slow pull to where it was
        # measured
        turn, e_A, _, a_A = frame
        loss = np.real(np.sum(apply_generators(self.L, v) * e_A, axis=-1) * np.conj(turn))
        return np.where(
            np.isfinite(self.held),
            self.held_slope - loss + self.follow_1_s * (self.held - a_A),
            self.main,
        )

    def _along(self, u: Array, v: Array) -> Array:
        """The drive along the axes of envelopes u that move as v does."""
        frame = find_frame_about(u, self.known_turn)
        main, (turn, e_A, e_B, _) = self._hold(frame, v), frame
        if self.beside_frame:
            cos, sin, phase = self.beside_frame
            turn, e_A, e_B = turn * phase, cos * e_A + sin * e_B, cos * e_B - sin * e_A
        return turn[..., None] * (main[..., None] * e_A - 1j * self.quadrature[..., None] * e_B)

    @property
    def beside_motion(self) -> Array | None:
        """jL₂/2ω (R, n, 2, 2): what the displacement shows beside the motion at a rate; None where
        no run turns."""
        return self.own_lead * self.second_order if self.turns else None

    def compute_displacement(self, v: Array) -> Array:
        """The envelopes u = v + jf/2ω + jL₂v/2ω that demodulation shows of the displacement, before
        the read-outs."""
        return self._displace(v, self.compute_drive(v) if self.driven else None)

    def _displace(self, v: Array, drive: Array | None) -> Array:
        """The displacement of envelopes v under the drive that they call for."""
        u = v if drive is None else v + self.lead * drive
        return u + self.own_lead * apply_generators(self.second_order, v) if self.turns else u

    def make_state(self, u: Array) -> SlowState:
        """What the effects look at beside the envelopes u, with the drive these call for."""
        if not self.driven:
            return self.state
        state = copy.copy(self.state)
        state.drive = self.compute_drive(u)
        return state

    def replace_second_order(self, p: Array, frequency_hz: float) -> RungeKuttaStage:
        """The same with the force's second order of other coordinates."""
        one = copy.copy(self)
        one.second = p[coordinates.SECOND_ORDER] * compute_second_order_force(p, frequency_hz)
        one.lead = p[coordinates.SECOND_ORDER] * compute_lead(frequency_hz)
        return one

    def remove_effect(self, effect: Effect) -> RungeKuttaStage:
        """The same with one effect out of the equation; what it does to the environment stays."""
        one = copy.copy(self)
        one.active = tuple(pair for pair in self.active if pair[0].name != effect.name)
        return one

    def compute_source(self, v: Array) -> Array:
        """dv/dt beside L v."""
        state = self.make_state(v)
        total = (
            state.drive + apply_generators(self.second, state.drive)
            if self.driven
            else np.zeros_like(v)
        )
        for effect, values in self.active:
            if effect.slow is not no_term:
                total += self.compute_force(effect, values, v, state)
        return total

    def compute_force(
        self, effect: Effect, values: Mapping[str, float], v: Array, state: SlowState
    ) -> Array:
        """What an effect adds to dv/dt, f, with what the second order makes of it.

        With u̇ = Lu + g, (2jω + 2Γ + L)g + ġ = 2jωf: g = f + (j/2ω)[(2Γ + L)f + ḟ], 2Γ + L = −L₀*.
        A spring that moves has ḟ = ∂f/∂t, which is −ω̇/2ω of the amplitude; a force that is not
        linear changes with the motion that L₀ and the drive make, ḟ = Df[L₀u + F]. What a linear
        one that stands makes of both is part of how its parameters are defined.
        """
        seen, beside = self.choose_envelopes(effect, v, state)
        if self.lead == 0:
            return effect.slow(values, seen, beside)
        if effect.nonlinear_force and self.fastest_1_s > 0:
            time_s = SMALL_MOVE / self.fastest_1_s
            moved = time_s * (apply_generators(self.plain, v) + state.drive)
            # all three at once: on short rows a call costs more than what it computes
            stacked = np.stack([seen, v + moved, v - moved])
            if beside.displacement is not None:
                beside.displacement = np.stack([beside.displacement, *stacked[1:]])
            force, ahead, behind = effect.slow(values, stacked, beside)
            second = (ahead - behind) / (2 * time_s)
            second -= apply_generators(np.conj(self.plain), force)
        else:
            force = effect.slow(values, seen, beside)
            second = np.zeros_like(force)
        if effect.slow_rate is not no_term:
            second += effect.slow_rate(values, v, state)
        return force + self.lead * second

    def pass_forcers(self, v: Array, command: Array) -> Array:
        """The force (R, n, 2) of a command beside the logged ones, with what the fitted causes make
        of it: the forcers' own are proportional to the drive."""
        force = command
        for effect, values in self.active:
            if effect.family != "control" or effect.slow is no_term:
                continue
            with_it, without = copy.copy(self.state), copy.copy(self.state)
            with_it.drive, without.drive = command, np.zeros_like(command)
            force = force + effect.slow(values, v, with_it) - effect.slow(values, v, without)
        return force

    def choose_envelopes(
        self, effect: Effect, v: Array, state: SlowState
    ) -> tuple[Array, SlowState]:
        """Envelopes and state that an effect's slow term looks at.

        Loops and forcers see the displacement u = v + jf/2ω, what slows the motion its velocity,
        ż = Re[(jωu + u̇) e^{jωt}], over jω: u + (Lv + f)/jω, and springs move as v does.

        With the displacement for all, driven runs whose frequency follows 40 K of temperature are
        missed by what that makes of the force's lead; with v for what follows the velocity, a
        damping that changes by Δν leaves out ΔνKΩ/ω of quadrature per second.
        """
        if effect.acts_on == "velocity":
            beside = copy.copy(state)
            beside.displacement = v + self.lead * state.drive
            return v - self.lead * (2 * apply_generators(self.plain, v) + state.drive), beside
        by_loops = self.driven and effect.family == "control"
        return (v + self.lead * state.drive if by_loops else v), state

    def read_out(self, v: Array) -> Array:
        """As demodulation shows it, through the read-outs."""
        state = self.make_state(v)
        u = self._displace(v, state.drive if self.driven else None)
        for effect, values in self.active:
            u = effect.slow_readout(values, u, state)
        return u

    @property
    def idle(self) -> bool:
        """Nothing acts beside L."""
        return not self.driven and not self.active


def compute_second_order_force(p: Array, frequency_hz: float) -> Array:
    """What of a force f the moving part of the envelopes feels beside f itself, −δωR/ω.

    Parameters
    ----------
    p
        Coordinates (7,), of which the frequency split counts.
    frequency_hz
        Of the wave.

    Returns
    -------
    ndarray
        (2, 2), real but for rounding.

    Examples
    --------
    A split of 2π rad/s at 1 kHz makes the stiffer channel 1/1000 less moved, the other more:

    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.slow_equation import compute_second_order_force
    >>> split = np.array([0, 0, 0, 2 * np.pi, 0, 0, 1])
    >>> compute_second_order_force(split, 1e3).real.round(9).tolist()
    [[-0.001, 0.0], [0.0, 0.001]]
    """
    split = np.tensordot(
        p[coordinates.FREQUENCY_SPLIT], coordinates.BASIS[coordinates.FREQUENCY_SPLIT], 1
    )
    return 1j * split / (2 * np.pi * frequency_hz)


def compute_lead(frequency_hz: float) -> complex:
    """By which part of a force the demodulated envelopes stand beside what moves, j/2ω.

    Parameters
    ----------
    frequency_hz
        Of the wave.

    Returns
    -------
    complex
        Seconds.

    Examples
    --------
    >>> from hrg_cli.fitting.causes.slow_equation import compute_lead
    >>> round(compute_lead(1e3).imag * 1e6, 3)
    79.577
    """
    return 1j / (4 * np.pi * frequency_hz)


def build_generators(series: MeasuredRuns, point: Point) -> Array:
    """The generator L + [L, A] of what moves, with the runs' frequency offsets.

    At a constant rate the displacement u = (1 + A)v, A = jL₂/2ω, follows u' = Lu: v follows
    (1 + A)⁻¹L(1 + A), to first order in A that commutator.

    Parameters
    ----------
    series
        The runs, R of n rows.
    point
        Coordinates and offsets.

    Returns
    -------
    ndarray
        (R, n, 2, 2) complex [1/s].

    Examples
    --------
    A wave 3 rad/s above the reference that decays by 0.1 1/s:

    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.fit_point import Point
    >>> from hrg_cli.fitting.causes.measured_runs import MeasuredRuns
    >>> from hrg_cli.fitting.causes.slow_equation import build_generators
    >>> needed = [f.name for f in fields(MeasuredRuns) if f.default is MISSING]
    >>> t, none = np.linspace(0.0, 10.0, 101)[None], np.zeros((1, 101))
    >>> series = MeasuredRuns(**dict.fromkeys(needed, none) | dict(
    ...     names=("left",), time_s=t, reference_frequency_hz=5e3, mode_number=2,
    ...     turn_rad_s=np.zeros(1), held_amplitude=none + np.nan,
    ... ))
    >>> point = Point(np.array([0.1, 0, 0, 0, 0, 0.5, 0]), np.ones((1, 2)), np.array([3.0]))
    >>> bool(np.allclose(build_generators(series, point)[0, 0], (3j - 0.1) * np.eye(2)))
    True
    """
    return _shift_generators(series, point, *_orders(series, point))


def _shift_generators(series: MeasuredRuns, point: Point, first: Array, second: Array) -> Array:
    """The same from both orders of L, (R, n, 2, 2)."""
    L = first + second
    if np.any(series.rate_rad_s):
        shift = compute_lead(series.reference_frequency_hz) * second
        L = L + (L @ shift - shift @ L)
    return L + 1j * point.offset_rad_s[:, None, None, None] * np.eye(2)


def build_mean_turns(series: MeasuredRuns) -> Array:
    """jδ of the mean turn δ of every run's phase.

    Parameters
    ----------
    series
        The runs, R of them.

    Returns
    -------
    ndarray
        (R, 2, 2) [1/s].

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.slow_equation import build_mean_turns
    >>> build_mean_turns(SimpleNamespace(turn_rad_s=np.array([0.5]))).tolist()
    [[[0.5j, 0j], [0j, 0.5j]]]
    """
    return 1j * series.turn_rad_s[:, None, None] * np.eye(2)


def find_steady_generators(series: MeasuredRuns, L: Array) -> Array:
    """The part of every run's generators that its steps take exactly.

    It is the mean of a free run's, of a driven run the mean turn alone. The rule of a step of
    length h misses (Lh)⁵/120 of the wave, which at a split of 0.2 rad/s and rows of a second is
    more than the noise of a quiet run. Of a driven run the commands stand against damping and
    split: the rule keeps that balance, while of L alone taken exactly it would miss what the
    commands do.

    Parameters
    ----------
    series
        The runs, R of n rows.
    L
        Their generators (R, n, 2, 2).

    Returns
    -------
    ndarray
        (R, 2, 2).

    Examples
    --------
    A free run and a driven one of the same damping:

    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.slow_equation import find_steady_generators
    >>> forced = np.array([[0.0, 0.0], [1.0, 1.0]])
    >>> series = SimpleNamespace(forced=forced, turn_rad_s=np.array([0.0, 0.5]))
    >>> L = np.tile(-0.1 * np.eye(2), (2, 2, 1, 1))
    >>> find_steady_generators(series, L)[:, 0, 0].tolist()
    [(-0.1+0j), 0.5j]
    """
    driven = np.any(series.forced > 0, axis=1)[:, None, None]
    return np.asarray(np.where(driven, build_mean_turns(series), L.mean(axis=1)))


def find_effect_turns(stage: RungeKuttaStage, series: MeasuredRuns) -> Array:
    """jλ of the common turn λ that a point's effects give the waves in every step, as measured.

    λ = Im u†f/u†u, the mean of both rows: what a frequency that moves makes of a long run is many
    radians a step, which a rule of fourth order misses; taken exactly, it leaves the change of λ
    within the step. Driven runs keep their balance of commands, damping and split (see
    `find_steady_generators`).

    Parameters
    ----------
    stage
        At the rows.
    series
        The runs, R of n rows.

    Returns
    -------
    ndarray
        (R, n − 1, 2, 2) [1/s].

    Examples
    --------
    Nothing acts:

    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.slow_equation import find_effect_turns
    >>> series = SimpleNamespace(time_s=np.zeros((1, 4)))
    >>> find_effect_turns(SimpleNamespace(active=()), series).shape
    (1, 3, 2, 2)
    """
    runs, rows = series.time_s.shape
    rate = np.zeros((runs, rows))
    acting = [pair for pair in stage.active if pair[0].slow is not no_term]
    if acting:
        u = np.where(np.isfinite(series.envelope), series.envelope, 0.0)
        state = stage.make_state(u)
        force = sum(stage.compute_force(*pair, u, state) for pair in acting)
        size = np.sum(np.abs(u) ** 2, axis=-1)
        # of what has next to no amplitude a phase is none
        clear = (series.weight > 0) & (size > CLEAR_PART * size.max(axis=1, keepdims=True))
        clear &= ~np.any(series.forced > 0, axis=1)[:, None]
        turning = np.imag(np.sum(np.conj(u) * force, axis=-1))
        for k, good in enumerate(clear):
            if good.any():
                places = np.flatnonzero(good)
                rate[k] = np.interp(np.arange(rows), places, turning[k, good] / size[k, good])
    mean = (rate[:, 1:] + rate[:, :-1]) / 2
    return 1j * mean[..., None, None] * np.eye(2)


def _orders(series: MeasuredRuns, point: Point) -> tuple[Array, Array]:
    """L by plain averaging, and what the second order changes of it, (R, n, 2, 2)."""
    omega = 2 * np.pi * series.reference_frequency_hz + point.offset_rad_s[:, None]
    plain = coordinates.build_generator(np.append(point.p[:6], 0.0), series.rate_rad_s, 1.0)
    full = coordinates.build_generator(np.append(point.p[:6], 1.0), series.rate_rad_s, omega)
    return plain, point.p[coordinates.SECOND_ORDER] * (full - plain)


def find_strikes(series: MeasuredRuns, point: Point) -> list[tuple[float, float]]:
    """Instants at which effects of a point make the motion, or what one run shows of it, jump.

    Parameters
    ----------
    series
        The runs.
    point
        With its effects.

    Returns
    -------
    list of tuple
        Number of the run, `OF_EVERY_RUN` for all, and the instant [s], in the order of the effects.

    Examples
    --------
    A knock after 4 s:

    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli.effects import EFFECTS
    >>> from hrg_cli.fitting.causes.fit_point import Point
    >>> from hrg_cli.fitting.causes.measured_runs import MeasuredRuns
    >>> from hrg_cli.fitting.causes.slow_equation import find_strikes
    >>> needed = [f.name for f in fields(MeasuredRuns) if f.default is MISSING]
    >>> t, none = np.linspace(0.0, 10.0, 101)[None], np.zeros((1, 101))
    >>> series = MeasuredRuns(**dict.fromkeys(needed, none) | dict(
    ...     names=("left",), time_s=t, reference_frequency_hz=5e3, mode_number=2,
    ...     turn_rad_s=np.zeros(1), held_amplitude=none + np.nan,
    ... ))
    >>> knock = next(one for one in EFFECTS if one.slow_jump is not None)
    >>> values = {one.name: one.neutral for one in knock.parameters} | {"time_s": 4.0}
    >>> point = Point(np.zeros(7), np.ones((1, 2)), np.zeros(1), ((knock, values),))
    >>> find_strikes(series, point)
    [(-1.0, 4.0)]
    """
    state = build_state(series, point)
    found = []
    for effect, values in point.active:
        if effect.slow_jump is not None:
            instant = float(effect.slow_jump(values, state)[0])
        elif effect.of_one_run:
            instant = float(values[INSTANT])
        else:
            continue
        found.append((float(values.get(RUN, OF_EVERY_RUN)), instant))
    return found


def predict_jumps(
    series: MeasuredRuns, point: Point, effect: Effect, values: Mapping[str, float]
) -> Array:
    """What an effect adds to the envelopes within each step by a jump, as the row after it sees it.

    A row is the mean of its length, so the part r(t) of a jump that the row at t sees rises from 0
    to 1 within the row that holds the instant; a step brings the difference of its rows' parts,
    carried on from the instant by the resonator alone.

    Parameters
    ----------
    series
        The runs, R of n rows.
    point
        Of the resonator that carries the jump on.
    effect
        One with a `slow_jump`.
    values
        Of its parameters.

    Returns
    -------
    ndarray
        (R, n − 1, 2) complex.

    Examples
    --------
    A resonator without damping or splits keeps all of a knock at 4 s; the steps before the row of
    it have none:

    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli.effects import EFFECTS
    >>> from hrg_cli.fitting.causes.fit_point import Point
    >>> from hrg_cli.fitting.causes.measured_runs import MeasuredRuns
    >>> from hrg_cli.fitting.causes.slow_equation import predict_jumps
    >>> needed = [f.name for f in fields(MeasuredRuns) if f.default is MISSING]
    >>> t, none = np.linspace(0.0, 10.0, 101)[None], np.zeros((1, 101))
    >>> series = MeasuredRuns(**dict.fromkeys(needed, none) | dict(
    ...     names=("left",), time_s=t, reference_frequency_hz=5e3, mode_number=2,
    ...     turn_rad_s=np.zeros(1), held_amplitude=none + np.nan,
    ... ))
    >>> knock = next(one for one in EFFECTS if one.slow_jump is not None)
    >>> values = {one.name: 1e-3 for one in knock.parameters} | {"time_s": 4.0, "run": 0.0}
    >>> point = Point(np.zeros(7), np.ones((1, 2)), np.zeros(1))
    >>> jumps = predict_jumps(series, point, knock, values)
    >>> bool(np.all(jumps[0, :38] == 0) and np.all(jumps[0, 42:] == 0))
    True
    >>> np.abs(jumps.sum(axis=1)).round(9).tolist()
    [[0.001, 0.001]]
    """
    assert effect.slow_jump is not None
    instant, change = effect.slow_jump(values, build_state(series, point))
    t, h = series.time_s, series.step_s
    share = np.diff(find_part_after(t, instant), axis=1) * (h > 0)
    L = build_generators(series, point)[:, 1:]
    near = np.where(share != 0, t[:, 1:] - instant, 0.0)
    return share[..., None] * apply_generators(
        exponentiate(L, near), np.broadcast_to(change, (*share.shape, 2))
    )


def apply_generators(L: Array, u: Array) -> Array:
    """L u, row by row.

    Parameters
    ----------
    L
        (..., 2, 2).
    u
        (..., 2).

    Returns
    -------
    ndarray
        (..., 2).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.slow_equation import apply_generators
    >>> turning = np.array([[0.0, 0.5], [-0.5, 0.0]])
    >>> apply_generators(turning, np.array([[1.0, 0.0], [0.0, 1.0]])).tolist()
    [[0.0, -0.5], [0.5, 0.0]]
    """
    c, s = u[..., 0], u[..., 1]
    first = L[..., 0, 0] * c + L[..., 0, 1] * s
    out = np.empty((*first.shape, 2), first.dtype)  # np.stack costs more than the products
    out[..., 0], out[..., 1] = first, L[..., 1, 0] * c + L[..., 1, 1] * s
    return out
