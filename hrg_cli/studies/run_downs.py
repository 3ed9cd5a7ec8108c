"""Programmes of free run-downs drawn over the whole range of gyros, tables and laboratories, as
waves: envelopes of the exact slow model with noise, or estimated from simulated raw samples."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..physics import ellipse, resonator
from ..physics.environment import EARTH_RATE_RAD_S
from ..physics.resonator import Mechanics
from ..records import Wave, collect
from ..stages.demodulate import demodulate
from ..stages.estimate import estimate
from ..stages.simulate import simulate

Array = np.ndarray
NAMES = tuple(name for name, _ in resonator.PARAMETERS)
MOST_WINDOWS, MOST_CHANGING = 12_000, 3_000
"""Most windows of a run, and of one whose rate changes."""
SUBSTEPS = 4
"""Steps a window over which a changing rate changes evenly."""
NOISE_SCATTER = 6
"""Degrees of freedom of a window's own noise estimate."""
RAW_SAMPLES = 120_000
"""Samples of a run that is simulated sample by sample."""


@dataclass(frozen=True)
class DrawnProgramme:
    """The gyro, its waves, Earth's rate about the axis, which the logs leave out [rad/s], whether
    it is told, and the scale factor where it is told."""

    gyro: Mechanics
    waves: list[Wave]
    earth_rad_s: float
    earth_told: bool
    scale_factor: float | None


@dataclass(frozen=True)
class DrawnCourse:
    """A table's rate over a run: `rate` (rad/s) and its integral `turned` (rad) at times (n,), and
    the [environment] of a simulation file that says the same."""

    kind: str
    environment: dict[str, Any]
    rate: Callable[[Array], Array]
    turned: Callable[[Array], Array]


def _draw_between(random: np.random.Generator, low: float, high: float) -> float:
    """A number between two, its logarithm evenly spread."""
    return float(np.exp(random.uniform(np.log(low), np.log(high))))


def draw(seed: int, raw: bool = False) -> DrawnProgramme:
    """A random gyro with the waves of a random programme of free runs.

    m 1 to 3, τ 0.1 to 1000 s, splits 0 and 10⁻² to 30 ν, rates 0 to 100 °/s steady or changing, ½
    to 3 τ, 300 to 12 000 windows, |a_B/a_A| to 0.97, with and without the Earth's rate.

    Parameters
    ----------
    seed
        Of it all.
    raw
        From samples of 10 to 60 periods a window; else from envelopes.

    Returns
    -------
    DrawnProgramme
        The gyro that is true, and its waves.

    Examples
    --------
    >>> from hrg_cli.studies.run_downs import draw
    >>> one, same = draw(3), draw(3)
    >>> one.gyro == same.gyro, len(one.waves) >= 2
    (True, True)
    """
    random = np.random.default_rng([seed, int(raw)])
    gyro = _gyro(random, raw)
    seconds = _draw_between(random, 0.5, 3) / gyro.damping_rate_1_s
    if raw:
        seconds = min(seconds, RAW_SAMPLES / 8 / gyro.frequency_hz)
    rate = float(random.choice([0.0, 1.0], p=[0.15, 0.85])) * math.radians(
        _draw_between(random, 0.01, 100)
    )
    kinds = random.choice(["steady", "sine", "ramp"], size=6, p=[0.6, 0.25, 0.15])
    if random.random() < 0.5:
        kinds[:] = "steady"
    earth = (
        EARTH_RATE_RAD_S * math.sin(random.uniform(0, math.pi / 2)) if random.random() < 0.5 else 0
    )
    told = bool(random.random() < 0.8)
    signs = [1.0, -1.0, 0.0, 0.5, 1.0, -1.0][: random.integers(2, 5 if raw else 7)]
    courses = [
        _course(str(kind), sign * rate, seconds, random)
        for kind, sign in zip(kinds, signs, strict=False)
    ]
    starts = [(random.uniform(0, math.pi / gyro.mode_number), _ratio(random)) for _ in courses]
    noise = _draw_between(random, 1e-6, 1e-2)
    known = gyro.scale_factor if random.random() < 0.25 else None
    make = _simulate_samples if raw else _simulate_envelopes
    waves = make(gyro, courses, starts, earth, seconds, noise, random)
    return DrawnProgramme(gyro, waves, earth, told, known)


def _gyro(random: np.random.Generator, raw: bool) -> Mechanics:
    """Any gyro; one that is simulated sample by sample has few periods to its decay."""
    mode = int(random.choice([1, 2, 2, 2, 3]))
    frequency = _draw_between(random, 300, 1000) if raw else _draw_between(random, 300, 10_000)
    longest = RAW_SAMPLES / 8 / frequency if raw else 1000.0
    nu = 1 / _draw_between(random, max(min(0.1, longest / 3), 48 / frequency), longest)
    split = min(nu * _draw_between(random, 0.01, 30), 2 * math.pi * frequency / 300)
    return Mechanics(
        frequency,
        nu,
        nu * float(random.choice([0.0, 1.0], p=[0.1, 0.9])) * _draw_between(random, 1e-3, 0.6),
        random.uniform(0, math.pi / mode),
        split * float(random.choice([0.0, 1.0], p=[0.1, 0.9])),
        random.uniform(0, math.pi / mode),
        random.uniform(0.9, 1.0) if mode == 1 else random.uniform(0.25, 0.85),
        mode,
    )


def _ratio(random: np.random.Generator) -> float:
    """a_B/a_A at the start: mostly small, now and then large, seldom nearly a circle."""
    size = random.choice([0.1, 0.5, 0.97], p=[0.7, 0.2, 0.1])
    return float(size * random.uniform(-1, 1))


def _course(kind: str, rate: float, seconds: float, random: np.random.Generator) -> DrawnCourse:
    """A table's rate: steady, a sine of half a period to six, or a ramp through zero."""
    if kind == "sine":
        omega = 2 * math.pi * random.uniform(0.5, 6) / seconds
        phase = random.uniform(0, 2 * math.pi)
        table = {
            "kind": "sine",
            "amplitude_rad_s": rate,
            "frequency_hz": omega / (2 * math.pi),
            "phase_rad": phase,
        }
        return DrawnCourse(
            kind,
            {"rate": table},
            lambda t: rate * np.sin(omega * t + phase),
            lambda t: rate / omega * (math.cos(phase) - np.cos(omega * t + phase)),
        )
    if kind == "ramp":
        slope = random.uniform(1.2, 2) / seconds
        ends = [rate, rate * (1 - slope * seconds)]
        points = {"kind": "points", "time_s": [0.0, seconds], "rate_rad_s": ends}
        return DrawnCourse(
            kind,
            {"rate": points},
            lambda t: rate * (1 - slope * t),
            lambda t: rate * (t - slope * t**2 / 2),
        )
    return DrawnCourse(
        kind, {"rate_rad_s": rate}, lambda t: np.full(np.shape(t), rate), lambda t: rate * t
    )


def _fastest(gyro: Mechanics, courses: list[DrawnCourse], seconds: float) -> float:
    """What moves the envelopes at most, rad/s."""
    times = np.linspace(0, seconds, 99)
    turning = gyro.scale_factor * max(float(np.abs(c.rate(times)).max()) for c in courses)
    return turning + gyro.frequency_split_rad_s + gyro.damping_rate_1_s


def _simulate_envelopes(
    gyro: Mechanics,
    courses: list[DrawnCourse],
    starts: list[tuple[float, float]],
    earth: float,
    seconds: float,
    noise: float,
    random: np.random.Generator,
) -> list[Wave]:
    """Waves of the slow model at the windows' middles with white noise of one component."""
    fastest = _fastest(gyro, courses, seconds)
    most = MOST_WINDOWS if all(c.kind == "steady" for c in courses) else MOST_CHANGING
    windows = int(
        np.clip(_draw_between(random, 300, most), min(most, seconds * fastest / 0.8), most)
    )
    size = _draw_between(random, 1e-3, 1e3) if random.random() < 0.2 else 1.0
    waves = []
    for i, (course, (angle, ratio)) in enumerate(zip(courses, starts, strict=True)):
        times = (np.arange(windows) + 0.5) * seconds / windows
        begin = np.array([1.0, ratio, angle, random.uniform(-3, 3)])
        first = ellipse.compute_envelopes(begin[0], begin[1], begin[2], begin[3], gyro.mode_number)
        u = make_envelope(gyro, course, earth, times, first)
        u += noise * (random.standard_normal(u.shape) + 1j * random.standard_normal(u.shape))
        seen = noise * np.sqrt(random.chisquare(NOISE_SCATTER, windows) / NOISE_SCATTER)
        waves.append(
            _wave(gyro, u * size, times, noise * size, seen * size, course.rate(times), f"run {i}")
        )
    return waves


def make_envelope(
    gyro: Mechanics, course: DrawnCourse, earth: float, times: Array, first: Array
) -> Array:
    """Envelopes of a free run on a table that turns as its course says.

    Parameters
    ----------
    gyro
        The resonator.
    course
        Of the table.
    earth
        What the table turns more than its course says [rad/s].
    times
        (n,) [s], rising.
    first
        Envelopes (2,) at 0.

    Returns
    -------
    ndarray
        (n, 2); of a rate that changes, to the fourth power of a step.

    Examples
    --------
    A resonator without splits decays by exp(−νt) whatever the table does:

    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.physics.resonator import Mechanics
    >>> from hrg_cli.studies.run_downs import make_envelope
    >>> gyro = Mechanics(frequency_hz=5e3, damping_rate_1_s=0.1, scale_factor=0.5)
    >>> course = Told(kind="steady", rate=lambda t: 0.3 + 0 * t)
    >>> u = make_envelope(gyro, course, 0.0, np.array([5.0, 10.0]), np.array([1.0, 0.0], complex))
    >>> bool(np.allclose(np.linalg.norm(u, axis=1), np.exp([-0.5, -1.0])))
    True
    """
    if course.kind == "steady":
        rate = float(course.rate(np.zeros(1))[0]) + earth
        return resonator.exponentiate(resonator.build_generator(gyro, rate), times) @ first
    ends = np.concatenate([[0.0], times])
    fine = np.append(
        (ends[:-1, None] + np.diff(ends)[:, None] * np.arange(SUBSTEPS) / SUBSTEPS).ravel(),
        ends[-1],
    )
    step = np.diff(fine)
    mean = np.diff(course.turned(fine)) / step + earth
    slope = np.diff(course.rate(fine)) / step
    steps = resonator.exponentiate(_mean_generator(gyro, mean, slope, step), step)
    out, u = np.empty((len(fine) - 1, 2), complex), first
    for k, matrix in enumerate(steps):
        u = out[k] = matrix @ u
    return out[SUBSTEPS - 1 :: SUBSTEPS]


def _mean_generator(gyro: Mechanics, mean: Array, slope: Array, step: Array) -> Array:
    """L̄ with exp(L̄ h) the motion over steps h (n,) along which the rate changes evenly, to h⁴.

    L̄ = L(Ω̄) + h² Ω̇² L''/24 + h² Ω̇ [L', L]/12: the mean of a quadratic in Ω, whose variance
    within a step is h² Ω̇²/12, and the second term of Magnus' series (' is ∂/∂Ω). With L(Ω̄) alone
    a scale factor that is known to 1e-6 was off by 3 of its σ.
    """
    still = resonator.build_generator(gyro, mean)
    faster, slower = (resonator.build_generator(gyro, mean + change) for change in (1.0, -1.0))
    turning, bending = (faster - slower) / 2, faster - 2 * still + slower
    bracket = turning @ still - still @ turning
    within = step * slope
    return (
        still
        + (within**2 / 24)[:, None, None] * bending
        + (step * within / 12)[:, None, None] * bracket
    )


def _wave(
    gyro: Mechanics, u: Array, times: Array, std: float, seen: Array, rate: Array, run_id: str
) -> Wave:
    """The record of envelopes (n, 2) whose windows state the noise `seen` (n,)."""
    mode, n = gyro.mode_number, len(times)
    main, quadrature, angle, phase = ellipse.find_wave(u, mode)
    angle, phase = ellipse.unwrap(angle, phase, mode)
    fill, none = np.full(n, std), np.zeros(n)
    return Wave(
        time_s=times,
        main_amplitude=main,
        quadrature_amplitude=quadrature,
        wave_angle_rad=angle,
        phase_rad=phase,
        carrier_phase_rad=none,
        main_amplitude_std=fill,
        quadrature_amplitude_std=fill,
        wave_angle_rad_std=fill,
        phase_rad_std=fill,
        carrier_phase_rad_std=none,
        residual_rms=none,
        signal_std=seen,
        iterations=np.zeros(n, "i2"),
        flags=np.zeros(n, "u1"),
        rate_rad_s=rate,
        frequency_hz=np.full(n, gyro.frequency_hz),
        reference_frequency_hz=gyro.frequency_hz,
        window_s=float(np.median(np.diff(times))),
        mode="free",
        mode_number=mode,
        run_id=run_id,
    )


def _simulate_samples(
    gyro: Mechanics,
    courses: list[DrawnCourse],
    starts: list[tuple[float, float]],
    earth: float,
    seconds: float,
    noise: float,
    random: np.random.Generator,
) -> list[Wave]:
    """Waves of simulated samples (second-order equations of motion), demodulated and estimated."""
    fastest = _fastest(gyro, courses, seconds)
    periods = min(_draw_between(random, 10, 60), max(1.0, 0.5 * gyro.frequency_hz / fastest))
    device = {
        name: getattr(gyro, name) for name in (*NAMES, "mode_number") if name != "damping_split_1_s"
    } | {"damping_split": gyro.damping_split_1_s / gyro.damping_rate_1_s}
    waves = []
    for i, (course, (angle, ratio)) in enumerate(zip(courses, starts, strict=True)):
        config: dict[str, Any] = {
            "device": device,
            "readout": {"noise": noise},
            "recording": {
                "sample_rate_hz": 8.3 * gyro.frequency_hz,
                "duration_s": seconds,
                "log_rate_hz": 1000.0,
            },
            "environment": {"earth_rate_rad_s": earth, "earth_logged": False} | course.environment,
            "run": [{"run_id": f"run{i}"}],
            "start": {
                "wave_angle_rad": angle,
                "quadrature": ratio,
                "phase_rad": random.uniform(-3, 3),
            },
            "control": {"mode": "free"},
        }
        recording = collect(simulate(config, seed=int(random.integers(2**31))))
        waves.append(collect(estimate(collect(demodulate(recording, periods_per_window=periods)))))
    return waves
