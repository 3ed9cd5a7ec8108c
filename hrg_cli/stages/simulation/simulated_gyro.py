"""The gyro of a simulated run in the engines' terms: start, resonator, loops, board, noise,
read-out."""

from __future__ import annotations

import numpy as np

from ...physics import ellipse, readout
from ...physics import noise as noises
from ...physics.electronics import Electronics
from ...physics.plant import Control, Plant, Readout, ThermalCourses
from ...physics.resonator import IDENTITY, Mechanics, make_reflection
from ..simulation_file import SimulationFile
from .device_tables import Course

Array = np.ndarray


def make_start(settings: SimulationFile) -> tuple[Array, float]:
    """Envelopes and electrical angle mθ at t = 0.

    Parameters
    ----------
    settings
        The run, with its [start].

    Returns
    -------
    tuple
        Envelopes (2,) complex in the amplitude's unit, and mθ [rad].

    Examples
    --------
    >>> from hrg_cli.stages.simulation.drawn_settings import draw_settings
    >>> from hrg_cli.stages.simulation.simulated_gyro import make_start
    >>> u, angle = make_start(draw_settings(start={"amplitude": 2.0, "wave_angle_rad": 0.25}))
    >>> abs(u).round(4).tolist(), angle
    ([1.7552, 0.9589], 0.5)
    """
    start = settings.start
    a_A, a_B, angle, phase = np.array(
        [start.amplitude, start.quadrature, start.wave_angle_rad, start.phase_rad]
    )
    mode_number = settings.device.mode_number
    return (
        ellipse.compute_envelopes(a_A, a_B, angle, phase, mode_number),
        mode_number * start.wave_angle_rad,
    )


def make_mechanics(settings: SimulationFile) -> Mechanics:
    """The resonator of [device] at the reference temperature.

    Parameters
    ----------
    settings
        The run.

    Returns
    -------
    Mechanics
        The parameters in SI units, whichever way the file gives damping and splits.

    Examples
    --------
    >>> import math
    >>> from hrg_cli.stages.simulation.drawn_settings import draw_settings
    >>> from hrg_cli.stages.simulation.simulated_gyro import make_mechanics
    >>> round(make_mechanics(draw_settings()).damping_rate_1_s / math.pi, 9)  # f/Q
    0.01
    """
    d = settings.device
    return Mechanics(
        d.frequency_hz, d.rate_1_s, d.split_1_s, d.damping_axis_rad, d.frequency_split,
        d.stiffness_axis_rad, d.scale_factor, d.mode_number
    )  # fmt: skip


def make_courses(settings: SimulationFile) -> ThermalCourses:
    """The courses of the resonator's parameters over temperature, [device.temperature].

    Parameters
    ----------
    settings
        The run.

    Returns
    -------
    ThermalCourses
        Coefficients of powers of T − T₀ for each parameter.

    Examples
    --------
    >>> from hrg_cli.stages.simulation.drawn_settings import draw_settings
    >>> from hrg_cli.stages.simulation.simulated_gyro import make_courses
    >>> make_courses(draw_settings()).reference_degc
    20.0
    """
    t = settings.device.temperature

    def course(given: Course) -> tuple[float, ...]:
        return tuple(given) if isinstance(given, list) else (given,)

    return ThermalCourses(
        t.reference_degc,
        course(t.frequency_per_degc),
        course(t.damping_rate_per_degc),
        course(t.damping_split_per_degc),
        course(t.frequency_split_per_degc),
        course(t.scale_factor_per_degc),
    )


def make_control(settings: SimulationFile) -> Control:
    """The loops of [control].

    Parameters
    ----------
    settings
        The run.

    Returns
    -------
    Control
        Loops that are off in a free run; the amplitude's integral is such that its two rates are
        equal, where the file gives none.

    Examples
    --------
    >>> from hrg_cli.stages.simulation.drawn_settings import draw_settings
    >>> from hrg_cli.stages.simulation.simulated_gyro import make_control
    >>> forced = make_control(draw_settings(control={"mode": "forced", "amplitude_gain_1_s": 4.0}))
    >>> forced.forced, forced.amplitude_integral_1_s2, make_control(draw_settings()).forced
    (True, 4.0, False)
    """
    c = settings.control
    if c.mode == "free":
        return Control()
    log = np.zeros((0, 3))
    if c.log is not None:
        log = np.column_stack(
            [c.log.time_s, c.log.drive_main, c.log.drive_quadrature or np.zeros(len(c.log.time_s))]
        )
    gain = 5.0 if c.quadrature_gain_1_s is None else c.quadrature_gain_1_s
    return Control(
        forced=True,
        main_amplitude=c.amplitude or settings.start.amplitude,
        amplitude_gain_1_s=c.amplitude_gain_1_s,
        # a quarter of the gain's square: the loop's two rates are equal
        amplitude_integral_1_s2=(
            c.amplitude_gain_1_s**2 / 4
            if c.amplitude_integral_1_s2 is None
            else c.amplitude_integral_1_s2
        ),
        quadrature_loop=c.quadrature_loop,
        quadrature_gain_1_s=gain if c.quadrature_loop != "off" else 0.0,
        quadrature_integral_1_s2=c.quadrature_integral_1_s2,
        drive=c.drive,
        main_phase_error_rad=c.main_phase_error_rad,
        quadrature_phase_error_rad=c.quadrature_phase_error_rad,
        on_off=np.array(c.off_s, float).reshape(-1, 2),
        log=log,
    )


def add_spring(settings: SimulationFile, plant: Plant) -> Plant:
    """The plant with [spring]: W less 2ωs(I + R(2mα)), a softening along α alone.

    Parameters
    ----------
    settings
        The run.
    plant
        That is softened in place.

    Returns
    -------
    Plant
        The same.

    Examples
    --------
    Along α = 0 the stiffness falls by 4ωs, across it nothing changes:

    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.stages.simulation.drawn_settings import draw_settings
    >>> from hrg_cli.stages.simulation.simulated_gyro import add_spring
    >>> plant = Told(stiffness=1e8 * np.eye(2), mechanics=Told(omega_rad_s=1e4))
    >>> soft = add_spring(draw_settings(spring={"size_rad_s": 0.5, "axis_rad": 0.0}), plant)
    >>> (1e8 * np.eye(2) - soft.stiffness).tolist()
    [[20000.0, 0.0], [0.0, 0.0]]
    """
    s = settings.spring
    if s is not None:
        axis = IDENTITY + make_reflection(2 * settings.device.mode_number * s.axis_rad)
        plant.stiffness = plant.stiffness - 2 * plant.mechanics.omega_rad_s * s.size_rad_s * axis
    return plant


def make_electronics(settings: SimulationFile, pickoff: Readout) -> Electronics | None:
    """The board of [electronics], with the converter of the read-out.

    Parameters
    ----------
    settings
        The run.
    pickoff
        Its read-out, whose converter the board has.

    Returns
    -------
    Electronics or None
        None where the file has no such table: the loops are ideal.

    Examples
    --------
    >>> from hrg_cli.stages.simulation.drawn_settings import draw_settings
    >>> from hrg_cli.stages.simulation.simulated_gyro import make_electronics, make_readout
    >>> settings = draw_settings()
    >>> make_electronics(settings, make_readout(settings)) is None
    True
    """
    e = settings.electronics
    if e is None:
        return None
    step = 2 * e.drive_full_scale / 2**e.drive_bits if e.drive_bits and e.drive_full_scale else 0.0
    converter = pickoff.adc_bits > 0
    return Electronics(
        periods_per_update=e.periods_per_update,
        delay_periods=e.delay_periods,
        filter_hz=e.filter_hz or 0.0,
        phase_loop_hz=e.phase_loop_hz,
        adc_step=readout.compute_least_count(pickoff) if converter else 0.0,
        adc_limit=pickoff.full_scale if converter else 0.0,
        drive_step=step,
        drive_limit=e.drive_full_scale or 0.0,
        drive_periods=e.drive_periods,
        phase_product=e.spring_signal == "phase_product",
    )


def make_noise(settings: SimulationFile, pickoff: Readout) -> noises.Noise:
    """What is noisy, in the engine's units.

    Parameters
    ----------
    settings
        The run, with its [noise].
    pickoff
        Its read-out, whose noise of a sample counts.

    Returns
    -------
    Noise
        Thermal noise of the resonator, noise of read-out and drive with their corners.

    Examples
    --------
    >>> from hrg_cli.stages.simulation.drawn_settings import draw_settings
    >>> from hrg_cli.stages.simulation.simulated_gyro import make_noise, make_readout
    >>> settings = draw_settings(readout={"noise": 1e-4})
    >>> make_noise(settings, make_readout(settings)).readout
    0.0001
    """
    n = settings.noise
    warm = n.temperature_k is not None and n.effective_mass_kg is not None
    return noises.Noise(
        (
            noises.compute_thermal_velocity2(
                n.temperature_k or 0.0, n.effective_mass_kg or 1.0, n.metres_per_unit
            )
            if warm
            else 0.0
        ),
        pickoff.noise,
        n.readout_corner_hz,
        n.drive_density,
        n.drive_corner_hz,
    )


def make_readout(settings: SimulationFile) -> Readout:
    """The pick-offs and converter of [readout].

    Where no full scale is given it is 1.5 times the largest amplitude, 3 times with a carrier.

    Parameters
    ----------
    settings
        The run.

    Returns
    -------
    Readout
        In the amplitude's unit.

    Examples
    --------
    >>> from hrg_cli.stages.simulation.drawn_settings import draw_settings
    >>> from hrg_cli.stages.simulation.simulated_gyro import make_readout
    >>> make_readout(draw_settings(start={"amplitude": 2.0})).full_scale
    3.0
    """
    r = settings.readout
    largest = max(settings.start.amplitude, settings.control.amplitude or 0.0)
    return Readout(
        kind=r.kind,
        carrier_hz=r.carrier_hz or 0.0,
        carrier_phase_rad=r.carrier_phase_rad,
        model=r.model,
        gap=r.gap or 1.0,
        law=r.law,
        gaps=np.array(r.electrode_gaps),
        gains=np.array(r.electrode_gains),
        noise=r.noise,
        adc_bits=r.adc_bits,
        full_scale=r.full_scale or (3.0 if r.kind == "carrier" else 1.5) * largest,
        clock_error=r.clock_error,
    )
