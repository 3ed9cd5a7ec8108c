"""An entry of the ledger: one result file of one gyro, with where, when and by whom it was made."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

KINDS = ("resonator", "calibration", "diagnosis")
"""Kinds of file that are a gyro's result."""
CIRCUMSTANCES = ("station", "operator", "fixture", "firmware", "order")
"""What a file does not know of its own making, but for the order, which may be its lot."""


@dataclass(frozen=True)
class Figure:
    """A number of a result; `std` None where its standard deviation is not known."""

    value: float
    std: float | None
    units: str


@dataclass(frozen=True)
class Entry:
    """One result file.

    sha256: of the file's bytes, by which a file is entered once. processed: when the file was made;
    measured: when the recording of its samples began, where its waves lie beside it and say so;
    added: when it was entered, by this computer's clock (all ISO 8601). samples: fingerprints of
    the recorded samples it goes back to: two entries of the same samples are one measurement,
    processed twice.
    """

    sha256: str
    file: str
    kind: str
    gyro_id: str
    processed: str
    status: str
    measured: str = ""
    added: str = ""
    station: str = ""
    operator: str = ""
    fixture: str = ""
    firmware: str = ""
    order: str = ""
    software: str = ""
    reasons: tuple[str, ...] = ()
    verdict: str | None = None
    mode_number: int = 2
    samples: tuple[str, ...] = ()
    figures: Mapping[str, Figure] = field(default_factory=dict)
