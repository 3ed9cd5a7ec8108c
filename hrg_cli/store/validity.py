"""Values held to their declaration: the same rules for every column, at reading block by block and
before anything is written."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any

import numpy as np

from ..errors import HrgError
from ..records import SIZES, Calibration, Column, Diagnosis, Record, Recording, Resonator, Valid
from ..units import to_file_unit
from .covariance_checks import find_covariance_problem
from .report_checks import find_report_problem

Array = np.ndarray
KINDS_OF_NUMBER = {"raw": "iuf", "f8": "iuf", "u1": "iu", "i2": "iu", "i4": "iu", "i8": "iu"}
"""Kinds of stored numbers that a declared type may be read from: no flags from fractions, no
samples from yes and no."""


def find_dtype_problem(found: np.dtype[Any], spec: Column) -> str | None:
    """Why a dataset's type cannot be that of a column.

    Parameters
    ----------
    found
        The dataset's type.
    spec
        The column's declaration.

    Returns
    -------
    str or None
        In words; None where it can.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.records import Wave
    >>> from hrg_cli.store.validity import find_dtype_problem
    >>> find_dtype_problem(np.dtype("f4"), Wave.columns()["flags"])
    'holds float32, whole numbers were expected'
    """
    if spec.dtype == "str":
        return None if found.kind in "OSU" else f"holds {found}, text was expected"
    if found.kind in KINDS_OF_NUMBER[spec.dtype]:
        return None
    what = "real numbers were" if spec.dtype in ("raw", "f8") else "whole numbers were"
    return f"holds {found}, {what} expected"


def find_size_problem(dim: str, size: int) -> str | None:
    """Why a dimension cannot have a size.

    Parameters
    ----------
    dim
        The dimension's name.
    size
        Its length.

    Returns
    -------
    str or None
        In words; None where it can.

    Examples
    --------
    >>> from hrg_cli.store.validity import find_size_problem
    >>> find_size_problem("row", 12)
    """
    allowed = SIZES.get(dim)
    if allowed is None or size in allowed:
        return None
    return (
        f"has {size} values along its dimension {dim}, {' or '.join(map(str, allowed))} were"
        " expected"
    )


def find_values_problem(
    values: Array, spec: Column, first_row: int = 0, excused: Callable[[], Array] | None = None
) -> str | None:
    """What is wrong with some rows of a column.

    Parameters
    ----------
    values
        (n, …), the rows from `first_row` on.
    spec
        The column's declaration.
    first_row
        Number of the first row in the file, for the sentence.
    excused
        () -> (n,) bool: rows in which NaN may stand, for columns declared missing="flagged"; asked
        only where there is a NaN.

    Returns
    -------
    str or None
        In words; None where they are as declared.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.records import Wave
    >>> from hrg_cli.store.validity import find_values_problem
    >>> find_values_problem(np.array([0.0, 1.0, 1.0]), Wave.columns()["time_s"], first_row=10)
    'holds 1 in row 13 after 1; the values must increase from row to row'
    """
    valid = spec.valid
    if spec.dtype == "str" or valid.raw or not np.size(values):
        return None
    if spec.dtype in ("u1", "i2", "i4", "i8"):
        limits = np.iinfo(spec.dtype)
        outside = _find_first((values < limits.min) | (values > limits.max))
        if outside is not None:
            return (
                f"holds {_tell_value(values, outside, first_row)}, a number from {limits.min} to"
                f" {limits.max} was expected"
            )
    # Whole numbers are finite; asking them costs a pass over millions of samples.
    known = np.isfinite(values) if values.dtype.kind == "f" else None
    if known is not None and not known.all():
        problem = _not_finite(values, valid, first_row, excused)
        if problem is not None:
            return problem
    # NaN that may stand there compares as false: no bound is broken by it.
    with np.errstate(invalid="ignore"):
        for outside_, words in (
            (None if valid.above is None else values <= valid.above, f"above {valid.above}"),
            (
                None if valid.at_least is None else values < valid.at_least,
                f"at least {valid.at_least}",
            ),
            (None if valid.at_most is None else values > valid.at_most, f"at most {valid.at_most}"),
        ):
            place = None if outside_ is None else _find_first(outside_)
            if place is not None:
                return f"holds {_tell_value(values, place, first_row)}, {words} was expected"
    if valid.rising and len(values) > 1:
        place = _find_first(np.diff(np.asarray(values), axis=0) <= 0)
        if place is not None:
            after = (place[0] + 1, *place[1:])
            return (
                f"holds {_tell_value(values, after, first_row)} after {values[place]:.9g}; the"
                " values must increase from row to row"
            )
    return None


def _not_finite(
    values: Array, valid: Valid, first_row: int, excused: Callable[[], Array] | None
) -> str | None:
    if not valid.infinite:
        place = _find_first(np.isinf(values))
        if place is not None:
            return f"holds {_tell_value(values, place, first_row)}, a finite number was expected"
    missing = np.isnan(values)
    if valid.missing == "flagged" and excused is not None and missing.any():
        rows = np.asarray(excused(), bool)
        missing = missing & ~rows.reshape(-1, *[1] * (missing.ndim - 1))
    place = None if valid.missing == "anywhere" else _find_first(missing)
    if place is None:
        return None
    return f"holds {_tell_value(values, place, first_row)}, a finite number was expected" + (
        " where no flag is set" if valid.missing == "flagged" else ""
    )


def _find_first(wrong: Array) -> tuple[int, ...] | None:
    """The place of the first True, or None."""
    wrong = np.asarray(wrong)
    if not wrong.any():
        return None
    return tuple(int(i) for i in np.unravel_index(int(np.argmax(wrong)), wrong.shape))


def _tell_value(values: Array, place: tuple[int, ...], first_row: int) -> str:
    row = place[0] + first_row if place else 0
    return f"{values[place]:.9g} in row {row + 1}" if place else f"{values:.9g}"


def find_attribute_problem(value: Any, spec: Column) -> str | None:
    """What is wrong with an attribute's value.

    Parameters
    ----------
    value
        The value; None: it is not there.
    spec
        The attribute's declaration.

    Returns
    -------
    str or None
        In words; None where it is as declared.

    Examples
    --------
    >>> from hrg_cli.records import Wave
    >>> from hrg_cli.store.validity import find_attribute_problem
    >>> print(find_attribute_problem("forked", Wave.columns()["mode"]))
    is 'forked', "free" or "forced" was expected
    """
    valid = spec.valid
    if value is None:
        return None
    if spec.dtype == "str":
        if valid.one_of and value not in valid.one_of:
            return f"is {str(value)[:60]!r}, {_join_choices(valid.one_of)} was expected"
        return _json_problem(value, valid.json) if valid.json else None
    value = float(value)  # whole numbers, too: one of 1e300 fits no type of numpy's
    if np.isnan(value):
        return None if valid.missing == "anywhere" else "is nan, a finite number was expected"
    if np.isinf(value) and not valid.infinite:
        return f"is {value}, a finite number was expected"
    if valid.above is not None and not value > valid.above:
        positive = " (positive)" if valid.above == 0 else ""
        return f"is {value:.9g}, a number above {valid.above:g}{positive} was expected"
    if valid.at_least is not None and not value >= valid.at_least:
        return f"is {value:.9g}, {valid.at_least:g} or more was expected"
    if valid.at_most is not None and not value <= valid.at_most:
        return f"is {value:.9g}, {valid.at_most:g} at most was expected"
    return None


def _join_choices(words: tuple[str, ...]) -> str:
    return " or ".join(f'"{word}"' for word in words)


def _json_problem(text: str, wanted: str) -> str | None:
    kind = {"object": dict, "list": list}[wanted]
    try:
        value = json.loads(text)
    except (ValueError, RecursionError):
        return f"is no JSON {wanted}"
    return None if isinstance(value, kind) else f"is JSON, but no {wanted}"


def may_be_missing(record: Record) -> Array:
    """Rows of a windowed record in which NaN may stand: flagged, or the solver did not converge.

    Parameters
    ----------
    record
        A record with flags (n,).

    Returns
    -------
    ndarray
        (n,) bool.

    Examples
    --------
    >>> import types
    >>> from hrg_cli.store.validity import may_be_missing
    >>> may_be_missing(types.SimpleNamespace(flags=[0, 1, 0], iterations=[3, 3, -1])).tolist()
    [False, True, True]
    """
    excused = np.asarray(record.flags) != 0  # type: ignore[attr-defined]
    iterations = getattr(record, "iterations", None)
    return excused if iterations is None else excused | (np.asarray(iterations) < 0)


def list_bound_together(record: Record) -> str | None:
    """What is wrong between several fields of a record.

    Parameters
    ----------
    record
        Of any kind, every field as declared.

    Returns
    -------
    str or None
        In words; None where all agree.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.store.validity import list_bound_together
    >>> list_bound_together(
    ...     Recording(c=np.zeros(0), s=np.zeros(0), sample_rate_hz=10.0, mode="free")
    ... )
    'holds no samples; record again'
    """
    if isinstance(record, Recording):
        return _recording_problem(record)
    if isinstance(record, Calibration):
        return _calibration_problem(record)
    if isinstance(record, Resonator):
        return _resonator_problem(record)
    if isinstance(record, Diagnosis):
        problem = find_report_problem(record.report)
        return None if problem is None else f"attribute report of /diagnosis {problem}"
    if hasattr(record, "signals") and len(record):
        readout = record.readout  # type: ignore[attr-defined]
        count, wanted = np.shape(record.signals)[1], 8 if readout == "carrier" else 4
        if count != wanted:
            return (
                f"/periods/signals has {count} signals, {wanted} were expected with readout"
                f' "{readout}"'
            )
    if (
        hasattr(record, "readout")
        and record.readout == "carrier"
        and getattr(record, "carrier_hz", 1.0) is None
    ):
        return 'readout is "carrier" but the attribute carrier_hz is missing; add it'
    return None


def _recording_problem(record: Recording) -> str | None:
    if len(record) == 0:
        return "holds no samples; record again"
    found = "neither" if record.time_s is None else "both"
    if (record.sample_rate_hz is None) == (record.time_s is None):
        return (
            "needs either the attribute sample_rate_hz or the dataset time_s in /recording, found"
            f" {found}"
        )
    if record.readout == "carrier" and record.carrier_hz is None:
        return 'readout is "carrier" but the attribute carrier_hz is missing; add it'
    for name in ("c_scale_factor", "s_scale_factor"):
        if getattr(record, name) == 0:
            return (
                f"{name[2:]} of channel {name[0]} is 0, a finite number other than 0 was expected"
            )
    if to_file_unit(record.c_units) != to_file_unit(record.s_units):
        return (
            f"channel c is in {record.c_units!r} and channel s in {record.s_units!r}; both must"
            " have one unit"
        )
    if record.auxiliary_time_s is None and (
        record.temperature_degc is not None or record.rate_rad_s is not None
    ):
        return "/auxiliary has data but no time_s; add it"
    return None


def _resonator_problem(record: Resonator) -> str | None:
    names = [str(name) for name in record.name]
    twice = next((name for name in names if names.count(name) > 1), None)
    if twice is not None:
        return f"/resonator/name has {twice[:60]!r} twice; each parameter once was expected"
    problem = find_covariance_problem(record.covariance)
    return None if problem is None else f"/resonator/covariance {problem}"


def _calibration_problem(record: Calibration) -> str | None:
    nodes = record.temperature_degc if record.axis == "temperature" else record.frequency_hz
    if nodes is None:
        return f"its axis is {record.axis}, but /calibration has no nodes of it"
    if not len(nodes) or not len(record.wave_angle_rad):
        return "its tables hold no node or no angle"
    drift, scale = np.shape(record.drift_harmonics)[1], np.shape(record.scale_factor_harmonics)[1]
    for name, count in (("drift_harmonics", drift), ("scale_factor_harmonics", scale)):
        if count % 2 == 0:
            return (
                f"/calibration/{name} has {count} coefficients per node; a constant and pairs of"
                " cos and sin were expected"
            )
    # tables that are refused may hold what nobody is to divide by: of runs at rest alone K is 0
    usable = record.status != "refused"
    if usable and not np.all(np.abs(record.scale_factor) >= np.finfo(float).tiny):
        return "/calibration/scale_factor holds 0, a finite number other than 0 was expected"
    coefficients = len(nodes) * (drift + scale)
    if len(record.covariance) != coefficients:
        return (
            f"/calibration/covariance has {len(record.covariance)} rows, {coefficients} were"
            " expected, one a coefficient"
        )
    problem = find_covariance_problem(record.covariance)
    if problem is not None:
        return f"/calibration/covariance {problem}"
    if record.node_min > record.node_max or record.rate_min_rad_s > record.rate_max_rad_s:
        return "the lowest value of a range is above its highest"
    return None


class WrittenBlocks:
    """Holds the blocks of a record to their declaration before they are written: what a command
    made must be what it promises."""

    def __init__(self, path: Any) -> None:
        self.path = path
        self.rows = 0
        self.last: dict[str, float] = {}

    def check(self, record: Record) -> None:
        """HrgError: a column or attribute of this block breaks its own declaration."""
        problem = self._problem(record)
        if problem is not None:
            raise HrgError(
                f"{self.path}: was not written: {problem}; look for values out of all proportion"
                " in the input, or report it"
            )
        self.rows += len(record)

    def _problem(self, record: Record) -> str | None:
        for name, spec in record.columns().items():
            value = getattr(record, name)
            if value is None:
                continue
            problem = (
                find_attribute_problem(value, spec)
                if spec.dims is None
                else self._column_problem(record, name, value, spec)
            )
            if problem is not None:
                return f"{name} {problem}"
        return list_bound_together(record) if len(record) or not self.rows else None

    def _column_problem(self, record: Record, name: str, value: Any, spec: Column) -> str | None:
        if spec.dtype == "str" or spec.valid.raw:
            return None
        values = np.asarray(value)
        problem = find_dtype_problem(values.dtype, spec) or find_values_problem(
            values, spec, self.rows, lambda: may_be_missing(record)
        )
        if (
            problem is None
            and spec.valid.rising
            and spec.dims is not None
            and spec.dims[0] == "row"
            and values.size
        ):
            before = self.last.get(name, -np.inf)
            if not values.flat[0] > before:
                problem = (
                    f"holds {values.flat[0]:.9g} in row {self.rows + 1} after {before:.9g}; the"
                    " values must increase from row to row"
                )
            self.last[name] = float(values.flat[-1])
        return problem
