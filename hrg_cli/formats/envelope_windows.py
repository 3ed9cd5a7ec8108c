"""How many rows of an envelope make a window: nearly independent of each other, clear of noise, and
short against the wave's own motion."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..errors import HrgError
from ..records import Array, Status
from .filter_start import count_settling_rows
from .magnitudes import find_magnitude_noise
from .row_noise import (
    DELAY,
    RowNoise,
    estimate_filter_gain,
    estimate_mean_turn,
    estimate_row_noise,
)
from .row_rounding import RowRounding, hold_rounding

LOOKS, LOOK_ROWS = 16, 1 << 14
"""Stretches of rows, at most, from which noise and correlation are found."""

SPREAD = 5.0
"""Windows are so many times longer than the rows' correlation: neighbours are then correlated by 5
% and less."""

INDEPENDENT = 1.3
"""Correlation (rows that count as one) up to which rows are windows as they are."""

CLEAR = 10.0
"""Amplitude over noise that a window shall have where the log is long enough."""

FEWEST_WINDOWS = 200
"""Windows that are kept even where they are still correlated; their standard deviations allow for
it."""

BEND = 0.1
"""Part of a window's standard deviation by which the envelope's curvature may move its mean."""

FOLLOWED = 0.25
"""Turns from window to window up to which windows follow the oscillation beside the reference as it
is: from half a turn on they would show it a window's rate off."""

WEAKENED, LOST = 0.9, 0.6
"""Gain of the filter at the oscillation below which it is told, and below which the result is
suspect."""


@dataclass(frozen=True)
class WindowPlan:
    """Rows a window, the rows' step, their noise, how far the oscillation lies from the reference,
    what the filter passes there, the rows before it has settled, whether they are lengths of
    phasors, the largest step to which they are rounded and the part of their noise that it makes,
    and all of the steps."""

    rows: int
    step_s: float
    noise: RowNoise
    offset_hz: float
    passed: float
    settling: int = 0
    lengths: bool = False
    least_count: float = 0.0
    rounded: float = 0.0
    rounding: RowRounding | None = None

    @property
    def moved_hz(self) -> float:
        """By how much the windows' reference lies beside that of the rows: 0 where they follow the
        oscillation beside this one."""
        window_s = self.rows * self.step_s
        if self.rows == 1 or abs(self.offset_hz) * window_s <= FOLLOWED:
            return 0.0
        # a thousandth of a window's rate: what is told has no more digits than are of use
        digits = max(0, 3 + math.ceil(math.log10(window_s)))
        return round(self.offset_hz, digits)

    def find_density(self, channel: int, size: Array) -> Array:
        """Density (n, 2) of the noise along phasors of these lengths (n,) and across them."""
        density = np.broadcast_to(self.noise.density[channel], (len(size), 2))
        return density if self.rounding is None else self.rounding.hold(density, size, channel)

    def judge(self, logged: bool) -> list[tuple[Status, str]]:
        """What the filter before the rows does, and what was done about it."""
        found = self._judge_correlation(logged)
        if self.settling:
            found.append(
                (
                    "valid",
                    f"the demodulator's filter settles until {self.settling * self.step_s:.3g} s:"
                    f" the first {-(-self.settling // self.rows)} windows are flagged as settling",
                )
            )
        if self.passed < WEAKENED:
            found.append(
                (
                    "suspect" if self.passed < LOST else "valid",
                    (
                        f"the oscillation lies {self.offset_hz:.3f} Hz from the reference, where"
                        f" the demodulator's filter passes about {self.passed:.0%} of the amplitude"
                        " and turns the phase; amplitudes are those behind the filter: move the"
                        " reference"
                    ),
                )
            )
        if self.moved_hz:
            found.append(
                (
                    "valid",
                    f"the oscillation lies {self.offset_hz:.3f} Hz from the reference, more than"
                    f" windows of {self.rows} rows follow: they are told against one"
                    f" {self.moved_hz:+g} Hz beside it",
                )
            )
        if not self.noise.level:
            found.append(
                (
                    "valid",
                    (
                        "too few rows, or noise that is not white, to be sure of its size: it is"
                        " that of the lowest octave seen"
                    ),
                )
            )
        return found

    def _judge_correlation(self, logged: bool) -> list[tuple[Status, str]]:
        """What the rows' correlation did to the windows, and by how much the filter delays them."""
        kappa = self.noise.correlated_rows
        if kappa <= INDEPENDENT:
            return []
        still = ", still correlated; their standard deviations are those that a long average needs"
        found: list[tuple[Status, str]] = [
            (
                "valid",
                f"the rows' noise is correlated over {kappa:.3g} rows (the demodulator's"
                f" filter): windows of {self.rows} rows are used"
                + ("" if self.rows >= SPREAD * kappa - 1 else still),
            )
        ]
        if logged:
            lag_s = DELAY * kappa * self.step_s
            found.append(
                (
                    "valid",
                    f"the filter delays the signals by about {lag_s:.2g} s against the"
                    " logged columns: where a rate changes, estimate with --rate-late-s"
                    f" -{lag_s:.2g}",
                )
            )
        return found


def plan_windows(
    path: Path,
    blocks: Iterable[tuple[Array, Array]],
    asked: int | None,
    phase_known: bool = True,
    rounding: RowRounding | None = None,
) -> WindowPlan:
    """How many rows make a window, with the noise and the correlation of the rows that decide it.

    A demodulator's filter correlates neighbouring rows; windows of several correlation lengths are
    nearly independent, so that their standard deviations add up as those of white noise do.

    Parameters
    ----------
    path
        Of the log, for messages.
    blocks
        Times (n,) [s] and envelopes (channel, n) of the rows, block by block.
    asked
        Rows per window; None: found from the correlation.
    phase_known
        False: the rows are amplitudes alone.
    rounding
        Lattices of the rows' values; None: they are not known.

    Returns
    -------
    WindowPlan
        No more rows per window than there are rows.

    Raises
    ------
    HrgError
        Fewer than 8 rows, from which no noise is found.

    Examples
    --------
    Rows of white noise are windows as they are; a filter's rows are put together:

    >>> from pathlib import Path
    >>> import numpy as np
    >>> from hrg_cli.formats.envelope_windows import plan_windows
    >>> t, random = np.arange(40_000) * 1e-3, np.random.default_rng(1)
    >>> noise = 1e-3 * random.standard_normal((2, 40_009, 2)).view(complex)[..., 0]
    >>> filtered = np.stack([np.convolve(row, np.full(10, 0.1), "valid") for row in noise])
    >>> [plan_windows(Path(), [(t, 1 + u)], None).rows > 20 for u in (noise[:, 9:], filtered)]
    [False, True]
    """
    looks: list[Array] = []
    steps: list[float] = []
    total = 0
    for times, u in blocks:
        total += len(times)
        if len(times) > 1:
            steps.append(float(np.median(np.diff(times))))
        for start in range(0, len(times), LOOK_ROWS):
            looks.append(u[:, start : start + LOOK_ROWS])
        if len(looks) > 4 * LOOKS:
            looks = looks[::2]
    looks = [look for look in looks[:: max(1, len(looks) // LOOKS)] if look.shape[1] > 3] or looks
    if total < 8:
        raise HrgError(
            f"{path}: holds {total} rows between from_s and to_s; at least 8 were expected"
        )
    step_s = float(np.median(steps))
    with np.errstate(invalid="ignore"):
        noise = estimate_row_noise(looks)
        settling = 0
        if rounding is None or not rounding.makes_most(noise, looks[0]):
            settling = count_settling_rows(
                looks[0],
                noise.correlated_rows,
                estimate_mean_turn(looks[0]),
                float(noise.variance.sum()),
            )
        if settling:
            looks[0] = looks[0][:, settling:]
            noise = estimate_row_noise(looks)
        # what is below 0 is no phasor's length: a detector's output, whose noise is its own
        lengths = not phase_known and min(np.nanmin(look.real) for look in looks) >= 0
        if lengths:
            noise = find_magnitude_noise(looks, noise)
        held = hold_rounding(noise, looks, rounding)
        offset_hz = float(np.median([estimate_mean_turn(look) for look in looks])) / (
            2 * np.pi * step_s
        )
    rows = _choose_rows(looks, held.noise, total) if asked is None else min(asked, total)
    gain = estimate_filter_gain(looks)
    step = held.least_count, held.share, rounding
    return WindowPlan(rows, step_s, held.noise, offset_hz, gain, settling, lengths, *step)


def _choose_rows(looks: list[Array], noise: RowNoise, total: int) -> int:
    """Rows per window of so many by their noise: independent windows that show the wave clearly,
    and as few that none bends."""
    kappa = noise.correlated_rows
    power = float(np.nanmedian(np.concatenate([(np.abs(look) ** 2).sum(0) for look in looks])))
    clear = CLEAR**2 * float(noise.density.sum()) / max(power, 1e-300)
    rows = max(
        1 if kappa <= INDEPENDENT else round(SPREAD * kappa), int(min(np.ceil(clear), total))
    )
    rows = max(1, min(rows, total // FEWEST_WINDOWS))
    while rows > 1 and _bends(looks, rows, noise):
        rows //= 2
    return rows


def _bends(looks: list[Array], rows: int, noise: RowNoise) -> bool:
    """Whether the envelope's curvature moves the mean of so many rows by more than `BEND` of its
    standard deviation."""
    bend2, noise2 = np.zeros(2), noise.density.sum(1) / rows
    count = 0
    for look in looks:
        means = average_windows(look, rows, estimate_mean_turn(look))[0]
        if means.shape[1] < 3:
            continue
        turn = np.exp(-1j * rows * estimate_mean_turn(look))
        second = means[:, 2:] * turn - 2 * means[:, 1:-1] + means[:, :-2] / turn
        second = second[:, np.isfinite(second).all(0)]
        bend2 += (
            np.maximum(0.0, (np.abs(second) ** 2).sum(1) - 6 * noise2 * second.shape[1]) / 24**2
        )
        count += second.shape[1]
    slack = 3 * 6 * noise2 / 24**2 * np.sqrt(max(count, 1))  # what chance adds to the sum
    return count > 0 and bool((bend2 > BEND**2 * noise2 * count + slack).any())


def average_windows(u: Array, rows: int, turn: float) -> tuple[Array, Array]:
    """Means of an envelope over windows of equally many rows, each turned back about its middle.

    Without turning back, a phasor that turns by φ from row to row would be shortened by
    sin(nφ/2)/(n sin(φ/2)) in the mean of n rows.

    Parameters
    ----------
    u
        Envelopes (channel, n).
    rows
        Of a window; rows that fill no window are left out.
    turn
        The envelopes' turn from row to row [rad].

    Returns
    -------
    tuple of ndarray
        The means (channel, windows), and which rows they are of (windows, rows).

    Examples
    --------
    A phasor of length 1 keeps its length, and the phase of the window's middle:

    >>> import numpy as np
    >>> from hrg_cli.formats.envelope_windows import average_windows
    >>> means, which = average_windows(np.exp(0.3j * np.arange(11.0))[None], 5, 0.3)
    >>> np.abs(means).round(9).tolist(), np.angle(means).round(9).tolist(), which.tolist()[1]
    ([[1.0, 1.0]], [[0.6, 2.1]], [5, 6, 7, 8, 9])
    """
    windows = u.shape[1] // rows
    part = u[:, : windows * rows].reshape(len(u), windows, rows)
    back = np.exp(-1j * turn * (np.arange(rows) - (rows - 1) / 2))
    return (part * back).mean(-1), np.arange(windows * rows).reshape(windows, rows)
