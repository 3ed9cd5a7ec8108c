"""Diagnosis, jumps: where the wave of one run does not go on as it went before.

The two circular parts z± = (C ± jS)/√2 of the envelopes turn each at a rate of its own and change
slowly beside that, at any angle and any quadrature (near a circle, where φ and mθ cannot be told
apart, both bend and z± do not). A jump is what one smooth course of z± on either side of an instant
leaves between them. Lost samples turn both parts alike; a knock does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...fitting.envelopes.envelope_runs import envelopes_of, turned
from ...records import Array, Wave

JUMP_SIGMA = 8.0
"""σ from which a jump is one: 1e-15 a row of white noise, and room for what is not white."""
NEIGHBOURS = 12
TOUCHED = 6
"""Windows on either side of a jump whose demodulation used the other side's slope."""
MOST_A_RUN = 5
"""More jumps than this are no instants: something else moves the wave."""
CORE, PART = 2, 0.1
"""Steps on either side of the largest that belong to the same jump, and part of it that they then
have."""
SPOILT = 1e-3
"""Part of a jump to which the motion on either side of it is known: its neighbours were fitted with
a slope across it."""
SKEWED = 3.0
"""Condition of the two directions of motion beyond which they are not told apart."""
ALIKE = 8.0
"""σ that what is left beside a common turn may have."""


@dataclass(frozen=True)
class Jump:
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
    """Common turn a second about the jump, against the reference frequency."""

    @property
    def alike(self) -> bool:
        """Whether both channels turned alike and did nothing else."""
        return (
            abs(self.turn_rad) > JUMP_SIGMA * self.turn_std_rad
            and float(np.abs(self.rest).max()) <= ALIKE * self.rest_std
        )

    @property
    def knock(self) -> bool:
        """Whether the wave was changed in another way."""
        return float(np.abs(self.rest).max()) > max(ALIKE, JUMP_SIGMA) * self.rest_std


def jumps(wave: Wave) -> list[Jump]:
    """Jumps of a wave in order of time, none where there are too many for instants."""
    rows = np.flatnonzero(wave.good() & np.isfinite(wave.phase_rad))
    if len(rows) < 4 * NEIGHBOURS:
        return []
    time = np.asarray(wave.time_s, float)[rows]
    u = envelopes_of(wave, rows)
    noise = np.asarray(wave.signal_std, float)[rows]
    z = circular(u)
    step = np.diff(time)
    rate = np.stack(
        [_running_median(np.angle(p[1:] * np.conj(p[:-1])) / step) for p in z.T], axis=-1
    )
    change = z[1:] * np.exp(-1j * rate * step[:, None]) - z[:-1]
    change -= np.stack(
        [_running_median(c.real) + 1j * _running_median(c.imag) for c in change.T], axis=-1
    )
    size = np.abs(change)
    usual = np.maximum(
        1.4826 * np.median(size, axis=0),
        np.sqrt(2) * float(np.median(noise[np.isfinite(noise)], axis=0)),
    )
    places = _peaks((size / usual).max(axis=1))
    if len(places) > MOST_A_RUN:
        return []
    table = _turned(wave, rows)
    found = (_between(time, z, noise, table, first, last, rows) for first, last in places)
    return [jump for jump in found if jump is not None]


def _peaks(height: Array) -> list[tuple[int, int]]:
    """Steps (first row, last row) that stand out, the highest first; what a jump does to its
    neighbours' fits is not looked at again."""
    left, out = height.copy(), list[tuple[int, int]]()
    while len(out) <= MOST_A_RUN and len(left) and left.max() > JUMP_SIGMA:
        top = int(np.argmax(left))
        near = np.arange(max(0, top - CORE), min(len(left), top + CORE + 1))
        core = near[height[near] > PART * height[top]]
        out.append((int(core[0]), int(core[-1]) + 1))
        left[max(0, top - 2 * TOUCHED) : top + 2 * TOUCHED + 1] = 0.0
    return sorted(out)


def circular(u: Array) -> Array:
    """The parts (n, 2) that a rotation only turns: (C + jS, C − jS)/√2."""
    return np.stack([u[:, 0] + 1j * u[:, 1], u[:, 0] - 1j * u[:, 1]], axis=-1) / np.sqrt(2)


def _turned(wave: Wave, rows: Array) -> Array:
    """The table's angle at the rows, by the logged rate; nought where none is logged."""
    rate = wave.rate_rad_s
    return turned(
        np.asarray(wave.time_s, float)[rows],
        None if rate is None else np.asarray(rate, float)[rows],
    )


def _between(
    time: Array, z: Array, noise: Array, table: Array, first: int, last: int, rows: Array
) -> Jump | None:
    """The jump between rows `first` and `last` of the good ones; None where it is none or the run
    begins or ends there.

    table: its angle at the rows. A rate that changes bends the course: what it leaves between two
    smooth ones, at a scale factor of 1, is part of what is not known of the jump.
    """
    left = np.arange(max(0, first + 1 - TOUCHED - 2 * NEIGHBOURS), max(0, first + 1 - TOUCHED))
    right = np.arange(
        min(len(time), last + TOUCHED), min(len(time), last + TOUCHED + 2 * NEIGHBOURS)
    )
    if len(left) < NEIGHBOURS or len(right) < NEIGHBOURS:
        return None
    near = np.concatenate([left, right])
    middle = float(time[first] + time[last]) / 2
    x = time[near] - middle
    unit = x / np.ptp(x)
    here = (unit > 0).astype(float)
    design = np.column_stack([np.ones(len(x)), unit, unit**2, here, here * unit])
    inverse = np.linalg.pinv(design)
    modes, turning = _own_modes(time, z, left, right)
    back = np.linalg.inv(modes)
    carried = np.exp(np.outer(x, turning))
    still = (z[near] @ back.T) / carried
    solution = inverse @ still
    before, after = modes @ solution[0], modes @ (solution[0] + solution[3])
    slope = modes @ (turning * solution[0] + solution[1] / np.ptp(x))
    left_over = (carried * (still - design @ solution)) @ modes.T
    spread = np.sum(np.abs(left_over) ** 2, axis=0) / (2 * max(1, len(x) - design.shape[1]))
    std = float(
        np.sqrt(max(spread.max(), float(np.median(noise[near])) ** 2) * (inverse @ inverse.T)[3, 3])
        * np.linalg.cond(modes)
    )
    size = float(np.sqrt(np.sum(np.abs(before) ** 2)))
    std = float(np.hypot(std, size * (inverse @ table[near])[3]))
    if not float(np.abs(after - before).max()) > JUMP_SIGMA * std:
        return None
    rate = float(np.sum(slope * np.conj(before)).imag) / size**2
    slope = slope - 1j * rate * before  # without the oscillation, which the turn is
    turn, shift = float(np.angle(np.sum(after * np.conj(before)))), 0.0
    # the wall of neighbouring windows, fitted across the jump, spoils the two sides by a part of it
    doubt = float(np.hypot(std, SPOILT * np.sqrt(np.sum(np.abs(after - before) ** 2))))
    speed = float(np.sqrt(np.sum(np.abs(slope) ** 2)))
    rest = after - before * np.exp(1j * turn)
    if speed * float(np.ptp(x)) > doubt:
        moved = slope * np.exp(1j * turn)
        shift = float(np.sum(rest * np.conj(moved)).real) / speed**2
        rest = rest - shift * moved
    linear = np.array([rest[0] + rest[1], (rest[0] - rest[1]) / 1j]) / np.sqrt(2)
    return Jump(
        before=int(rows[first]),
        after=int(rows[last]),
        time_s=middle,
        turn_rad=turn,
        turn_std_rad=std / size,
        rest=linear,
        rest_std=doubt,
        shift_s=shift,
        shift_std_s=doubt / speed if speed > 0 else np.inf,
        rate_rad_s=rate,
    )


def _own_modes(time: Array, z: Array, left: Array, right: Array) -> tuple[Array, Array]:
    """Directions (2, 2, columns) whose course is one complex exponential each, and the exponents
    (2,) [1/s], from steps of equal length on either side: z_{k+1} = M z_k.

    A resonator at a constant rate has two such directions whatever its splits; where they cannot be
    told apart the circular ones stand, each with its median rate.
    """
    step = float(np.median(np.diff(time[left])))
    pairs = np.concatenate([np.column_stack([side[:-1], side[1:]]) for side in (left, right)])
    even = np.abs(np.diff(time[pairs], axis=1)[:, 0] - step) < 1e-3 * step
    first, second = z[pairs[even, 0]], z[pairs[even, 1]]
    if np.count_nonzero(even) > 2 * NEIGHBOURS:
        values, modes = np.linalg.eig(np.linalg.lstsq(first, second, rcond=None)[0].T)
        if np.linalg.cond(modes) < SKEWED and np.all(np.abs(np.abs(values) - 1) < 0.5):
            return modes, np.log(values) / step
    turns = np.angle(z[pairs[:, 1]] * np.conj(z[pairs[:, 0]]))
    return np.eye(2, dtype=complex), 1j * np.median(turns / np.diff(time[pairs], axis=1), axis=0)


def _running_median(values: Array) -> Array:
    width = 2 * NEIGHBOURS + 1
    padded = np.pad(values, NEIGHBOURS, mode="reflect")
    return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(padded, width), axis=1))
