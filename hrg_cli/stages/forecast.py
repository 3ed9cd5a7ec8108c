"""forecast: from a resonator alone, the drift a gyro will show, the way of its wave over hours, and
the error between external fixes.

Seed A (8), (9), the tangent law, D_max and the Adams rule, each with the errata of PHYSICS §4 and
with the standard deviation that the resonator's covariance makes. Three ways to run: free (M2),
force drive with its amplitude held, one ring electrode (M3p).
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from itertools import islice
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ..errors import HrgError
from ..fitting.checks import Check, at_most, covariance_is_one, failures
from ..fitting.envelopes.resonator_spread import (
    deviation,
    from_vector,
    mechanics_of,
    spread_points,
    vector_covariance,
    vector_of,
)
from ..physics import drift as law
from ..physics.resonator import Mechanics
from ..records import Resonator
from .forecasting.trim import Trim, trim_of

Array = np.ndarray
NODES = 48
"""Wave angles of the drift's map over its period π/m."""
STARTS = 24
"""Wave angles from which the error between fixes is followed."""
STEP_ANGLE = 0.1
"""Fastest rate × step of the Adams rule."""
MOST_STEPS = 400_000
FAST_LOOP = 100.0
"""λ over the rates of the motion from which r follows the angle, with its lag: the error is the
square of the inverse."""
SMALL_SPLIT = 0.3
"""δω/λ up to which seed A's (9) and D_max hold: their error is its square."""
LARGEST_RATIO = 0.9
"""|r| from which a wave is nearly a circle and has no angle to forecast."""
INTEGRATION = 1e-3
"""Error of the Adams rule against the error forecast."""
FADED = 1e-2
"""Amplitude at which a run-down is over."""


@dataclass(frozen=True)
class Forecast:
    """The forecast: the map D(θ) with its parts, the table over time, and what was found of both;
    angles in rad, drift in rad/s of mθ."""

    drive: str
    mechanics: Mechanics
    map: dict[str, Array]
    """wave_angle_rad, drift_rad_s, drift_rad_s_std, damping_part_rad_s, split_part_rad_s,
    quadrature_ratio: (NODES,) each."""
    table: dict[str, Array]
    """A row a time after an external fix; see `COLUMNS`."""
    figures: dict[str, dict[str, float]]
    trim: Trim
    trimmed: bool
    checks: tuple[Check, ...]
    status: str
    status_reasons: tuple[str, ...]


COLUMNS = (
    ("time_s", "time after the fix"),
    ("wave_angle_rad", "wave angle forecast from the start angle"),
    ("wave_angle_rad_std", "its standard deviation"),
    ("tangent_law_rad", "wave angle by the tangent law (damping split alone, at rest)"),
    ("error_rad", "accumulated error of the input angle from this start, uncompensated"),
    ("error_rms_rad", "the same, rms over all start angles"),
    ("error_worst_rad", "the same, worst start angle"),
    (
        "left_rms_rad",
        (
            "what compensation with this resonator leaves: standard deviation of the error, rms"
            " over all start angles"
        ),
    ),
)


def forecast(
    resonator: Resonator,
    *,
    drive: Annotated[
        Literal["free", "force", "parametric"],
        Field(description="run-down, force drive, or one ring electrode (parametric)"),
    ] = "force",
    wave_angle_rad: Annotated[
        float, Field(description="wave angle at the start of the forecast")
    ] = 0.0,
    rate_rad_s: Annotated[float, Field(description="constant input rate")] = 0.0,
    duration_s: Annotated[
        float, Field(gt=0, le=1e6, description="length of the forecast")
    ] = 3600.0,
    quadrature_gain_1_s: Annotated[
        float, Field(ge=0, description="gain of a quadrature loop by force (drive force only)")
    ] = 0.0,
    scale_factor: Annotated[
        float | None, Field(gt=0, description="K, where the resonator has none")
    ] = None,
    trim: Annotated[
        bool,
        Field(
            description="forecast the gyro as an electric spring along the stiffest axis leaves it"
        ),
    ] = False,
    trim_step_rad_s: Annotated[
        float | None,
        Field(gt=0, description="smallest step of the spring, of either electrode pair"),
    ] = None,
) -> Forecast:
    """The drift and its accumulation as this resonator makes them, nothing else being wrong.

    HrgError: a refused resonator, no damping, no scale factor, a split that lets no force drive
    settle, a forecast of too many steps.
    """
    _usable(resonator, scale_factor, drive, quadrature_gain_1_s)
    whole = mechanics_of(resonator, scale_factor)
    x, covariance = vector_of(whole), vector_covariance(resonator)
    spring, trimmed = trim_of(whole, x, covariance, drive, quadrature_gain_1_s, trim_step_rad_s)
    x = trimmed if trim else x
    points = spread_points(x, covariance)
    gyros = from_vector(points, whole)
    mechanics = Mechanics(
        **{k: float(np.ravel(v)[0]) for k, v in vars(gyros).items() if k != "mode_number"},
        mode_number=whole.mode_number,
    )
    ratio = float(
        mechanics.frequency_split_rad_s
        / law.quadrature_decay(mechanics, drive, quadrature_gain_1_s)
    )
    drawn = _map(gyros, drive, quadrature_gain_1_s)
    if drive == "force" and not np.max(np.abs(drawn["quadrature_ratio"])) < LARGEST_RATIO:
        raise HrgError(
            f"{resonator.gyro_id or 'the resonator'}: δω/(ν + k_q) = {ratio:.3g}; a force drive"
            " lets its wave become a circle, so it has no steady drift. Add a quadrature loop"
            " (--quadrature-gain-1-s), trim it (--trim) or forecast a run-down (--drive free)"
        )
    table, error = _table(
        gyros, mechanics, drive, quadrature_gain_1_s, wave_angle_rad, rate_rad_s, duration_s
    )
    checks = (
        at_most(
            "small_split", ratio, SMALL_SPLIT,
            f"δω/λ = {ratio:.3g}: seed A's (9) and D_max ask for δω ≪ λ; map and table are exact, bound and sin 8θ term are not",
        ),
        at_most("integration", error, INTEGRATION, f"halving the Adams step still moves the forecast by {error:.2g} of itself"),
        covariance_is_one(covariance, "the resonator's covariance is none; identify it again"),
    )  # fmt: skip
    reasons = [
        *failures(checks),
        *(f"the resonator is {resonator.status}: {why}" for why in resonator.status_reasons[:1]),
    ]
    if len(table["time_s"]) < len(_times(duration_s)):
        reasons.append(_short(table, duration_s, drive))
    lost = np.isnan(table["error_worst_rad"])
    if lost.any():
        reasons.append(
            "the wave of another start angle is nearly a circle from"
            f" {table['time_s'][np.argmax(lost)]:g} s on: rms and worst over all start angles end"
            " before"
        )
    figures = _figures(gyros, drawn, drive, quadrature_gain_1_s, rate_rad_s)
    status = "suspect" if reasons else "valid"
    return Forecast(
        drive, mechanics, drawn, table, figures, spring, trim, checks, status, tuple(reasons)
    )


def summary(made: Forecast) -> dict[str, Any]:
    """The JSON of a forecast."""
    m = made.mechanics
    return {
        "drive": made.drive,
        "trimmed": made.trimmed,
        "scale_factor": m.scale_factor,
        "mode_number": m.mode_number,
        "figures": made.figures,
        "trim": asdict(made.trim),
        "drift": {name: values.tolist() for name, values in made.map.items()},
        "table": [
            dict(zip(made.table, row, strict=True))
            for row in np.column_stack(list(made.table.values())).tolist()
        ],
        "checks": [check.table() for check in made.checks],
    }


def _usable(resonator: Resonator, scale_factor: float | None, drive: str, gain: float) -> None:
    name = resonator.gyro_id or "the resonator"
    if resonator.status == "refused":
        why = "; ".join(resonator.status_reasons) or "no reason is given"
        raise HrgError(f"{name}: is refused ({why}); identify it from better runs")
    values = resonator.parameters()
    if not values.get("damping_rate_1_s", (0.0, 0.0, ""))[0] > 0:
        raise HrgError(
            f"{name}: has no positive damping_rate_1_s, which holds the quadrature back; identify"
            " it from run-downs"
        )
    if scale_factor is None and not values.get("scale_factor", (0.0, 0.0, ""))[0] > 0:
        raise HrgError(
            f"{name}: has no scale_factor, so a drift is no input rate; give --scale-factor or"
            " identify it with rotated runs"
        )
    if gain and drive != "force":
        raise HrgError(
            f"a quadrature loop by force needs the force drive, not {drive!r}; leave"
            " --quadrature-gain-1-s out"
        )


def _map(gyros: Mechanics, drive: str, gain: float) -> dict[str, Array]:
    """D over the wave angle: exact at the settled quadrature where the gyro is driven, after one
    time constant in a run-down."""
    angle = np.arange(NODES) * np.pi / gyros.mode_number / NODES
    damping = law.drift(gyros, angle)
    r = (
        law.quadrature_quasi_static(gyros, angle, drive)
        if drive == "free"
        else law.quadrature_settled(gyros, angle, drive, gain)
    )
    total = (
        law.drift_quasi_static(gyros, angle, drive)
        if drive == "free"
        else law.drift(gyros, angle, r)
    )
    return {
        "wave_angle_rad": angle,
        "drift_rad_s": total[0],
        "drift_rad_s_std": deviation(total),
        "damping_part_rad_s": damping[0],
        "split_part_rad_s": (total - damping)[0],
        "quadrature_ratio": np.asarray(r)[0],
    }


def _figures(
    gyros: Mechanics, drawn: dict[str, Array], drive: str, gain: float, rate: float
) -> dict[str, dict[str, float]]:
    """Named figures with their standard deviations."""
    split = np.square(gyros.frequency_split_rad_s) / law.quadrature_decay(gyros, drive, gain)
    figures = {
        "damping_part_rad_s": np.asarray(gyros.damping_split_1_s),
        "sin_8_theta_part_rad_s": np.asarray(split),
        "drift_bound_rad_s": law.drift_bound(gyros, drive, gain),
        "drift_bound_input_rad_s": law.drift_bound(gyros, drive, gain) / gyros.scale_factor,
    }
    if rate and drive != "free":  # in a run-down r settles at no mean
        turning, nu = (
            2 * gyros.scale_factor * rate,
            np.asarray(law.quadrature_decay(gyros, drive, gain)),
        )
        figures["mean_drift_while_turning_rad_s"] = (
            -turning * np.square(gyros.frequency_split_rad_s) / (nu**2 + turning**2)
        )
    out = {
        name: {"value": float(v[0, 0]), "std": float(deviation(v)[0])}
        for name, v in figures.items()
    }
    worst = int(np.argmax(np.abs(drawn["drift_rad_s"])))
    out["drift_largest_rad_s"] = {
        "value": float(abs(drawn["drift_rad_s"][worst])),
        "std": float(drawn["drift_rad_s_std"][worst]),
    }
    return out


def _times(duration_s: float) -> Array:
    """1, 2, 5, 10 … s up to the duration, and the duration."""
    decades = range(-6, 7)
    steps = [m * 10.0**k for k in decades for m in (1, 2, 5)]
    first = 1.0 if duration_s > 10 else duration_s / 1000
    return np.unique(
        [t for t in steps if first * (1 - 1e-9) <= t < duration_s * (1 - 1e-9)] + [duration_s]
    )


def _table(
    gyros: Mechanics,
    mechanics: Mechanics,
    drive: str,
    gain: float,
    start: float,
    rate: float,
    duration: float,
) -> tuple[dict[str, Array], float]:
    """The table over time, and the Adams rule's error against the largest error forecast (the same
    with twice the step, over 15). It ends with the wave that was asked for; the columns over all
    start angles are NaN once one of their waves has ended."""
    times = _times(duration)
    angles = start + np.concatenate(
        [[0.0], np.arange(STARTS) * np.pi / mechanics.mode_number / STARTS]
    )
    followed, largest = _followed(gyros, angles, drive, gain, rate, times, STEP_ANGLE / 2)
    m, K = mechanics.mode_number, mechanics.scale_factor
    alive = np.all(largest < LARGEST_RATIO, axis=1)  # (times, angles): a course ends by itself
    if drive == "free":
        alive &= (np.exp(-mechanics.damping_rate_1_s * times) > FADED)[:, None]
    count = int(np.count_nonzero(alive[:, 0]))
    if count == 0:
        poorly = largest[0, 0, 0] < LARGEST_RATIO
        raise HrgError(
            f"within {times[0]:g} s the wave is a circle"
            + (
                " for splits within a standard deviation of what was identified; identify the"
                " frequency split better"
                if poorly
                else ""
            )
            + ", add a quadrature loop (--quadrature-gain-1-s) or forecast a shorter --duration-s"
        )
    times, followed, alive = times[:count], followed[:count], alive[:count]
    followed = np.where(alive[:, None, None, :], followed, np.nan)
    error = -(m * (followed[:, 0] - angles) / K + rate * times[:, None, None])
    told = slice(None) if alive[-1].all() else slice(1)  # the last row's courses
    coarse, _ = _followed(
        from_vector(vector_of(mechanics)[None], mechanics),
        angles,
        drive,
        gain,
        rate,
        times[-1:],
        STEP_ANGLE,
    )
    off = float(np.max(np.abs(coarse[0, 0, 0] - followed[-1, 0, 0])[told])) * m / K / 15
    spread = np.stack([deviation(e) for e in error])
    nominal = error[:, 0]
    table = {
        "time_s": times,
        "wave_angle_rad": followed[:, 0, 0, 0],
        "wave_angle_rad_std": np.stack([deviation(a[:, 0]) for a in followed[:, 0]]),
        "tangent_law_rad": (
            law.tangent_law(mechanics, start, times) if rate == 0 else np.full(count, np.nan)
        ),
        "error_rad": nominal[:, 0],
        "error_rms_rad": np.sqrt(np.mean(nominal[:, 1:] ** 2, axis=1)),
        "error_worst_rad": np.abs(nominal[:, 1:]).max(axis=1),
        "left_rms_rad": np.sqrt(np.mean(spread[:, 1:] ** 2, axis=1)),
    }
    return table, off / max(float(np.abs(nominal[-1, told]).max()), 1e-12)


def _followed(
    gyros: Mechanics,
    angles: Array,
    drive: str,
    gain: float,
    rate: float,
    times: Array,
    step_angle: float,
) -> tuple[Array, Array]:
    """(θ, r) at the times (t, 2, gyros, angles) by the Adams rule, and the largest |r| of any step
    up to them (t, gyros, angles); the quadrature starts settled, in a run-down at zero."""
    turning = float(np.max(2 * gyros.scale_factor * abs(rate)))
    splits = float(np.max(2 * gyros.damping_split_1_s + 2 * gyros.frequency_split_rad_s))
    decay = float(np.max(law.quadrature_decay(gyros, drive, gain)))
    follows = gain > 0 and decay > FAST_LOOP * (turning + splits)
    fastest = turning + splits + (0.0 if follows else 2 * decay)
    first = np.ceil(times[0] * fastest / step_angle)  # steps up to the first row
    step, whole = float(times[0] / first), float(first * (times[-1] / times[0]))
    if not whole < MOST_STEPS:
        raise HrgError(
            f"a forecast of {times[-1]:g} s takes {whole:.3g} steps of {step:.2g} s; shorten it"
            " (--duration-s) or its rate"
        )
    numbers = np.round(times / step).astype(int)
    begin = np.zeros((len(np.atleast_1d(gyros.damping_rate_1_s)), len(angles)))
    settled = (
        begin if drive == "free" else begin + law.quadrature_settled(gyros, angles, drive, gain)
    )
    slope = (
        law.motion_following(gyros, rate, gain) if follows else law.motion(gyros, rate, drive, gain)
    )
    steps = law.adams_steps(
        slope, begin + angles if follows else np.stack([begin + angles, settled]), step
    )
    out, widest, largest, at = [], [], np.abs(settled), 0
    with np.errstate(all="ignore"):
        for number in numbers:
            for state in islice(steps, int(number) - at):
                if not follows:
                    # `fmax` would forget a course that has left the numbers
                    np.maximum(largest, np.abs(state[1]), out=largest)
            if follows:  # whose map was held against a circle at every angle
                state = np.stack([state, law.quadrature_settled(gyros, state, drive, gain)])
                np.maximum(largest, np.abs(state[1]), out=largest)
            out.append(state)
            widest.append(largest.copy())
            at = int(number)
    path, ratio = (np.where(np.isfinite(kept), kept, np.inf) for kept in (out, widest))
    return path, ratio


def _short(table: dict[str, Array], duration: float, drive: str) -> str:
    why = (
        "the run-down has faded to a hundredth or its wave is nearly a circle"
        if drive == "free"
        else "the wave is nearly a circle"
    )
    return f"the forecast ends after {table['time_s'][-1]:g} s of {duration:g} s: {why} then"
