"""What is told of a log beside its columns: which run it is, and units its titles leave out."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .log import Log


@dataclass(frozen=True)
class RunHeading:
    """Name and kind of a run as its record holds them; empty where the log is to say it."""

    mode: str
    mode_number: int
    gyro_id: str
    run_id: str
    lot_id: str
    start_time: str

    def make_fields(self, log: Log, path: Path) -> dict[str, Any]:
        """Fields of the record: a run without a name has its file's, one without a start the
        log's."""
        return {
            "mode": self.mode,
            "mode_number": self.mode_number,
            "gyro_id": self.gyro_id,
            "run_id": self.run_id or path.stem,
            "lot_id": self.lot_id,
            "start_time": self.start_time or log.start_time,
        }


@dataclass(frozen=True)
class UnitsTold:
    """Units of the times, rates and temperatures; None: as the columns' titles have them."""

    time: str | None
    rate: str | None
    temperature: str | None

    def list_by_role(self, signals: Iterable[str], unit: str) -> dict[str, str]:
        """Role -> unit, of the signals and of every column whose unit was told."""
        told = {"time": self.time, "rate": self.rate, "temperature": self.temperature}
        return dict.fromkeys(signals, unit) | {role: of for role, of in told.items() if of}
