"""Options that every log has, whether it holds samples or demodulated signals: each declared once,
with its meaning and bounds."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

Column = str | int | None
"""A column by its title or its number from 1."""

Time = Annotated[Column, Field(description='column of the times; "none" to ignore times')]
SamplingTolerance = Annotated[
    float,
    Field(ge=0, le=0.5, description="departure from an even grid, in steps, still called even"),
]
TimeUnits = Annotated[
    str | None,
    Field(
        description="unit of the times: s, ms, us, ns, min, h or d; the title's, or s, where not"
        " given"
    ),
]
ClockHz = Annotated[
    float | None, Field(gt=0, description="ticks per second of a time column that counts ticks")
]
RateUnits = Annotated[
    str | None,
    Field(
        description="unit of the rates: rad/s, deg/s, deg/h or rpm; the title's, or rad/s, where"
        " not given"
    ),
]
TemperatureUnits = Annotated[
    str | None,
    Field(
        description="unit of the temperatures: degC, K or degF; the title's, or degC, where not"
        " given"
    ),
]
ConstantRate = Annotated[
    float | None, Field(description="rate of the whole run, where the log has none")
]
ConstantTemperature = Annotated[
    float | None, Field(description="temperature of the whole run, where the log has none")
]
Mode = Annotated[Literal["free", "forced"], Field(description="run-down or driven")]
ModeNumber = Annotated[
    int, Field(ge=1, le=1000, description="angular mode number m: 2 for a shell, 1 for a pendulum")
]
GyroId = Annotated[str, Field(description="name of the gyro")]
RunId = Annotated[str, Field(description="name of the run; the file's where not given")]
LotId = Annotated[str, Field(description="name of the lot")]
FormatName = Annotated[
    str, Field(description="name of a format, where its content is not to decide")
]
Separator = Annotated[
    str | None,
    Field(
        min_length=1,
        max_length=1,
        description="what separates a text log's columns; a blank for any run of blanks",
    ),
]
Decimal = Annotated[
    Literal[".", ","] | None,
    Field(description="decimal sign of a text log; found where not given"),
]
FromS = Annotated[
    float | None,
    Field(ge=0, description="first time to take, from the log's first row on; it becomes t = 0"),
]
ToS = Annotated[
    float | None, Field(gt=0, description="time from the log's first row on at which to end")
]
