"""What results say of a gyro, as a person reads it."""

from __future__ import annotations

from .shape import Number, Shape


class Requirement(Shape):
    """A figure against its limit, as a person reads it."""

    name: str
    """The figure."""
    label: str
    """The figure in words."""
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
