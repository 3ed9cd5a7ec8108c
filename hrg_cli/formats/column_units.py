"""The unit in which a column of times, rates or temperatures is read."""

from __future__ import annotations

from ..errors import HrgError
from .log import Channel
from .unit_spellings import OF_ROLE, is_of, list_units


def find_column_unit(
    where: str, role: str, column: int, channel: Channel, given: str | None
) -> str:
    """The unit in which a column of times, rates or temperatures is read.

    Parameters
    ----------
    where
        The log, for messages.
    role
        "time", "rate" or "temperature".
    column
        Its index, from 0.
    channel
        The column as the log describes it.
    given
        As told; None: the log's own, else the SI one (°C of a temperature).

    Returns
    -------
    str
        One that `quantities` knows, but for one that was given, which is checked where it is used.

    Raises
    ------
    HrgError
        The log's own is not one of that quantity; the sentence says what to do.

    Examples
    --------
    >>> from hrg_cli.formats.column_units import find_column_unit
    >>> from hrg_cli.formats.log import Channel
    >>> column = Channel("table", "deg/s")
    >>> find_column_unit("bench.csv", "rate", 3, column, None)
    'deg/s'
    >>> find_column_unit("bench.csv", "rate", 3, column, "rpm")
    'rpm'
    """
    table, default = OF_ROLE[role]
    unit = given or channel.units or default
    if given is None and not is_of(table, unit):
        scaled = ", for a voltage also rate_scale_factor" if role == "rate" else ""
        leave = f'{role} = "none" to leave it out'
        raise HrgError(
            f"{where}: its column {column + 1} ({channel.name}) is in {unit!r}, no unit of a"
            f" {role} ({list_units(table)}); give {role}_units{scaled}, or {leave}"
        )
    return unit
