"""The resonator and the rate from free runs: identify, rate."""

from __future__ import annotations

from typing import Any

from .rehearsal import Rehearsed
from .shape import Check, Common, Estimated, Number, Shape, Value


class Identifiability(Shape):
    """What the runs can tell."""

    condition: Number
    """Condition number of the scaled Fisher information."""
    flat_directions: list[str]
    """What these runs cannot tell: sentences."""


class Parameter(Estimated):
    """A parameter of the resonator."""

    assumed: bool = False
    """Whether the runs do not show it: the value was given, σ is the range it may have."""


class Identify(Rehearsed):
    """`hrg identify`."""

    parameters: dict[str, Parameter]
    """The resonator by the names of its parameters."""
    chi2_per_dof: Number
    """χ² per degree of freedom."""
    runs: list[str]
    """The runs used."""
    identifiability: Identifiability
    """What these runs can and cannot tell."""
    method: str
    """Method of identification."""
    checks: list[Check]
    """Checks on the result."""
    details: dict[str, Any]
    """What the method tells beside: frequencies of the runs, comparison of methods, profiles,
    Cramér–Rao bounds."""


class PlainRate(Shape):
    """The rate from −m·dθ/dt/K alone, without the resonator."""

    equation: str
    """The equation used."""
    mean_rad_s: float
    """Its mean."""
    difference_mean_rad_s: float
    """Mean of its difference from the estimate: the drift."""
    difference_rms_rad_s: float
    """Rms of that difference."""


class TableRateFigures(Shape):
    """The rate by the tables less that of the reference model, means about the nodes."""

    difference_mean_rad_s: Number | None
    """Mean over the run; null where the tables have no row."""
    difference_rms_rad_s: Number | None
    """Root of the mean square."""


class Rate(Common):
    """`hrg rate`."""

    nodes: int
    """Times at which the rate is fitted."""
    node_distance_s: Number
    """Time from one of them to the next; what changes faster is smoothed over."""
    bandwidth_hz: Number
    """Half of one over that distance: the fastest swing that the nodes can follow."""
    chi2_per_dof: Number
    """χ² per degree of freedom."""
    mean_rate_rad_s: Value
    """Mean rate."""
    median_std_rad_s: Number
    """Median standard deviation of the rate at a node."""
    turned_rad: Value
    """Angle turned from the first node to the last, the integral of the rate."""
    plain_rate: PlainRate
    """The rate without the resonator as a reference."""
    plain_error_rms_rad_s: Number = None
    """With a logged rate: rms error of the plain rate."""
    error_rms_rad_s: Number = None
    """With a logged rate: rms error of the estimate."""
    tables: TableRateFigures | None = None
    """With a calibration: its tables' rate against this one."""
    checks: list[Check]
    """Checks on the result."""
