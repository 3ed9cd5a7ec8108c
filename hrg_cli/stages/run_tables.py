"""What a measured wave says of its run, as tables of a simulation file: noise of one sample,
courses of rate and temperature, loops."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any

import numpy as np

from ..fitting.least_squares import fit_columns
from ..fitting.samples.course import Course, build_course, build_from_means
from ..records import Wave

Array = np.ndarray
COURSE = 1e-6
"""Part of its range by which a course of straight lines may miss the log."""
ROUNDING = 1e-12
"""Part of the values' size by which they differ by rounding alone: a constant is no course."""
CHORDS = 1e-5
"""The same where the lines keep the integral of a log that bends between its rows: what is left
turns nothing but within a line."""
FINER = 8
"""Parts of a row's length in which a log that bends is drawn."""
STEADY_DEGC = 1e-4
"""Range of a temperature below which it is constant."""
LOOP = 0.5
"""Part of a logged command's power that a loop must explain to be taken for one."""
FEWEST, ROUNDS = 20, 8
"""Windows from which a loop is looked for, and rounds of the fit of its level."""


def compute_sample_noise(wave: Wave, sample_rate_hz: float) -> float:
    """Noise of one sample that gives a wave's windows the noise they state.

    A window of N samples shows an amplitude to σ_w = σ √(2/N), N = f_s T, the least variance that a
    fit of cosine and sine can have (Rife and Boorstyn 1974).

    Parameters
    ----------
    wave
        Of a run; `signal_std` (n, …) and `window_s` are looked at.
    sample_rate_hz
        f_s of the samples to be made.

    Returns
    -------
    float
        σ in the signals' unit, from the windows' median; 0 where none states its noise.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from hrg_cli.stages.run_tables import compute_sample_noise
    >>> round(compute_sample_noise(SimpleNamespace(signal_std=[1e-4] * 9, window_s=0.02), 1e4), 9)
    0.001
    """
    std = np.asarray(wave.signal_std, float)
    std = std[np.isfinite(std) & (std > 0)]
    return (
        float(np.median(std) * np.sqrt(max(2.0, sample_rate_hz * wave.window_s) / 2))
        if len(std)
        else 0.0
    )


def make_rate_course(
    time_s: Array, rate_rad_s: Array | None, length_s: float, straight: bool = False
) -> dict[str, Any]:
    """The logged rate as a part of [environment] of a simulation file.

    A wave turns by the rate's integral: between its rows the log is the course that fits integrate,
    and the lines keep its area.

    Parameters
    ----------
    time_s
        Rows (n,) of the log, s.
    rate_rad_s
        Rates (n,), rad/s, NaN where none is known; None: no log.
    length_s
        Of the run to be simulated, s.
    straight
        Whether the lines go through the log's rows instead.

    Returns
    -------
    dict
        A constant, or corners of straight lines; empty where no rate is logged.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.run_tables import make_rate_course
    >>> t = np.arange(0.0, 10.5, 0.5)
    >>> make_rate_course(t, np.full(21, 0.25), 10.0)
    {'rate_rad_s': 0.25}
    >>> make_rate_course(t, 0.01 * t, 10.0, straight=True)["rate"]["time_s"]
    [0.0, 10.0]
    """
    if rate_rad_s is None or not np.any(known := np.isfinite(rate_rad_s)):
        return {}
    rate = np.asarray(rate_rad_s, float)[known]
    if np.ptp(rate) <= 1e-6 * max(1e-9, float(np.abs(rate).max())):
        return {"rate_rad_s": float(rate.mean())}
    at = np.asarray(time_s, float)[known]
    if straight:
        times, values = choose_points(at, rate)
    else:
        times, (values,) = fit_chords([build_course(at, rate)], length_s)
    return {"rate": {"kind": "points", "time_s": times, "rate_rad_s": values}}


def make_drive_log(wave: Wave, length_s: float) -> dict[str, Any] | None:
    """The logged commands of a driven run as [control.log] of a simulation file.

    Parameters
    ----------
    wave
        The run's; rows where one of its logged commands is not known are left out.
    length_s
        Of the run to be simulated, s.

    Returns
    -------
    dict or None
        Corners [s] of straight lines with the commands' integrals, and the commands there [unit/s];
        None where the main one was not logged.

    Examples
    --------
    >>> import numpy as np
    >>> from types import SimpleNamespace
    >>> from hrg_cli.stages.run_tables import make_drive_log
    >>> t = 0.01 + np.arange(0.0, 2.0, 0.02)
    >>> wave = SimpleNamespace(
    ...     time_s=t, window_s=0.02, drive_main=np.full(100, 0.1), drive_quadrature=None
    ... )
    >>> log = make_drive_log(wave, 2.0)
    >>> log["time_s"], np.round(log["drive_main"], 9).tolist()
    ([0.0, 2.0], [0.1, 0.1])
    """
    names = [
        name
        for name in ("drive_main", "drive_quadrature")
        if getattr(wave, name) is not None and np.isfinite(getattr(wave, name)).sum() > 1
    ]
    if "drive_main" not in names:
        return None
    columns = {name: np.asarray(getattr(wave, name), float) for name in names}
    known = np.all([np.isfinite(values) for values in columns.values()], axis=0)
    t = np.asarray(wave.time_s, float)[known]
    logs = [build_from_means(t, column[known], wave.window_s) for column in columns.values()]
    times, values = fit_chords(logs, length_s)
    return {"time_s": times} | dict(zip(columns, values, strict=True))


def make_temperature_course(time_s: Array, temperature_degc: Array | None) -> dict[str, Any]:
    """The logged temperature as a part of [environment] of a simulation file.

    Parameters
    ----------
    time_s
        Rows (n,) of the log, s.
    temperature_degc
        Temperatures (n,), °C, NaN where none is known; None: no log.

    Returns
    -------
    dict
        A constant, or corners of straight lines; empty where none is logged.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.run_tables import make_temperature_course
    >>> t = np.arange(5.0)
    >>> make_temperature_course(t, 20.0 + 2 * t)["temperature"]["temperature_degc"]
    [20.0, 28.0]
    """
    if temperature_degc is None or not np.any(known := np.isfinite(temperature_degc)):
        return {}
    warm = np.asarray(temperature_degc, float)[known]
    if np.ptp(warm) <= STEADY_DEGC:
        return {"temperature_degc": float(warm.mean())}
    times, values = choose_points(np.asarray(time_s, float)[known], warm)
    return {"temperature": {"kind": "points", "time_s": times, "temperature_degc": values}}


def fit_chords(
    logs: Sequence[Course], length_s: float, share: float = CHORDS
) -> tuple[list[float], list[list[float]]]:
    """Corners of straight lines that have the integrals of logs, to fourth order of the lines'
    lengths.

    A chord of the bend f'' over h has h³f''/12 too much below it. Half of it is taken from either
    end: the values at the corners, which two lines share, give up (e₋ + e₊)/(h₋ + h₊).

    Parameters
    ----------
    logs
        Courses of the same rows; the lines of all of them have the same corners.
    length_s
        Time up to which the lines go, from 0, s.
    share
        Part of its range by which the lines may miss a log that bends.

    Returns
    -------
    tuple of list
        Corners [s], and the values at them for each log.

    Examples
    --------
    Lines along a parabola keep what lies below it, 9:

    >>> import numpy as np
    >>> from hrg_cli.fitting.samples.course import build_course
    >>> from hrg_cli.stages.run_tables import fit_chords
    >>> t = np.linspace(0.0, 3.0, 31)
    >>> corners, (values,) = fit_chords([build_course(t, t**2)], 3.0)
    >>> round(float(np.trapezoid(values, corners)), 6)
    9.0
    """
    t, bent = logs[0].time_s, np.any([log.alpha != 0 for log in logs], axis=0)
    parts = np.where(bent, FINER, 1)
    place = np.concatenate([np.arange(n) / n for n in parts])
    inner = np.repeat(t[:-1], parts) + np.repeat(np.diff(t), parts) * place
    fine = np.unique(np.concatenate([inner, t[-1:], [0.0, length_s]]))
    fine = fine[(fine >= 0) & (fine <= length_s)]
    corner = np.unique(
        np.concatenate(
            [
                choose_points(fine, log.interpolate(fine), share if log.alpha.any() else COURSE)[0]
                for log in logs
            ]
        )
    )
    h = np.diff(corner)
    values = []
    for log in logs:
        value = log.interpolate(corner)
        excess = h * (value[1:] + value[:-1]) / 2 - np.diff(log.integrate_to(corner))
        value -= (np.append(0.0, excess) + np.append(excess, 0.0)) / (
            np.append(0.0, h) + np.append(h, 0.0)
        )
        values.append([float(v) for v in value])
    return [float(x) for x in corner], values


def choose_points(
    t: Array, values: Array, share: float = COURSE
) -> tuple[list[float], list[float]]:
    """Corners of straight lines that follow values, as few as keep to them.

    The point furthest off is added until none is further off than a share of the range (Ramer 1972;
    Douglas and Peucker 1973).

    Parameters
    ----------
    t
        Times (n,), s; of equal ones the first counts.
    values
        (n,).
    share
        Of the values' range, by which the lines may miss them; never by less than rounding does.

    Returns
    -------
    tuple of list
        Corners and the values there.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.run_tables import choose_points
    >>> choose_points(np.arange(5.0), np.array([0.0, 1.0, 2.0, 2.0, 2.0]))
    ([0.0, 2.0, 4.0], [0.0, 2.0, 2.0])
    """
    t, place = np.unique(t, return_index=True)
    values = values[place]
    tolerance = max(share * float(np.ptp(values)), ROUNDING * float(np.abs(values).max()))
    kept = [0, len(t) - 1]
    while len(kept) < len(t):
        off = np.abs(values - np.interp(t, t[kept], values[kept]))
        parts = [slice(a + 1, b) for a, b in pairwise(kept) if b > a + 1]
        further = [p.start + int(np.argmax(off[p])) for p in parts]
        further = [k for k in further if off[k] > tolerance]
        if not further:
            break
        kept = sorted({*kept, *further})
    return [float(v) for v in t[kept]], [float(v) for v in values[kept]]


def describe_loops(wave: Wave, damping_rate_1_s: float) -> dict[str, Any]:
    """Set amplitude and gains of a driven run's loops, as far as the logged commands show them.

    a_ΦA = ν a₀ + k_A (a₀ − a_A) + k_I ∫(a₀ − a_A) dt and a_ΦB = −k_q a_B − k_i ∫a_B dt.

    Parameters
    ----------
    wave
        The run's, with its logged commands.
    damping_rate_1_s
        ν, 1/s.

    Returns
    -------
    dict
        Keys of [control]: `amplitude` [signals' unit] always, the median where no loop is seen;
        gains [1/s] and integral gains [1/s²] where a loop explains half of its command.

    Examples
    --------
    Loops of gains 5 and 40 per second:

    >>> import numpy as np
    >>> from types import SimpleNamespace
    >>> from hrg_cli.stages.run_tables import describe_loops
    >>> t = np.linspace(0.0, 4.0, 201)
    >>> a, q = 1.0 - 0.1 * np.exp(-5 * t), 0.01 * np.exp(-40 * t)
    >>> wave = SimpleNamespace(
    ...     time_s=t, main_amplitude=a, quadrature_amplitude=q, good=lambda: np.ones(201, bool),
    ...     drive_main=0.1 + 5 * (1 - a), drive_quadrature=-40 * q,
    ... )
    >>> found = describe_loops(wave, 0.1)
    >>> [
    ...     round(found[name], 6)
    ...     for name in ("amplitude", "amplitude_gain_1_s", "quadrature_gain_1_s")
    ... ]
    [1.0, 5.0, 40.0]
    """
    level = float(np.median(wave.main_amplitude[wave.good()]))
    out: dict[str, Any] = {"amplitude": level}
    law = _law(wave, wave.drive_main, wave.main_amplitude, level, damping_rate_1_s)
    if law is not None:
        out |= {
            "amplitude": law[0],
            "amplitude_gain_1_s": law[1],
            "amplitude_integral_1_s2": law[2],
        }
    law = _law(wave, wave.drive_quadrature, wave.quadrature_amplitude, 0.0, None)
    if law is not None:
        out |= {
            "quadrature_loop": "finite",
            "quadrature_gain_1_s": law[1],
            "quadrature_integral_1_s2": law[2],
        }
    return out


def _law(
    wave: Wave, command: Array | None, values: Array, level: float, forward_1_s: float | None
) -> tuple[float, float, float] | None:
    """(level, gain, integral gain) of command = forward·level + gain·e + integral·∫e dt, e = level
    − values; None: the log shows another.

    The level is fitted where the command is fed forward, and held elsewhere.
    """
    if command is None:
        return None
    good = wave.good() & np.isfinite(command) & np.isfinite(values)
    if np.count_nonzero(good) < FEWEST or np.ptp(command[good]) == 0:
        return None
    t, right, x = (np.asarray(column, float)[good] for column in (wave.time_s, command, values))
    fitted = forward_1_s is not None
    forward = forward_1_s or 0.0
    for terms in (2, 1):
        # Level times gains: linear in either. Rounds of Gauss–Newton are not asked whether they
        # settled, as the law is judged below by the part of the command that it explains.
        gains, now = np.zeros(2), level
        for _ in range(ROUNDS):
            e = now - x
            total = e[0] * t[0] + np.concatenate(
                [[0.0], np.cumsum(np.diff(t) * (e[1:] + e[:-1]) / 2)]
            )
            columns = [e, total][:terms] + ([forward + gains[0] + gains[1] * t] if fitted else [])
            design = np.column_stack(columns)
            found = fit_columns(design, right - forward * now)
            gains = np.append(found[:terms], 0.0)[:2]
            now += float(found[-1]) if fitted else 0.0
        if gains[0] > 0 and gains[1] >= 0:
            left, whole = (
                right - forward * now - design @ np.append(found[:terms], 0.0)[: design.shape[1]],
                right - right.mean() * fitted,
            )
            return (
                (now, float(gains[0]), float(gains[1]))
                if left @ left < (1 - LOOP) * (whole @ whole)
                else None
            )
    return None
