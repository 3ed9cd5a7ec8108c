"""Diagnosis, jumps: where the wave of one run does not go on as it went before.

The two circular parts z± = (C ± jS)/√2 of the envelopes turn each at a rate of its own and change
slowly beside that, at any angle and any quadrature (near a circle, where φ and mθ cannot be told
apart, both bend and z± do not). A jump is what one smooth course of z± on either side of an instant
leaves between them. Lost samples turn both parts alike; a knock does not.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from ....fitting.envelopes.envelope_runs import compute_envelopes, integrate_rate
from ....fitting.least_squares import fit_columns, invert_scaled
from ....fitting.samples.neighbours import find_local_median
from ....records import Array, Wave
from ..thresholds import JUMP_SIGMA, SKEWED

NEIGHBOURS = 12
TOUCHED = 6
"""Windows on either side of a jump whose demodulation used the other side's slope."""
MOST_PLACES = 16
"""Places of a run that are looked at: a rate that changes makes some where nothing jumps."""
MOST_A_RUN = 5
"""More jumps than this are no instants: something else moves the wave."""
CORE, PART = 2, 0.1
"""Steps on either side of the largest that belong to the same jump, and part of it that they then
have."""
SPOILT = 1e-3
"""Part of a jump to which the motion on either side of it is known: its neighbours were fitted with
a slope across it."""
MOST_SCALE_FACTOR = 2.0
"""Greatest |K| of a run that is looked for: the nominal one is at most 1."""
CURVED = 1e-3
"""Turn of the table beside a constant rate from which it is looked at [rad]."""
UNFOLLOWED = 2e-3
"""Part of what the table turns beside a constant rate that the carried course may miss: the windows
are means, and splits turn with the wave within a step."""
BENT = 0.25
"""Part of what the bends of the course do to a jump to which they are not known."""
AT_ONCE = 0.5
"""Part of a jump that the rows next to it must show: a bend that the two sides do not follow looks
like a step between them, and is none there."""


@dataclass(frozen=True)
class EnvelopeJump:
    """A jump of one wave: last row before and first row after it, instant, common turn with σ, what
    is left beside it (C, S) and its σ.

    `shift_s`: time by which the slow motion moved on, taken out of the rest, with its σ: known
    where the wave turns or dies fast enough.
    """

    before: int
    after: int
    time_s: float
    turn_rad: float
    turn_std_rad: float
    rest: Array
    rest_std: float
    shift_s: float
    shift_std_s: float
    rate_rad_s: float
    """Common turn per second about the jump, against the reference frequency."""

    @property
    def alike(self) -> bool:
        """Whether both channels turned alike and did nothing else."""
        return (
            abs(self.turn_rad) > JUMP_SIGMA * self.turn_std_rad
            and float(np.abs(self.rest).max()) <= JUMP_SIGMA * self.rest_std
        )

    @property
    def knock(self) -> bool:
        """Whether the wave was changed in another way."""
        return float(np.abs(self.rest).max()) > JUMP_SIGMA * self.rest_std


def find_jumps(wave: Wave) -> list[EnvelopeJump]:
    """Jumps of a wave in order of time.

    Parameters
    ----------
    wave
        Of a run.

    Returns
    -------
    list of EnvelopeJump
        None where there are too many for instants.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.jumps import find_jumps
    >>> wave = draw_waves()[0]
    >>> struck = wave.replace(wave_angle_rad=wave.wave_angle_rad + 0.1 * (np.arange(50) > 24))
    >>> [(jump.before, jump.after) for jump in find_jumps(struck)], find_jumps(wave)
    ([(24, 25)], [])
    """
    rows = np.flatnonzero(wave.good() & np.isfinite(wave.phase_rad))
    if len(rows) < 4 * NEIGHBOURS:
        return []
    time = np.asarray(wave.time_s, float)[rows]
    u = compute_envelopes(wave, rows)
    noise = np.asarray(wave.signal_std, float)[rows]
    z = to_circular(u)
    step = np.diff(time)
    running = partial(find_local_median, reach=NEIGHBOURS)
    rate = np.stack([running(np.angle(p[1:] * np.conj(p[:-1])) / step) for p in z.T], axis=-1)
    change = z[1:] * np.exp(-1j * rate * step[:, None]) - z[:-1]
    change -= np.stack([running(c.real) + 1j * running(c.imag) for c in change.T], axis=-1)
    size = np.abs(change)
    usual = np.maximum(
        1.4826 * np.median(size, axis=0),
        np.sqrt(2) * float(np.median(noise[np.isfinite(noise)], axis=0)),
    )
    places = _peaks((size / usual).max(axis=1))
    table = _turned(wave, rows)
    tried = (_find_jump_between(time, z, noise, table, first, last, rows) for first, last in places)
    found = [jump for jump in tried if jump is not None]
    return found if len(found) <= MOST_A_RUN else []


def _peaks(height: Array) -> list[tuple[int, int]]:
    """Steps (first row, last row) that stand out, the highest first; what a jump does to its
    neighbours' fits is not looked at again."""
    left, out = height.copy(), list[tuple[int, int]]()
    while len(out) < MOST_PLACES and len(left) and left.max() > JUMP_SIGMA:
        top = int(np.argmax(left))
        near = np.arange(max(0, top - CORE), min(len(left), top + CORE + 1))
        core = near[height[near] > PART * height[top]]
        out.append((int(core[0]), int(core[-1]) + 1))
        left[max(0, top - 2 * TOUCHED) : top + 2 * TOUCHED + 1] = 0.0
    return sorted(out)


def to_circular(u: Array) -> Array:
    """The parts of envelopes that a rotation only turns: (C + jS, C − jS)/√2.

    Parameters
    ----------
    u
        Envelopes of C and S, (n, 2).

    Returns
    -------
    ndarray
        z₊ and z₋, (n, 2).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.samples.jumps import to_circular
    >>> to_circular(np.array([[1.0, 1j]])).round(6).tolist()
    [[0j, (1.414214+0j)]]
    """
    return np.stack([u[:, 0] + 1j * u[:, 1], u[:, 0] - 1j * u[:, 1]], axis=-1) / np.sqrt(2)


def _turned(wave: Wave, rows: Array) -> Array:
    """The table's angle at the rows, by the logged rate; nought where none is logged."""
    rate = wave.rate_rad_s
    return integrate_rate(
        np.asarray(wave.time_s, float)[rows],
        None if rate is None else np.asarray(rate, float)[rows],
    )


def _find_jump_between(
    time: Array, z: Array, noise: Array, table: Array, first: int, last: int, rows: Array
) -> EnvelopeJump | None:
    """The jump between rows `first` and `last` of the good ones; None where it is none or the run
    begins or ends there. table: its angle at the rows."""
    seen = Crossing.from_rows(time, z, noise, table, first, last)
    if seen is None or not seen.jumps:
        return None
    size = float(np.sqrt(np.sum(np.abs(seen.before) ** 2)))
    rate = float(np.sum(seen.slope * np.conj(seen.before)).imag) / size**2
    slope = seen.slope - 1j * rate * seen.before  # without the oscillation, which the turn is
    turn, shift = float(np.angle(np.sum(seen.after * np.conj(seen.before)))), 0.0
    # the wall of neighbouring windows, fitted across the jump, spoils the two sides by a part of it
    wall = float(np.sqrt(np.sum(np.abs(seen.after - seen.before) ** 2)))
    doubt = float(np.hypot(seen.std, SPOILT * wall))
    speed = float(np.sqrt(np.sum(np.abs(slope) ** 2)))
    rest = seen.after - seen.before * np.exp(1j * turn)
    if speed * seen.length_s > doubt:
        moved = slope * np.exp(1j * turn)
        shift = float(np.sum(rest * np.conj(moved)).real) / speed**2
        rest = rest - shift * moved
    linear = np.array([rest[0] + rest[1], (rest[0] - rest[1]) / 1j]) / np.sqrt(2)
    return EnvelopeJump(
        before=int(rows[first]),
        after=int(rows[last]),
        time_s=float(time[first] + time[last]) / 2,
        turn_rad=turn,
        turn_std_rad=seen.std / size,
        rest=linear,
        rest_std=doubt,
        shift_s=shift,
        shift_std_s=doubt / speed if speed > 0 else np.inf,
        rate_rad_s=rate,
    )


@dataclass(frozen=True)
class Crossing:
    """z± (2,) at an instant as the rows before it and as those behind it have them, ż before it,
    the σ of their difference, what the two rows next to it differ by, and the length of all
    rows."""

    before: Array
    after: Array
    slope: Array
    std: float
    across: Array
    length_s: float

    @property
    def jumps(self) -> bool:
        """Whether the two sides differ by more than noise, and at once."""
        step = float(np.abs(self.after - self.before).max())
        return step > JUMP_SIGMA * self.std and float(np.abs(self.across).max()) >= AT_ONCE * step

    @classmethod
    def from_rows(
        cls, time: Array, z: Array, noise: Array, table: Array, first: int, last: int
    ) -> Crossing | None:
        """Every row is carried to the instant along the run's own motion, where it stands still but
        for what this misses; None where the run begins or ends."""
        left = np.arange(max(0, first + 1 - TOUCHED - 2 * NEIGHBOURS), max(0, first + 1 - TOUCHED))
        right = np.arange(
            min(len(time), last + TOUCHED), min(len(time), last + TOUCHED + 2 * NEIGHBOURS)
        )
        if len(left) < NEIGHBOURS or len(right) < NEIGHBOURS:
            return None
        near = np.concatenate([left, right])
        span = slice(near[0], near[-1] + 1)
        middle = float(time[first] + time[last]) / 2
        x = time[near] - middle
        unit, here = x / np.ptp(x), (x > 0).astype(float)
        curved = table[near] - np.polyval(np.polyfit(x, table[near], 1), x)
        design = np.column_stack([np.ones(len(x)), unit, unit**2, here, here * unit])
        if np.ptp(curved) > CURVED:
            design = np.column_stack([design, curved])
        else:  # a constant rate is a part of the motion's own exponents
            table = np.zeros(len(table))
        bend = table - np.interp(middle, time, table)
        motion = OwnMotion.from_rows(time, z, table, left, right)
        carried = motion.carry_to(middle, time[span], bend[span], z[span])
        still, inverse = carried[near - near[0]], invert_scaled(design)
        solution = inverse @ still
        turning = np.interp(middle, (time[1:] + time[:-1]) / 2, np.diff(table) / np.diff(time))
        left_over = still - design @ solution
        spread = np.sum(np.abs(left_over) ** 2, axis=0) / (2 * max(1, len(x) - design.shape[1]))
        variance = max(spread.max(), float(np.median(noise[near])) ** 2)
        # what a straighter course would make of the step: the rest of it is not known to that
        straight = fit_columns(design[:, [0, 1, 3]], still)
        size = float(np.sqrt(np.sum(np.abs(solution[0]) ** 2)))
        doubts = (
            np.sqrt(variance * (inverse @ inverse.T)[3, 3]),
            BENT * np.abs(straight[2] - solution[3]).max(),
            UNFOLLOWED * size * np.ptp(curved),
        )
        return cls(
            before=solution[0],
            after=solution[0] + solution[3],
            slope=motion.compute_slope(solution[0], turning) + solution[1] / np.ptp(x),
            std=float(np.linalg.norm(doubts)),
            across=carried[last - near[0]] - carried[first - near[0]],
            length_s=float(np.ptp(x)),
        )


@dataclass(frozen=True)
class OwnMotion:
    """How z± of a run move: ż = (G + jKΩ diag(−1, 1)) z, with G (2, 2) constant in the resonator's
    frame, kept as its eigenvectors and exponents [1/s], and the run's own K."""

    directions: Array
    exponents: Array
    scale_factor: float

    @classmethod
    def from_rows(cls, time: Array, z: Array, table: Array, left: Array, right: Array) -> OwnMotion:
        """From steps of equal length on either side, R⁻½ z_{k+1} = M R½ z_k, R the step's turn by
        the table with the K that leaves least.

        A resonator has two directions whose course is one exponential each whatever its splits;
        where the steps do not show them the circular ones stand, each with its median rate.
        """
        from scipy.optimize import minimize_scalar

        step = float(np.median(np.diff(time[left])))
        pairs = np.concatenate([np.column_stack([side[:-1], side[1:]]) for side in (left, right)])
        even = np.abs(np.diff(time[pairs], axis=1)[:, 0] - step) < 1e-3 * step
        half = (table[pairs[:, 1]] - table[pairs[:, 0]]) / 2

        def sides(K: float) -> tuple[Array, Array]:
            return z[pairs[:, 0]] * _turn(K * half), z[pairs[:, 1]] / _turn(K * half)

        def left_over(K: float) -> float:
            first, second = (side[even] for side in sides(K))
            M = fit_columns(first, second)
            return float(np.sum(np.abs(second - first @ M) ** 2))

        if np.count_nonzero(even) > 2 * NEIGHBOURS:
            K = 0.0
            if half.any():
                bounds = (-MOST_SCALE_FACTOR, MOST_SCALE_FACTOR)
                K = float(minimize_scalar(left_over, bounds=bounds, options={"xatol": 1e-7}).x)
            first, second = (side[even] for side in sides(K))
            M = fit_columns(first, second).T
            values, directions = np.linalg.eig(M)
            if np.linalg.cond(directions) < SKEWED and np.all(np.abs(np.abs(values) - 1) < 0.5):
                return cls(directions, np.log(values) / step, K)
        turns_rad = np.angle(z[pairs[:, 1]] * np.conj(z[pairs[:, 0]]))
        rates = np.median(turns_rad / np.diff(time[pairs], axis=1), axis=0)
        return cls(np.eye(2, dtype=complex), 1j * rates, 0.0)

    def carry_to(self, middle: float, time: Array, bend: Array, z: Array) -> Array:
        """Rows z (n, 2) where they would be at the instant `middle`, from either side of it row by
        row; bend (n,): the table's turn since then."""
        back = np.linalg.inv(self.directions)
        out = np.empty_like(z)
        for side in (np.flatnonzero(time < middle)[::-1], np.flatnonzero(time >= middle)):
            carry, t, turned = np.eye(2, dtype=complex), middle, 0.0
            for k in side:  # carry: from this row to the middle
                half = _turn(self.scale_factor * np.array([(bend[k] - turned) / 2]))[0]
                decay = np.exp(-self.exponents * (time[k] - t))
                carry = carry @ ((self.directions * decay) @ back / np.outer(half, half))
                out[k] = carry @ z[k]
                t, turned = time[k], bend[k]
        return out

    def compute_slope(self, z: Array, rate_rad_s: float) -> Array:
        """ż of z (2,) where the table turns so fast."""
        own = (self.directions * self.exponents) @ np.linalg.solve(self.directions, z)
        return own + 1j * self.scale_factor * rate_rad_s * np.array([-1.0, 1.0]) * z


def _turn(angle: Array) -> Array:
    """What a turn of the wave, −mθ (n,), does to z±, (n, 2)."""
    return np.exp(1j * np.multiply.outer(angle, [-1.0, 1.0]))
