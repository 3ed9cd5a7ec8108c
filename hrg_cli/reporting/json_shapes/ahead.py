"""What will be, and what to measure next: plan, forecast, mismatch."""

from __future__ import annotations

from .shape import Check, Common, Number, Shape, Value


class PlannedRun(Shape):
    """A run to do next."""

    run_id: str
    """The run of the menu."""
    reason: str
    """Why."""


class Separation(Shape):
    """Two causes that the planned runs tell apart."""

    causes: list[str]
    """Both causes."""
    before_sigma: Number
    """Their distance now, σ."""
    after_sigma: Number
    """After the runs."""


class Plan(Common):
    """`hrg plan`."""

    runs: list[PlannedRun]
    """The runs chosen."""
    before: dict[str, Number]
    """Standard deviations now, by parameter."""
    after: dict[str, Number]
    """Standard deviations expected after."""
    separations: list[Separation]
    """Each pair to be told apart."""
    impossible: list[str]
    """What no run of the menu can tell: sentences."""


class ForecastOfDrift(Common):
    """`hrg forecast`."""

    drive: str
    """free, force or parametric."""
    trimmed: bool
    """Whether the electric spring is on."""
    scale_factor: float
    """K."""
    mode_number: int
    """Angular mode number m."""
    figures: dict[str, Value]
    """Parts and bounds of the drift, rad/s."""
    trim: dict[str, Number]
    """The electric spring along the stiffest axis and what it leaves."""
    drift: dict[str, list[Number]]
    """D and its parts over the wave angle."""
    table: list[dict[str, Number]]
    """Wave angle and errors after a fix, over time."""
    checks: list[Check]
    """Checks on the forecast."""


class Mismatch(Common):
    """`hrg mismatch`."""

    rows: int
    """Rows written."""
    delay_s: float
    """Time after which the signals are known."""
    noise_density: dict[str, Number]
    """Noise density of each signal, unit/√Hz."""
    latency: list[dict[str, Number]]
    """windows, latency_s, rate_noise_rad_s, rate_noise_found_rad_s of a rate over so many
    windows."""
