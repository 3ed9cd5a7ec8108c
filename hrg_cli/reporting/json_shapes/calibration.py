"""Making the tables and using them: calibrate, compensate, update, export."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from .diagnosis import SuspectRun
from .rehearsal import Rehearsed
from .shape import Before, Check, Common, Estimated, HeldOut, Number, Shape


class Accuracy(Shape):
    """What a model of the tables leaves, with 95 % intervals."""

    drift_rms_rad_s: Number
    """Rms of the drift left."""
    scale_factor_rms_ppm: Number
    """Rms of the scale factor left."""
    drift_interval_rad_s: list[Number]
    """Its interval: low, high."""
    scale_factor_interval_ppm: list[Number]
    """Its interval: low, high."""


class Step(Accuracy):
    """A stage of the ladder of accuracy."""

    stage: str
    """The stage."""
    note: str | None = None
    """What should be known of it."""


class Variant(Accuracy):
    """A model of the drift that was tried."""

    model: str
    """The model."""
    coefficients: int
    """Its coefficients."""
    held_out_chi2_per_row: Number
    """χ² per row on data left out."""
    passed: bool
    """Whether its closing checks passed."""
    why_not: list[str]
    """Which of them did not."""


class LoopFault(Estimated):
    """What is wrong with a loop, in the catalogue's names, and how late loops act."""

    name: str
    """The effect, or `loop_delay`."""
    z: Number
    """Its significance, σ."""


class Hour(Shape):
    """The tables' standard deviations, rms over nodes and angles, now and with an hour more."""

    recorded_s: Number
    """Time recorded."""
    drift_std_rad_s: Number
    """Of the drift, now."""
    drift_std_with_it_rad_s: Number
    """Of the drift, with the hour."""
    scale_factor_std_ppm: Number
    """Of the scale factor, now."""
    scale_factor_std_with_it_ppm: Number
    """Of the scale factor, with the hour."""


class Factor(Shape):
    """What a term of the model buys."""

    name: str
    """The term."""
    needs: str
    """What has to be measured for it."""
    coefficients: int
    """Its coefficients."""
    z: Number
    """Its significance, σ."""
    held_out_chi2_gain: Number
    """What it gains on data left out."""
    independence: Number
    """Part of it that no other term imitates."""
    drift_without_rad_s: Number
    """Rms drift without it."""
    scale_without_ppm: Number
    """Rms of the scale factor without it."""
    drift_bought_rad_s: Number
    """Difference of the drift that it makes."""
    scale_bought_ppm: Number
    """Difference of the scale factor."""
    values: list[Number] | None = None
    """Its coefficients, where it is no table."""
    std: list[Number] | None = None
    """Their standard deviations."""


class Choice(Shape):
    """Which model `auto` takes."""

    model: str
    """The model."""
    why: str
    """Why."""
    fitting: list[str]
    """Models whose checks passed."""
    not_tried: dict[str, str]
    """Models that were not tried, and why."""
    weights: dict[str, Number] | None = None
    """How each model that passed counts in the standard deviations that are stated."""


class Repeated(Shape):
    """Whether a harmonic repeats between programmes."""

    name: str
    """In words."""
    kind: Literal["drift", "scale"]
    """Of which table."""
    harmonic: int
    """Its order in 2mθ."""
    p_value: Number
    """Chance of such a scatter where it repeats."""
    scatter: Number
    """Scatter between programmes."""
    amplitude: Number
    """Its own size."""
    repeats: bool
    """Whether it repeats."""
    stable: bool
    """Whether it predicts: it repeats, or scatters by less than its size."""


class Programmes(Shape):
    """Whether the tables repeat between programmes."""

    told_by: str
    """What tells programmes apart."""
    programmes: list[str]
    """The programmes."""
    not_enough_alone: list[str]
    """Programmes that cannot tell the tables alone."""
    harmonics: list[Repeated]
    """Each harmonic."""


class RateLog(Shape):
    """How late the rate logs are against the samples; negative: early."""

    late_s: float
    """Seconds, as the waves' turns show."""
    std_s: float
    """Standard deviation."""
    taken_off_s: float
    """What was taken off the logs' times before the tables were made; 0 where none is shown."""


class Calibrate(Rehearsed):
    """`hrg calibrate` of wave files."""

    drift_rms_rad_s: HeldOut
    """Rms drift."""
    scale_factor_rms_ppm: HeldOut
    """Rms departure of the scale factor."""
    harmonics: int
    """Band limit of the drift, harmonics of 2mθ."""
    scale_factor_harmonics: int
    """Band limit of K."""
    scale_factor: Number
    """Mean K."""
    model: str
    """Model of the drift."""
    nodes: list[float]
    """Nodes, °C or Hz."""
    held_out_by: str
    """What was left out for the held-out figures."""
    ladder: list[Step]
    """The stages of accuracy, with --ladder all seven."""
    trade: dict[str, Number] | None = None
    """Figures of the trade: bias, its dependences, scale factor, its errors."""
    hour: Hour | None = None
    """What one hour more of recordings brings."""
    loops: list[LoopFault] | None = None
    """What is wrong with the loops."""
    readout_matrix: dict[str, Number] | None = None
    """The read-out's mismatch and its errors."""
    factors: list[Factor] | None = None
    """What each term of the model buys."""
    significant: list[str] | None = None
    """Factors beyond chance."""
    correlated: list[tuple[str, str, float]] | None = None
    """Factors that cannot be told apart: both names, correlation."""
    false_rate: Number = None
    """Chance of a false factor."""
    choice: Choice | None = None
    """Which model was chosen, and why."""
    checks: list[Check] = Field(default=[])
    """Checks on the result."""
    noise: dict[str, Number] | None = None
    """Noise found over noise stated, angle random walk."""
    rate_log: RateLog | None = None
    """Lateness of the rate logs, where a rate changes within a run."""
    suspect_runs: list[SuspectRun] | None = None
    """Runs that the others contradict, where there are such."""
    resonator: list[dict[str, Any]] | None = None
    """With --model physical, a row a resonator: its node, each coefficient with its _std, their
    covariance."""
    stability: Programmes | None = None
    """Whether each harmonic repeats between programmes."""
    variants: list[Variant] | None = None
    """The models tried."""


class CalibrateTable(Common):
    """`hrg calibrate` of a table of dwells."""

    drift_rms_rad_s: HeldOut
    """Rms of the output less the tables, as a rate."""
    scale_factor_rms_ppm: HeldOut
    """The same as a part of the largest rate."""
    residual_rms_rad_s: HeldOut
    """The same as the drift's."""
    harmonics: int
    """0: there is no wave angle."""
    ladder: list[Step]
    """Empty."""
    nodes: list[float]
    """Nodes of the temperature."""
    trade: dict[str, Number]
    """Figures of the trade: nonlinearity and asymmetry of the scale factor."""
    nominal_scale: float
    """Output for 1 rad/s."""
    powers: list[int]
    """Powers of the rate taken in."""
    power_coefficients: list[float]
    """Their coefficients."""
    held_out_by_power: dict[str, Number]
    """Held-out error by highest power."""
    rows: int
    """Rows of the table."""
    rejected: int
    """Spikes and unconfirmed ends left out."""
    rejected_rows: list[int]
    """Their rows, counted from 1 below the columns' names."""
    nonlinearity_ppm: Number = None
    """Of the scale factor, where the gyro turned."""
    asymmetry_ppm: Number = None
    """Of the scale factor, where the gyro turned."""
    scale_factor_coefficient_ppm_per_degc: Number = None
    """With a temperature."""
    bias_coefficient_rad_s_per_degc: Number = None
    """With a temperature."""


class Trade(Shape):
    """Figures of the trade of a compensated run."""

    bias_residual_rad_s: Number
    """Bias left."""
    white_angle_noise_rad: Number
    """White angle noise."""
    angle_random_walk_rad_sqrt_s: Number
    """Angle random walk; null: below what the run can show."""
    bias_instability_rad_s: Number
    """Bias instability; null: below what the run can show."""
    rate_random_walk_rad_s_sqrt_s: Number
    """Rate random walk; null: below what the run can show."""


class RateStd(Shape):
    """Stated standard deviations of the rates, rms over the run."""

    rms: float
    """All of it."""
    by_noise: float
    """By the noise of the wave angle, of its own in every increment."""
    by_tables: float
    """By the tables, common to all increments at a temperature and an angle."""


class AngleAgainstLog(Shape):
    """The compensated angle against the run's rate log, where it is furthest off."""

    largest_over_std: Number
    """In standard deviations of the angle."""
    error_rad: Number
    """Its error there."""
    time_s: Number
    """When."""


class Compensate(Common):
    """`hrg compensate`. The figures are absent where the run's rate is not logged; those of the
    standard deviation where the windows do not state one."""

    rate_std_rad_s: RateStd | None = None
    """Stated standard deviations of the rates."""
    error_over_std_rms: Number = None
    """Rms of rate estimate less logged rate over its standard deviation."""
    angle_against_log: AngleAgainstLog | None = None
    """Where the compensated angle is furthest off the integral of the logged rate."""
    residual_rms_rad_s: Before | None = None
    """Rms of rate estimate less logged rate."""
    angle_cell_rms_rad_s: Before | None = None
    """Rms of its means in cells of wave angle."""
    trade: Trade | None = None
    """Figures of the trade."""
    allan: dict[str, Any] | None = None
    """Terms of the Allan variance with intervals, and the fit's χ² per degree of freedom."""


class Moved(Shape):
    """A coefficient that moved."""

    name: str
    """The coefficient."""
    before: Number
    """At the tables' time."""
    before_std: Number
    """Its standard deviation."""
    now: Number
    """Now."""
    now_std: Number
    """Its standard deviation."""
    std: Number
    """Standard deviation of the difference."""
    moved_sigma: Number
    """Difference in σ."""
    tables: Literal["replaced", "combined", "shifted", "kept"]
    """What became of the tables'."""


class Update(Common):
    """`hrg update`."""

    moved: list[Moved]
    """The coefficients of the drift."""
    chi2: Number
    """χ² of all that moved."""
    p_value: Number
    """Its chance."""
    changed: bool
    """Whether the tables were changed."""
    reference: str
    """What told the state at the tables' time."""
    at: Number
    """Node at which the resonator was found."""
    model: str
    """Model of the drift."""
    nodes: list[float]
    """Nodes, °C or Hz."""


class Export(Common):
    """`hrg export`. The four errors are of a C header alone."""

    drift_rad_s_interpolation: Number = None
    """Largest error of the drift by the nodes' spacing."""
    drift_rad_s_rounding: Number = None
    """Largest error of the drift by rounding."""
    scale_factor_interpolation: Number = None
    """Largest error of K by the nodes' spacing."""
    scale_factor_rounding: Number = None
    """Largest error of K by rounding."""
