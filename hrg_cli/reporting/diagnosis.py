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
    """Print the answer of a diagnosis.

    Parameters
    ----------
    record
        The diagnosis.
    report
        The command's JSON, which names its file.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.records import Diagnosis
    >>> from hrg_cli.reporting.diagnosis import show
    >>> rows = dict.fromkeys(("run", "time_s", "wave_angle_rad", "main_amplitude"), np.zeros(0))
    >>> series = (
    ...     "measured",
    ...     "simulated_before",
    ...     "simulated_after",
    ...     "residual_before",
    ...     "residual_after",
    ... )
    >>> rows |= dict.fromkeys(series, np.zeros((0, 4))) | {"series": np.zeros(0)}
    >>> show(Diagnosis(verdict="adequate", report="{}", run_ids='["a"]', **rows), {})
    The model describes the run.
    gyro: sound; fit: valid; verdict: adequate
    """
    file = Path(str(report.get("output") or "diagnosis.h5"))
    found = answer([record], (), {"diagnosis": file.name})
    assert found is not None
    answer_text.show(found, file.parent)


def tabulate_gains(gain: Mapping[str, Any]) -> Rows:
    """Errors of data held out, before and after the causes are taken in.

    Parameters
    ----------
    gain
        Of a diagnosis's report.

    Returns
    -------
    list of tuple
        A row a quantity that it tells, in physical units with standard deviations.

    Examples
    --------
    >>> from hrg_cli.reporting.diagnosis import tabulate_gains
    >>> gain = {"drift_error_deg_h": dict(before=20.0, before_std=1.0, after=2.0, after_std=0.1)}
    >>> tabulate_gains(gain)
    [('drift error, °/h', '20 ± 1', '2 ± 0.1')]
    """
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
    """|z| of a cause that was looked for, beside those that were found.

    Parameters
    ----------
    tested
        Of a diagnosis's report.

    Returns
    -------
    float
        NaN where the file does not know it.

    Examples
    --------
    >>> from hrg_cli.reporting.diagnosis import score_left
    >>> score_left({"z_left": -1.2}), score_left({})
    (1.2, nan)
    """
    return abs(read_float(tested.get("z_left")))
