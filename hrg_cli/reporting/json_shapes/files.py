"""Commands on finished files: check, diff, report, info, verify."""

from __future__ import annotations

from typing import Any, Literal

from .answer import Answer
from .shape import Common, Number, Shape, Status


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
    kind: str = ""
    """Kind of the file that it is a figure of."""
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
    not_followed: list[str]
    """Sources that do not lie in the folder."""


class Verify(Common):
    """`hrg verify`."""

    files: list[Verified]
    """Each file."""
