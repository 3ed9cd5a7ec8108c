"""The slow model with effects: prediction of all runs side by side, its Jacobian, and Gauss–Newton over coordinates, runs and effects.

u' = L(p, Ω) u + jδ_r u + drive(u) + Σ effects' slow terms, measured through the effects' read-outs. The prediction is the
Runge–Kutta rule of fourth order over the rows; the Jacobian follows from the linearised equation along the prediction, so that any
number of sensitivities costs one sweep. The drive of a forced run is the logged command, turned to the wave's own direction and phase.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...effects.effect import Effect, frame
from ...physics.plant import SlowState
from ...physics.resonator import Mechanics
from ..envelopes import coordinates
from ..envelopes.coordinates import COUNT
from .colour import Colour
from .wave_frame import imaginary, real

Array = np.ndarray
CLEAR = 10.0
"""Amplitude over σ from which a row's phase is unwrapped."""
FOLLOWING = 10.0
"""Relaxations in a run by which a held amplitude is followed."""
OWN = 5
"""Parameters of a run's own: start state (4 reals) and frequency offset."""


@dataclass(frozen=True)
class Series:
    """Runs side by side (R, n), padded with weight 0: envelopes against one reference frequency and what the effects may look at."""

    names: tuple[str, ...]
    time_s: Array
    envelope: Array
    weight: Array
    rate_rad_s: Array
    temperature_degc: Array
    temperature_rate_degc_s: Array
    branch: Array
    table_angle_rad: Array
    phase_rad: Array
    main_drive: Array
    quadrature_drive: Array
    forced: Array
    held_amplitude: Array
    """Main amplitude that a drive without a log keeps up; NaN where the command is logged or the run is free."""
    held_slope: Array
    turn_rad_s: Array
    """Mean turn of every run's phase (R,), which the steps take exactly."""
    reference_frequency_hz: float
    mode_number: int
    has_temperature: bool = True
    free_phase: bool = False
    """Every row's phase is its own: what turns both channels together is neither fitted nor judged."""
    colour: Colour | None = None
    """Noise that wanders: residuals and sensitivities are whitened by it after σ."""

    @property
    def step_s(self) -> Array:
        """(R, n − 1), 0 where padded."""
        return np.diff(self.time_s, axis=1)

    def runs(self, index: Sequence[int]) -> Series:
        """Some of the runs."""
        index = list(index)
        cut = {f: getattr(self, f)[index] for f in _ARRAYS}
        colour = None if self.colour is None else self.colour.runs(index)
        return replace(self, names=tuple(self.names[i] for i in index), turn_rad_s=self.turn_rad_s[index], colour=colour, **cut)

    def middle(self) -> Series:
        """The same quantities in the middle of the steps, (R, n − 1)."""
        cut = {f: (getattr(self, f)[:, 1:] + getattr(self, f)[:, :-1]) / 2 for f in _ARRAYS if f not in ("branch", "forced")}
        h, rate = self.step_s, self.rate_rad_s
        mean = np.divide(np.diff(self.table_angle_rad, axis=1), h, out=cut["rate_rad_s"].copy(), where=h > 0)
        # Simpson's rule then turns by exactly the table's angle, however fast the rate changes within a step
        cut["rate_rad_s"] = (6 * mean - rate[:, 1:] - rate[:, :-1]) / 4
        return replace(self, branch=self.branch[:, :-1], forced=self.forced[:, :-1], **cut)


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
    "forced",
    "held_amplitude",
    "held_slope",
)

Active = tuple[tuple[Effect, Mapping[str, float]], ...]
"""Effects with all their parameters' values."""


@dataclass(frozen=True)
class Point:
    """Where a fit stands: coordinates (7,), the runs' start states (R, 2) and frequency offsets (R,), effects with values."""

    p: Array
    start: Array
    offset_rad_s: Array
    active: Active = ()


@dataclass(frozen=True)
class Prediction:
    """Envelopes at the rows before (`motion`) and after (`seen`) the read-out, (R, n, 2)."""

    series: Series
    point: Point
    motion: Array
    seen: Array

    def residual(self) -> Array:
        """Measured minus seen over σ as reals, (R, n, 4), linear in the phase however far it has run off.

        With ψ the phase between measured and seen, unwrapped: measured·e^{−jψ} − seen + jψ·seen, which is the plain difference for ψ → 0.
        """
        if self.series.free_phase:
            turn = np.exp(-1j * np.angle(np.sum(self.series.envelope * np.conj(self.seen), axis=-1)))
            left = real((self.series.envelope * turn[..., None] - self.seen) * self.series.weight[..., None])
            return self.whitened(left[..., None])[..., 0]
        psi = self.phase_error()[..., None]
        plain = real((self.series.envelope * np.exp(-1j * psi) - self.seen + 1j * psi * self.seen) * self.series.weight[..., None])
        return self.whitened(plain[..., None])[..., 0]

    def whitened(self, x: Array) -> Array:
        """Reals (R, n, 4, K) over σ as the fit weighs them: as they are, or through the filter of the noise's colour."""
        return x if self.series.colour is None else self.series.colour.whitened(x, self.seen)

    def uncoloured(self) -> Prediction:
        """The same with residuals over σ as they are."""
        return replace(self, series=replace(self.series, colour=None))

    def judged(self, change: Array) -> Array:
        """Changes (R, n, 4, K) over σ of what the fit judges: all of them, or all but a common turn of both channels."""
        change = change * self.series.weight[..., None, None]
        if not self.series.free_phase:
            return self.whitened(change)
        turned = real(1j * self.seen)
        size = np.sum(turned**2, axis=-1, keepdims=True)
        unit = turned / np.sqrt(np.where(size > 0, size, 1.0))
        left = change - unit[..., None] * np.einsum("rni,rnik->rnk", unit, change)[:, :, None, :]
        # what is a turn and nothing else leaves rounding, which scaled to unit length would look like a direction
        return self.whitened(left * (np.sum(left**2, axis=(0, 1, 2)) > 1e-12 * np.sum(change**2, axis=(0, 1, 2))))

    def phase_error(self) -> Array:
        """Phase of measured against seen, unwrapped along each run where the signal stands out of the noise, (R, n)."""
        overlap = np.sum(self.series.envelope * np.conj(self.seen), axis=-1)
        size = np.sqrt(np.sum(np.abs(self.seen) ** 2, axis=-1))
        clear = size * self.series.weight > CLEAR
        out = np.zeros(overlap.shape)
        for k, good in enumerate(clear):
            if good.any():
                rows = np.flatnonzero(good)
                out[k] = np.interp(np.arange(len(good)), rows, np.unwrap(np.angle(overlap[k, rows])))
        return np.where(np.abs(out).max(axis=1, keepdims=True) > 0.02, out, 0.0)


def mechanics(p: Array, series: Series) -> Mechanics:
    """The resonator of coordinates p at the reference frequency."""
    return coordinates.to_mechanics(p, series.reference_frequency_hz, series.mode_number)


def state_of(series: Series, point: Point) -> SlowState:
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
    )
    for effect, values in point.active:
        state = effect.slow_environment(values, state)
    return state


_SLICED = ("time_s", "temperature_degc", "temperature_rate_degc_s", "branch", "rate_rad_s", "table_angle_rad", "forced", "phase_rad")


class _Stage:
    """Everything beside L u at one set of instants: drive and effects; sliced from whole arrays for one Runge–Kutta stage."""

    def __init__(self, series: Series, point: Point) -> None:
        self.state = state_of(series, point)
        self.active = point.active
        self.driven = bool(np.any(series.forced))
        self.main, self.quadrature = series.main_drive, series.quadrature_drive
        self.holds = bool(np.any(np.isfinite(series.held_amplitude)))
        self.L = generators(series, point) if self.holds else np.empty((*series.time_s.shape, 0))
        self.held, self.held_slope = series.held_amplitude, series.held_slope
        self.follow_1_s = FOLLOWING / max(float(series.time_s.max() - series.time_s.min()), 1e-9)

    def at(self, k: int) -> _Stage:
        """The instants of column k, (R,)."""
        one = object.__new__(_Stage)
        state = object.__new__(SlowState)
        state.__dict__.update(self.state.__dict__)
        for name in _SLICED:
            state.__dict__[name] = getattr(self.state, name)[:, k]
        state.drive = self.state.drive[:, k]
        one.state, one.active, one.driven = state, self.active, self.driven
        one.main, one.quadrature, one.L = self.main[:, k], self.quadrature[:, k], self.L[:, k]
        one.holds, one.held, one.held_slope, one.follow_1_s = self.holds, self.held[:, k], self.held_slope[:, k], self.follow_1_s
        return one

    def drive(self, u: Array) -> Array:
        """Commanded force on the envelopes: e^{jφ}(a_ΦA e_A − j a_ΦB e_B); without a log, what holds the measured amplitude."""
        turn, e_A, e_B, a_A = frame(u, self.state.phase_rad)
        main = self.main
        if self.holds:
            loss = np.real(np.sum(times(self.L, u) * e_A, axis=-1) * np.conj(turn))
            main = np.where(np.isfinite(self.held), self.held_slope - loss + self.follow_1_s * (self.held - a_A), main)
        return turn[..., None] * (main[..., None] * e_A - 1j * self.quadrature[..., None] * e_B)

    def beside(self, u: Array) -> Array:
        """du/dt beside L u."""
        total = np.zeros_like(u)
        state = self.state
        if self.driven:
            state = copy.copy(state)
            state.drive = self.drive(u)
            total = total + state.drive
        for effect, values in self.active:
            total = total + effect.slow(values, u, state)
        return total

    def seen(self, u: Array) -> Array:
        """Through the read-outs."""
        state = self.state
        if self.driven:
            state = copy.copy(state)
            state.drive = self.drive(u)
        for effect, values in self.active:
            u = effect.slow_readout(values, u, state)
        return u

    @property
    def idle(self) -> bool:
        """Nothing acts beside L."""
        return not self.driven and not self.active


def generators(series: Series, point: Point) -> Array:
    """L (R, n, 2, 2) with the runs' frequency offsets beside their mean turn, which the steps take exactly."""
    omega = 2 * np.pi * series.reference_frequency_hz + point.offset_rad_s[:, None]
    plain = coordinates.generator(np.append(point.p[:6], 0.0), series.rate_rad_s, 1.0)
    full = coordinates.generator(np.append(point.p[:6], 1.0), series.rate_rad_s, omega)
    offset = 1j * (point.offset_rad_s - series.turn_rad_s)[:, None, None, None] * np.eye(2)
    return plain + point.p[6] * (full - plain) + offset


def times(L: Array, u: Array) -> Array:
    """L u over (..., 2, 2) and (..., 2)."""
    return (L * u[..., None, :]).sum(-1)


def predict(series: Series, point: Point) -> Prediction:
    """All runs from their start states by the Runge–Kutta rule of fourth order, each run's mean turn taken exactly (Lawson)."""
    h = series.step_s[..., None]
    turn = half_turns(series)[..., None]
    centre = series.middle()
    rows, halves = _Stage(series, point), _Stage(centre, point)
    L, M = generators(series, point), generators(centre, point)
    motion = np.empty(series.envelope.shape, complex)
    u = motion[:, 0] = point.start
    idle, ahead = rows.idle, None
    for k in range(h.shape[1]):
        step, E, before, mid, after = h[:, k], turn[:, k], L[:, k], M[:, k], L[:, k + 1]
        if idle:
            k1 = times(before, u)
            k2 = times(mid, E * (u + step / 2 * k1))
            k3 = times(mid, E * u + step / 2 * k2)
            k4 = times(after, E * (E * u + step * k3))
        else:
            a, b, c = ahead or rows.at(k), halves.at(k), rows.at(k + 1)
            ahead = c
            k1 = times(before, u) + a.beside(u)
            v = E * (u + step / 2 * k1)
            k2 = times(mid, v) + b.beside(v)
            v = E * u + step / 2 * k2
            k3 = times(mid, v) + b.beside(v)
            v = E * (E * u + step * k3)
            k4 = times(after, v) + c.beside(v)
        u = E * (E * (u + step / 6 * k1) + step / 3 * (k2 + k3)) + step / 6 * k4
        motion[:, k + 1] = u
    return Prediction(series, point, motion, rows.seen(motion))


def half_turns(series: Series) -> Array:
    """e^{jδh/2} of every step (R, n − 1), δ the run's mean turn."""
    return np.exp(0.5j * series.turn_rad_s[:, None] * series.step_s)


def real_matrix(L: Array) -> Array:
    """Complex (..., 2, 2) as the real (..., 4, 4) that acts on `real` vectors."""
    top = np.concatenate([L.real, -L.imag], axis=-1)
    return np.concatenate([top, np.concatenate([L.imag, L.real], axis=-1)], axis=-2)


def slope(function: object, u: Array) -> Array:
    """∂function/∂u as real (..., 4, 4) by central differences."""
    size = 1e-4 * np.maximum(np.sqrt(np.sum(np.abs(u) ** 2, -1, keepdims=True)), 1e-300)
    columns = []
    for unit in np.eye(4):
        step = size * imaginary(unit)
        columns.append(real((function(u + step) - function(u - step)) / (2 * size)))  # type: ignore[operator]
    return np.stack(columns, axis=-1)


@dataclass(frozen=True)
class Propagation:
    """The linearised flow along a prediction: step propagators (R, n−1, 4, 4), read-out slope (R, n, 4, 4), motion at rows and middles."""

    prediction: Prediction
    centre: Series
    middle: Array
    step: Array
    half: Array
    view: Array | None

    def carried(self, at_rows: Array, at_middle: Array, start: Array | None = None) -> Array:
        """Changes (R, n, 4, K) of the motion by source terms (R, n, 4, K), (R, n−1, 4, K) in u' and changes of the start (R, 4, K)."""
        h = self.prediction.series.step_s[..., None, None]
        source = h / 6 * (self.step @ at_rows[:, :-1] + 4 * self.half @ at_middle + at_rows[:, 1:])
        out = np.zeros(at_rows.shape)
        if start is not None:
            out[:, 0] = start
        for k in range(source.shape[1]):
            out[:, k + 1] = self.step[:, k] @ out[:, k] + source[:, k]
        return out

    def seen(self, change: Array) -> Array:
        """Through the read-out's slope and over σ, (R, n, 4, K)."""
        if self.view is not None:
            change = self.view @ change
        return self.prediction.judged(change)


def propagation(prediction: Prediction) -> Propagation:
    """The linearised flow along a prediction."""
    series, point, u = prediction.series, prediction.point, prediction.motion
    centre = series.middle()
    h = series.step_s[..., None, None]
    L, M = generators(series, point), generators(centre, point)
    rows, halves = _Stage(series, point), _Stage(centre, point)
    slope_rows = times(L, u) + rows.beside(u)
    hh, E = series.step_s[..., None], half_turns(series)[..., None]
    middle = (np.conj(E) * u[:, 1:] + E * u[:, :-1]) / 2 + hh / 8 * (E * slope_rows[:, :-1] - np.conj(E) * slope_rows[:, 1:])
    A, B = real_matrix(L), real_matrix(M)
    view = None
    if not rows.idle:
        A, B = A + slope(rows.beside, u), B + slope(halves.beside, middle)
        view = slope(rows.seen, u)
    eye = np.eye(4)

    def flow(first: Array, mid: Array, last: Array, h: Array) -> Array:
        E = real_matrix(np.exp(0.5j * series.turn_rad_s[:, None, None, None] * h) * np.eye(2))
        k1 = first
        k2 = mid @ E @ (eye + h / 2 * k1)
        k3 = mid @ (E + h / 2 * k2)
        k4 = last @ E @ (E + h * k3)
        return E @ (E @ (eye + h / 6 * k1) + h / 3 * (k2 + k3)) + h / 6 * k4

    step = flow(A[:, :-1], B, A[:, 1:], h)
    half = flow(B, (B + A[:, 1:]) / 2, A[:, 1:], h / 2)
    return Propagation(prediction, centre, middle, step, half, view)


def base_sensitivities(flow: Propagation) -> tuple[Array, Array]:
    """Over σ: of the shared coordinates (R, n, 4, 7), and of each run's own start state and frequency (R, n, 4, 5)."""
    prediction = flow.prediction
    point, series = prediction.point, prediction.series
    u, v = prediction.motion, flow.middle

    def sources(series: Series, u: Array) -> Array:
        omega = 2 * np.pi * series.reference_frequency_hz + point.offset_rad_s[:, None]
        plain = coordinates.generator(np.append(point.p[:6], 0.0), series.rate_rad_s, 1.0)
        full = coordinates.generator(np.append(point.p[:6], 1.0), series.rate_rad_s, omega)
        turning = series.rate_rad_s[..., None] * np.stack([u[..., 1], -u[..., 0]], -1)
        columns = [times(b, u) for b in coordinates.BASIS] + [turning, times(full - plain, u), 1j * u]
        held = np.isfinite(series.held_amplitude)
        if held.any():
            # the drive makes up for what the resonator loses along the wave, whatever its parameters
            turn, e_A, _, _ = frame(u, series.phase_rad)
            for c in columns:
                c -= (held * np.real(np.sum(c * e_A, axis=-1) * np.conj(turn)) * turn)[..., None] * e_A
        return np.stack([real(c) for c in columns], axis=-1)

    runs = len(series.names)
    start = np.zeros((runs, 4, COUNT + 1 + 4))
    start[:, :, COUNT + 1 :] = np.eye(4)
    rows, mids = sources(series, u), sources(flow.centre, v)
    pad = [(0, 0)] * 3 + [(0, 4)]
    carried = flow.seen(flow.carried(np.pad(rows, pad), np.pad(mids, pad), start))
    own = np.concatenate([carried[..., COUNT + 1 :], carried[..., COUNT : COUNT + 1]], axis=-1)
    return carried[..., :COUNT], own


def effect_sources(
    flow: Propagation, effect: Effect, values: Mapping[str, float], steps: Mapping[str, float]
) -> tuple[Array, Array, Array]:
    """An effect's terms by its fitted parameters (those in `steps`): sources at rows and middles, direct changes; (R, n, 4, K).

    `values`: where it stands (neutral for one that is not active). Differences are forward from a neutral value, else central.
    """
    prediction = flow.prediction
    point, u = prediction.point, prediction.motion
    others = tuple(pair for pair in point.active if pair[0].name != effect.name)

    def terms(changed: Mapping[str, float]) -> tuple[Array, Array, Array]:
        moved = replace(point, active=(*others, (effect, changed)))
        rows, halves = _Stage(prediction.series, moved), _Stage(flow.centre, moved)
        return rows.beside(u), halves.beside(flow.middle), rows.seen(u)

    columns = []
    here: tuple[Array, Array, Array] | None = None
    for name, size in steps.items():
        up, down = dict(values), dict(values)
        up[name] += size
        if values[name] == next(p.neutral for p in effect.parameters if p.name == name):
            low = here = here or terms(values)
        else:
            down[name] -= size
            low = terms(down)
        span = up[name] - down[name]
        high = terms(up)
        columns.append([real(a - b) / span for a, b in zip(high, low, strict=True)])
    first, second, third = ([c[i] for c in columns] for i in range(3))
    return np.stack(first, -1), np.stack(second, -1), np.stack(third, -1)


def effect_sensitivity(flow: Propagation, effect: Effect, values: Mapping[str, float], steps: Mapping[str, float]) -> Array:
    """Over σ, (R, n, 4, K)."""
    rows, mids, direct = effect_sources(flow, effect, values, steps)
    direct = flow.prediction.judged(direct)
    if not rows.any() and not mids.any():
        return direct
    return flow.seen(flow.carried(rows, mids)) + direct
