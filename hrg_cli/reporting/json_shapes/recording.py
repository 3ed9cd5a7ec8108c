"""Commands that make recordings: import, simulate, inject."""

from __future__ import annotations

from pydantic import Field

from .shape import Common, Number, Shape, Status


class TakenColumn(Shape):
    """A column of the log that was taken."""

    column: int
    """Its place, from 1."""
    name: str
    """Its name in the log."""
    units: str
    """Its unit, empty where neither the log nor an option names one."""
    taken_in: str | None = None
    """The unit that the values became, where it is another one."""


class LeftColumn(Shape):
    """A column of the log of which nothing was taken."""

    column: int
    """Its place, from 1."""
    name: str
    """Its name in the log."""
    units: str
    """Its unit."""
    why: str
    """Why it was left."""


class Gap(Shape):
    """A gap in the times."""

    before: str
    """Place in the log before which it is."""
    length_s: float
    """Its length."""


class Gaps(Shape):
    """The gaps of the times."""

    count: int
    """How many."""
    longest_s: float
    """The longest."""
    first: list[Gap]
    """The first of them."""


class NotFinite(Shape):
    """Samples that are not finite."""

    count: int
    """How many."""
    first: list[str]
    """Where the first of them are."""


class LeftOut(Shape):
    """A part of the log that could not be read."""

    first_line: int
    """Its first line."""
    last_line: int
    """Its last line."""
    rows: int
    """Rows lost."""
    why: str
    """Why."""
    example: str
    """The first of them as it stands."""


class Cut(Shape):
    """The part of the log asked for."""

    from_s: Number
    """--from-s."""
    to_s: Number
    """--to-s."""
    first_s: Number
    """Time of the first row taken."""
    last_s: Number
    """Time of the last one."""
    rows: int
    """Rows outside."""


class RowNoise(Shape):
    """The noise of demodulated rows, and what the windows made of them have of it."""

    correlated_rows: float
    """Rows over which the noise is correlated."""
    rows_per_window: int
    """Rows in a window."""
    row_std: list[float]
    """Standard deviation of a row, channel C and S."""
    window_std: list[float]
    """Of a window's mean."""
    offset_hz: float
    """Frequency of the rows against the reference."""
    filter_passes: float
    """Part of the signal that the instrument's filter passes there."""


class Import(Common):
    """`hrg import`: what was taken of the log."""

    run_id: str
    """The run."""
    format: str | None = None
    """Format of the log."""
    columns: dict[str, TakenColumn] | None = None
    """Role -> column (from 1), name and units of what was taken."""
    columns_left: list[LeftColumn] = Field(default=[])
    """Columns of which nothing was taken."""
    samples: int | None = None
    """Samples written."""
    sample_rate_hz: Number = None
    """Sampling rate; null for uneven sampling."""
    duration_s: Number = None
    """Length."""
    gaps: Gaps | None = None
    """Gaps in the times."""
    not_finite: NotFinite | None = None
    """Samples that are not finite."""
    left_out: list[LeftOut] = Field(default=[])
    """Parts of the log that could not be read."""
    cut: Cut | None = None
    """The part asked for by --from-s and --to-s."""
    rows: int | None = None
    """With --envelope: rows of the log."""
    noise: RowNoise | None = None
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
