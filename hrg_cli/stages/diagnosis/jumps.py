"""Diagnosis, jumps: where the wave of one run does not go on as it went before.

The two circular parts z± = (C ± jS)/√2 of the envelopes turn each at a rate of its own and change
slowly beside that, at any angle and any quadrature (near a circle, where φ and mθ cannot be told
apart, both bend and z± do not). A jump is what one smooth course of z± on either side of an instant
leaves between them. Lost samples turn both parts alike; a knock does not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...physics import ellipse
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
    u = ellipse.envelopes(
        wave.main_amplitude,
        wave.quadrature_amplitude,
        wave.wave_angle_rad,
        wave.phase_rad,
        wave.mode_number,
    )[rows]
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
    found = (_between(time, z, noise, first, last, rows) for first, last in places)
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


def _between(
    time: Array, z: Array, noise: Array, first: int, last: int, rows: Array
) -> Jump | None:
    """The jump between rows `first` and `last` of the good ones; None where it is none or the run
    begins or ends there."""
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
    before, after, slope, spread = (
        np.zeros(2, complex),
        np.zeros(2, complex),
        np.zeros(2, complex),
        [],
    )
    for part in (0, 1):
        steps = np.concatenate([np.diff(time[side]) for side in (left, right)])
        turns = np.concatenate(
            [np.angle(z[side[1:], part] * np.conj(z[side[:-1], part])) for side in (left, right)]
        )
        turning = float(np.median(turns / steps))
        still = z[near, part] * np.exp(-1j * turning * x)
        solution = inverse @ still
        before[part], after[part] = solution[0], solution[0] + solution[3]
        slope[part] = 1j * turning * solution[0] + solution[1] / np.ptp(x)
        spread.append(
            float(np.sum(np.abs(still - design @ solution) ** 2))
            / (2 * max(1, len(x) - design.shape[1]))
        )
    std = float(
        np.sqrt(max(max(spread), float(np.median(noise[near])) ** 2) * (inverse @ inverse.T)[3, 3])
    )
    if not float(np.abs(after - before).max()) > JUMP_SIGMA * std:
        return None
    size = float(np.sqrt(np.sum(np.abs(before) ** 2)))
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


def _running_median(values: Array) -> Array:
    width = 2 * NEIGHBOURS + 1
    padded = np.pad(values, NEIGHBOURS, mode="reflect")
    return np.asarray(np.median(np.lib.stride_tricks.sliding_window_view(padded, width), axis=1))
