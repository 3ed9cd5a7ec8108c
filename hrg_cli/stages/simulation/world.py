"""The bench of a simulated run: its temperature and rate over time."""

from __future__ import annotations

import math
from dataclasses import replace

from ...errors import HrgError
from ...physics import environment as bench
from ...physics.plant import Environment
from ..simulation_file import SimulationFile
from .bench_tables import Cycle, Ramp, RatePoints, Sine, Soak, Steps, Sweep, TemperaturePoints


def make_environment(settings: SimulationFile, fine: bool = False) -> Environment:
    """The run's temperature and rate over time, as they are and as they are logged.

    Parameters
    ----------
    settings
        The run, with its [environment].
    fine
        On a grid that effects may bend.

    Returns
    -------
    Environment
        Temperatures [°C] and rates [rad/s] on times [s].

    Raises
    ------
    HrgError
        A ramp that ends before it begins.

    Examples
    --------
    Earth turns the gyro, and its log does not say so:

    >>> from hrg_cli.stages.simulation.drawn_settings import draw_settings
    >>> from hrg_cli.stages.simulation.world import make_environment
    >>> bench = {"rate_rad_s": 1.0, "earth_rate_rad_s": 5e-5, "earth_logged": False}
    >>> world = make_environment(draw_settings(environment=bench))
    >>> float(world.rate_rad_s[0]), float(world.logged_rate_rad_s[0])
    (1.00005, 1.0)
    """
    e, duration = settings.environment, settings.recording.duration_s
    rates = [_rate_programme(e.rate, duration)] if e.rate else []
    earth = (
        e.earth_rate_rad_s or 0.0
        if e.earth_latitude_rad is None
        else bench.compute_earth_rate(e.earth_latitude_rad)
    )
    rate = bench.add_programmes([bench.hold_value(e.rate_rad_s + earth), *rates])
    temperature = (
        _temperature_programme(e.temperature, duration)
        if e.temperature
        else bench.hold_value(e.temperature_degc)
    )
    world = bench.make_environment(
        temperature,
        rate,
        0.0 if e.earth_logged else earth,
        duration,
        1 / settings.recording.sample_rate_hz,
        fine,
    )
    return replace(world, begun_s=settings.begun_s)


def _temperature_programme(
    t: Ramp | Soak | Cycle | TemperaturePoints, duration: float
) -> bench.Programme:
    if isinstance(t, Ramp):
        end = duration if t.end_s is None else t.end_s
        if end <= t.begin_s:
            raise HrgError(
                f"simulation: environment.temperature ends at {end:g} s, before it begins at"
                f" {t.begin_s:g} s"
            )
        return bench.follow_points([t.begin_s, end], [t.start_degc, t.stop_degc])
    if isinstance(t, TemperaturePoints):
        return bench.follow_points(t.time_s, t.temperature_degc)
    if isinstance(t, Soak):
        return bench.follow_levels(t.levels_degc, t.dwell_s, t.transition_s)
    if t.shape == "triangle":
        return bench.make_triangle(t.low_degc, t.high_degc, t.period_s, duration)
    return bench.make_sine(
        (t.high_degc - t.low_degc) / 2, 1 / t.period_s, -math.pi / 2, (t.high_degc + t.low_degc) / 2
    )


def _rate_programme(r: Steps | Sine | Sweep | RatePoints, duration: float) -> bench.Programme:
    if isinstance(r, RatePoints):
        return bench.follow_points(r.time_s, r.rate_rad_s)
    if isinstance(r, Steps):
        return bench.follow_levels(r.levels_rad_s, r.dwell_s, r.transition_s)
    if isinstance(r, Sine):
        return bench.make_sine(r.amplitude_rad_s, r.frequency_hz, r.phase_rad)
    return bench.make_sweep(r.maximum_rad_s, r.period_s or duration, duration)
