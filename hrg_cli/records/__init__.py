"""The records that pass between stages: one frozen dataclass a kind of file, each column declared
once with unit and meaning.

Reading, writing, checking and slicing follow from the declarations (`store` knows no column by
name). A column's first dimension says how it grows: `row` is the record's own length; the auxiliary
log and the simulated truth have their own rows. A *stream* is an iterator of records of one kind:
its rows are appended, its other values are those of the last record.
"""

from __future__ import annotations

from .calibration import Calibration
from .columns import GROWING, SIZES, Array, Column, Valid, attribute, column
from .compensated import Compensated
from .details import read_details_number
from .diagnosis import Diagnosis
from .doubts import list_doubts, name_record
from .periods import Periods
from .record import REHEARSAL, Provenance, Record, Source, Status, collect, open_single
from .recording import Recording, Slice
from .resonator import Resonator
from .wave import Wave
from .windowed import FLAG_CLIPPED, FLAG_GAP, FLAG_NOT_FINITE, FLAG_SETTLING, Windowed

KINDS: tuple[type[Record], ...] = (
    Recording,
    Periods,
    Wave,
    Resonator,
    Calibration,
    Compensated,
    Diagnosis,
)
"""Every kind of file, in the order of the work."""

__all__ = [
    "FLAG_CLIPPED",
    "FLAG_GAP",
    "FLAG_NOT_FINITE",
    "FLAG_SETTLING",
    "GROWING",
    "KINDS",
    "REHEARSAL",
    "SIZES",
    "Array",
    "Calibration",
    "Column",
    "Compensated",
    "Diagnosis",
    "Periods",
    "Provenance",
    "Record",
    "Recording",
    "Resonator",
    "Slice",
    "Source",
    "Status",
    "Valid",
    "Wave",
    "Windowed",
    "attribute",
    "collect",
    "column",
    "list_doubts",
    "name_record",
    "open_single",
    "read_details_number",
]
