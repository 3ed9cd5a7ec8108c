"""What `hrg diagnose` shows a person: the answer; and the held-out errors that the page's tables
hold."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..records import Diagnosis
from . import answer_text
from .answer import answer
from .json_text import read_float, take_child
from .text import format_number

Rows = list[tuple[Any, ...]]
QUANTITIES = (
    ("drift_error_deg_h", "drift error, °/h"),
    ("angle_error_ppm", "error of the wave angle, ppm of a radian"),
    ("amplitude_error_ppm", "error of the amplitude, ppm"),
)


def show(record: Diagnosis, report: Mapping[str, Any]) -> None:
    """Print the answer of a diagnosis; `report` is the command's JSON, which names its file."""
    file = Path(str(report.get("output") or "diagnosis.h5"))
    found = answer([record], (), {"diagnosis": file.name})
    assert found is not None
    answer_text.show(found, file.parent)


def tabulate_gains(gain: Mapping[str, Any]) -> Rows:
    """Held-out errors before and after in physical units, with their standard deviations."""
    return [
        (
            words,
            *(
                f"{format_number(part.get(when), 4)} ± {format_number(part.get(f'{when}_std'), 2)}"
                for when in ("before", "after")
            ),
        )
        for key, words in QUANTITIES
        if (part := take_child(gain, key))
    ]


def score_left(tested: Mapping[str, Any]) -> float:
    """|z| of a cause that was looked for, beside those that were found; NaN where the file does not
    know it."""
    return abs(read_float(tested.get("z_left")))
