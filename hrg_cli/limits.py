"""Production acceptance: the figures of a file held against limits written in TOML."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from importlib import import_module
from typing import Any

import numpy as np

from .errors import HrgError, UsageError
from .limit_values import find_unit, limit_value, spell_whole_names, suggest
from .records import KINDS, Calibration, Diagnosis, Record, Recording, Resonator

STATUSES = {"valid": 0, "suspect": 1, "refused": 2}
VERDICTS = ("adequate", "explained", "partly explained", "unexplained")


@dataclass(frozen=True)
class Row:
    """One figure against its limits; `value` None: the file does not hold it, which does not
    pass."""

    name: str
    value: float | None
    minimum: float | None
    maximum: float | None
    passed: bool
    words: tuple[str, str] | None = None
    """Of a figure that is no number: what was found and what was wanted."""
    std: float | None = None
    """Standard deviation of the value, where the file knows it."""
    units: str = ""
    kind: str = ""
    """Kind of the file that it is a figure of."""

    @property
    def margin_sigma(self) -> float | None:
        """Distance of the value from the nearest limit in σ, negative outside; None where σ is not
        known."""
        if self.value is None or not self.std:
            return None
        room = [self.value - self.minimum] if self.minimum is not None else []
        room += [self.maximum - self.value] if self.maximum is not None else []
        return min(room) / self.std if room else None

    def describe(self) -> str:
        """Why the figure does or does not pass."""
        if self.words is not None:
            return (
                f"the {'file' if self.name == 'status' else self.name} is {self.words[0]},"
                f" {self.words[1]} was wanted"
            )
        if self.value is None:
            return f"{self.name} is not in the file"
        bounds = [f"at least {self.minimum:g}"] if self.minimum is not None else []
        bounds += [f"at most {self.maximum:g}"] if self.maximum is not None else []
        return f"{self.name} is {self.value:.6g}, {' and '.join(bounds)} was wanted"


MOST_LIMITS = 10_000
"""More than any file has figures; a longer list is a damaged file."""
ROWS_AT_ONCE = 1 << 20
"""Rows of a file left on disk that are read at once."""


@dataclass(frozen=True)
class Judged:
    """What limits are held against: the kind of a result, its status, its figures and, of a
    diagnosis, its verdict."""

    kind: str
    status: str
    figures: Mapping[str, float]
    verdict: str | None = None


def check(record: Record, limits: Mapping[str, Any]) -> list[Row]:
    """Hold the figures of a record against limits: a row each, the status first.

    `status = "valid"` (the default) wants a record that is not refused or suspect;
    `verdict = "adequate"`, or a list of words, is for a diagnosis, as is `causes = 0`.

    Parameters
    ----------
    record
        A result of any kind.
    limits
        Tables of limits, name = { minimum = …, maximum = … } or a bare limit, which is a maximum;
        in a table of the record's kind ([calibration], [resonator], …) or at the top. Names are
        those of the kind's figures (`list_figures`), nested keys joined by points; numbers are in
        SI, text has a unit ("5 deg/h", "200 ppm").

    Returns
    -------
    list[Row]
        Each figure in SI with its limits, its standard deviation where the file knows it, and
        whether it passed; a figure that the file does not hold does not.

    Raises
    ------
    HrgError
        No limit for this kind.
    UsageError
        A limit that is neither, a name, table, unit or word that looks mistyped.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Resonator
    >>> from hrg_cli.limits import check
    >>> resonator = Resonator(
    ...     name=np.array(["frequency_split_rad_s"]), value=np.array([2e-3]), std=np.array([1e-4]),
    ...     units=np.array(["rad s-1"]), covariance=np.array([[1e-8]]),
    ... )
    >>> for row in check(resonator, {"resonator": {"frequency_split_rad_s": "1 mrad/s"}}):
    ...     print(row.passed, row.describe(), row.margin_sigma)
    True the file is valid, valid was wanted None
    False frequency_split_rad_s is 0.002, at most 0.001 was wanted -10.0
    """
    verdict = record.verdict if isinstance(record, Diagnosis) else None
    table = find_table(record.kind, limits)
    return list_rows(Judged(record.kind, record.status, list_figures(record), verdict), table)


def find_table(kind: str, limits: Mapping[str, Any]) -> Mapping[str, Any]:
    """The limits for a kind of file: its own table, or those at the top.

    Parameters
    ----------
    kind
        Of the file.
    limits
        Of a limits file.

    Returns
    -------
    Mapping
        Name -> limit, names spelt whole.

    Raises
    ------
    HrgError
        There are none, or too many; a table that looks mistyped is a UsageError.

    Examples
    --------
    >>> from hrg_cli.limits import find_table
    >>> find_table("resonator", {"resonator": {"scale_factor": 0.56}, "rows": 100})
    {'scale_factor': 0.56}
    """
    check_tables(limits)
    own = limits.get(kind)
    outside = {k: v for k, v in limits.items() if not is_group(v)}
    table = spell_whole_names(own if isinstance(own, Mapping) else outside)
    if not table:
        raise HrgError(
            f"the limits hold nothing for a {kind} file; write a table [{kind}] with"
            " name = { minimum = …, maximum = … }"
        )
    if len(table) > MOST_LIMITS:
        raise HrgError(
            f"the limits hold {len(table)} entries for a {kind} file, {MOST_LIMITS} at most"
            " were expected"
        )
    return table


def check_tables(limits: Mapping[str, Any]) -> None:
    """Refuse a table that looks mistyped.

    Parameters
    ----------
    limits
        Of a limits file.

    Raises
    ------
    UsageError
        There is one.

    Examples
    --------
    >>> from hrg_cli.errors import UsageError
    >>> from hrg_cli.limits import check_tables
    >>> try:
    ...     check_tables({"resonater": {"scale_factor": 0.56}})
    ... except UsageError as error:
    ...     print(error)
    the limits have a table [resonater], which is no kind of file; did you mean resonator?
    """
    kinds = [cls.kind for cls in KINDS]
    for name, value in limits.items():
        if is_group(value) and name not in kinds and (hint := suggest(name, kinds)):
            raise UsageError(f"the limits have a table [{name}], which is no kind of file; {hint}")


def list_rows(judged: Judged, table: Mapping[str, Any]) -> list[Row]:
    """Every limit of a kind's table held against the figures, the status first.

    Parameters
    ----------
    judged
        What is limited.
    table
        Name -> limit.

    Returns
    -------
    list of Row
        Figures and limits in SI.

    Raises
    ------
    UsageError
        As of `check`.

    Examples
    --------
    >>> from hrg_cli.limits import Judged, list_rows
    >>> judged = Judged("resonator", "valid", {"scale_factor": 0.55}, None)
    >>> [(row.name, row.passed) for row in list_rows(judged, {"scale_factor": 0.5})]
    [('status', True), ('scale_factor', False)]
    """
    figures = judged.figures
    kind = judged.kind
    rows = [replace(_status_row(judged.status, table.get("status", "valid")), kind=kind)]
    for name, limit in table.items():
        if name == "status":
            continue
        if name == "verdict" and judged.verdict is not None:
            rows.append(replace(_verdict_row(judged.verdict, limit), kind=kind))
            continue
        minimum, maximum = read_bounds(name, limit)
        value = figures.get(name)
        if value is None and (hint := suggest(name, [*figures, "verdict", "status"])):
            raise UsageError(f"limit {name} is no figure of a {judged.kind} file; {hint}")
        inside = value is not None and math.isfinite(value)
        inside = (
            inside
            and (minimum is None or value >= minimum)  # type: ignore[operator]
            and (maximum is None or value <= maximum)  # type: ignore[operator]
        )
        std = next(
            (
                figures[k]
                for k in (f"{name}_std", f"{name.removesuffix('.value')}.std")
                if k in figures
            ),
            None,
        )
        units = find_unit(name)
        rows.append(
            Row(name, value, minimum, maximum, bool(inside), std=std, units=units, kind=kind)
        )
    return rows


def _status_row(status: str, wanted: Any) -> Row:
    if wanted not in ("valid", "suspect", "any"):
        raise UsageError(f'limit status = {wanted!r}: "valid", "suspect" or "any" was expected')
    worst, allowed = STATUSES[status], {"valid": 0, "suspect": 1, "any": 2}[wanted]
    at_worst = {"valid": "valid", "suspect": "suspect at the worst", "any": "anything"}[wanted]
    return Row("status", float(worst), None, float(allowed), worst <= allowed, (status, at_worst))


def _verdict_row(verdict: str, wanted: Any) -> Row:
    words = (
        [wanted]
        if isinstance(wanted, str)
        else list(wanted)
        if isinstance(wanted, list)
        else [wanted]
    )
    for word in words:
        if word not in VERDICTS:
            hint = suggest(word, VERDICTS) if isinstance(word, str) else ""
            raise UsageError(
                f"limit verdict = {word!r}: {hint or ', '.join(VERDICTS) + ' was expected'}"
            )
    place = float(VERDICTS.index(verdict)) if verdict in VERDICTS else None
    return Row("verdict", place, None, None, verdict in words, (verdict, " or ".join(words)))


def is_group(value: Any) -> bool:
    """Whether an entry is a table of limits, not a limit.

    Parameters
    ----------
    value
        Of a limits file.

    Returns
    -------
    bool
        False for one with `minimum` and `maximum` alone.

    Examples
    --------
    >>> from hrg_cli.limits import is_group
    >>> is_group({"maximum": 0.56}), is_group({"scale_factor": {"maximum": 0.56}})
    (False, True)
    """
    return isinstance(value, Mapping) and not set(value) <= {"minimum", "maximum"}


def read_bounds(name: str, limit: Any) -> tuple[float | None, float | None]:
    """Minimum and maximum of a limit as it is written, in the figure's own unit.

    Parameters
    ----------
    name
        Of the figure.
    limit
        A number or text with a unit, which is a maximum, or a table of both.

    Returns
    -------
    tuple
        None where one is not given.

    Raises
    ------
    UsageError
        Neither is one.

    Examples
    --------
    >>> from hrg_cli.limits import read_bounds
    >>> read_bounds("frequency_split_rad_s", 0.5), read_bounds("duration_s", {"minimum": "2 min"})
    ((None, 0.5), (120.0, None))
    """
    if not isinstance(limit, Mapping):
        return None, limit_value(name, limit)
    for key in limit:
        if key not in ("minimum", "maximum"):
            raise UsageError(
                f"limit {name} has {key};"
                f" {suggest(key, ('minimum', 'maximum')) or 'minimum and maximum are known'}"
            )
    if not limit:
        raise UsageError(f"limit {name} has nothing; minimum and maximum are known")
    low, high = (
        limit_value(name, limit[key]) if key in limit else None for key in ("minimum", "maximum")
    )
    return low, high


def list_figures(record: Record) -> dict[str, float]:
    """Every number a limit may name: the stage's JSON, flattened, and figures of the trade.

    Parameters
    ----------
    record
        A record of any kind.

    Returns
    -------
    dict[str, float]
        Figures in SI by name, nested keys joined by points; beside a figure whose standard
        deviation is known, NAME_std.

    Raises
    ------
    HrgError
        The details that the record keeps as JSON are of another shape than its command writes.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Resonator
    >>> from hrg_cli.limits import list_figures
    >>> resonator = Resonator(
    ...     name=np.array(["scale_factor"]), value=np.array([0.55]), std=np.array([1e-5]),
    ...     units=np.array(["1"]), covariance=np.array([[1e-10]]),
    ... )
    >>> figures = list_figures(resonator)
    >>> figures["scale_factor"], figures["scale_factor_std"]
    (0.55, 1e-05)
    """
    figures: dict[str, float] = {"rows": float(len(record))}
    summary = _summary_of(record)
    try:
        _flatten("", summary(record), figures)
        if isinstance(record, Calibration):
            from .stages.figures_of_merit import compute_calibration_figures

            figures |= compute_calibration_figures(record)
            _flatten("details", json.loads(record.details), figures)
    except (
        KeyError,
        TypeError,
        ValueError,
        AttributeError,
        IndexError,
    ) as error:  # JSON of another shape than its command writes
        what = f"{type(error).__name__}: {str(error)[:80]}"
        raise HrgError(
            f"the details of this {record.kind} are damaged ({what}); make the file again with"
            f" `{record.made_by}`"
        ) from error
    if isinstance(record, Resonator):
        for name, (value, std, _) in record.parameters().items():
            figures[name], figures[f"{name}_std"] = value, std
    if isinstance(record, Diagnosis):
        figures |= _causes(record)
    if hasattr(record, "flags"):
        flagged = sum(
            int(np.count_nonzero(record.flags[start : start + ROWS_AT_ONCE]))
            for start in range(0, len(record), ROWS_AT_ONCE)
        )
        figures["flagged_part"] = flagged / max(len(record), 1)
    return figures


def _summary_of(record: Record) -> Callable[[Any], Mapping[str, Any]]:
    """What sums a record up: the `summarise` of the stage that made it."""
    if isinstance(record, Recording):  # of a log or a simulation: no stage found figures in it
        return lambda _: {}
    stage = record.made_by.removeprefix("hrg ")
    found: Callable[[Any], Mapping[str, Any]] = import_module(f"hrg_cli.stages.{stage}").summarise
    return found


def _causes(record: Diagnosis) -> dict[str, float]:
    """How many causes were found, their sizes by name (effects.NAME.PARAMETER), and the values
    beside them (values.NAME), with _std."""
    try:
        report = record.read_report()
    except (ValueError, TypeError):
        report = {}
    effects = report.get("effects") or []
    figures = {"causes": float(len(effects))}
    for value in report.get("values") or []:
        figures[f"values.{value['name']}"], figures[f"values.{value['name']}_std"] = (
            float(value["value"]),
            float(value["std"]),
        )
    for effect in effects:
        for name, parameter in (effect.get("parameters") or {}).items():
            key = f"effects.{effect.get('name')}.{name}"
            figures[key], figures[f"{key}_std"] = float(parameter["value"]), float(parameter["std"])
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
