"""The slow columns of a log (temperature, rate, drive) as the auxiliary log of a recording."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import HrgError
from ..records import Status
from ..units import KELVIN_DEGC
from .column_units import find_column_unit
from .log import Array, Log
from .log_columns import Roles
from .no_values import NoValues
from .readers import guard_reading
from .run_heading import UnitsTold
from .timing import Timing
from .unit_spellings import find_rate_factor, find_temperature_scale

MOST_OWN_ROWS = 1 << 26
FIELD = {
    "rate": "rate_rad_s",
    "temperature": "temperature_degc",
    "drive_main": "drive_main",
    "drive_quadrature": "drive_quadrature",
}
"""Role -> field of the recording."""


class SlowLog:
    """Takes the slow columns block by block beside the channels and hands over auxiliary rows in SI
    units.

    Columns as long as the channels are averaged over groups of rows so that about `most` rows
    remain; columns with times of their own go out with the first block; constants stand at the
    first and last time.
    """

    def __init__(
        self,
        log: Log,
        roles: Roles,
        *,
        where: str,
        told: UnitsTold,
        rate_scale_factor: float,
        constants: dict[str, float | None],
        most: int,
    ) -> None:
        self.log, self.roles = log, roles
        self.constants = {role: value for role, value in constants.items() if value is not None}
        for role in self.constants:
            if role in roles.list_auxiliary():
                raise HrgError(
                    f"a {role} column and constant_{FIELD[role]} were both given; leave one out"
                )
        self.scales: dict[str, tuple[float, float]] = {}
        self.unnamed = False
        """Whether nobody says in what unit the temperature is."""
        self.begin()
        for role, index in roles.list_auxiliary().items():
            channel = log.channels[index]
            factor, offset = 1.0, 0.0
            if role == "rate":
                unit = find_column_unit(where, role, index, channel, told.rate)
                factor = rate_scale_factor * find_rate_factor(unit)
            if role == "temperature":
                unit = find_column_unit(where, role, index, channel, told.temperature)
                self.unnamed = told.temperature is None and not channel.units
                factor, offset = find_temperature_scale(unit)
            self.scales[role] = (
                factor * channel.scale_factor,
                factor * channel.add_offset + offset,
            )
        own = roles.auxiliary_time is not None or any(
            log.channels[i].length != log.channels[roles.c].length
            for i in roles.list_auxiliary().values()
        )
        self.own = own and bool(self.scales)
        self.indexes = [] if self.own else list(roles.list_auxiliary().values())
        self.every = max(1, -(-(log.rows or 0) // most))
        self.left: list[Array] | None = None

    def make_block(
        self,
        path: Path,
        timing: Timing,
        times: Array,
        columns: list[Array],
        first: bool,
        last: bool,
        shift_s: float = 0.0,
        row: int = 0,
    ) -> dict[str, Array]:
        """Auxiliary rows of one block: field name -> values; `shift_s` is the log's time that
        became t = 0, `row` the log's row of the first."""
        if self.own:
            return self._with_constants(
                self._own_rows(path, timing, shift_s)
                if first
                else [np.empty(0)] * (1 + len(self.scales))
            )
        if not self.indexes:
            rows = ([times[0]] if first else []) + (
                [times[-1]] if last and not (first and len(times) == 1) else []
            )
            return self._with_constants([np.array(rows, float)]) if self.constants else {}
        stacked = [times, *self.convert(columns, row + np.arange(len(times)))]
        if self.left is not None:
            stacked = [np.concatenate(pair) for pair in zip(self.left, stacked)]
        whole = len(stacked[0]) if last else len(stacked[0]) // self.every * self.every
        self.left = [values[whole:] for values in stacked]
        grouped = [mean_groups(values[:whole], self.every) for values in stacked]
        seen = ~np.all([np.isnan(values) for values in grouped[1:]], axis=0)
        return self._with_constants([values[seen] for values in grouped])

    def begin(self) -> None:
        """Forget what was seen of the rows: they are read from the first one on."""
        self.warmth, self.warm_rows = 0.0, 0
        self.no_values = {
            role: NoValues(role, self.log.where) for role in self.roles.list_auxiliary()
        }

    def list_fields(self) -> list[str]:
        """Fields of a record that the columns fill, in their order."""
        return [FIELD[role] for role in self.scales]

    def list_constant_fields(self) -> dict[str, float]:
        """Fields that were given as constants."""
        return {FIELD[role]: value for role, value in self.constants.items()}

    def convert(self, columns: list[Array], rows: Array) -> list[Array]:
        """Slow columns in SI units, NaN where a number is no value; `rows` are those of the
        log."""
        found = [
            self.no_values[role].take(values, np.asarray(values, float) * factor + offset, rows)
            for values, (role, (factor, offset)) in zip(columns, self.scales.items())
        ]
        if self.unnamed:
            warm = found[list(self.scales).index("temperature")]
            self.warmth += float(np.nansum(warm))
            self.warm_rows += int(np.count_nonzero(np.isfinite(warm)))
        return found

    def judge(self) -> list[tuple[Status, str]]:
        """After the last block: numbers that are no values, and a temperature of no unit that no
        gyro has in °C."""
        none = [reason for column in self.no_values.values() for reason in column.judge()]
        mean = self.warmth / self.warm_rows if self.warm_rows else 0.0
        if mean < KELVIN_DEGC:
            return none
        told = f"its temperature column names no unit and holds {mean:.4g} on the average, no"
        return [
            *none,
            ("suspect", f'{told} temperature of a gyro in °C; give temperature_units = "K"'),
        ]

    def _with_constants(self, stacked: list[Array]) -> dict[str, Array]:
        found = {
            "auxiliary_time_s": stacked[0],
            **{FIELD[role]: values for role, values in zip(self.scales, stacked[1:])},
        }
        return found | {
            FIELD[role]: np.full(len(stacked[0]), value) for role, value in self.constants.items()
        }

    def _own_rows(self, path: Path, timing: Timing, shift_s: float) -> list[Array]:
        indexes = list(self.roles.list_auxiliary().values())
        clock = self.roles.auxiliary_time
        rows = self.log.channels[indexes[0]].length or 0
        if rows > MOST_OWN_ROWS:
            raise HrgError(
                f"{path}: its slow columns have {rows} rows, {MOST_OWN_ROWS} at the most were"
                " expected; thin them out"
            )
        with guard_reading(path, self.log.format):
            blocks = list(self.log.read([*indexes, *([] if clock is None else [clock])]))
        joined = [
            np.concatenate([np.asarray(b[k], float) for b in blocks]) for k in range(len(blocks[0]))
        ]
        if clock is None:
            times = np.arange(rows) / (self.log.channels[indexes[0]].sample_rate_hz or 1.0)
        else:
            times = joined.pop() * timing.factor - timing.first
        row, times, joined = self._filled_rows(path, times, joined)
        if len(times) > 1 and not np.all(np.diff(times) > 0):
            fallen = row[int(np.argmin(np.diff(times) > 0)) + 1] + 1
            raise HrgError(
                f"{path}: the times of its slow columns do not rise at their row {fallen}; sort the"
                " log or leave the columns out"
            )
        return [times - shift_s, *self.convert(joined, row)]

    def _filled_rows(
        self, path: Path, times: Array, values: list[Array]
    ) -> tuple[Array, Array, list[Array]]:
        """Number, time and values of the rows that hold a value: in a table of text, slow columns
        stand in as many lines as the channels and are blank where they have no row."""
        filled = np.any(np.isfinite(values), axis=0)
        timeless = np.flatnonzero(filled & ~np.isfinite(times))
        if len(timeless):
            raise HrgError(
                f"{path}: row {timeless[0] + 1} of its slow columns holds a value but no time; fill"
                " its time in, or leave the value out"
            )
        row = np.flatnonzero(filled)
        return row, times[row], [column[row] for column in values]


def mean_groups(values: Array, every: int) -> Array:
    """Means of groups of rows without their NaN.

    Parameters
    ----------
    values
        Rows (n,).
    every
        Rows of a group; the last one may be shorter.

    Returns
    -------
    ndarray
        One value a group; NaN where a group holds nothing else.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.formats.slow import mean_groups
    >>> mean_groups(np.array([1.0, np.nan, 3.0, 5.0]), 2).tolist()
    [1.0, 4.0]
    """
    if every == 1 or len(values) == 0:
        return values
    starts = np.arange(0, len(values), every)
    finite = np.isfinite(values)
    sums, counts = (
        np.add.reduceat(np.where(finite, values, 0.0), starts),
        np.add.reduceat(finite.astype(int), starts),
    )
    return np.divide(sums, counts, out=np.full(len(starts), np.nan), where=counts > 0)
