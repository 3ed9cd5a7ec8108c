"""Rate and angle after the tables: what `hrg compensate` and `hrg rate` make of a wave."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from .columns import JSON_OBJECT, LOGGED, ORDER, RISING, SCATTER, Array, attribute, column
from .record import Record


@dataclass(frozen=True, kw_only=True, repr=False)
class Compensated(Record):
    """Rate and angle of one run after the tables, with what was left before and after where the
    rate was known."""

    kind: ClassVar[str] = "compensated"
    made_by: ClassVar[str] = "hrg compensate"
    time_s: Array = column("s", "middle of the increment", valid=RISING)
    rate_estimate_rad_s: Array = column("rad s-1", "rate after the tables")
    rate_estimate_rad_s_std: Array | None = column(
        "rad s-1", "its standard deviation, NaN where it is not known", optional=True, valid=SCATTER
    )
    angle_estimate_rad: Array = column(
        "rad", "its integral from the middle of the first windows that make an increment"
    )
    angle_estimate_rad_std: Array | None = column(
        "rad", "its standard deviation, NaN where it is not known", optional=True, valid=SCATTER
    )
    residual_before_rad_s: Array | None = column(
        "rad s-1", "rate error with a constant scale factor only", optional=True, valid=LOGGED
    )
    residual_after_rad_s: Array | None = column(
        "rad s-1", "rate error after the tables", optional=True, valid=LOGGED
    )
    table_rate_rad_s: Array | None = column(
        "rad s-1", "rate by a calibration's tables about the node", optional=True, valid=LOGGED
    )
    gyro_id: str = attribute("the gyro", default="")
    run_id: str = attribute("the run", default="")
    lot_id: str = attribute("the lot", default="")
    mode_number: int = attribute("angular mode number m", default=2, dtype="i8", valid=ORDER)
    details: str = attribute("JSON: rms figures", default="{}", valid=JSON_OBJECT)
