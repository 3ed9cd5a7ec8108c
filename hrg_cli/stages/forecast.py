"""forecast: from a resonator alone, the drift a gyro will show, the way of its wave over hours, and
the error between external fixes.

Seed A (8), (9), the tangent law, D_max and the Adams rule, each with the errata of PHYSICS §4 and
with the standard deviation that the resonator's covariance makes. Three ways to run: free (M2),
force drive with its amplitude held, one ring electrode (M3p).
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ..errors import HrgError
from ..fitting.checks import Check, check_at_most, check_covariance, list_failures
from ..fitting.envelopes.resonator_spread import (
    compute_vector_covariance,
    from_vector,
    make_mechanics,
    make_vector,
    spread_points,
)
from ..physics import drift as law
from ..physics.resonator import Mechanics
from ..records import Resonator
from .forecasting.drift_map import map_drift, name_figures
from .forecasting.trim import Trim, compute_trim
from .forecasting.wave_path import (
    LARGEST_RATIO,
    Conditions,
    follow_wave,
    list_times,
    say_short,
)

Array = np.ndarray
SMALL_SPLIT = 0.3
"""δω/λ up to which seed A's (9) and D_max hold: their error is its square."""
INTEGRATION = 1e-3
"""Error of the Adams rule against the error forecast."""


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
    """A row a time after an external fix; see `follow_wave`."""
    figures: dict[str, dict[str, float]]
    trim: Trim
    trimmed: bool
    checks: tuple[Check, ...]
    status: str
    status_reasons: tuple[str, ...]


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

    m·dθ/dt = −K·Ω + D(θ): seed A (8), (9) and the Adams rule (PHYSICS §4), with the standard
    deviations that the resonator's covariance makes.

    Parameters
    ----------
    resonator
        Frequency, damping and splits [1/s, rad/s], axes [rad] with their covariance.

    Returns
    -------
    Forecast
        D [rad/s] over the wave angle, wave angle and error [rad] over time, named figures, checks.

    Raises
    ------
    HrgError
        A refused resonator, no damping, no scale factor, a split that lets no force drive settle, a
        forecast of too many steps.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Resonator
    >>> from hrg_cli.stages.forecast import forecast
    >>> known = {
    ...     "frequency_hz": (5000.0, "Hz"), "damping_rate_1_s": (0.02, "s-1"),
    ...     "damping_split_1_s": (2e-4, "s-1"), "damping_axis_rad": (0.35, "rad"),
    ...     "frequency_split_rad_s": (1e-3, "rad s-1"), "stiffness_axis_rad": (0.9, "rad"),
    ...     "scale_factor": (0.55, "1"),
    ... }
    >>> value = np.array([size for size, _ in known.values()])
    >>> std = 1e-3 * np.abs(value)
    >>> resonator = Resonator(
    ...     name=np.array(list(known)), value=value, std=std,
    ...     units=np.array([unit for _, unit in known.values()]), covariance=np.diag(std**2),
    ... )
    >>> made = forecast(resonator, duration_s=60.0)
    >>> made.status, bool(made.figures["drift_largest_rad_s"]["value"] < 3e-4)
    ('valid', True)
    """
    _usable(resonator, scale_factor, drive, quadrature_gain_1_s)
    whole = make_mechanics(resonator, scale_factor)
    x, covariance = make_vector(whole), compute_vector_covariance(resonator)
    spring, trimmed = compute_trim(
        whole, x, covariance, drive, quadrature_gain_1_s, trim_step_rad_s
    )
    x = trimmed if trim else x
    points = spread_points(x, covariance)
    gyros = from_vector(points, whole)
    mechanics = Mechanics(
        **{k: float(np.ravel(v)[0]) for k, v in vars(gyros).items() if k != "mode_number"},
        mode_number=whole.mode_number,
    )
    ratio = float(
        mechanics.frequency_split_rad_s
        / law.compute_quadrature_decay(mechanics, drive, quadrature_gain_1_s)
    )
    drawn = map_drift(gyros, drive, quadrature_gain_1_s)
    if drive == "force" and not np.max(np.abs(drawn["quadrature_ratio"])) < LARGEST_RATIO:
        raise HrgError(
            f"{resonator.gyro_id or 'the resonator'}: δω/(ν + k_q) = {ratio:.3g}; driven by force"
            " its wave becomes a circle, without a steady drift; add --quadrature-gain-1-s, --trim"
            " or --drive free"
        )
    run = Conditions(drive, quadrature_gain_1_s, wave_angle_rad, rate_rad_s, duration_s)
    table, error = follow_wave(gyros, mechanics, run)
    checks = _list_checks(ratio, error, covariance)
    reasons = [
        *list_failures(checks),
        *(f"the resonator is {resonator.status}: {why}" for why in resonator.status_reasons[:1]),
    ]
    reasons += _ends(table, run)
    figures = name_figures(gyros, drawn, drive, quadrature_gain_1_s, rate_rad_s)
    status = "suspect" if reasons else "valid"
    return Forecast(
        drive, mechanics, drawn, table, figures, spring, trim, checks, status, tuple(reasons)
    )


def _ends(table: dict[str, Array], run: Conditions) -> list[str]:
    """What of the table ends before its time."""
    said = []
    if len(table["time_s"]) < len(list_times(run.duration_s)):
        said.append(say_short(table, run.duration_s, run.drive))
    lost = np.isnan(table["error_worst_rad"])
    if lost.any():
        said.append(
            "the wave of another start angle is nearly a circle from"
            f" {table['time_s'][np.argmax(lost)]:g} s on: rms and worst over all start angles end"
            " before"
        )
    return said


def _list_checks(ratio: float, error: float, covariance: Array) -> tuple[Check, ...]:
    """Whether the formulas' own condition holds, the steps are short enough, σ is one."""
    return (
        check_at_most(
            "small_split",
            ratio,
            SMALL_SPLIT,
            f"δω/λ = {ratio:.3g}: seed A's (9) and D_max ask for δω ≪ λ; map and table are exact,"
            " bound and sin 8θ term are not",
        ),
        check_at_most(
            "integration",
            error,
            INTEGRATION,
            f"halving the Adams step still moves the forecast by {error:.2g} of itself",
        ),
        check_covariance(covariance, "the resonator's covariance is none; identify it again"),
    )


def summarise(made: Forecast) -> dict[str, Any]:
    """The JSON of a forecast.

    Parameters
    ----------
    made
        Made by `forecast`.

    Returns
    -------
    dict
        Figures, the drift's map over the wave angle, the table row by row, and the checks.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Resonator
    >>> from hrg_cli.physics.resonator import PARAMETERS
    >>> from hrg_cli.stages.forecast import forecast, summarise
    >>> names, units = zip(*PARAMETERS)
    >>> value, std = np.array([5e3, 2e-3, 1e-4, 0.0, 0.02, 0.1, 0.55]), np.full(7, 1e-6)
    >>> known = dict(
    ...     name=np.array(names), units=np.array(units), std=std, covariance=np.diag(std**2)
    ... )
    >>> told = summarise(forecast(Resonator(value=value, **known), drive="free", duration_s=60.0))
    >>> told["drive"], told["scale_factor"], told["trimmed"]
    ('free', 0.55, False)
    """
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
        "checks": [check.to_json() for check in made.checks],
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
