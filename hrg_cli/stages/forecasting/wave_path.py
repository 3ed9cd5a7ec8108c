"""The way of the wave over hours, and the error of the input angle that it makes between external
fixes, by the Adams rule and along the orbit on which a driven wave settles."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from ...errors import HrgError
from ...fitting.envelopes.resonator_spread import find_deviation, from_vector, make_vector
from ...physics import drift as law
from ...physics.resonator import Mechanics
from .settled_orbit import SettledOrbit, find_orbits

Array = np.ndarray
STARTS = 24
"""Wave angles from which the error between fixes is followed."""
STEP_ANGLE = 0.1
"""Fastest rate × step of the Adams rule."""
MOST_STEPS = 400_000
E_FOLDS = 30.0
"""Of the quadrature's decay towards its orbit, after which it is on it: 1e-13 of what it began
beside it."""
BESIDE_ORBIT = 1e-8
"""Of r, within which it is."""
LARGEST_RATIO = 0.9
"""|r| from which a wave is nearly a circle and has no angle to forecast."""
FADED = 1e-2
"""Amplitude at which a run-down is over."""


@dataclass(frozen=True)
class Conditions:
    """How the gyro runs: drive, gain of its quadrature loop by force, start angle, constant rate,
    time."""

    drive: str
    quadrature_gain_1_s: float
    wave_angle_rad: float
    rate_rad_s: float
    duration_s: float


def follow_wave(
    gyros: Mechanics, mechanics: Mechanics, run: Conditions
) -> tuple[dict[str, Array], float]:
    """The way of the wave over hours.

    Parameters
    ----------
    gyros
        The resonator (1 + 2k, 1) with its spread, as `spread_points` has it.
    mechanics
        The first of them.
    run
        How the gyro runs.

    Returns
    -------
    tuple
        The table over time, and the Adams rule's error against the largest error forecast (the same
        with twice the step, over 15). Columns (t,): time after an external fix; wave angle from the
        start angle, its σ, and by the tangent law (damping split alone, at rest); error of the
        input angle uncompensated, from this start, rms and worst over all start angles; what
        compensation with this resonator leaves of it, rms over all start angles. The table ends
        with the wave that was asked for; the columns over all start angles are NaN once one of
        their waves has ended.

    Raises
    ------
    HrgError
        The table ends at once, or takes too many steps.

    Examples
    --------
    A damping split of 10⁻³ 1/s turns the wave towards its axis, m dθ/dt = −νδμ sin 2mθ:

    >>> import numpy as np
    >>> from hrg_cli.fitting.envelopes.resonator_spread import (
    ...     from_vector,
    ...     make_vector,
    ...     spread_points,
    ... )
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> from hrg_cli.stages.forecasting.wave_path import Conditions, follow_wave
    >>> gyro = Mechanics(1000.0, 0.2, 1e-3)
    >>> gyros = from_vector(spread_points(make_vector(gyro), 1e-12 * np.eye(6)), gyro)
    >>> table, error = follow_wave(gyros, gyro, Conditions("force", 0.0, 0.1, 0.0, 20.0))
    >>> bool(np.isclose(table["wave_angle_rad"][-1], table["tangent_law_rad"][-1]))
    True
    """
    m, K, rate = mechanics.mode_number, mechanics.scale_factor, run.rate_rad_s
    starts = np.arange(STARTS) * np.pi / m / STARTS
    angles = run.wave_angle_rad + np.concatenate([[0.0], starts])
    times = list_times(run.duration_s)
    if run.drive == "free":  # what has faded is not followed
        heard = np.exp(-mechanics.damping_rate_1_s * times) > FADED
        times = times[: max(1, int(np.count_nonzero(heard)))]
    followed, largest = _follow(gyros, angles, run, times, STEP_ANGLE / 2)
    alive = np.all(largest < LARGEST_RATIO, axis=1)  # (times, angles): a course ends by itself
    if run.drive == "free":
        alive &= (np.exp(-mechanics.damping_rate_1_s * times) > FADED)[:, None]
    count = int(np.count_nonzero(alive[:, 0]))
    if count == 0:
        raise _no_angle(float(times[0]), poorly=bool(largest[0, 0, 0] < LARGEST_RATIO))

    times, followed, alive = times[:count], followed[:count], alive[:count]
    followed = np.where(alive[:, None, None, :], followed, np.nan)
    error = -(m * (followed[:, 0] - angles) / K + rate * times[:, None, None])
    told = slice(None) if alive[-1].all() else slice(1)  # the last row's courses
    alone = from_vector(make_vector(mechanics)[None], mechanics)
    coarse, _ = _follow(alone, angles, run, times[-1:], STEP_ANGLE)
    off = float(np.max(np.abs(coarse[0, 0, 0] - followed[-1, 0, 0])[told])) * m / K / 15

    spread, nominal = np.stack([find_deviation(e) for e in error]), error[:, 0]
    table = {
        "time_s": times,
        "wave_angle_rad": followed[:, 0, 0, 0],
        "wave_angle_rad_std": np.stack([find_deviation(a[:, 0]) for a in followed[:, 0]]),
        "tangent_law_rad": (
            law.follow_tangent_law(mechanics, run.wave_angle_rad, times)
            if rate == 0
            else np.full(count, np.nan)
        ),
        "error_rad": nominal[:, 0],
        "error_rms_rad": np.sqrt(np.mean(nominal[:, 1:] ** 2, axis=1)),
        "error_worst_rad": np.abs(nominal[:, 1:]).max(axis=1),
        "left_rms_rad": np.sqrt(np.mean(spread[:, 1:] ** 2, axis=1)),
    }
    return table, off / max(float(np.abs(nominal[-1, told]).max()), 1e-12)


def _no_angle(within_s: float, poorly: bool) -> HrgError:
    """Why there is no forecast at all: the wave is a circle, or may be one."""
    which = (
        " for splits within a standard deviation of what was identified; identify the"
        " frequency split better"
        if poorly
        else ""
    )
    return HrgError(
        f"within {within_s:g} s the wave is a circle{which}, add a quadrature loop"
        " (--quadrature-gain-1-s) or forecast a shorter --duration-s"
    )


def list_times(duration_s: float) -> Array:
    """Times of a forecast's table: 1, 2, 5, 10 … s up to the duration, and the duration.

    Parameters
    ----------
    duration_s
        [s]

    Returns
    -------
    ndarray
        (t,), rising; from a thousandth of a duration of 10 s or less.

    Examples
    --------
    >>> from hrg_cli.stages.forecasting.wave_path import list_times
    >>> list_times(60.0).tolist()
    [1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 60.0]
    """
    decades = range(-6, 7)
    steps = [m * 10.0**k for k in decades for m in (1, 2, 5)]
    first = 1.0 if duration_s > 10 else duration_s / 1000
    return np.unique(
        [t for t in steps if first * (1 - 1e-9) <= t < duration_s * (1 - 1e-9)] + [duration_s]
    )


def _follow(
    gyros: Mechanics, angles: Array, run: Conditions, times: Array, step_angle: float
) -> tuple[Array, Array]:
    """(θ, r) at the times (t, 2, gyros, angles), and the largest |r| of any step up to them (t,
    gyros, angles); by the Adams rule until the quadrature has settled on the gyro's orbit, along
    this thereafter. The quadrature starts settled, in a run-down at zero."""
    fastest, settling = _rates_of_motion(gyros, run)
    first = np.ceil(times[0] * fastest / step_angle)  # steps up to the first row
    step, whole = float(times[0] / first), float(first * (times[-1] / times[0]))
    until = E_FOLDS / settling if settling > 0 else np.inf
    _need_steps(min(whole, until / step), times[-1], step)
    orbits = _find_usable_orbits(gyros, run) if until < times[-1] else None
    if orbits is not None:
        until = E_FOLDS / min(orbit.settling_1_s for orbit in orbits)
        rows, after = np.round(times[times <= until] / step), times[times > until]
        settled = np.floor(until / step)
        if len(after) and settled < MOST_STEPS:
            path, widest = _step_through(gyros, angles, run, step, [*rows, settled])
            most = np.array([orbit.largest_ratio for orbit in orbits])[:, None]
            state = path[-1]
            if np.max(np.abs(state[1] - _find_ratios(orbits, state[0]))) < BESIDE_ORBIT:
                later = _follow_orbits(orbits, state[0], after - settled * step)
                highest = np.repeat(np.maximum(widest[-1:], most), len(after), axis=0)
                return np.concatenate([path[:-1], later]), np.concatenate([widest[:-1], highest])
    _need_steps(whole, times[-1], step)
    return _step_through(gyros, angles, run, step, np.round(times / step))


def _find_usable_orbits(gyros: Mechanics, run: Conditions) -> list[SettledOrbit] | None:
    """The gyros' orbits, where none of them comes near a circle."""
    found = find_orbits(gyros, run.rate_rad_s, run.drive, run.quadrature_gain_1_s)
    usable = found is not None and all(o.largest_ratio < LARGEST_RATIO for o in found)
    return found if usable else None


def _need_steps(count: float, duration_s: float, step_s: float) -> None:
    if not count < MOST_STEPS:
        raise HrgError(
            f"a forecast of {duration_s:g} s takes {count:.3g} steps of {step_s:.2g} s; shorten it"
            " (--duration-s) or its rate"
        )


def _step_through(
    gyros: Mechanics, angles: Array, run: Conditions, step: float, numbers: Iterable[float]
) -> tuple[Array, Array]:
    """(θ, r) after so many steps of the Adams rule each, and the largest |r| up to them; infinite
    where a course has left the numbers."""
    drive, gain = run.drive, run.quadrature_gain_1_s
    begin = np.zeros((len(np.atleast_1d(gyros.damping_rate_1_s)), len(angles)))
    settled = (
        begin
        if drive == "free"
        else begin + law.find_settled_quadrature(gyros, angles, drive, gain)
    )
    state = np.stack([begin + angles, settled])
    motion = law.make_motion(gyros, run.rate_rad_s, drive, gain)
    steps = law.step_by_adams(motion, state, step)
    out, widest, largest, at = [], [], np.abs(settled), 0
    with np.errstate(all="ignore"):
        for number in numbers:
            for state in islice(steps, int(number) - at):
                # `fmax` would forget a course that has left the numbers
                np.maximum(largest, np.abs(state[1]), out=largest)
            out.append(state)
            widest.append(largest.copy())
            at = int(number)
    path, ratio = (np.where(np.isfinite(kept), kept, np.inf) for kept in (out, widest))
    return path, ratio


def _find_ratios(orbits: Sequence[SettledOrbit], angles: Array) -> Array:
    """r on the gyros' orbits at the wave angles (gyros, …)."""
    return np.stack([orbit.find_ratio(one) for orbit, one in zip(orbits, angles, strict=True)])


def _follow_orbits(orbits: Sequence[SettledOrbit], starts: Array, times: Array) -> Array:
    """(θ, r) at the times (t, 2, gyros, angles) from settled angles (gyros, angles) on."""
    later = np.stack(
        [orbit.follow(start, times) for orbit, start in zip(orbits, starts, strict=True)]
    )
    return np.moveaxis(np.stack([later, _find_ratios(orbits, later)]), 2, 0)


def _rates_of_motion(gyros: Mechanics, run: Conditions) -> tuple[float, float]:
    """The fastest rate to step, and about the rate at which the quadrature settles (0: it does
    not), 1/s."""
    turning = float(np.max(2 * gyros.scale_factor * abs(run.rate_rad_s)))
    splits = float(np.max(2 * gyros.damping_split_1_s + 2 * gyros.frequency_split_rad_s))
    decay = law.compute_quadrature_decay(gyros, run.drive, run.quadrature_gain_1_s)
    settling = 0.0 if run.drive == "free" else float(np.min(decay))
    return turning + splits + 2 * float(np.max(decay)), settling


def say_short(table: dict[str, Array], duration: float, drive: str) -> str:
    """Why a forecast's table ends before the duration.

    Parameters
    ----------
    table
        Its columns.
    duration
        That was asked for [s].
    drive
        "free", or how the wave is driven.

    Returns
    -------
    str
        For a person.

    Examples
    --------
    >>> from hrg_cli.stages.forecasting.wave_path import say_short
    >>> say_short({"time_s": [1.0, 20.0]}, 60.0, "force")
    'the forecast ends after 20 s of 60 s: the wave is nearly a circle then'
    """
    why = (
        "the run-down has faded to a hundredth or its wave is nearly a circle"
        if drive == "free"
        else "the wave is nearly a circle"
    )
    return f"the forecast ends after {table['time_s'][-1]:g} s of {duration:g} s: {why} then"
