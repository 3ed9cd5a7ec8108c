"""What every command prints with --json: one model a command. The documentation and its JSON
schemas are made from these models, and a test holds the commands' real outputs against them.

A figure that is not finite, or that a result does not have, is null. Keys of a table that are
names (of parameters, effects, columns) are free; every other key is listed, and no other is
printed.
"""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field

Number = float | None
Status = Literal["valid", "suspect", "refused"]


class Shape(BaseModel):
    """A JSON object whose keys are all declared."""

    model_config = ConfigDict(
        extra="forbid", strict=True, populate_by_name=True, use_attribute_docstrings=True
    )


class Common(Shape):
    """The keys that every command's JSON has."""

    kind: str
    """Kind of the file written, or what was done."""
    status: Status
    """Validity; exit status 3 where it is refused, or suspect with --strict."""
    status_reasons: list[str]
    """Why it is not valid, and what else should be known: sentences."""
    output: str | None
    """File or folder written."""
    elapsed_s: float
    """Time taken."""


class Value(Shape):
    """A number with its standard deviation."""

    value: Number
    """The number."""
    std: Number
    """Its standard deviation."""


class Estimated(Value):
    """A parameter with its standard deviation and unit."""

    units: str
    """Unit."""


class Check(Shape):
    """A check on the final result that could have failed."""

    name: str
    """The check."""
    value: Number
    """What was found."""
    limit: Number
    """What was allowed."""
    passed: bool
    """Whether it passed."""
    sentence: str
    """What it means."""


class Before(Shape):
    """A figure before and after the correction."""

    before: Number
    """Without the correction."""
    after: Number
    """With it."""


class HeldOut(Before):
    """A figure before and after the correction, and on data that were left out of the fit."""

    held_out: Number
    """On data left out of the fit."""


class Requirement(Shape):
    """A figure against its limit, as a person reads it."""

    name: str
    """The figure."""
    value: str
    """What was found."""
    limit: str
    """What was wanted."""
    margin_sigma: Number
    """Distance from the limit in σ, negative outside."""
    passed: bool
    """Whether it passed."""


class Departure(Shape):
    """By how much the runs depart from the model."""

    key: str
    """Key of the quantity."""
    words: str
    """The quantity."""
    unit: str
    """Unit."""
    before: Number
    """Without the causes."""
    after: Number
    """With them."""
    held_out: bool
    """Judged on data that the models were not fitted to."""


class Cause(Shape):
    """A cause found, as a person reads it."""

    name: str
    """The effect."""
    words: str
    """In words."""
    size: str
    """Its size with its error."""
    family: str
    """Its family."""
    z: Number
    """Significance, σ."""
    drift_deg_h: Number
    """Its share of the drift, °/h."""
    angle_ppm: Number
    """Its share of the wave angle, ppm of a radian."""
    amplitude_ppm: Number
    """Its share of the amplitude, ppm."""
    frequency_hz: Number
    """Its share of the frequency, Hz."""
    rivals: list[str]
    """What it cannot be told from."""


class ModelParameter(Shape):
    """A parameter of the (extended) model, for people and as it stands in the file."""

    name: str
    """The parameter."""
    label: str
    """In words."""
    text: str
    """Value with error in the unit of the trade."""
    value: Number
    """Value, SI."""
    std: Number
    """Its standard deviation."""
    units: str
    """SI unit."""


class Contradicted(Shape):
    """A value of the supplied model that the runs contradict."""

    name: str
    """The parameter."""
    label: str
    """In words."""
    believed: str
    """What the model said."""
    measured: str
    """What the runs say."""
    sigma: Number
    """Difference in σ."""


class Answer(Shape):
    """What the results of one gyro say: the first lines of the terminal, the page and JUnit."""

    gyro_id: str
    """The gyro."""
    sentence: str
    """The answer in one sentence."""
    health: str
    """Of the gyro: sound, fault found, bench fault, in doubt, not examined."""
    validity: str
    """Of the fit: valid, suspect, refused."""
    verdict: str | None
    """Of the diagnosis."""
    why: list[str]
    """Why the word was given, or not."""
    requirements: list[Requirement]
    """Figures against limits."""
    departure: Departure | None
    """By how much the runs depart from the model."""
    causes: list[Cause]
    """The causes found."""
    parameters: list[ModelParameter]
    """The model."""
    parameters_of: str
    """Which model that is."""
    moved: list[Contradicted]
    """Values of the supplied model that the runs contradict."""
    forecast: str
    """The forecast in one sentence."""
    suspect_runs: list[str]
    """Runs that are not what they say."""
    stability: list[str]
    """Whether the causes stay when the runs are looked at otherwise."""
    next_runs: list[str]
    """What to measure next."""
    equation: str
    """The correction as an equation."""
    snippet: str
    """The correction as code."""
    commands: list[str]
    """What to type next."""


class FitFigures(Shape):
    """How well a model fits."""

    chi2_per_dof: Number
    """χ² per degree of freedom."""
    residual_rms: Number
    """Rms of the residual, unit of the signals."""


class RehearsedFigure(Shape):
    """How one figure's errors compare with its σ over all rehearsals, and the limits of both."""

    name: str
    """The figure."""
    bias_over_std: Number
    """Mean error over σ."""
    error_over_std_rms: Number
    """Rms error over σ; 1 where the errors hold."""
    coverage_68: Number
    """Part of the rehearsals within 68 % intervals."""
    coverage_95: Number
    """Part within 95 % intervals."""
    count: int
    """Rehearsals that gave it."""
    bias_limit: Number
    """Most bias that passes."""
    rms_limit: Number
    """Most rms that passes."""
    rms_least: Number
    """Least rms that passes."""


class NamedAgain(Shape):
    """How often a rehearsed diagnosis named a cause."""

    name: str
    """The cause."""
    held: bool
    """Whether the twin holds it."""
    named: int
    """Rehearsals that named it."""
    times: int
    """Rehearsals that came to an end."""
    sentence: str = ""
    """What is wrong with that, or nothing."""


class RehearsalTable(Shape):
    """How a result's errors compare with its standard deviations on a simulated twin."""

    times: int
    """Rehearsals."""
    figures: list[RehearsedFigure]
    """Each figure."""
    failed: int
    """Rehearsals without a result."""
    statuses: dict[str, int]
    """How many results were valid, suspect, refused."""
    truth: str
    """Where the twin's truth comes from."""
    causes: list[NamedAgain] = []
    """Of a diagnosis: how often each cause was named again, and strangers beside them."""
    colour: list[dict[str, Any]] = []
    """The coloured noise of the twin, by component."""


class Rehearsed(Common):
    """A command that may rehearse its result."""

    rehearsal: RehearsalTable | None = None
    """With --rehearse alone."""


class Import(Common):
    """`hrg import`: what was taken of the log."""

    run_id: str
    """The run."""
    format: str | None = None
    """Format of the log."""
    columns: dict[str, dict[str, Any]] | None = None
    """Role -> column (from 1), name and units of what was taken."""
    samples: int | None = None
    """Samples written."""
    sample_rate_hz: Number = None
    """Sampling rate; null for uneven sampling."""
    duration_s: Number = None
    """Length."""
    gaps: dict[str, Any] | None = None
    """How many gaps (count), the longest (longest_s) and the first of them."""
    not_finite: dict[str, Any] | None = None
    """How many samples are not finite (count), and where the first are."""
    left_out: list[Any] = Field(default=[])
    """Parts of the log that could not be read: place, rows, why."""
    cut: dict[str, Any] | None = None
    """The part asked for by --from-s and --to-s."""
    rows: int | None = None
    """With --envelope: rows of the log."""
    noise: dict[str, Any] | None = None
    """With --envelope: the noise found in the rows and what the windows have of it."""


class SimulatedRun(Shape):
    """One simulated run."""

    output: str
    """Its file."""
    status: Status
    """Its validity."""
    status_reasons: list[str]
    """Why."""
    run_id: str
    """The run."""
    gyro_id: str
    """The gyro."""
    mode: str
    """free or forced."""
    readout: str
    """direct or carrier."""
    carrier_hz: Number
    """Carrier frequency."""
    sample_rate_hz: Number
    """Sampling rate."""
    mode_number: int
    """Angular mode number m."""


class Simulate(Common):
    """`hrg simulate`."""

    outputs: list[str]
    """Files written."""
    runs: list[SimulatedRun]
    """Each run."""


class Inject(Common):
    """`hrg inject`."""

    run_id: str
    """The run."""
    gyro_id: str
    """The gyro."""
    samples: int
    """Samples written."""
    effects: dict[str, dict[str, float]]
    """Effect -> its parameters."""


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


class Identifiability(Shape):
    """What the runs can tell."""

    condition: Number
    """Condition number of the scaled Fisher information."""
    flat_directions: list[str]
    """What these runs cannot tell: sentences."""


class Identify(Rehearsed):
    """`hrg identify`."""

    parameters: dict[str, Estimated]
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


class Rate(Common):
    """`hrg rate`."""

    nodes: int
    """Times at which the rate is fitted."""
    chi2_per_dof: Number
    """χ² per degree of freedom."""
    mean_rate_rad_s: Value
    """Mean rate."""
    median_std_rad_s: Number
    """Median standard deviation of the rate at a node."""
    plain_rate: PlainRate
    """The rate without the resonator as a reference."""
    plain_error_rms_rad_s: Number = None
    """With a logged rate: rms error of the plain rate."""
    error_rms_rad_s: Number = None
    """With a logged rate: rms error of the estimate."""
    checks: list[Check]
    """Checks on the result."""


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
    loops: list[Any] | None = None
    """Loop gains found in the logs."""
    readout_matrix: dict[str, Number] | None = None
    """The read-out's mismatch and its errors."""
    factors: list[dict[str, Any]] | None = None
    """What each term of the model buys: z, held-out χ², drift and scale factor without it."""
    significant: list[str] | None = None
    """Factors beyond chance."""
    correlated: list[Any] | None = None
    """Factors that cannot be told apart."""
    false_rate: Number = None
    """Chance of a false factor."""
    choice: dict[str, Any] | None = None
    """Which model was chosen, and why."""
    checks: list[Check] = Field(default=[])
    """Checks on the result."""
    noise: dict[str, Number] | None = None
    """Noise found over noise stated, angle random walk."""
    resonator: dict[str, Any] | None = None
    """What the resonator files said, of --model physical."""
    stability: dict[str, Any] | None = None
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
    """Spikes left out."""
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


class Compensate(Common):
    """`hrg compensate`. The figures are absent where the run's rate is not logged."""

    residual_rms_rad_s: Before | None = None
    """Rms of rate estimate less logged rate."""
    angle_cell_rms_rad_s: Before | None = None
    """Rms of its means in cells of wave angle."""
    trade: Trade | None = None
    """Figures of the trade."""
    allan: dict[str, Any] | None = None
    """Terms of the Allan variance with intervals, and the fit's χ² per degree of freedom."""


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


class Held(Shape):
    """A parameter that was not fitted."""

    value: float
    """Its value."""
    units: str
    """Unit."""


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
    held: dict[str, Held]
    """Its other parameters."""
    indistinguishable_from: list[str]
    """Effects that these runs cannot tell from it."""
    next_experiment: str | None
    """The run that would."""
    independence: Number
    """Part of it that no parameter of the base model imitates."""
    share: dict[str, Any] | None = None
    """What it does to drift, angle, amplitude and frequency: the model with and without it."""


class Tested(Shape):
    """An effect that was looked for."""

    name: str
    """The effect."""
    z: Number
    """Its score beside the base model, σ."""
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
    why_not: str | None = None
    """Why not."""


class NotSeparable(Shape):
    """What these runs cannot tell apart."""

    effects: list[str]
    """Effects that are one to these runs."""
    base: str | None
    """What of the base model hides them; null: they hide one another."""
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
    shapes: list[dict[str, Any]] | None = None
    """Forms that were tried, with their χ²."""


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
    parts: dict[str, Any]
    """Errors of drift, angle, amplitude."""
    course: list[dict[str, Any]]
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
    scores: dict[str, Any] | None = None
    """The one-step estimate of every cause that can be compared between gyros: names, units, value,
    std, correlation (lower triangle)."""
    remainder: Remainder | None
    """What the catalogue does not describe."""
    lines: list[dict[str, Any]]
    """Causes told from the samples' own spectrum."""
    frequencies: dict[str, Any]
    """The runs' frequencies (hz, std_hz), what they follow, their scatter; a sentence."""
    wander: list[dict[str, Any]]
    """Coloured noise by component: after an hour, correlation time, white level over stated."""
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


class PlannedRun(Shape):
    """A run to do next."""

    run_id: str
    """The run of the menu."""
    reason: str
    """Why."""


class Plan(Common):
    """`hrg plan`."""

    runs: list[PlannedRun]
    """The runs chosen."""
    before: dict[str, Number]
    """Standard deviations now, by parameter."""
    after: dict[str, Number]
    """Standard deviations expected after."""
    separations: list[dict[str, Any]]
    """causes, before_sigma, after_sigma of each pair to be told apart."""
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


class Moved(Shape):
    """A coefficient that moved."""

    name: str
    """The coefficient."""
    before: Number
    """At the tables' time."""
    now: Number
    """Now."""
    std: Number
    """Standard deviation of the difference."""
    moved_sigma: Number
    """Difference in σ."""


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


class CheckedFile(Shape):
    """A file that was checked."""

    file: str
    """The file."""
    kind: str
    """Its kind."""
    passed: bool
    """Whether it passed."""
    moved: list[str] | None
    """What is too far from the baseline; null: not compared."""


class Row(Shape):
    """A figure against its limits."""

    file: str
    """The file."""
    name: str
    """The figure."""
    value: Number
    """Its value; null: the file does not hold it."""
    minimum: Number
    """Least that passes."""
    maximum: Number
    """Most that passes."""
    passed: bool
    """Whether it passed."""
    words: list[str] | None
    """Of a figure that is no number: what was found, what was wanted."""
    std: Number
    """Its standard deviation."""
    units: str
    """Unit."""
    margin_sigma: Number
    """Distance from the nearest limit in σ, negative outside."""


class CheckFiles(Common):
    """`hrg check`."""

    passed: bool
    """Whether every figure of every file passed."""
    answer: Answer | None
    """What it means for the gyro."""
    files: list[CheckedFile]
    """Each file."""
    rows: list[Row]
    """Each figure."""


class Difference(Shape):
    """A figure of both results."""

    name: str
    """The figure."""
    old: Number
    """Its old value."""
    old_std: Number
    """Its standard deviation."""
    new: Number
    """Its new value."""
    new_std: Number
    """Its standard deviation."""
    units: str
    """Unit."""
    difference: Number
    """new − old."""
    sigma: Number
    """The difference over the root of both variances' sum."""


class Words(Shape):
    """A text that differs."""

    name: str
    """What."""
    old: Any
    """In the old result."""
    new: Any
    """In the new one."""


class Diff(Common):
    """`hrg diff`."""

    largest_sigma: Number
    """The largest difference in σ."""
    differences: list[Difference]
    """Every figure of both."""
    only_old: list[str]
    """Figures of the old result alone."""
    only_new: list[str]
    """Figures of the new result alone."""
    words: list[Words]
    """Texts that differ."""


class Reported(Shape):
    """The worst validity among the files reported on."""

    status: Status
    """The worst."""
    status_reasons: list[str]
    """Why."""


class Report(Common):
    """`hrg report`."""

    files: list[str]
    """Files written."""
    reported: Reported
    """The results' own validity."""


class Source(Shape):
    """An input of a file."""

    name: str
    """Its name."""
    kind: str
    """Its kind."""
    sha256: str
    """Its SHA-256."""
    samples: list[str]
    """SHA-256 of the samples that it goes back to."""


class Info(Common):
    """`hrg info`."""

    facts: dict[str, Any]
    """Attributes and figures by name."""
    answer: Answer | None
    """Of a result: what it means for the gyro."""
    history: list[str]
    """One line for each command that led to it."""
    created: str
    """When, ISO 8601."""
    generated_by: str
    """By which program."""
    sources: list[Source]
    """Its inputs."""


class Verified(Shape):
    """A file that was verified."""

    name: str
    """The file."""
    kind: str
    """Its kind."""
    result: Literal["whole", "without checksums", "changed", "damaged"]
    """How it stands."""
    findings: list[str]
    """What was changed."""
    notes: list[str]
    """What else is worth knowing."""


class Verify(Common):
    """`hrg verify`."""

    files: list[Verified]
    """Each file."""


class Rehearse(Common, RehearsalTable):
    """`hrg rehearse`."""

    file: str
    """The file rehearsed."""
    written: bool
    """Whether the verdict was written into its status."""


class ChainStep(Shape):
    """A step of the chain."""

    name: str
    """The command."""
    inputs: list[str]
    """What it read."""
    output: str
    """What it wrote."""
    status: Literal["valid", "suspect", "refused", "failed", "skipped"]
    """How it ended."""
    reasons: list[str]
    """Why."""
    report: dict[str, Any] = Field(alias="json")
    """Of identify, calibrate and diagnose: the command's JSON."""
    checks: list[dict[str, Any]]
    """Figures against limits: name, passed, sentence."""


class Run(Common):
    """`hrg run`; with --dry-run the steps are command lines, and answer and report are absent."""

    answer: Answer | None = None
    """What it means for the gyro."""
    steps: list[ChainStep] | list[str]
    """Each step."""
    report: str | None = None
    """The page."""


class Lot(Common):
    """`hrg batch`."""

    lot_id: str
    """The lot."""
    gyros: int
    """Gyros."""
    passed: int
    """Gyros that passed."""
    recordings: int
    """Recordings."""
    recordings_failed: int
    """Recordings that could not be used."""
    unreadable: list[dict[str, Any]] = []
    """Recordings that could not be read: name, the gyro they are of, by what that is told, why."""
    outliers: list[str]
    """Gyros that stand out of the lot."""
    outlier_rate: Number = None
    """Chance that a lot without outliers is given one; none where the distance is fixed."""
    worst: list[str] = []
    """The gyros to look at first."""
    lot_causes: list[dict[str, Any]] = []
    """What gyros have in common: kind, name, parameter, sentence, group, value, std, spread, z, the
    estimates of every gyro."""
    lot_tests: dict[str, Any] = {}
    """How many pairs of cause and group were tried, at what rate of false alarms."""
    populations: dict[str, Any] = {}
    """Mean and own spread of every parameter over the gyros, the measurement's σ taken off."""
    ledger: dict[str, Any] | None = None
    """With --ledger: its path, and how many results were added and known."""
    rows: list[dict[str, Any]]
    """Each gyro: gyro_id, status, passed, why, runs, verdict, outliers, and each figure with its
    _std and its robust z (_z) in the lot."""


class LedgerAdd(Common):
    """`hrg ledger add`."""

    ledger: str
    """The ledger."""
    added: int
    """Results entered."""
    known: int
    """Results that were there already, by SHA-256."""
    files: list[dict[str, Any]]
    """Each file: gyro_id, kind, status, true times, station and so on, sha256, whether it is
    new."""


class LedgerShow(Common):
    """`hrg ledger show`."""

    ledger: str
    """The ledger."""
    entries: int
    """Results told of."""
    refused: int
    """Results left out because they are refused."""
    reprocessed: int
    """Results left out because the same samples were processed again later."""
    false_alarms_expected: Number
    """Points beyond 3 σ to expect by chance in all charts."""
    gyros: list[dict[str, Any]]
    """Each gyro's last result, what moved most in σ, and its limits."""
    figures: list[dict[str, Any]]
    """Each figure: chart, capability, gauge study, risks."""
    golden: list[dict[str, Any]]
    """With --golden: the golden unit's drift at each station."""


class LedgerHistory(Common):
    """`hrg ledger history`."""

    ledger: str
    """The ledger."""
    gyro_id: str
    """The gyro."""
    entries: list[dict[str, Any]]
    """Each result; counts: whether it is the last of its samples."""
    figures: list[dict[str, Any]]
    """Each figure over time: values, σ, moves in σ and in shares of the limit, chart."""
    limits: list[dict[str, Any]]
    """The last result against limits."""


class Study(Common):
    """`hrg study`."""

    name: str
    """The study."""
    settings: dict[str, Any]
    """Its settings."""
    result: dict[str, Any]
    """Its figures."""


class EffectInList(Shape):
    """An effect of the catalogue."""

    name: str
    """The effect."""
    family: str
    """Its family."""
    parameters: list[str]
    """Its parameters."""
    title: str
    """In words."""


class Effects(Common):
    """`hrg effects`, or `hrg effects NAME`."""

    effects: list[EffectInList] | None = None
    """The catalogue, without NAME."""
    name: str | None = None
    """The effect."""
    page: str | None = None
    """Its page."""


SHAPES: dict[str, tuple[type[Common], ...]] = {
    "import": (Import,),
    "simulate": (Simulate,),
    "inject": (Inject,),
    "demodulate": (Demodulate,),
    "estimate": (Estimate,),
    "identify": (Identify,),
    "rate": (Rate,),
    "calibrate": (Calibrate, CalibrateTable),
    "compensate": (Compensate,),
    "diagnose": (Diagnose,),
    "plan": (Plan,),
    "forecast": (ForecastOfDrift,),
    "mismatch": (Mismatch,),
    "update": (Update,),
    "export": (Export,),
    "check": (CheckFiles,),
    "diff": (Diff,),
    "report": (Report,),
    "info": (Info,),
    "verify": (Verify,),
    "rehearse": (Rehearse,),
    "run": (Run,),
    "batch": (Lot,),
    "ledger": (LedgerAdd, LedgerShow, LedgerHistory),
    "study": (Study,),
    "effects": (Effects,),
}
"""Command -> its JSON; of calibrate one of two, of ledger that of its subcommand."""
