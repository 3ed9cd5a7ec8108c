"""What the model gets wrong: diagnose."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from .answer import Answer
from .shape import Before, Check, Common, Estimated, FitFigures, Number, Shape


class BaseValue(Estimated):
    """A parameter of the linear resonator beside the causes."""

    name: str
    """The parameter."""
    believed: Number = None
    """With --model: its value there."""
    sigma: Number = None
    """With --model: the difference in σ of both."""
    wrong: bool | None = None
    """With --model: whether the difference is beyond 4 σ."""
    assumed: bool = False
    """Whether the runs do not show it: the value is what is usual, σ as large as that."""
    sum_with: list[str] = Field(default=[])
    """Causes of the drive, and loops that act late (`loop_delay`), that these runs cannot tell from
    it: the value is the sum, and σ holds what they may add."""
    doubted_for: list[str] = Field(default=[])
    """Causes neither named nor excluded that may move it by more than these runs show it to; σ
    holds by how much."""


class Held(Shape):
    """A parameter that was not fitted."""

    value: float
    """Its value."""
    units: str
    """Unit."""


class Share(Shape):
    """What a cause does: the model with it less the model refitted without it, rms."""

    drift_deg_h: Number
    """To the drift m·dθ/dt, °/h."""
    angle_ppm: Number
    """To the angle mθ, ppm of a radian."""
    amplitude_ppm: Number
    """To the amplitude, ppm."""
    frequency_hz: Number
    """To the frequency."""


class Effect(Shape):
    """A cause that was found."""

    name: str
    """The effect (reference: effects)."""
    z: Number
    """Its significance beside the others, σ."""
    p_value: Number
    """Chance, corrected for how many were tried."""
    delta_bic: Number
    """Gain in the Bayesian information criterion when it was taken in."""
    parameters: dict[str, Estimated]
    """Its fitted parameters."""
    held: dict[str, Held] = Field(default={})
    """Its other parameters."""
    indistinguishable_from: list[str]
    """Effects that these runs cannot tell from it."""
    next_experiment: str | None
    """The run that would."""
    independence: Number = None
    """Part of it that no parameter of the base model imitates."""
    view: Literal["waveform"] | None = None
    """waveform: told from the samples' own spectrum or times, not from the motion."""
    magnitude: dict[str, Number] = Field(default={})
    """Of a cause of the waveform: sizes that do not depend on its phase."""
    magnitude_std: dict[str, Number] = Field(default={})
    """Their standard deviations."""
    phase: str | None = None
    """Of a tone far from the oscillation: why its phase is not known."""
    sign: str | None = None
    """Of odd harmonics: why the cause's sign is not known."""
    lines: int | None = None
    """Of a converter: lines of the spectrum that show it."""
    clipped_windows: int | None = None
    """Of a saturation: windows that hold clipped samples."""
    runs: list[str] | None = None
    """Of lost samples: the runs that lost them."""
    what: Literal["lost", "repeated"] | None = None
    """Of lost samples: whether they are missing or stand twice."""
    samples: int | None = None
    """Of lost samples: how many; negative where they stand twice."""
    or_samples: list[int] | None = None
    """Of lost samples: the other numbers that phase and motion allow, which the σ holds."""
    ambiguity_s: Number = None
    """Of lost samples: time that the wave's period leaves open."""
    same_phase_in_all_runs: bool | None = None
    """Of a tone: whether its phase is the same in every run."""
    share: Share | None = None
    """What it does to drift, angle, amplitude and frequency: the model with and without it."""


class Tested(Shape):
    """An effect that was looked for."""

    name: str
    """The effect."""
    z: Number
    """Its score beside the base model, σ."""
    z_left: Number
    """Its score beside the causes that were found, σ."""
    upper_limit: Number
    """95 % upper limit of its size; null where it was found or cannot be seen."""
    units: str
    """Unit of the limit."""
    std: list[Number]
    """Standard deviation of each parameter."""
    independence: Number
    """Part of it that no parameter of the base model imitates."""
    visible: bool
    """Whether these runs can show it."""
    held: dict[str, float] = Field(default={})
    """Its other parameters, where these runs show it with these values alone."""
    why_not: str | None = None
    """Why not."""


class NotSeparable(Shape):
    """What these runs cannot tell apart."""

    effects: list[str]
    """Effects that are one to these runs."""
    base: str | None
    """What of the base model hides them, or the mistake of one run that leaves as little; null:
    they hide one another."""
    next_experiment: str | None
    """The run that would tell."""


class Correlations(Shape):
    """Correlations of the effects' scores."""

    names: list[str]
    """The effects."""
    matrix: list[list[float]]
    """Their correlations."""


class Term(Shape):
    """An open term of the remainder."""

    place: str
    """Where it stands in the equations."""
    covariate: str
    """What it follows."""
    harmonic: int | None
    """Harmonic of the wave angle."""
    formula: str
    """As a formula."""
    size: float
    """Size."""
    std: float
    """Its standard deviation."""
    units: str
    """Unit."""
    z: float
    """Significance, σ."""


class TriedShape(Shape):
    """A form of the rest that was tried."""

    name: str
    """In words."""
    chi2: Number
    """χ² with it."""


class Remainder(Shape):
    """What the catalogue does not describe."""

    description: str
    """In words."""
    covariate: str | None
    """What it follows."""
    harmonic: int | None
    """Harmonic of the wave angle."""
    formula: str | None
    """As a formula."""
    terms: list[Term]
    """The terms found."""
    power: dict[str, Number] | None = None
    """Power of the amplitude, with its standard deviation."""
    shapes: list[TriedShape] | None = None
    """Forms that were tried."""


class BeforeAfter(Before):
    """A prediction error with and without the causes, and its standard deviations."""

    before_std: Number
    """Standard deviation of the first."""
    after_std: Number
    """Of the second."""


class Gain(Before):
    """What the causes gain on data left out of the fit (rms over the noise)."""

    held_out: str
    """What was left out: runs, or time."""
    ratio: Number
    """after/before."""
    std: Number
    """Its standard deviation."""
    drift_error_deg_h: BeforeAfter | None = None
    """Error of the predicted drift, °/h."""
    angle_error_ppm: BeforeAfter | None = None
    """Error of the predicted wave angle, ppm of a radian."""
    amplitude_error_ppm: BeforeAfter | None = None
    """Error of the predicted amplitude, ppm."""


class PredictionErrors(Shape):
    """Rms errors of a prediction."""

    angle_deg: Number
    """Of the wave angle, °."""
    amplitude_percent: Number
    """Of the amplitude, %."""
    quadrature_percent: Number
    """Of the quadrature, % of the amplitude."""
    phase_deg: Number
    """Of the phase, °."""


class BothPredictions(Shape):
    """Errors with and without the causes."""

    before: PredictionErrors
    """Without."""
    after: PredictionErrors
    """With."""


class ErrorCourse(Shape):
    """Errors of a predicted run against time, with and without the causes."""

    run: str
    """The run."""
    time_s: list[float]
    """Times."""
    before: dict[str, list[Number]]
    """Without: the parts of PredictionErrors, each a list over the times."""
    after: dict[str, list[Number]]
    """With."""


class Forecast(Before):
    """Prediction by causes that were chosen without the data predicted."""

    held_out: str
    """What was left out: runs, or time."""
    ratio: Number
    """after/before."""
    low: Number
    """Lower end of its interval."""
    high: Number
    """Upper end."""
    std: Number
    """Standard deviation of its logarithm."""
    unit: str
    """Unit of before and after."""
    chosen: list[list[str]]
    """The causes chosen in each part."""
    train_fraction: float
    """Part of the data that they were chosen on."""
    parts: BothPredictions
    """Errors of drift, angle, amplitude."""
    course: list[ErrorCourse]
    """Errors against time."""
    sentence: str
    """In words."""


class WrittenModel(Shape):
    """The written extended model, simulated and held against the measurement."""

    rms_over_noise: Number
    """Rms of measurement less simulation over the noise."""
    fitted_rms_over_noise: Number
    """The same of the fit."""
    share: Number = None
    """Rms of simulation less fit over the noise."""


class SuspectRun(Shape):
    """A run that is not what it says."""

    run_id: str
    """The run."""
    what: str
    """What is wrong with it."""
    evidence: str
    """By what it was seen."""
    correction: str
    """What to do."""
    z: Number = None
    """Significance, σ."""


class Stability(Shape):
    """The causes' names where the same runs are looked at otherwise."""

    change: str
    """What was changed."""
    effects: list[str]
    """The causes found then."""


class Scores(Shape):
    """The one-step estimate of every cause that can be compared between gyros."""

    names: list[str]
    """effect.parameter."""
    units: list[str]
    """Units."""
    value: list[Number]
    """Estimates, off neutral."""
    std: list[Number]
    """Their standard deviations."""
    correlation: list[list[Number]]
    """Lower triangle without the diagonal."""


class SpectralLine(Shape):
    """A line of the samples' residual, and what it means."""

    frequency_hz: float
    """Frequency."""
    amplitude: list[Number]
    """Amplitude in channel C and S."""
    power_over_floor: Number
    """Power over the noise floor."""
    multiple: int | None
    """Which harmonic of the oscillation it is."""
    meaning: str
    """In words."""


class Frequencies(Shape):
    """The runs' own frequencies; empty where a run is not what it says."""

    hz: list[float] = Field(default=[])
    """Of each run."""
    std_hz: list[Number] = Field(default=[])
    """Their standard deviations."""
    follow: list[str] = Field(default=[])
    """Causes that they follow."""
    would_follow: list[str] = Field(default=[])
    """Causes that would make them differ so, where too few runs tell them from chance."""
    scatter_hz: Number = None
    """Scatter beyond the errors."""
    sigma: Number = None
    """Its significance, σ."""
    sentence: str = ""
    """In words."""


class Wander(Shape):
    """Coloured noise of a component."""

    component: str
    """amplitude, phase, angle or ellipticity."""
    after_one_hour: Number
    """Standard deviation after an hour."""
    units: str
    """Its unit."""
    correlation_s: Number
    """Correlation time of its rate."""
    white_over_stated: Number
    """White level over the stated σ."""


class Diagnose(Common):
    """`hrg diagnose`."""

    verdict: Literal["adequate", "explained", "partly explained", "unexplained"]
    """adequate: the model you believe; explained: with the causes below."""
    mode_number: int
    """Angular mode number m."""
    baseline: FitFigures
    """The base model alone."""
    after: FitFigures
    """With the causes."""
    values: list[BaseValue]
    """The linear resonator beside the causes."""
    covariance: list[list[float]] = Field(default=[])
    """Covariance of these values."""
    effects: list[Effect]
    """The causes, in the order found."""
    gain: Gain
    """What they gain on data left out."""
    forecast: Forecast | None
    """Causes chosen without the data that they predict."""
    tested: list[Tested]
    """Every effect of the catalogue: score and upper limit."""
    not_separable: list[NotSeparable]
    """What these runs cannot tell apart."""
    correlations: Correlations
    """Of the effects' scores."""
    noise_factor: float
    """Variance inflation by noise that is not white."""
    scores: Scores | None = None
    """The one-step estimate of every cause that can be compared between gyros."""
    remainder: Remainder | None
    """What the catalogue does not describe."""
    lines: list[SpectralLine]
    """Lines of the samples' own spectrum."""
    frequencies: Frequencies
    """The runs' own frequencies, and what they follow."""
    wander: list[Wander]
    """Coloured noise by component."""
    checks: list[Check]
    """All passed where the verdict is adequate or explained."""
    written_model: WrittenModel | None
    """The written model against the measurement."""
    suspect_runs: list[SuspectRun]
    """Runs that are not what they say."""
    stability: list[Stability]
    """The causes where the same runs are looked at otherwise."""
    extended_model: str | None
    """File of the extended model (TOML that `hrg simulate` runs)."""
    extended_resonator: str | None
    """File of its resonator."""
    answer: Answer | None
    """What it means for the gyro."""
