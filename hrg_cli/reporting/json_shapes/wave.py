"""From samples to the standing wave: demodulate, estimate."""

from __future__ import annotations

from .shape import Common, Number, Shape, Value


class Flagged(Shape):
    """Windows with each flag."""

    clipped: int
    """Clipped samples."""
    gap: int
    """A gap in the samples."""
    not_finite: int
    """Samples that are not finite."""
    settling: int
    """Before the motion has settled."""


class ResidualLine(Shape):
    """A line that stands out of the residual's spectrum."""

    frequency_hz: float
    """Frequency."""
    amplitude: list[float]
    """Amplitude in channel C and S."""
    power_ratio: float
    """Power over the noise floor."""


class Demodulate(Common):
    """`hrg demodulate`."""

    windows: int
    """Windows."""
    reference_frequency_hz: float
    """Frequency of the reference phase."""
    periods_per_window: float
    """Oscillation periods in a window."""
    window_s: float
    """Length of a window."""
    duration_s: float
    """Length of the run."""
    residual_rms: list[Number]
    """Median rms of what the fit leaves, channel C and S."""
    flagged: Flagged
    """How many windows have each flag."""
    residual_lines: list[ResidualLine]
    """The strongest lines of the residual, at most 8."""


class FirstLast(Shape):
    """A course's first and last value."""

    first: float
    """Of the first usable window."""
    last: float
    """Of the last one."""


class FirstLastUnits(FirstLast):
    """A course's first and last value with its unit."""

    units: str
    """Unit."""


class Estimate(Common):
    """`hrg estimate`. The figures are absent where no window is usable."""

    windows: int
    """Windows."""
    usable: int
    """Windows without a flag whose solution converged."""
    flagged: int
    """Windows with a flag."""
    not_converged: int
    """Windows whose solver did not converge."""
    main_amplitude: FirstLastUnits | None = None
    """Main amplitude a_A."""
    quadrature_ratio_rms: Number = None
    """Rms of a_B/a_A."""
    wave_angle_rad: FirstLast | None = None
    """Wave angle θ, unwrapped."""
    wave_angle_std_rad: Number = None
    """Median of its standard deviation."""
    frequency_hz: Number = None
    """Median oscillation frequency."""
    residual_rms: Number = None
    """Rms of the redundant equations' residual."""
    carrier_phase_difference_rad: Value | None = None
    """The carrier's phase of S less that of C, taken off where it is more than 5 σ."""
