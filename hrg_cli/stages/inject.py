"""inject: effects of the catalogue hidden in a recording, measured or simulated, to see whether a
diagnosis finds them there.

Of the read-out an effect acts on the samples themselves, by its own fast term; what it needs to
know of the oscillation (its quadrature, its phase) is the demodulated envelope's, at the
recording's own frequency, and displacements count from each channel's mean position. Of the motion
an effect acts through the slow model of the identified resonator, integrated along the run with and
without the effect from the same start: u₁ = T u₀, T (2, 2) complex as a function of time, by which
the analytic signal of the samples is multiplied. So noise, harmonics and all that the model does
not know stay as they were measured. What an effect does to the logs, it does to the recording's.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from .. import effects as catalogue
from ..effects.effect import Effect, frame, nothing
from ..errors import HrgError
from ..fitting.causes import extended, extended_fit
from ..fitting.causes.extended import MeasuredRuns, Point
from ..fitting.causes.extended_fit import CoordinatePriors
from ..fitting.envelopes.base_fit import nominal_scale_factor
from ..fitting.envelopes.coordinates import COUNT, from_mechanics
from ..fitting.envelopes.envelope_runs import envelopes_of
from ..physics.plant import Environment, Readout, Samples
from ..physics.resonator import exponential
from ..records import Recording, Resonator, Wave, collect
from .demodulate import demodulate
from .diagnosis.data import freedom_of, prepare
from .estimate import estimate
from .planning.known import mechanics_of

Array = np.ndarray
ROWS = 1500
"""Rows of the slow model along the run."""
FEWEST = 8
"""Windows without which there is no envelope."""
KNOWN = 0.05
"""Relative standard deviation up to which a run shows the scale factor."""
NOTHING = 1e-12
"""Part of the signal below which an effect did nothing."""
Hidden = tuple[Effect, dict[str, float]]
ChangeAt = Callable[[Array], Array]
"""Times (n,) -> T (n, 2, 2)."""


class UnchangedError(HrgError):
    """The effects do nothing in this recording."""


def inject(
    recording: Recording,
    resonator: Resonator | None = None,
    extra_effects: Sequence[Effect] = (),
    *,
    effects: Annotated[
        dict[str, dict[str, float]], Field(description="effects to hide, each with its parameters")
    ] = {},  # noqa: B006
    periods_per_window: Annotated[
        float, Field(gt=0, description="oscillation periods per window of the envelope")
    ] = 4.0,
    block_samples: Annotated[
        int, Field(ge=1, description="samples worked on at once; they do not depend on it")
    ] = 1 << 20,
) -> Iterator[Recording]:
    """The recording with effects hidden in it, as a stream of blocks; memory does not grow with the
    samples.

    resonator: that of the motion; fitted to this run where it is not given. HrgError: an unknown
    effect or parameter, values that do nothing in this recording, a read-out by carrier.
    """
    name = f"run {recording.run_id}" if recording.run_id else "the recording"
    hidden = _choose_effects(effects, extra_effects)
    if recording.readout != "direct":
        raise HrgError(
            f"{name}: its read-out is {recording.readout}, samples of a direct read-out were"
            " expected; demodulate the carrier first"
        )
    warm = [e.name for e, _ in hidden if e.follows_temperature or "temperature cycle" in e.shown_by]
    if warm and recording.temperature_degc is None:
        raise HrgError(
            f"{name}: has no temperature log, {', '.join(warm)} need{'s' * (len(warm) == 1)} one;"
            " add it at the import"
        )
    wave = collect(estimate(collect(demodulate(recording, periods_per_window=periods_per_window))))
    moving = [(effect, p) for effect, p in hidden if _moves(effect)]
    change = _change(wave, moving, resonator) if moving else None
    pickoff = Readout()
    for effect, p in hidden:
        effect.readout(p, pickoff)
    return _Injection(
        recording, wave, change, pickoff, _logs(recording, hidden), bool(moving), name
    ).blocks(block_samples)


def summary(record: Recording) -> dict[str, Any]:
    """The stage's part of the JSON."""
    settings = (
        tomllib.loads(record.provenance.settings).get("inject", {})
        if record.provenance.settings
        else {}
    )
    return {
        "run_id": record.run_id,
        "gyro_id": record.gyro_id,
        "samples": len(record),
        "effects": settings.get("effects", {}),
    }


def _choose_effects(
    effects: Mapping[str, Mapping[str, float]], extra_effects: Sequence[Effect]
) -> list[Hidden]:
    """The effects with all their parameters; one that is given nothing but neutral values is a
    mistake."""
    if not effects:
        raise HrgError(
            "no effect is named; `hrg effects` lists them, add --effect NAME --set PARAMETER=VALUE"
        )
    hidden = []
    for name, given in effects.items():
        effect = catalogue.find(name, (*extra_effects, *catalogue.EFFECTS))
        values = effect.values(given)
        if all(
            values[p.name] == p.neutral
            for p in effect.parameters
            if p.fitted or p.name not in given
        ):
            sizes = effect.fitted() or effect.parameters
            own = ", ".join(f"{p.name} [{p.units}]" for p in sizes)
            raise HrgError(f"effects.{name}: does nothing with the values given; set one of {own}")
        hidden.append((effect, values))
    return hidden


def _moves(effect: Effect) -> bool:
    """Whether it acts on the motion: it has a term there, or no fast term at all, so that its slow
    terms say all of it."""
    on_motion = any(
        term is not nothing for term in (effect.environment, effect.plant, effect.control)
    )
    return on_motion or effect.readout is nothing


def _change(wave: Wave, moving: Sequence[Hidden], resonator: Resonator | None) -> ChangeAt:
    """T of the motion with the effects, through the rows of the slow model; what jumps, jumps from
    the wave as it was measured."""
    series, point = _model(wave, resonator)
    smooth = tuple((effect, p) for effect, p in moving if effect.slow_jump is None)
    changes = []
    if smooth:
        t = series.time_s[0]
        changes.append(
            _ratio(t, _motion(series, replace(point, active=smooth)), _motion(series, point))
        )
    state = extended.state_of(series, point)
    jumps = [effect.slow_jump(p, state) for effect, p in moving if effect.slow_jump is not None]
    measured = _oscillation(wave).spline
    for instant, jump in sorted(
        ((float(at), np.reshape(change, 2)) for at, change in jumps), key=lambda one: one[0]
    ):
        if series.time_s[0, 0] < instant < series.time_s[0, -2]:
            before = _product(changes, np.array([instant]))[0] @ measured(np.array([instant]))[0]
            changes.append(
                _after(series, replace(point, active=smooth), instant, before, before + jump)
            )
    return partial(_product, changes)


def _product(changes: Sequence[ChangeAt], times: Array) -> Array:
    """One change after another, (n, 2, 2)."""
    out = np.broadcast_to(np.eye(2, dtype=complex), (len(times), 2, 2))
    for change in changes:
        out = change(times) @ out
    return out


def _motion(series: MeasuredRuns, point: Point) -> Array:
    """Envelopes (n, 2) of the one run as the model has them. HrgError: they have no end."""
    with np.errstate(over="ignore", invalid="ignore"):
        seen = extended.predict(series, point).seen[0]
    if not np.all(np.isfinite(seen)):
        raise HrgError(
            f"{', '.join(e.name for e, _ in point.active)}: the motion has no end with these"
            " values; give smaller ones"
        )
    return seen


def _ratio(t: Array, changed: Array, plain: Array) -> ChangeAt:
    """T of the envelopes `changed` = T `plain` (n, 2) at times t, smooth in between."""
    from scipy.interpolate import CubicSpline

    spline: ChangeAt = CubicSpline(t, _whole(changed) @ np.linalg.inv(_whole(plain)))
    return spline


def _after(
    series: MeasuredRuns, point: Point, instant: float, plain: Array, changed: Array
) -> ChangeAt:
    """T from an instant on, at which the envelopes `plain` (2,) become `changed`; the identity
    before."""
    first = int(np.searchsorted(series.time_s[0], instant))
    rest = series.later(first)
    L = extended.generators(series, point)[0, first] + 1j * series.turn_rad_s[0] * np.eye(2)
    carry = exponential(L, rest.time_s[0, 0] - instant)
    ends = [
        np.concatenate([[u], _motion(rest, replace(point, start=(carry @ u)[None]))])
        for u in (changed, plain)
    ]
    late = _ratio(np.concatenate([[instant], rest.time_s[0]]), *ends)

    def at(times: Array) -> Array:
        return np.where((times >= instant)[:, None, None], late(times), np.eye(2))

    return at


def _model(wave: Wave, resonator: Resonator | None) -> tuple[MeasuredRuns, Point]:
    """The run's rows and the slow model's start in them; the resonator is given, or fitted to this
    run.

    A run that does not show the scale factor (no rate, or a constant one) has the nominal one.
    """
    scale = None
    if resonator is not None:
        if resonator.mode_number != wave.mode_number:
            raise HrgError(
                f"the resonator has mode_number {resonator.mode_number}, the recording"
                f" {wave.mode_number}; use one of the same"
            )
        scale = mechanics_of(resonator).scale_factor
    series, point, _ = prepare([wave], scale, ROWS)
    free = freedom_of(series, point, scale)
    if resonator is not None:
        p = from_mechanics(mechanics_of(resonator))
        point, free = replace(point, p=p), CoordinatePriors(p, np.zeros(COUNT))
    try:
        fit = extended_fit.fit(series, point, free)
        if resonator is None and not fit.coordinate_std("scale_factor") < KNOWN * abs(
            fit.coordinate("scale_factor")
        ):
            nominal = nominal_scale_factor(wave.mode_number)
            fit = extended_fit.fit(series, point, free.holding("scale_factor", nominal))
        return series, fit.point
    except extended_fit.DivergedError as error:
        raise HrgError(
            f"the slow model finds no fit to this run ({error}); give a --resonator that was"
            " identified from better ones"
        ) from error


def _whole(u: Array) -> Array:
    """Envelopes u (n, 2) with their companion, (n, 2, 2): e^{jφ}[e_A, e_B][[a, −jb], [−jb, a]],
    which no ellipse makes singular."""
    turn, e_A, e_B, _ = frame(u, 0.0)
    a, b = (np.sum(u * e, axis=-1) * np.conj(turn) for e in (e_A, e_B))
    companion = turn[:, None] * (b[:, None] * e_A + a[:, None] * e_B)
    return np.stack([u, companion], axis=-1)


def _logs(recording: Recording, hidden: Sequence[Hidden]) -> dict[str, Array]:
    """The logs as the effects leave them."""
    t = recording.auxiliary_time_s
    if t is None or len(t) < 2:
        return {}
    t = np.asarray(t, float)
    logs = {
        name: None if (log := getattr(recording, name)) is None else np.asarray(log, float)
        for name in ("temperature_degc", "rate_rad_s")
    }
    T, rate = (np.zeros(len(t)) if log is None else log for log in logs.values())
    world = Environment(t, T.copy(), rate.copy(), T.copy(), rate.copy())
    for effect, p in hidden:
        effect.environment(p, world)
    made = {
        "temperature_degc": world.logged_temperature_degc,
        "rate_rad_s": world.logged_rate_rad_s,
    }
    return {
        name: made[name]
        for name, log in logs.items()
        if log is not None and np.any(made[name] != log)
    }


@dataclass(frozen=True)
class _Oscillation:
    """The envelopes u(t) of a run against its reference frequency, smooth between the windows."""

    spline: Callable[[Array], Array]
    omega_r: float

    def at(self, t: Array) -> Array:
        """Analytic signal u e^{jω_r t} (n, 2)."""
        return self.spline(t) * np.exp(1j * self.omega_r * t)[:, None]


def _oscillation(wave: Wave) -> _Oscillation:
    from scipy.interpolate import CubicSpline

    u = envelopes_of(wave)
    good = np.isfinite(u).all(axis=-1)
    if np.count_nonzero(good) < FEWEST:
        found = f"{np.count_nonzero(good)} windows show the oscillation"
        raise HrgError(
            f"run {wave.run_id or '?'}: {found}, at least {FEWEST} are needed; give a longer record"
        )
    return _Oscillation(
        CubicSpline(wave.time_s[good], u[good]), 2 * np.pi * wave.reference_frequency_hz
    )


@dataclass
class _Injection:
    """What is done to every block of samples."""

    recording: Recording
    wave: Wave
    change: ChangeAt | None
    pickoff: Readout
    logs: Mapping[str, Array]
    moved: bool
    name: str

    def blocks(self, rows: int) -> Iterator[Recording]:
        """The recording block by block."""
        source, oscillation = self.recording, _oscillation(self.wave)
        offset = self._mean_position(oscillation, rows)
        last, size, altered, clipped, removed = (
            None,
            0.0,
            bool(self.logs) or self.pickoff.clock_error != 0,
            0,
            0,
        )
        for first in range(0, len(source.c), rows):
            t = source.times(first, first + rows)
            y = np.stack(source.physical(first, first + rows)) - offset[:, None]
            seen = self._seen(t, y, oscillation)
            size = max(size, float(np.nanmax(np.abs(y), initial=0.0)))
            altered = altered or bool(np.nanmax(np.abs(seen - y), initial=0.0) > NOTHING * size)
            raw, cut = self._raw(seen + offset[:, None])
            clipped += cut
            keep, shift = self._kept(t, first)
            removed += int(np.count_nonzero(~keep))
            if last is not None:
                yield last
            last = self._block(t + shift, raw, keep, first == 0)
        if last is None or not (altered or removed):
            raise UnchangedError(
                f"{self.name}: the effects do nothing in it (a free run has no drive, a constant"
                " temperature no ramp); see `hrg effects`"
            )
        yield last.judged(
            [f"{clipped} samples lay beyond the range of {source.c.dtype} and were clipped to it"]
            if clipped
            else []
        )

    def _seen(self, t: Array, y: Array, oscillation: _Oscillation) -> Array:
        """Samples (2, n) about their mean position with the effects in them."""
        q = oscillation.at(t)
        if self.change is not None:
            moved = np.einsum("nij,nj->ni", self.change(t), q)
            y, q = y + np.real(moved - q).T, moved
        drive = self._drive(t, q)
        logs = [
            self._log(name, t, 25.0 if name == "temperature_degc" else 0.0)
            for name in ("temperature_degc", "rate_rad_s")
        ]
        block = Samples(t, q.real.T, -q.imag.T, drive, logs[0], logs[1])
        for step in (*self.pickoff.steps, *self.pickoff.after):
            y = step(block, y)
        return y

    def _drive(self, t: Array, q: Array) -> Array:
        """Commanded force on the envelopes turned to the instant, (2, n)."""
        turn, e_A, e_B, _ = frame(q, 0.0)
        main, quadrature = self._log("drive_main", t, 0.0), self._log("drive_quadrature", t, 0.0)
        return (turn[:, None] * (main[:, None] * e_A - 1j * quadrature[:, None] * e_B)).T

    def _log(self, name: str, t: Array, absent: float) -> Array:
        values = getattr(self.recording, name)
        if values is None or self.recording.auxiliary_time_s is None:
            return np.full(len(t), absent)
        at, values = np.asarray(self.recording.auxiliary_time_s, float), np.asarray(values, float)
        good = np.isfinite(at) & np.isfinite(values)
        return np.interp(t, at[good], values[good]) if good.any() else np.full(len(t), absent)

    def _mean_position(self, oscillation: _Oscillation, rows: int) -> Array:
        """What stands beside the oscillation in each channel, (2,)."""
        total, count = np.zeros(2), np.zeros(2)
        for first in range(0, len(self.recording.c), rows):
            t = self.recording.times(first, first + rows)
            beside = (
                np.stack(self.recording.physical(first, first + rows)) - oscillation.at(t).real.T
            )
            total += np.nansum(beside, axis=1)
            count += np.count_nonzero(np.isfinite(beside), axis=1)
        return total / np.maximum(count, 1)

    def _raw(self, y: Array) -> tuple[list[Array], int]:
        """Both channels as the recording keeps them, and how many integers had to be clipped."""
        out, clipped = [], 0
        of = self.recording
        for values, channel, scale, offset in (
            (y[0], of.c, of.c_scale_factor, of.c_add_offset),
            (y[1], of.s, of.s_scale_factor, of.s_add_offset),
        ):
            raw = (values - offset) / scale
            dtype = channel.dtype
            if dtype.kind in "iu":
                limits = np.iinfo(dtype)
                raw = np.rint(raw)
                clipped += int(np.count_nonzero((raw < limits.min) | (raw > limits.max)))
                raw = np.clip(raw, limits.min, limits.max)
            out.append(raw.astype(dtype))
        return out, clipped

    def _kept(self, t: Array, first: int) -> tuple[Array, Array]:
        """Which samples are not lost (n,), and by how much the times of those after a loss are
        moved, the gap being closed up."""
        keep, shift = np.ones(len(t), bool), np.zeros(len(t))
        rate = self.recording.sample_rate_hz
        for time_s, lost_s in self.pickoff.dropped:
            if self.recording.time_s is None:
                assert rate is not None
                number, begin = first + np.arange(len(t)), round(time_s * rate)
                keep &= ~((number >= begin) & (number < begin + round(lost_s * rate)))
            else:
                keep &= ~((t >= time_s) & (t < time_s + lost_s))
                shift -= lost_s * (t >= time_s + lost_s)
        return keep, shift

    def _block(self, t: Array, raw: Sequence[Array], keep: Array, first: bool) -> Recording:
        """The block as a record; the log's rows stand in the first one. The truth of a simulation
        is none for a changed motion."""
        of, clock = self.recording, 1 + self.pickoff.clock_error
        fields: dict[str, Any] = {
            "c": raw[0][keep],
            "s": raw[1][keep],
            "time_s": None if of.time_s is None else t[keep] / clock,
        }
        if of.sample_rate_hz is not None:
            fields["sample_rate_hz"] = of.sample_rate_hz * clock
        for name, spec in of.columns().items():
            if (
                spec.dims
                and spec.dims[0] in ("auxiliary_row", "truth_row")
                and getattr(of, name) is not None
            ):
                values = np.asarray(self.logs.get(name, getattr(of, name)))
                values = values / clock if name in ("auxiliary_time_s", "truth_time_s") else values
                fields[name] = values if first else values[:0]
                if spec.dims[0] == "truth_row" and self.moved:
                    fields[name] = None
        return of.replace(**fields)
