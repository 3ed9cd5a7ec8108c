"""The table a person sees after a command, one function a kind of record."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ..limit_values import find_unit
from ..records import (
    Calibration,
    Compensated,
    Diagnosis,
    Periods,
    Record,
    Recording,
    Resonator,
    Wave,
)
from ..units import DEGREE_PER_HOUR, to_deg_per_hour, to_trade
from . import calibration, diagnosis, figures_in_words, identification
from .console import print_table
from .json_text import parse_object
from .quantities import format_parameter, format_quantity, label_of
from .text import format_number

SMALLEST = 1e-3
"""Of a °/h or a ppm."""


def show(record: Record, report: Mapping[str, Any]) -> None:
    """Print the table of a record.

    Parameters
    ----------
    record
        Any record.
    report
        The command's JSON.

    Examples
    --------
    >>> import contextlib, io
    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.reporting.tables import show
    >>> made = Recording(c=np.zeros(9), s=np.zeros(9), sample_rate_hz=8.0, mode="free")
    >>> with contextlib.redirect_stdout(io.StringIO()) as shown:
    ...     show(made, {"samples": 9, "output": "run.h5"})
    >>> [line.split() for line in shown.getvalue().splitlines()]
    [['figure', 'value'], ['samples', '9']]
    """
    if isinstance(record, Diagnosis):
        return diagnosis.show(record, report)
    head, rows = _tabulate(record, report)
    if rows:
        print_table("", head, rows)
    if isinstance(record, Resonator):
        identification.show(report)
    if isinstance(record, Calibration):
        calibration.show(report)
    for head, rows in (_faults(report), _allan(report)):
        if rows:
            print_table("", head, rows)


def _tabulate(
    record: Record, report: Mapping[str, Any]
) -> tuple[tuple[str, ...], list[tuple[Any, ...]]]:
    """Head and rows of a record's table."""
    if isinstance(record, Resonator):
        return ("parameter", "value", "in files and limits"), [
            (label_of(n, v, s), format_parameter(n, v, s, u), n)
            for n, (v, s, u) in record.parameters().items()
        ]
    if isinstance(record, Calibration):
        return _calibration(report)
    own = {
        key: value
        for key, value in report.items()
        if key not in ("kind", "status", "status_reasons", "output")
        and not isinstance(value, dict | list)
    }
    return ("figure", "value"), [
        *figures_in_words.list_told(own),
        *_list_estimates(report),
        *_list_differences(report),
        *(_trade(key, value) for key, value in (report.get("trade") or {}).items() if value),
    ]


def _list_estimates(report: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Figures that have a standard deviation."""
    return [
        (
            figures_in_words.say_key(key),
            format_parameter(key, told["value"], told["std"], find_unit(key)),
        )
        for key, told in report.items()
        if isinstance(told, dict) and set(told) == {"value", "std"} and told["std"] is not None
    ]


def _list_differences(report: Mapping[str, Any]) -> list[tuple[str, str]]:
    """How far the tables' rate is from the reference model's."""
    return [
        (f"tables less model, {key.split('_')[1]}", figures_in_words.say_value(key, value))
        for key, value in (report.get("tables") or {}).items()
        if value is not None
    ]


def list_facts(record: Record) -> dict[str, Any]:
    """The figures that `hrg info` prints of a record.

    Parameters
    ----------
    record
        Any record.

    Returns
    -------
    dict
        Key -> value.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.reporting.tables import list_facts
    >>> facts = list_facts(Recording(c=np.zeros(9), s=np.zeros(9), sample_rate_hz=8.0, mode="free"))
    >>> facts["rows"], facts["duration_s"], facts["mode"]
    (9, 1.0, 'free')
    """
    found: dict[str, Any] = {"rows": len(record)} if len(record) else {}
    for name, spec in record.columns().items():
        value = getattr(record, name)
        if (
            spec.dims is None
            and value not in (None, "")
            and spec.group != "/truth"
            and not (isinstance(value, str) and len(value) > 60)
        ):
            found[name] = value
    if isinstance(record, Recording):
        last = record.times(len(record) - 1)
        found["duration_s"] = float(last[-1]) if len(last) else 0.0
        found["auxiliary"] = [
            n
            for n in ("temperature_degc", "rate_rad_s", "drive_main", "drive_quadrature")
            if getattr(record, n) is not None
        ]
    if isinstance(record, Periods | Wave):
        flags = np.asarray(record.flags[:])
        found |= {
            f"flagged_{name}": int(np.sum(flags & bit > 0))
            for name, bit in (("clipped", 1), ("gap", 2), ("not_finite", 4), ("settling", 8))
        }
        found["duration_s"] = float(record.time_s[-1]) if len(record) else 0.0
    if isinstance(record, Resonator):
        found |= {name: value for name, (value, _, _) in record.parameters().items()}
    if isinstance(record, Calibration):
        found |= {
            k: v
            for k, v in parse_object(record.details).items()
            if isinstance(v, int | float | str)
        }
    if isinstance(record, Compensated):
        found["duration_s"] = float(record.time_s[-1]) if len(record) else 0.0
        trade = parse_object(record.details).get("trade") or {}
        found |= {name: value for name, value in trade.items() if value is not None}
    return found


def _calibration(report: Mapping[str, Any]) -> tuple[tuple[str, ...], list[tuple[Any, ...]]]:
    rows: list[tuple[Any, ...]] = []
    drift, scale = report.get("drift_rms_rad_s", {}), report.get("scale_factor_rms_ppm", {})
    for key in ("before", "after", "held_out"):
        d, k = drift.get(key), scale.get(key)
        if d is not None or k is not None:  # an update knows none of them
            rows.append((key.replace("_", " "), _rms_rate(d), _rms(k)))
    for stage in report.get("ladder", []):
        d = stage.get("drift_rms_rad_s")
        rows.append(
            (
                str(stage.get("stage")),
                _rms_rate(d),
                _rms(stage.get("scale_factor_rms_ppm")),
            )
        )
    for key, value in report.get("trade", {}).items():
        if not value or not key.endswith(("_rad_s", "_ppm")):
            continue
        if abs(value) < SMALLEST * (DEGREE_PER_HOUR if key.endswith("_rad_s") else 1.0):
            continue
        rows.append(
            (
                _words(key),
                _rms_rate(value) if key.endswith("_rad_s") else "",
                "" if key.endswith("_rad_s") else _rms(value),
            )
        )
    return ("rms residual", "drift, °/h", "scale factor, ppm"), rows


def _faults(report: Mapping[str, Any]) -> tuple[tuple[str, ...], list[tuple[Any, ...]]]:
    """Faults of the loops and of the read-out that stages 5 and 6 of the ladder measure."""
    rows = [(r["name"], r["value"], r["std"], r["units"]) for r in report.get("loops", [])]
    seen = report.get("readout_matrix") or {}
    rows += [
        (name, seen[name], seen[f"{name}_std"], "rad" if name.endswith("_rad") else "1")
        for name in ("gain_mismatch", "electrode_nonorthogonality_rad")
        if name in seen
    ]
    return ("fault looked for", "value", "σ"), [
        (
            figures_in_words.say_key(name),
            format_quantity(name, value, std, units),
            format_number(value / std, 2),
        )
        for name, value, std, units in rows
        if std > 0
    ]


def _rms_rate(rate_rad_s: float | None) -> str | None:
    return None if rate_rad_s is None else _rms(to_deg_per_hour(rate_rad_s))


def _rms(value: float | None) -> str | None:
    """An rms, which is known to a few per cent, in four digits; below a thousandth of its unit it
    is none."""
    return None if value is None else "0" if abs(value) < SMALLEST else format_number(value)


def _trade(key: str, value: float) -> tuple[str, str]:
    """A figure of the trade in its own unit."""
    words, size, unit = to_trade(key, value)
    return words, f"{format_number(size)} {unit}".strip()


def _allan(report: Mapping[str, Any]) -> tuple[tuple[str, ...], list[tuple[Any, ...]]]:
    """Noise coefficients of IEEE Std 952 with their 95 % intervals; one that is not told from zero
    has an upper limit only."""
    rows = []
    for key, found in (report.get("allan") or {}).items():
        if isinstance(found, Mapping):
            words, value, unit = to_trade(key, found["value"])
            low, high = (to_trade(key, found[end])[1] for end in ("low", "high"))
            sizes = (value, low, high) if value > 0 else (None, None, high)
            rows.append((words, *(None if s is None else format_number(s, 3) for s in sizes), unit))
    return ("noise of the rate (IEEE 952)", "value", "95 % from", "to", "unit"), rows


def _words(key: str) -> str:
    """A figure's name for people, without its unit."""
    return key.removesuffix("_rad_s").removesuffix("_ppm").replace("_", " ")
