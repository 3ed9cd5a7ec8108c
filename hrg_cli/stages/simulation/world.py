"""The bench of a simulated run: its temperature and rate over time."""

from __future__ import annotations

import math

from ...errors import HrgError
from ...physics import environment as bench
from ...physics.plant import Environment
from ..simulation_file import SimulationFile
from .bench_tables import Cycle, Ramp, RatePoints, Sine, Soak, Steps, Sweep, TemperaturePoints


def environment_of(settings: SimulationFile, fine: bool = False) -> Environment:
    """The run's world; `fine`: on a grid that effects may bend."""
    e, duration = settings.environment, settings.recording.duration_s
    rates = [_rate_programme(e.rate, duration)] if e.rate else []
    earth = (
        e.earth_rate_rad_s or 0.0
        if e.earth_latitude_rad is None
        else bench.earth_rate(e.earth_latitude_rad)
    )
    rate = bench.total([bench.constant(e.rate_rad_s + earth), *rates])
    temperature = (
        _temperature_programme(e.temperature, duration)
        if e.temperature
        else bench.constant(e.temperature_degc)
    )
    return bench.environment(
        temperature,
        rate,
        0.0 if e.earth_logged else earth,
        duration,
        1 / settings.recording.sample_rate_hz,
        fine,
    )


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
        return bench.polyline([t.begin_s, end], [t.start_degc, t.stop_degc])
    if isinstance(t, TemperaturePoints):
        return bench.polyline(t.time_s, t.temperature_degc)
    if isinstance(t, Soak):
        return bench.levels(t.levels_degc, t.dwell_s, t.transition_s)
    if t.shape == "triangle":
        return bench.triangle(t.low_degc, t.high_degc, t.period_s, duration)
    return bench.sine(
        (t.high_degc - t.low_degc) / 2, 1 / t.period_s, -math.pi / 2, (t.high_degc + t.low_degc) / 2
    )


def _rate_programme(r: Steps | Sine | Sweep | RatePoints, duration: float) -> bench.Programme:
    if isinstance(r, RatePoints):
        return bench.polyline(r.time_s, r.rate_rad_s)
    if isinstance(r, Steps):
        return bench.levels(r.levels_rad_s, r.dwell_s, r.transition_s)
    if isinstance(r, Sine):
        return bench.sine(r.amplitude_rad_s, r.frequency_hz, r.phase_rad)
    return bench.sweep(r.maximum_rad_s, r.period_s or duration, duration)
