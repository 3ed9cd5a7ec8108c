"""Columns of a log that an import did not take, each with the reason."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from .log import Channel, Log
from .quantities import is_rate, is_temperature, is_time


def list_left_columns(log: Log, taken: Mapping[str, int]) -> list[dict[str, Any]]:
    """Column (from 1), name, unit and reason of every column of which nothing was taken; `taken` is
    role -> index."""
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
