"""How a result's errors compare with its standard deviations on simulated twins."""

from __future__ import annotations

from pydantic import Field

from .shape import Common, Number, Shape


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
    std_ratio: Number = None
    """The file's own σ over the median of those of the simulated twins; null where it states none
    of the same figure."""
    std_limit: Number = None
    """Factor either way that passes."""


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


class TwinColour(Shape):
    """Coloured noise of one component of the twin, of the strongest run."""

    component: str
    """amplitude, phase, angle or ellipticity."""
    wander_1_s: float
    """Wander in a second."""
    correlation_s: Number
    """Correlation time of its rate."""
    white_over_stated: float
    """White level over the stated σ."""


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
    causes: list[NamedAgain] = Field(default=[])
    """Of a diagnosis: how often each cause was named again, and strangers beside them."""
    colour: list[TwinColour] = Field(default=[])
    """The coloured noise of the twin, by component."""


class Rehearsed(Common):
    """A command that may rehearse its result."""

    rehearsal: RehearsalTable | None = None
    """With --rehearse alone."""


class Rehearse(Common, RehearsalTable):
    """`hrg rehearse`."""

    file: str
    """The file rehearsed."""
    written: bool
    """Whether the verdict was written into its status."""
