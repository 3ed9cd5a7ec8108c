"""Production acceptance: the figures of a file held against limits written in TOML."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from .errors import HrgError
from .records import Calibration, Record, Resonator


@dataclass(frozen=True)
class Row:
    """One figure against its limits; `value` None: the file does not hold it, which does not pass."""

    name: str
    value: float | None
    minimum: float | None
    maximum: float | None
    passed: bool
    words: tuple[str, str] | None = None
    """Of a figure that is no number: what was found and what was wanted."""

    def sentence(self) -> str:
        """Why the figure does or does not pass."""
        if self.words is not None:
            return f"the file is {self.words[0]}, {self.words[1]} was wanted"
        if self.value is None:
            return f"{self.name} is not in the file"
        bounds = [f"at least {self.minimum:g}"] if self.minimum is not None else []
        bounds += [f"at most {self.maximum:g}"] if self.maximum is not None else []
        return f"{self.name} is {self.value:.6g}, {' and '.join(bounds)} was wanted"


MOST_LIMITS = 10_000
"""More than any file has figures; a longer list is a damaged file."""


def check(record: Record, limits: Mapping[str, Any]) -> list[Row]:
    """Rows of verdicts for `[limits]` tables: name = { minimum = …, maximum = … }, or a bare number, which is a maximum.

    Names are those of the kind's figures (`figures_of`), nested keys joined by points; limits stand in a table of the record's kind
    ([calibration], [resonator], …) or at the top. `status = "valid"` (the default) wants a record that is not refused or suspect.
    HrgError: a limit that is neither, no limit for this kind.
    """
    own = limits.get(record.kind)
    table: Mapping[str, Any] = own if isinstance(own, Mapping) else {k: v for k, v in limits.items() if not _is_group(v)}
    if not table:
        raise HrgError(
            f"the limits hold nothing for a {record.kind} file; write a table [{record.kind}] with name = {{ minimum = …, maximum = … }}"
        )
    if len(table) > MOST_LIMITS:
        raise HrgError(f"the limits hold {len(table)} entries for a {record.kind} file, {MOST_LIMITS} at most were expected")
    figures = figures_of(record)
    rows = []
    wanted = table.get("status", "valid")
    if wanted not in ("valid", "suspect", "any"):
        raise HrgError(f'limit status = {wanted!r}: "valid", "suspect" or "any" was expected')
    worst = {"valid": 0, "suspect": 1, "refused": 2}[record.status]
    allowed = {"valid": 0, "suspect": 1, "any": 2}[wanted]
    at_worst = {"valid": "valid", "suspect": "suspect at the worst", "any": "anything"}[wanted]
    rows.append(Row("status", float(worst), None, float(allowed), worst <= allowed, (record.status, at_worst)))
    for name, limit in table.items():
        if name == "status":
            continue
        minimum, maximum = _bounds(name, limit)
        value = figures.get(name)
        inside = value is not None and math.isfinite(value)
        inside = inside and (minimum is None or value >= minimum) and (maximum is None or value <= maximum)  # type: ignore[operator]
        rows.append(Row(name, value, minimum, maximum, bool(inside)))
    return rows


def _is_group(value: Any) -> bool:
    return isinstance(value, Mapping) and not set(value) <= {"minimum", "maximum"}


def _bounds(name: str, limit: Any) -> tuple[float | None, float | None]:
    if isinstance(limit, bool) or not isinstance(limit, int | float | Mapping):
        raise HrgError(f"limit {name} = {limit!r}: a number (a maximum) or {{ minimum = …, maximum = … }} was expected")
    if isinstance(limit, Mapping):
        unknown = set(limit) - {"minimum", "maximum"}
        if unknown or not limit:
            raise HrgError(f"limit {name} has {', '.join(sorted(unknown)) or 'nothing'}; minimum and maximum are known")
        values = tuple(limit.get(key) for key in ("minimum", "maximum"))
        if any(v is not None and (isinstance(v, bool) or not isinstance(v, int | float) or not math.isfinite(v)) for v in values):
            raise HrgError(f"limit {name}: minimum and maximum must be finite numbers")
        return values  # type: ignore[return-value]
    if not math.isfinite(limit):
        raise HrgError(f"limit {name}: a finite number was expected")
    return None, float(limit)


def figures_of(record: Record) -> dict[str, float]:
    """Every number a limit may name: the stage's JSON, flattened, and figures of the trade."""
    figures: dict[str, float] = {"rows": float(len(record))}
    stage = record.made_by.split()[1] if record.made_by.startswith("hrg ") else ""
    try:
        module = import_module(f"hrg_cli.stages.{stage}")
    except ModuleNotFoundError:
        module = None
    try:
        if module is not None and hasattr(module, "summary"):
            _flatten("", module.summary(record), figures)
        if isinstance(record, Calibration):
            from .stages.figures_of_merit import calibration_figures

            figures |= calibration_figures(record)
            _flatten("details", json.loads(record.details), figures)
    except (KeyError, TypeError, ValueError, AttributeError, IndexError) as error:  # JSON of another shape than its command writes
        what = f"{type(error).__name__}: {str(error)[:80]}"
        raise HrgError(f"the details of this {record.kind} are damaged ({what}); make the file again with `{record.made_by}`") from error
    if isinstance(record, Resonator):
        for name, (value, std, _) in record.parameters().items():
            figures[name], figures[f"{name}_std"] = value, std
    if hasattr(record, "flags"):
        figures["flagged_part"] = float(np.mean(np.asarray(record.flags) != 0)) if len(record) else 0.0
    return figures


def _flatten(prefix: str, tree: Any, into: dict[str, float]) -> None:
    if isinstance(tree, bool) or tree is None:
        return
    if isinstance(tree, int | float):
        into[prefix] = float(tree)
    elif isinstance(tree, Mapping):
        for key, value in tree.items():
            _flatten(f"{prefix}.{key}" if prefix else str(key), value, into)
    elif isinstance(tree, list):
        for i, value in enumerate(tree):
            _flatten(f"{prefix}.{i}", value, into)
