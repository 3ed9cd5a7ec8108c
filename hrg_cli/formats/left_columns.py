"""Columns of a log that an import did not take, each with the reason."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .log import Channel, Log
from .unit_spellings import is_rate, is_temperature, is_time


def list_left_columns(log: Log, taken: Mapping[str, int]) -> list[dict[str, Any]]:
    """The columns of a log of which nothing was taken, each with the reason.

    Parameters
    ----------
    log
        As it was opened.
    taken
        Role -> index of its column, from 0.

    Returns
    -------
    list of dict
        Column (from 1), name, units and why, in the order of the log.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.formats.left_columns import list_left_columns
    >>> from hrg_cli.formats.log import make_log
    >>> columns = {name: np.zeros(3) for name in ("c", "s", "chamber")}
    >>> log = make_log("bench", columns, {"chamber": "°C"})
    >>> (left,) = list_left_columns(log, {"c": 0, "s": 1})
    >>> left["column"], left["why"]
    (3, 'its title does not say the temperature; --temperature chamber takes this one')
    """
    return [
        {
            "column": index + 1,
            "name": channel.name,
            "units": channel.units,
            "why": _reason(channel, taken),
        }
        for index, channel in enumerate(log.channels)
        if index not in taken.values()
    ]


def _reason(channel: Channel, taken: Mapping[str, int]) -> str:
    if channel.kind == "text":
        return "holds text"
    for role, fits in (("rate", is_rate), ("temperature", is_temperature), ("time", is_time)):
        if fits(channel.units):
            other = "another column is" if role in taken else "its title does not say"
            return f"{other} the {role}; --{role} {_quote_name(channel)} takes this one"
    return "not asked for, and its title is no known one"


def _quote_name(channel: Channel) -> str:
    return f"'{channel.name}'" if " " in channel.name else channel.name
