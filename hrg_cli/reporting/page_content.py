"""What the page says in words and tables: steps of the chain, headline, parameters for people,
method comparison."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from ..records import Calibration, Compensated, Diagnosis, Record, Resonator, Status
from ..units import DEGREE_PER_HOUR
from .json_text import parse_list, parse_object, read_calibration_rms, read_figure_of_merit
from .page_diagnosis import list_diagnosis
from .page_table import PageTable, list_figures
from .text import clean_text, format_number

STEPS = (
    ("recording", ("import", "simulate"), "record, import or simulate"),
    ("periods", ("demodulate",), "demodulate"),
    ("wave", ("estimate",), "estimate"),
    ("resonator", ("identify",), "identify"),
    ("calibration", ("calibrate",), "calibrate"),
    ("diagnosis", ("diagnose",), "diagnose"),
    ("compensated", ("compensate",), "compensate"),
)
"""Kind of file, commands that make it, name of the step; in the order of the work."""


@dataclass(frozen=True)
class ShownStep:
    """One step of the chain: `state` is "run", "suspect", "failed" or "skipped", `note` says
    why."""

    name: str
    state: str
    note: str


def list_steps(records: Iterable[tuple[str, Status]], history: Iterable[str]) -> list[ShownStep]:
    """The chain's steps, from the files of a page and the commands in their histories.

    Parameters
    ----------
    records
        Kind and status of the files.
    history
        Commands of all files.

    Returns
    -------
    list of ShownStep
        In the chain's order.

    Examples
    --------
    >>> from hrg_cli.reporting.page_content import list_steps
    >>> steps = list_steps([("resonator", "suspect")], [])
    >>> [(step.state, step.note) for step in steps if step.state != "skipped"]
    [('suspect', '1 of 1 file suspect')]
    """
    states: dict[str, list[Status]] = {}
    for kind, status in records:
        states.setdefault(kind, []).append(status)
    ran = {command for text in history for command in text.split()[1:]}
    found = []
    for kind, commands, name in STEPS:
        given = states.get(kind, [])
        files = f"{len(given)} file{'s' if len(given) != 1 else ''}"
        if "refused" in given:
            found.append(ShownStep(name, "failed", f"{given.count('refused')} of {files} refused"))
        elif "suspect" in given:
            found.append(ShownStep(name, "suspect", f"{given.count('suspect')} of {files} suspect"))
        elif given:
            found.append(ShownStep(name, "run", f"{files}, valid"))
        elif ran.intersection(commands):
            found.append(
                ShownStep(name, "run", "named in the history; its file is not on this page")
            )
        else:
            found.append(ShownStep(name, "skipped", "no file and no line in any history"))
    return found


def translate_parameter(name: str, value: float, std: float, frequency_hz: float | None) -> str:
    """A resonator's parameter in the units that people use.

    Parameters
    ----------
    name
        Of the parameter.
    value, std
        In SI units.
    frequency_hz
        Of the resonator, for its quality factor; None: not known.

    Returns
    -------
    str
        Empty where there is no other unit.

    Examples
    --------
    A damping rate ν is a decay time 1/ν, and Q = πf/ν:

    >>> from hrg_cli.reporting.page_content import translate_parameter
    >>> translate_parameter("damping_rate_1_s", 0.1, 1e-4, 5000.0)
    'τ = 10 ± 0.01 s, Q = 157100'
    """

    def pair(factor: float, unit: str) -> str:
        return f"{format_number(value * factor, 5)} ± {format_number(std * factor, 2)} {unit}"

    if name == "damping_rate_1_s" and value > 0:
        quality = (
            f", Q = {format_number(math.pi * frequency_hz / value, 4)}" if frequency_hz else ""
        )
        return (
            f"τ = {format_number(1 / value, 5)} ± {format_number(std / value / value, 2)}"
            f" s{quality}"
        )
    if name == "damping_split_1_s":
        return f"{pair(1 / DEGREE_PER_HOUR, '°/h')} of drift D"
    if name == "frequency_split_rad_s":
        return f"Δf = {pair(1e3 / math.pi, 'mHz')}"
    if name.endswith("_axis_rad"):
        return pair(180 / math.pi, "°")
    if name == "scale_factor" and value:
        return f"σ = {format_number(abs(std / value) * 1e6, 2)} ppm"
    if name.endswith("_hz"):
        return f"σ = {format_number(std * 1e3, 2)} mHz"
    if name.endswith("_rad_s"):
        return pair(1 / DEGREE_PER_HOUR, "°/h")
    return ""


def list_tables(record: Record) -> list[PageTable]:
    """The tables of a result.

    Parameters
    ----------
    record
        Any record.

    Returns
    -------
    list of PageTable
        Empty of one that is no result.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording, Resonator
    >>> from hrg_cli.reporting.page_content import list_tables
    >>> list_tables(Recording(c=np.zeros(9), s=np.zeros(9), sample_rate_hz=1e4, mode="free"))
    []
    >>> found = Resonator(
    ...     name=np.array(["scale_factor"]), units=np.array(["1"]), value=np.array([0.55]),
    ...     std=np.array([1e-3]), covariance=np.array([[1e-6]]),
    ... )
    >>> list_tables(found)[0].rows[0][0]
    'scale_factor'
    """
    if isinstance(record, Resonator):
        return _list_resonator(record)
    if isinstance(record, Calibration):
        return _list_calibration(record)
    if isinstance(record, Diagnosis):
        return list_diagnosis(record)
    if isinstance(record, Compensated):
        return list_figures("Figures", parse_object(record.details))
    return []


def _list_resonator(record: Resonator) -> list[PageTable]:
    parameters = record.parameters()
    frequency = parameters.get("frequency_hz", (None,))[0]
    rows = [
        (
            clean_text(n),
            format_number(v, 8),
            format_number(s, 2),
            clean_text(u),
            translate_parameter(n, v, s, frequency),
        )
        for n, (v, s, u) in parameters.items()
    ]
    found = [
        PageTable(
            "Parameters with standard deviations",
            ("parameter", "value", "σ", "unit", "for people"),
            rows,
        )
    ]
    flat = parse_list(record.flat_directions)
    if flat:
        found.append(
            PageTable(
                "What these runs cannot tell",
                ("direction",),
                [(clean_text(sentence),) for sentence in flat],
            )
        )
    return found + list_figures("Details", parse_object(record.details))


def _list_calibration(record: Calibration) -> list[PageTable]:
    drift, scale = read_calibration_rms(record.details)
    found = []
    if drift or scale:
        rows = [
            (
                key.replace("_", " "),
                _write_range(drift.get(key), 1 / DEGREE_PER_HOUR),
                _write_range(scale.get(key), 1.0),
            )
            for key in ("before", "after", "held_out")
        ]
        found.append(PageTable("Residual, rms", ("", "drift, °/h", "scale factor, ppm"), rows))
    shown = ("drift_rms_rad_s", "scale_factor_rms_ppm", "figures", "ladder", "harmonics")
    left = {
        k: [_with_units(row) for row in v] if k == "variants" and isinstance(v, list) else v
        for k, v in parse_object(record.details).items()
        if k not in (*shown, "band_limit_scores")
    }
    return found + list_figures("Details", left)


OF_VARIANTS = {
    "stage": "model",
    "drift": "drift_left_out_rad_s",
    "drift_used": "drift_used_rad_s",
    "scale": "scale_factor_left_out_ppm",
    "scale_used": "scale_factor_used_ppm",
}
"""What a variant's errors are called in the file -> what they are."""


def _with_units(row: Any) -> Any:
    if not isinstance(row, Mapping):
        return row
    return {OF_VARIANTS.get(k, k): v for k, v in row.items()}


def _write_range(value: Any, factor: float) -> str:
    middle, low, high = (format_number(part * factor) for part in read_figure_of_merit(value))
    return middle if low == "–" else f"{middle} ({low} … {high})"
