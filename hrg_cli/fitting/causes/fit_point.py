"""Where a fit of the extended model stands, and what the effects see of the runs there."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ...effects.effect import RELATIVE_TO_TEMPERATURE, Effect
from ...physics.plant import SlowState
from ...physics.resonator import Mechanics
from ..envelopes import coordinates
from .measured_runs import MeasuredRuns

Array = np.ndarray
Active = tuple[tuple[Effect, Mapping[str, float]], ...]
"""Effects with all their parameters' values."""


@dataclass(frozen=True)
class Point:
    """Where a fit stands: coordinates (7,), the runs' start states (R, 2) and frequency offsets
    (R,), effects with values."""

    p: Array
    start: Array
    offset_rad_s: Array
    active: Active = ()

    def find_temperature_slopes(self) -> dict[str, float]:
        """What its effects scale of the resonator by the temperature: name -> relative change per
        kelvin [1/K]."""
        return {
            effect.scales: values[RELATIVE_TO_TEMPERATURE]
            for effect, values in self.active
            if effect.scales
        }


def add_effect(point: Point, effect: Effect, values: Mapping[str, float]) -> Point:
    """The point with one more effect, or with another value of it.

    Parameters
    ----------
    point
        Where a fit stands.
    effect
        By whose name another value is told.
    values
        Of all its parameters.

    Returns
    -------
    Point
        With the effect last.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.effects import EFFECTS
    >>> from hrg_cli.fitting.causes.fit_point import Point, add_effect
    >>> effect, plain = EFFECTS[0], Point(np.zeros(7), np.ones((1, 2)), np.zeros(1))
    >>> values = {one.name: 1e-3 for one in effect.parameters}
    >>> twice = add_effect(add_effect(plain, effect, values), effect, values)
    >>> len(plain.active), len(twice.active)
    (0, 1)
    """
    others = tuple(pair for pair in point.active if pair[0].name != effect.name)
    return replace(point, active=(*others, (effect, dict(values))))


def remove_effect(point: Point, name: str) -> Point:
    """The point without an effect.

    Parameters
    ----------
    point
        Where a fit stands.
    name
        Of the effect.

    Returns
    -------
    Point
        The same where it has no such effect.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.effects import EFFECTS
    >>> from hrg_cli.fitting.causes.fit_point import Point, remove_effect
    >>> effect, other = EFFECTS[:2]
    >>> point = Point(np.zeros(7), np.ones((1, 2)), np.zeros(1), ((effect, {}), (other, {})))
    >>> [one.name for one, _ in remove_effect(point, effect.name).active] == [other.name]
    True
    """
    return replace(point, active=tuple(pair for pair in point.active if pair[0].name != name))


def make_mechanics(p: Array, series: MeasuredRuns, offset_rad_s: Array | None = None) -> Mechanics:
    """The resonator of coordinates at the runs' frequency.

    Parameters
    ----------
    p
        (7,).
    series
        The runs.
    offset_rad_s
        Of the runs (R,) beside their reference frequency, of which a part per kelvin is one of the
        resonator's own; None: they are at the reference.

    Returns
    -------
    Mechanics
        Its axes in [0, π/m).

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.fit_point import make_mechanics
    >>> series = SimpleNamespace(reference_frequency_hz=5e3, mode_number=2)
    >>> gyro = make_mechanics(np.array([0.2, 0.0, 0.01, 0.0, 0.0, 0.55, 1.0]), series)
    >>> gyro.frequency_hz, round(gyro.damping_axis_rad * 8 / np.pi, 9)
    (5000.0, 1.0)
    """
    offset_hz = 0.0 if offset_rad_s is None else float(np.mean(offset_rad_s)) / (2 * np.pi)
    frequency_hz = series.reference_frequency_hz + offset_hz
    return coordinates.to_mechanics(p, frequency_hz, series.mode_number)


def build_state(series: MeasuredRuns, point: Point) -> SlowState:
    """What the effects look at on the rows of the runs.

    Parameters
    ----------
    series
        The runs, R of n rows.
    point
        Whose effects' own changes of the environment are applied.

    Returns
    -------
    SlowState
        (R, n), without a drive.

    Examples
    --------
    >>> from dataclasses import MISSING, fields
    >>> import numpy as np
    >>> from hrg_cli.fitting.causes.fit_point import Point, build_state
    >>> from hrg_cli.fitting.causes.measured_runs import MeasuredRuns
    >>> rows = np.arange(4.0)[None]
    >>> needed = [f.name for f in fields(MeasuredRuns) if f.default is MISSING]
    >>> series = MeasuredRuns(**dict.fromkeys(needed, rows) | dict(
    ...     names=("left",), temperature_degc=20 + rows, reference_frequency_hz=5e3, mode_number=2,
    ... ))
    >>> state = build_state(series, Point(np.array([0.1, 0, 0, 0, 0, 0.5, 1]), None, None))
    >>> state.mechanics.damping_rate_1_s, state.temperature_degc.tolist(), state.run.tolist()
    (0.1, [[20.0, 21.0, 22.0, 23.0]], [[0]])
    """
    state = SlowState(
        mechanics=make_mechanics(point.p, series, point.offset_rad_s),
        time_s=series.time_s,
        temperature_degc=series.temperature_degc,
        temperature_rate_degc_s=series.temperature_rate_degc_s,
        branch=series.branch,
        rate_rad_s=series.rate_rad_s,
        table_angle_rad=series.table_angle_rad,
        drive=np.zeros((*series.time_s.shape, 2), complex),
        forced=series.forced,
        phase_rad=series.phase_rad,
        omega_r_rad_s=2 * np.pi * series.reference_frequency_hz,
        run=series.run,
        begun_s=np.broadcast_to(
            0.0 if series.begun_s is None else series.begun_s[:, None], series.time_s.shape
        ),
    )
    for effect, values in point.active:
        state = effect.slow_environment(values, state)
    return state
