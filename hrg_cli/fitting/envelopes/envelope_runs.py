"""Free runs as complex envelopes with their noise and turning, and their exact averaging into
blocks."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...errors import HrgError
from ...least_count import SPREAD_SHARE
from ...physics import ellipse
from ...records import Wave
from ..noise import channel_noise
from ..samples.course import build_course
from ..samples.rate_log import restrict_to_log
from .matrices import Matrix, apply

Array = np.ndarray
MIN_ROWS = 8
PHASE_UNKNOWN_RAD = 1.0
"""Standard deviation of a phase that was not recorded, or is lost in noise."""
SMOOTHING_ROWS = 64
"""Windows over which the noise estimate is pooled: one window of a few samples knows its own noise
to 20 % only."""

ODD_WINDOW, ODD_SPREAD = 1.3, 8.0
"""Variance over its neighbours' median, and distance from it in lower spreads, above which a window
(an end, a burst) keeps its own."""


@dataclass(frozen=True)
class EnvelopeRun:
    """Envelopes (n, 2) of one run at times (n,), standard deviation (n,) of one real component,
    turned table angle ∫Ω dt (n,); `phase_known` False: their phases are none that was measured;
    `whitening` of the channels' noise (2, 2), None where both have the same, and their `shares` of
    it, C's and S's variance over the mean of both (`channel_noise`); `lead_rad` (n,): by how much
    the phase of a row, which is the mean of its windows' phases, runs ahead of that in its middle,
    None where rows are windows; `rate_logged` False: no log tells how the table turned; `rounding`:
    the step of values whose noise does not spread it, 0 where it does or where there is none."""

    run_id: str
    time_s: Array
    envelope: Array
    std: Array
    turn_rad: Array
    temperature_degc: Array | None
    reference_frequency_hz: float
    mode_number: int
    window_s: float
    phase_known: bool = True
    whitening: Array | None = None
    shares: tuple[float, float] = (1.0, 1.0)
    lead_rad: Array | None = None
    rate_logged: bool = True
    rounding: float = 0.0

    def __len__(self) -> int:
        return len(self.time_s)

    @property
    def duration_s(self) -> float:
        """From the first to the last row."""
        return float(self.time_s[-1] - self.time_s[0])

    def select_rows(self, mask: Array | slice) -> EnvelopeRun:
        """Some of the rows."""
        cut = {
            name: getattr(self, name)[mask] for name in ("time_s", "envelope", "std", "turn_rad")
        }
        warm = None if self.temperature_degc is None else self.temperature_degc[mask]
        lead = None if self.lead_rad is None else self.lead_rad[mask]
        return dataclasses.replace(self, **cut, temperature_degc=warm, lead_rad=lead)


def retune(run: EnvelopeRun, offset_rad_s: float) -> EnvelopeRun:
    """The same run against a reference shifted by an angular frequency.

    Parameters
    ----------
    run
        Its phases against its own reference frequency.
    offset_rad_s
        New reference less the old one.

    Returns
    -------
    EnvelopeRun
        Envelopes times e^{−jδt}; no motion of the wave changes.

    Examples
    --------
    A wave 0.5 rad/s above the reference stands against one that is raised by as much:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun, retune
    >>> t = np.arange(20.0)
    >>> u = np.outer(np.exp(0.5j * t), [1.0, 0.1j])
    >>> run = EnvelopeRun("", t, u, 0 * t + 1e-4, 0 * t, None, 5e3, 2, 1.0)
    >>> found = retune(run, 0.5)
    >>> bool(np.allclose(found.envelope, [1.0, 0.1j])), round(found.reference_frequency_hz, 4)
    (True, 5000.0796)
    """
    turn = np.exp(-1j * offset_rad_s * run.time_s)[:, None]
    return dataclasses.replace(
        run,
        envelope=run.envelope * turn,
        reference_frequency_hz=run.reference_frequency_hz + offset_rad_s / (2 * np.pi),
    )


def turn_table(run: EnvelopeRun, rate_rad_s: float) -> EnvelopeRun:
    """The same run on a table that turns by a constant rate more.

    Parameters
    ----------
    run
        Its `turn_rad` is what the table turns already.
    rate_rad_s
        More of it.

    Returns
    -------
    EnvelopeRun
        Turned since its own first row; the same envelopes.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun, turn_table
    >>> t = np.array([10.0, 11.0, 12.0])
    >>> run = EnvelopeRun("", t, np.ones((3, 2)), 0 * t + 1e-4, 0 * t, None, 5e3, 2, 1.0)
    >>> turn_table(run, 0.25).turn_rad.tolist()
    [0.0, 0.25, 0.5]
    """
    if rate_rad_s == 0:
        return run
    return dataclasses.replace(
        run, turn_rad=run.turn_rad + rate_rad_s * (run.time_s - run.time_s[0])
    )


def from_wave(wave: Wave, rate_rad_s: float | None = None) -> EnvelopeRun:
    """Envelopes of a wave's good rows.

    Parameters
    ----------
    wave
        Rows that its own rate log does not cover are no good rows.
    rate_rad_s
        Of the table; None: the wave's own log, 0 where it has none.

    Returns
    -------
    EnvelopeRun
        With the angle that the table has turned since the first row.

    Raises
    ------
    HrgError
        Fewer than 8 good rows, or times that do not increase.

    Examples
    --------
    A wave at mθ = 2·0.1 rad on a table of 0.5 rad/s; its fourth window is flagged:

    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli import Wave
    >>> from hrg_cli.fitting.envelopes.envelope_runs import from_wave
    >>> t, ones, flags = np.arange(20.0), np.ones(20), np.zeros(20, "u1")
    >>> flags[3] = 1
    >>> wave = Wave(**{f.name: ones for f in fields(Wave) if f.default is MISSING} | dict(
    ...     time_s=t, flags=flags, iterations=np.zeros(20, "i2"), quadrature_amplitude=0 * t,
    ...     wave_angle_rad=0.1 * ones, phase_rad=0 * t, reference_frequency_hz=5e3, window_s=1.0,
    ... ))
    >>> run = from_wave(wave, 0.5)
    >>> len(run), round(float(run.turn_rad[3]), 9), np.angle(run.envelope[0] @ [1, 1j]).round(9)
    (19, 2.0, np.float64(0.2))
    """
    name = wave.run_id or "the run"
    if rate_rad_s is None:
        wave = restrict_to_log(wave)
    time = np.asarray(wave.time_s, float)
    run = select_good_rows(
        wave,
        integrate_rate(
            time, wave.rate_rad_s if rate_rad_s is None else np.full(len(time), rate_rad_s)
        ),
    )
    if len(run) < MIN_ROWS:
        raise HrgError(
            f"{name}: {len(run)} windows without a flag, at least {MIN_ROWS} are needed; demodulate"
            " a longer or cleaner record"
        )
    if np.any(np.diff(run.time_s) <= 0):
        raise HrgError(
            f"{name}: the windows' times do not increase; sort the record or remove repeated rows"
        )
    return run


def compute_envelopes(wave: Wave, rows: Array | slice = slice(None)) -> Array:
    """Complex envelopes of the channels C and S in a wave's rows, against its own reference.

    C = e^{jφ}(a_A cos mθ + j a_B sin mθ), S = e^{jφ}(a_A sin mθ − j a_B cos mθ).

    Parameters
    ----------
    wave
        Amplitudes, angle and phase.
    rows
        Which of its rows.

    Returns
    -------
    ndarray
        (n, 2) complex.

    Examples
    --------
    A wave along mθ = π/2 moves S alone, its quadrature C, a quarter of a period apart:

    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import compute_envelopes
    >>> one = np.ones(1)
    >>> wave = SimpleNamespace(
    ...     main_amplitude=one, quadrature_amplitude=0.1 * one, wave_angle_rad=np.pi / 4 * one,
    ...     phase_rad=0 * one, mode_number=2,
    ... )
    >>> (compute_envelopes(wave).round(9) + 0).tolist()
    [[0.1j, (1+0j)]]
    """
    return ellipse.compute_envelopes(
        wave.main_amplitude[rows],
        wave.quadrature_amplitude[rows],
        wave.wave_angle_rad[rows],
        wave.phase_rad[rows],
        wave.mode_number,
    )


def replace_envelopes(wave: Wave, envelope: Array) -> Wave:
    """The wave with other envelopes of its channels: A, B, θ and φ anew, its σ as they were.

    Parameters
    ----------
    wave
        Every row.
    envelope
        (n, 2), complex, against the wave's own reference.

    Returns
    -------
    Wave
        With θ and φ without jumps.

    Examples
    --------
    Channel S read with twice its gain, and that taken back:

    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import compute_envelopes, replace_envelopes
    >>> from hrg_cli.records import Wave
    >>> ones = np.ones(3)
    >>> wave = Wave(**{f.name: ones for f in fields(Wave) if f.default is MISSING} | dict(
    ...     quadrature_amplitude=0.1 * ones, mode_number=2))
    >>> u = compute_envelopes(wave)
    >>> twice = replace_envelopes(wave, u * [1, 2])
    >>> back = replace_envelopes(twice, compute_envelopes(twice) / [1, 2])
    >>> bool(abs(compute_envelopes(back) - u).max() < 1e-12 * abs(u).max())
    True
    """
    main, quadrature, angle, phase = ellipse.find_wave(envelope, wave.mode_number)
    angle, phase = ellipse.unwrap(angle, phase, wave.mode_number)
    return wave.replace(
        main_amplitude=main,
        quadrature_amplitude=quadrature,
        wave_angle_rad=angle,
        phase_rad=phase,
    )


def select_good_rows(wave: Wave, turn_rad: Array, inside: slice = slice(None)) -> EnvelopeRun:
    """The good rows of a wave as a run.

    Parameters
    ----------
    wave
        Rows that are flagged, or hold what is not finite, are left out.
    turn_rad
        What the table has turned, (n,).
    inside
        Which rows are looked at.

    Returns
    -------
    EnvelopeRun
        May be empty.

    Examples
    --------
    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli import Wave
    >>> from hrg_cli.fitting.envelopes.envelope_runs import select_good_rows
    >>> t, ones, phase = np.arange(20.0), np.ones(20), np.zeros(20)
    >>> phase[3] = np.nan
    >>> wave = Wave(**{f.name: ones for f in fields(Wave) if f.default is MISSING} | dict(
    ...     time_s=t, flags=np.zeros(20, "u1"), iterations=np.zeros(20, "i2"), phase_rad=phase,
    ...     reference_frequency_hz=5e3, window_s=1.0,
    ... ))
    >>> select_good_rows(wave, 0 * t, slice(0, 6)).time_s.tolist()
    [0.0, 1.0, 2.0, 4.0, 5.0]
    """
    good = (
        wave.good()
        & np.isfinite(wave.time_s)
        & np.isfinite(wave.main_amplitude)
        & np.isfinite(wave.phase_rad)
    )
    good &= np.isfinite(wave.quadrature_amplitude)
    chosen = np.arange(len(good))[inside][good[inside]]
    u = compute_envelopes(wave, chosen)
    channel_std = None if wave.channel_std is None else np.asarray(wave.channel_std, float)[chosen]
    return EnvelopeRun(
        run_id=wave.run_id,
        time_s=np.asarray(wave.time_s, float)[chosen],
        envelope=u,
        std=(
            pool_std(np.asarray(wave.signal_std, float)[chosen], u) if len(chosen) else np.zeros(0)
        ),
        turn_rad=turn_rad[chosen],
        temperature_degc=(
            None
            if wave.temperature_degc is None
            else np.asarray(wave.temperature_degc, float)[chosen]
        ),
        reference_frequency_hz=float(wave.reference_frequency_hz),
        mode_number=int(wave.mode_number),
        window_s=float(wave.window_s),
        phase_known=not len(chosen)
        or not np.all(np.asarray(wave.phase_rad_std, float)[chosen] > PHASE_UNKNOWN_RAD),
        whitening=channel_noise.compute_whitening(channel_std, wave.noise_correlation, u),
        shares=channel_noise.find_shares(channel_std),
        rate_logged=wave.rate_rad_s is not None,
        rounding=(
            float(wave.least_count or 0.0)
            if (wave.quantisation_share or 0.0) > SPREAD_SHARE
            else 0.0
        ),
    )


def integrate_rate(time_s: Array, rate_rad_s: Array | None) -> Array:
    """∫Ω dt from the first row along the rate's course.

    Parameters
    ----------
    time_s
        (n,).
    rate_rad_s
        Mean rates of the rows (n,); what is not finite is bridged; None: no rate.

    Returns
    -------
    ndarray
        (n,) rad; zeros where no rate is finite.

    Examples
    --------
    A table that speeds up by 0.2 rad/s², with one reading lost, has turned by 0.1·t²:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import integrate_rate
    >>> t = np.arange(6.0)
    >>> integrate_rate(t, np.array([0.0, 0.2, np.nan, 0.6, 0.8, 1.0])).round(9).tolist()
    [0.0, 0.1, 0.4, 0.9, 1.6, 2.5]
    """
    if rate_rad_s is None or not np.isfinite(rate_rad_s).any():
        return np.zeros(len(time_s))
    finite = np.isfinite(rate_rad_s)
    rate = np.interp(time_s, time_s[finite], np.asarray(rate_rad_s, float)[finite])
    return build_course(time_s, rate).integrate()


def pool_std(std: Array, u: Array) -> Array:
    """Noise of one signal coefficient, pooled over neighbouring windows.

    Where it is missing in most rows, it is taken from the envelopes' third differences.

    Parameters
    ----------
    std
        As every window knows it (n,); what is not finite, or 0, is missing.
    u
        Envelopes (n, 2).

    Returns
    -------
    ndarray
        (n,) above 0; windows far above their neighbours (ends, bursts) keep their own.

    Examples
    --------
    Windows that know their noise of 0.01 to a fifth only, and none that say it:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import pool_std
    >>> random = np.random.default_rng(0)
    >>> noise = random.standard_normal((2, 4096, 2)) * 0.01
    >>> u = np.exp(-1e-3 * np.arange(4096.0))[:, None] + noise[0] + 1j * noise[1]
    >>> said = 0.01 * (1 + 0.2 * random.standard_normal(4096))
    >>> bool(np.std(pool_std(said, u)) < 0.2 * np.std(said))
    True
    >>> bool(abs(pool_std(np.full(4096, np.nan), u)[0] - 0.01) < 5e-4)
    True
    """
    scale = np.sqrt(np.mean(np.abs(u) ** 2))
    usable = np.isfinite(std) & (std > 0)
    if usable.sum() < len(std) / 2:
        rough = np.diff(u, n=3, axis=0) if len(u) > 3 else np.zeros((1, 2))
        # Third differences of noise have 1 + 9 + 9 + 1 = 20 times its variance, and |·|² of a
        # complex normal has the median 2σ² ln 2.
        level = np.sqrt(np.median(np.abs(rough) ** 2) / (20 * 2 * np.log(2)))
        return np.full(len(std), max(float(level), 1e-12 * scale))
    variance = np.where(usable, std, np.median(std[usable])) ** 2
    width = min(SMOOTHING_ROWS, len(std))
    pooled = variance.copy()
    for part in np.array_split(np.arange(len(std)), max(1, len(std) // width)):
        low, middle = np.quantile(variance[part], [0.25, 0.5])
        like = part[
            variance[part] <= max(ODD_WINDOW * middle, middle + ODD_SPREAD * (middle - low))
        ]
        pooled[like] = variance[like].mean()
    return np.maximum(np.sqrt(pooled), 1e-12 * scale)


def average_rows(
    run: EnvelopeRun,
    blocks: int,
    carry: Callable[[Array, Array], Matrix],
    phase: Callable[[Array], Array] | None = None,
    grid: tuple[float, float] | None = None,
    beside: Array | None = None,
) -> EnvelopeRun:
    """A run's rows averaged by blocks, each carried to its block's mean time along a known motion.

    The mean time is the weighted one, so an error δL of that motion enters only as
    (δL² + [δL, L])dt²/24 of the row: averaging along the motion that is fitted to the rows, until
    neither changes, leaves none. Weights 1/σ². Blocks are equal pieces of time; empty ones (gaps)
    vanish.

    Parameters
    ----------
    run
        As it is kept where it has no more rows than blocks and no grid is given.
    blocks
        Of the run; about as many rows at most.
    carry
        carry(dt, dturn): the propagator over dt [s] and table turn [rad].
    phase
        phase(time_s) [rad]: what a moving frequency adds.
    grid
        Where the first block begins and how long each is [s], of the whole run that this is a part
        of.
    beside
        What moves the envelopes beside that motion, u̇ = Lu + g (n, 2): a slope ġ within a block,
        as the carried rows see it, leaves ġτ²/2 = τg/2 in their mean.

    Returns
    -------
    EnvelopeRun
        σ is that of a weighted mean.

    Examples
    --------
    Four windows of a decay by 0.5 1/s, a second apart, carried to their mean time of 1.5 s:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun, average_rows
    >>> t = np.arange(4.0)
    >>> u = np.outer(np.exp(-0.5 * t), [1.0, 0.0])
    >>> run = EnvelopeRun("", t, u, 0 * t + 0.01, 0 * t, None, 5e3, 2, 1.0)
    >>> decay = lambda dt, turn: (np.exp(-0.5 * dt), 0 * dt, 0 * dt, np.exp(-0.5 * dt))
    >>> one = average_rows(run, 1, decay)
    >>> one.time_s.tolist(), bool(np.isclose(one.envelope[0, 0], np.exp(-0.75))), one.std.tolist()
    ([1.5], True, [0.005])
    """
    if grid is None:
        if len(run) <= blocks:
            return run
        grid = float(run.time_s[0]), (run.duration_s * (1 + 1e-12) + run.window_s) / blocks
    index = np.floor((run.time_s - grid[0]) / grid[1]).astype(int)
    starts = np.flatnonzero(np.diff(index, prepend=-1))
    # Least variance of the mean; σ is pooled, so that no window weighs more by the luck of its own.
    weight = 1 / run.std**2
    total = np.add.reduceat(weight, starts)
    which = np.repeat(np.arange(len(starts)), np.diff(np.append(starts, len(run))))

    def mean(values: Array) -> Array:
        return np.add.reduceat(values * weight, starts) / total

    time = mean(run.time_s)
    turn = build_course(run.time_s, run.turn_rad).interpolate(time)
    late = time[which] - run.time_s
    propagator = carry(late, turn[which] - run.turn_rad)
    c, s = run.envelope[:, 0], run.envelope[:, 1]
    if beside is not None:
        c, s = c + late / 2 * beside[:, 0], s + late / 2 * beside[:, 1]
    c, s = apply(propagator, (c, s))
    if phase is not None:
        turned_by = np.exp(1j * (phase(time)[which] - phase(run.time_s)))
        c, s = c * turned_by, s * turned_by
    return dataclasses.replace(
        run,
        time_s=time,
        envelope=np.stack([mean(c), mean(s)], axis=-1),
        std=1 / np.sqrt(total),
        turn_rad=turn,
        temperature_degc=None if run.temperature_degc is None else mean(run.temperature_degc),
    )
