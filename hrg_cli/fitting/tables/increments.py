"""Increments of the wave angle and their noise: exact generalised least squares for m·dθ/dt = −K·Ω
+ D.

Windows are averaged to blocks; the equation is taken between neighbouring block averages, never as
a derivative:
    m(θ̄_{i+1} − θ̄_i) = ∫ w_i(t) [−K(T,θ)Ω + D(T,θ)] dt,
    w_i the triangle of two neighbouring block averages.
White angle noise of variance s² a block and an angle random walk q (rad²/s, of mθ) give the
increments a tridiagonal covariance:
    var_i = s_i² + s_{i+1}² + q(Δt − (w_i + w_{i+1})/6),   cov_{i,i+1} = −s_{i+1}² + q w_{i+1}/6
    (w: width of a block)
whose Cholesky factor whitens them in one sweep; neighbouring increments share a block, so they are
anticorrelated. The basis functions are taken at the measured angle; averaging to blocks first keeps
that error second-order small: a harmonic nθ is damped by exp(−n²s²/2m²).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from ...errors import HrgError
from ...fourier import build_harmonic_basis
from ...records import Wave
from ..samples.course import build_course
from ..samples.rate_log import describe_left_out, find_covered, restrict_to_log

Array = np.ndarray
LARGEST_PHASE_STEP = 0.6
"""Phase of the highest harmonic that may pass within a block; the loss by averaging is corrected by
sinc² (exact at even speed)."""
FEWEST_BLOCKS, MOST_BLOCKS = 600, 20_000
ROWS_AT_ONCE = 1 << 16
BESIDE = 4
"""Rows beside a piece of a rate log that its course between rows hangs on."""
SPEED_COLUMNS = ("time_s", "wave_angle_rad", "rate_rad_s")
BLOCK_COLUMNS = (
    *SPEED_COLUMNS, "wave_angle_rad_std", "main_amplitude", "quadrature_amplitude", "frequency_hz",
    "temperature_degc", "drive_main", "drive_quadrature", "flags", "iterations",
)  # fmt: skip
"""The columns of a wave that are read, so that nothing else of a long file is."""


@dataclass(frozen=True)
class AnglePath:
    """One run averaged to blocks (b values each); `rate_integral_rad` is the block average of ∫Ω dt
    from the run's start."""

    run_id: str
    forced: bool
    mode_number: int
    start_time: str
    time_s: Array
    width_s: Array
    angle_rad: Array
    angle_variance: Array
    rate_integral_rad: Array
    temperature_degc: Array
    frequency_hz: Array
    ratio: Array
    main_amplitude: Array
    phase_rate_rad_s: Array
    drive_main: Array | None
    drive_quadrature: Array | None
    rows: int
    row_s: float
    """Time between two windows."""
    bend_off_s: float = 0.0
    """Length of windows that stand for their middle, the bend within them taken off; 0: for their
    mean."""
    curvature_rad_s2: Array | None = None
    """θ̈ at the blocks (b,) of a part of a longer path; None: as its own angles bend."""

    def __len__(self) -> int:
        return len(self.time_s) - 1

    @property
    def interval_s(self) -> Array:
        """Time between block centres (n,)."""
        return np.diff(self.time_s)

    @property
    def turn(self) -> Array:
        """m·Δθ of the increments (n,)."""
        return self.mode_number * np.diff(self.angle_rad)

    @property
    def rotation(self) -> Array:
        """∫wΩ dt of the increments (n,)."""
        return np.diff(self.rate_integral_rad)

    @property
    def rate_rad_s(self) -> Array:
        """Mean rate of the increments (n,)."""
        return self.rotation / self.interval_s

    @property
    def blur_s(self) -> Array:
        """Width of the even average that blurs a block's angle as its windows do (b,).

        A window's angle is that of its middle, since `demodulate` fits the envelope's motion within
        it: k of them, h apart, have the spread of an even average over h√(k² − 1), and a single one
        none.
        """
        return np.sqrt(np.maximum(self.width_s**2 - self.row_s**2, 0.0))

    def find_abscissa(self, axis: str) -> Array:
        """Temperature or frequency of the blocks (b,), whichever tables have nodes of."""
        return self.temperature_degc if axis == "temperature" else self.frequency_hz

    def average_neighbours(self, values: Array) -> Array:
        """Mean of neighbouring blocks (n,)."""
        return (values[1:] + values[:-1]) / 2

    def build_angle_basis(self, harmonics: int) -> Array:
        """∫w·(1, cos 2mθ, …) dt / Δt of the increments (n, 1 + 2K)."""
        travel = np.diff(self.angle_rad)
        within = travel * np.minimum(self.average_neighbours(self.blur_s) / self.interval_s, 1.0)
        return build_harmonic_basis(
            self.middle_angle_rad, harmonics, self.mode_number, travel, within
        )

    @property
    def middle_angle_rad(self) -> Array:
        """Mean angle of the increments by their weights w (n,).

        Δt apart, blurred over b, two blocks have the mean of angles ±Δt/2 away, of variance Δt²/4 +
        b²/12; w has Δt²/12 + b²/12. The mean of both is therefore too far along a bend, by
        θ̈Δt²/12: of a wave that its own drift bends (θ̈ ∝ D D') a part that would be a K of its own.
        The speeds of the increments beside one know nothing of its own noise.
        """
        bend = self.average_neighbours(self._find_curvature()) * self.interval_s**2
        return np.asarray(self.average_neighbours(self.angle_rad) - bend / 12)

    def _find_curvature(self) -> Array:
        """θ̈ at the blocks (b,), by their neighbours; at either end that beside it."""
        if self.curvature_rad_s2 is not None:
            return self.curvature_rad_s2
        if len(self) < 2:
            return np.zeros(len(self.time_s))
        speed = np.diff(self.angle_rad) / self.interval_s
        curvature = np.diff(speed) / np.diff(self.average_neighbours(self.time_s))
        return np.pad(curvature, 1, mode="edge")

    def select_rows(self, rows: slice) -> AnglePath:
        """The path of the increments `rows` alone."""
        blocks = slice(rows.start, rows.stop + 1)
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        columns: dict[str, Any] = {
            name: v[blocks] for name, v in values.items() if isinstance(v, np.ndarray)
        }
        columns["curvature_rad_s2"] = self._find_curvature()[blocks]
        return replace(self, **columns)

    def remove_jumps(self, half_turns: Array) -> AnglePath:
        """The path with (n,) half turns of mθ taken out of its increments."""
        angle = self.angle_rad.copy()
        angle[1:] -= np.cumsum(half_turns) * np.pi / self.mode_number
        return replace(self, angle_rad=angle, curvature_rad_s2=None)


def build_path(
    wave: Wave,
    *,
    harmonics: int,
    rate_rad_s: float | None = None,
    earth_rate_rad_s: float = 0.0,
    per_block: int | None = None,
    need_rate: bool = True,
) -> AnglePath:
    """Average a run to blocks.

    Memory does not grow with the run: rows are read piece by piece. Windows that the rate log does
    not cover are left out, unless `need_rate` is False.

    Parameters
    ----------
    wave
        The run.
    harmonics
        Of 2mθ that the tables have: how far the wave may turn within a block.
    rate_rad_s
        A constant rate in the place of the log.
    earth_rate_rad_s
        The Earth's rotation about the gyro's axis, added to the rate.
    per_block
        Windows a block; by default as many as the run's speed and `harmonics` allow.
    need_rate
        Whether a run without a rate is an error; otherwise its rate is zero.

    Returns
    -------
    AnglePath
        b blocks, between which n = b − 1 increments lie.

    Raises
    ------
    HrgError
        No rate, fewer than two good blocks, or times that do not increase.

    Examples
    --------
    At 0.1 rad/s a wave with K = 0.3, m = 2 turns by −KΩ/m·Δt between blocks of 4 s:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.increments import build_path
    >>> from hrg_cli.records import Wave
    >>> t = np.arange(40.0)
    >>> sized = ["main_amplitude", "quadrature_amplitude"]
    >>> sized += ["wave_angle_rad", "phase_rad", "carrier_phase_rad"]
    >>> others = [*sized, *(f"{name}_std" for name in sized)]
    >>> others += ["residual_rms", "signal_std", "frequency_hz"]
    >>> wave = Wave(**dict.fromkeys(others, np.ones(40)) | dict(
    ...     time_s=t, flags=np.zeros(40, "u1"), iterations=np.zeros(40, "i4"), mode="free",
    ...     window_s=1.0, reference_frequency_hz=5e3, wave_angle_rad=-0.3 * 0.1 / 2 * t,
    ... ))
    >>> path = build_path(wave, harmonics=1, rate_rad_s=0.1, per_block=4)
    >>> len(path), round(float(path.turn[0]), 9), round(float(path.rotation[0]), 9)
    (9, -0.12, 0.4)
    """
    rows = len(wave)
    if need_rate and rate_rad_s is None:
        wave = _restrict_to_rate_log(wave)
    if wave.rate_rad_s is None and rate_rad_s is None:
        rate_rad_s = 0.0
    per_block = per_block or _rows_per_block(wave, rows, harmonics, rate_rad_s)
    pieces = list(_read_blocks(wave, rows, per_block, rate_rad_s, earth_rate_rad_s))
    joined = {key: np.concatenate([p[key] for p in pieces]) for key in pieces[0]} if pieces else {}
    if not joined or len(joined["time_s"]) < 2:
        raise HrgError(
            f"run {wave.run_id or '?'}: fewer than two good blocks of its {rows} windows; a longer"
            " or a cleaner run is needed"
        )
    degc = joined["temperature_degc"]
    known = np.isfinite(degc)
    if known.any() and not known.all():
        joined["temperature_degc"] = np.interp(
            joined["time_s"], joined["time_s"][known], degc[known]
        )
    # blocks that lost rows are shorter; the median one lost none
    shortest = np.median(np.diff(joined["time_s"])) / per_block
    drive_main, drive_quadrature = (
        joined.pop("drive_main", None),
        joined.pop("drive_quadrature", None),
    )
    return AnglePath(
        run_id=wave.run_id,
        forced=wave.mode == "forced",
        mode_number=wave.mode_number,
        start_time=wave.start_time,
        width_s=joined.pop("count") * shortest,
        phase_rate_rad_s=2 * np.pi * (joined["frequency_hz"] - wave.reference_frequency_hz),
        rows=rows,
        row_s=float(shortest),
        bend_off_s=wave.window_s if wave.window_stands_for == "middle" else 0.0,
        drive_main=drive_main,
        drive_quadrature=drive_quadrature,
        **joined,
    )


def _restrict_to_rate_log(wave: Wave) -> Wave:
    """The wave where its rate was logged. HrgError: nowhere."""
    if wave.rate_rad_s is None:
        raise HrgError(
            f"run {wave.run_id or '?'}: no rate log (rate_rad_s) and no constant rate was"
            " given; log the table's rate or give it with rate_rad_s or rates_rad_s"
        )
    inside = find_covered(wave)
    if not inside.any():
        told = describe_left_out(wave, inside)
        raise HrgError(f"{told}; log the table's rate or give it with rate_rad_s")
    return restrict_to_log(wave, inside)


def _read_blocks(
    wave: Wave, rows: int, per_block: int, constant_rate: float | None, earth_rate: float
) -> Iterator[dict[str, Array]]:
    """Means of the run's blocks, piece by piece, with the rate's integral from its first row.
    HrgError: times that do not increase."""
    turned = 0.0
    step = max(per_block, ROWS_AT_ONCE // per_block * per_block)
    whole = wave.only(BLOCK_COLUMNS)
    for start in range(0, rows, step):
        stop = min(start + step, rows)
        # the cubic through the log needs rows beside the piece, or it would bend at its ends
        first = max(start - BESIDE, 0)
        log = wave.only(SPEED_COLUMNS).rows(first, min(stop + BESIDE, rows))
        time = np.asarray(log.time_s, float)
        standing = np.diff(time) <= 0
        if standing.any():
            raise HrgError(
                f"run {wave.run_id or '?'}: time_s stands or goes back at"
                f" {time[1 + int(np.argmax(standing))]:g} s; times must increase"
            )
        integral = build_course(time, _rate(log, constant_rate) + earth_rate).integrate()
        before = integral[start - first - 1] if start else 0.0
        integral = turned + integral[start - first : stop - first] - before
        turned = float(integral[-1])
        time = time[start - first : stop - first]
        yield _block_means(whole.rows(start, stop), time, integral, per_block)


def _rate(block: Wave, constant: float | None) -> Array:
    if block.rate_rad_s is None or constant is not None:
        return np.full(len(block), constant if constant is not None else 0.0)
    rate = np.array(block.rate_rad_s, float)  # a copy: the wave keeps what was logged
    bad = ~np.isfinite(rate)
    if bad.all():
        return np.zeros(len(block))  # no row of it is used for its rate
    if bad.any():
        rate[bad] = np.interp(np.flatnonzero(bad), np.flatnonzero(~bad), rate[~bad])
    return rate


def _rows_per_block(wave: Wave, rows: int, harmonics: int, constant_rate: float | None) -> int:
    """As many windows a block as the highest harmonic allows, from a coarse look at the run's
    speed."""
    coarse, largest_rate = max(1, rows // 400), 0.0
    angles, times, turns = [], [], []
    for block in wave.only(SPEED_COLUMNS).blocks(max(coarse, ROWS_AT_ONCE // coarse * coarse)):
        angle, time = np.asarray(block.wave_angle_rad, float), np.asarray(block.time_s, float)
        rate = _rate(block, constant_rate)
        largest_rate = max(largest_rate, float(np.abs(rate).max(initial=0.0)))
        angles.append(angle[::coarse])
        times.append(time[::coarse])
        turns.append(rate[::coarse])
    angle, time, rate = np.concatenate(angles), np.concatenate(times), np.concatenate(turns)
    if len(time) < 3 or time[-1] <= time[0]:
        return 1
    speed = np.abs(np.diff(angle)) / np.maximum(np.diff(time), 1e-12)
    # the coarse look may miss the run's fastest moment, which the rate log tells: times what a rate
    # turns the wave by
    turning = np.abs(rate[1:]) > 0.2 * largest_rate
    gain = (
        float(np.nanmedian(speed[turning] / np.abs(rate[1:][turning])))
        if turning.any() and largest_rate > 0
        else 0.0
    )
    gain = min(gain if np.isfinite(gain) else 0.0, 1.0)
    fastest = max(
        float(np.nanpercentile(speed, 90)) if np.isfinite(speed).any() else 0.0, gain * largest_rate
    )
    step = (time[-1] - time[0]) / rows
    phase_a_row = 2 * wave.mode_number * max(harmonics, 1) * fastest * step
    by_phase = int(LARGEST_PHASE_STEP / max(phase_a_row, LARGEST_PHASE_STEP / rows))

    # a fast wave in a long run: blocks up to 2.5 times as long, which sinc² still corrects
    if by_phase and rows // by_phase > MOST_BLOCKS:
        by_phase = min(-(-rows // MOST_BLOCKS), int(2.5 * by_phase))
    return max(1, min(by_phase, rows // FEWEST_BLOCKS))


def find_good_windows(wave: Wave) -> Array:
    """Which windows count, bool (n,): good ones whose time is known.

    Parameters
    ----------
    wave
        Of n windows.

    Returns
    -------
    ndarray
        True for a window that counts.

    Examples
    --------
    >>> from hrg_cli.fitting.tables.increments import find_good_windows
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> bool(find_good_windows(draw_waves()[0]).all())
    True
    """
    return np.asarray(wave.good() & np.isfinite(np.asarray(wave.time_s, float)))


def count_good(good: Array, per_block: int) -> Array:
    """Good windows of every block; 0 of those less than half good, whose means do not count.

    Parameters
    ----------
    good
        Windows that are good (n,).
    per_block
        Windows a block; the last may have fewer.

    Returns
    -------
    ndarray
        (b,).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.increments import count_good
    >>> count_good(np.array([1, 1, 1, 0, 0, 1, 0], bool), 3).tolist()
    [3.0, 0.0, 0.0]
    """
    count = np.add.reduceat(good.astype(float), np.arange(0, len(good), per_block))
    return np.where(count >= max(1.0, per_block / 2), count, 0.0)


def _block_means(block: Wave, time: Array, integral: Array, per_block: int) -> dict[str, Array]:
    """Means over the good rows of each group of `per_block` rows; groups less than half good are
    left out."""
    # reduceat sums groups without a copy, and the last group may be short
    good = find_good_windows(block)
    starts = np.arange(0, len(time), per_block)
    count = count_good(good, per_block)
    keep = count > 0

    def mean(values: Array, power: int = 1) -> Array:
        total = np.add.reduceat(np.where(good, values, 0.0), starts)[keep]
        return np.asarray(total / count[keep] ** power)

    amplitude = np.asarray(block.main_amplitude, float)
    ratio = np.divide(
        np.asarray(block.quadrature_amplitude, float),
        amplitude,
        out=np.zeros_like(amplitude),
        where=amplitude > 0,
    )
    means = {
        "time_s": mean(time),
        "count": count[keep],
        "angle_rad": mean(np.asarray(block.wave_angle_rad, float)),
        "angle_variance": mean(
            np.nan_to_num(np.asarray(block.wave_angle_rad_std, float)) ** 2, power=2
        ),
        "rate_integral_rad": mean(integral),
        "temperature_degc": (
            np.full(int(keep.sum()), np.nan)
            if block.temperature_degc is None
            else mean(np.asarray(block.temperature_degc, float))
        ),
        "frequency_hz": mean(np.asarray(block.frequency_hz, float)),
        "ratio": mean(ratio),
        "main_amplitude": mean(amplitude),
    }
    for name in ("drive_main", "drive_quadrature"):
        values = getattr(block, name)
        if values is not None:
            means[name] = mean(np.asarray(values, float))
    return means
