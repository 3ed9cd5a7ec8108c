"""What the simulation gets wrong: what `hrg diagnose` finds in waves."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, ClassVar

from .columns import JSON_LIST, JSON_OBJECT, LOGGED, SCATTER, Array, Valid, attribute, column
from .record import Record


@dataclass(frozen=True, kw_only=True, repr=False)
class Diagnosis(Record):
    """What the simulation gets wrong: the verdict as JSON and the residual series before and
    after."""

    kind: ClassVar[str] = "diagnosis"
    made_by: ClassVar[str] = "hrg diagnose"
    run: Array = column("1", "index of the run of each row", dtype="i4", valid=SCATTER)
    time_s: Array = column("s", "time")
    wave_angle_rad: Array = column("rad", "wave angle")
    main_amplitude: Array = column("any", "main amplitude")
    temperature_degc: Array | None = column("degC", "temperature", optional=True, valid=LOGGED)
    rate_rad_s: Array | None = column("rad s-1", "rate", optional=True, valid=LOGGED)
    measured: Array = column("any", "measured series, columns named in `series`", ("row", "series"))
    simulated_before: Array = column("any", "the same of the base model", ("row", "series"))
    simulated_after: Array = column("any", "the same of the extended model", ("row", "series"))
    simulated_without: Array | None = column(
        "any",
        "the model fitted without some of the causes, columns named in `left_out`",
        ("row", "series", "left_out"),
        optional=True,
    )
    residual_before: Array = column("1", "whitened residual of the base model", ("row", "series"))
    residual_after: Array = column(
        "1", "whitened residual of the extended model", ("row", "series")
    )
    series: str = attribute("JSON list: the columns' names", valid=JSON_LIST)
    left_out: str = attribute(
        "JSON list of lists: the causes left out of each column of simulated_without",
        default="[]",
        valid=JSON_LIST,
    )
    run_ids: str = attribute("JSON list: the runs", default="[]", valid=JSON_LIST)
    gyro_id: str = attribute("the gyro", default="")
    verdict: str = attribute(
        "adequate, explained, partly explained, unexplained",
        valid=Valid(one_of=("adequate", "explained", "partly explained", "unexplained")),
    )
    report: str = attribute("JSON: the whole verdict", valid=JSON_OBJECT)
    extended_model: str = attribute("the extended model as TOML", default="")

    def read_report(self) -> dict[str, Any]:
        """The whole verdict: the keys of `hrg diagnose --json`, which
        `reporting/json_shapes/diagnosis.py` declares.

        Returns
        -------
        dict
            A new object at each call.

        Raises
        ------
        ValueError
            The text is no JSON object: the file was changed by another program.
        """
        read = json.loads(self.report)
        if not isinstance(read, dict):
            raise ValueError(f"a JSON object was expected, found {type(read).__name__}")
        return read

    def told(self, table: str) -> list[dict[str, Any]]:
        """The rows of a table of the report.

        Parameters
        ----------
        table
            Its key, such as "effects" or "checks".

        Returns
        -------
        list of dict
            A row each; empty where the report has no such table.
        """
        return list(self.read_report().get(table) or [])
