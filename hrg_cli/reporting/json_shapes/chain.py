"""The whole chain on a gyro and on a lot: run, batch."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import Field

from .answer import Answer
from .shape import Common, Number, Shape


class StepCheck(Shape):
    """A figure of a step against its limits."""

    name: str
    """The figure."""
    passed: bool
    """Whether it passed."""
    sentence: str
    """What was found and what was wanted."""


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
    checks: list[StepCheck]
    """Figures against limits."""


class Run(Common):
    """`hrg run`; with --dry-run the steps are command lines, and answer and report are absent."""

    answer: Answer | None = None
    """What it means for the gyro."""
    steps: list[ChainStep] | list[str]
    """Each step."""
    undiagnosed: list[str] = Field(default=[])
    """Forced waves beside free ones, which the diagnosis did not take."""
    report: str | None = None
    """The page."""


class Unreadable(Shape):
    """A recording of a lot that could not be read."""

    name: str
    """Its name."""
    gyro_id: str
    """The gyro it is of; empty where nothing tells."""
    told_by: str
    """By what that is told."""
    error: str
    """Why it could not be read."""


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
    unreadable: list[Unreadable] = Field(default=[])
    """Recordings that could not be read."""
    runs_undiagnosed: int = Field(default=0)
    """Driven runs beside free ones, which no diagnosis took."""
    outliers: list[str]
    """Gyros that stand out of the lot."""
    outlier_rate: Number = None
    """Chance that a lot without outliers is given one; none where the distance is fixed."""
    worst: list[str] = Field(default=[])
    """The gyros to look at first."""
    lot_causes: list[dict[str, Any]] = Field(default=[])
    """What gyros have in common: kind, name, parameter, sentence, group, value, std, spread, z, the
    estimates of every gyro."""
    lot_tests: dict[str, Any] = Field(default={})
    """How many pairs of cause and group were tried, at what rate of false alarms."""
    populations: dict[str, Any] = Field(default={})
    """Mean and own spread of every parameter over the gyros, the measurement's σ taken off."""
    ledger: dict[str, Any] | None = None
    """With --ledger: its path, and how many results were added and known."""
    rows: list[dict[str, Any]]
    """Each gyro: gyro_id, status, passed, why, runs, verdict, outliers, and each figure with its
    _std and its robust z (_z) in the lot."""
