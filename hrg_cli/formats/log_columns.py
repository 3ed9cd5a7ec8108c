"""Which column of a log is what: named by the user, or known by its title, or by standing alone."""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import HrgError, name_some
from .grouped_numbers import describe_unread
from .log import Channel, Log
from .unit_spellings import is_rate, is_temperature, is_time

TICKS = ("ticks", "tick", "clock ticks", "timer", "counter")
"""Titles of a column that counts a clock whose rate was given."""

ALIASES: dict[str, tuple[str, ...]] = {
    "time": (
        "time",
        "t",
        "timestamp",
        "time_s",
        "seconds",
        "second",
        "x-axis",
        "datetime",
        "date",
        "clock",
        "zeit",
        "temps",
        "elapsed",
        "elapsed time",
        "systemtime",
    ),
    "c": (
        "c",
        "cos",
        "cosine",
        "channel c",
        "ch c",
        "chan_c",
        "x",
        "ch1",
        "channel 1",
        "channel1",
        "channel a",
        "ch a",
        "cha",
        "a",
        "ai0",
        "in1",
        "1",
        "left",
        "chan1",
        "kanal c",
        "kanal a",
        "kanal 1",
        "kanal1",
        "voie c",
        "voie a",
        "voie 1",
        "voie1",
    ),
    "s": (
        "s",
        "sin",
        "sine",
        "channel s",
        "ch s",
        "chan_s",
        "y",
        "ch2",
        "channel 2",
        "channel2",
        "channel b",
        "ch b",
        "chb",
        "b",
        "ai1",
        "in2",
        "2",
        "right",
        "chan2",
        "kanal s",
        "kanal b",
        "kanal 2",
        "kanal2",
        "voie s",
        "voie b",
        "voie 2",
        "voie2",
    ),
    "temperature": (
        "temperature",
        "temp",
        "temperature_degc",
        "t_degc",
        "temperatur",
        "température",
    ),
    "rate": (
        "rate",
        "rate_rad_s",
        "omega",
        "omega_z",
        "table rate",
        "table_rate",
        "angular rate",
        "angular_rate",
        "turntable rate",
        "turntable_rate",
        "rotation rate",
        "rotation_rate",
        "drehrate",
        "winkelgeschwindigkeit",
        "drehgeschwindigkeit",
        "vitesse angulaire",
        "vitesse de rotation",
    ),
    "drive_main": ("drive_main", "drive main", "main drive", "main_drive"),
    "auxiliary_time": (
        "auxiliary_time",
        "aux_time",
        "log_time",
        "temperature_time",
        "temp_time",
        "auxiliary time",
    ),
    "drive_quadrature": (
        "drive_quadrature",
        "drive quadrature",
        "quadrature drive",
        "quadrature_drive",
    ),
}
"""Role -> titles it goes by, in the order of trust."""
OF_UNIT = {"temperature": is_temperature, "rate": is_rate}
"""Role -> whether a unit is its own, so that the only column of it needs no title."""


@dataclass(frozen=True)
class Roles:
    """Channel index of every role, None where the log has none."""

    time: int | None
    c: int
    s: int | None
    temperature: int | None
    rate: int | None
    drive_main: int | None
    drive_quadrature: int | None
    auxiliary_time: int | None = None
    doubts: tuple[str, ...] = ()
    """Roles that several columns may have, of which none was taken."""

    def list_columns(self) -> dict[str, int]:
        """The columns present, in the order of `ALIASES`: role -> index."""
        found = {role: getattr(self, role) for role in ALIASES}
        return {role: index for role, index in found.items() if index is not None}

    def list_auxiliary(self) -> dict[str, int]:
        """The slow columns present: role -> index."""
        found = {
            role: getattr(self, role)
            for role in ("temperature", "rate", "drive_main", "drive_quadrature")
        }
        return {role: index for role, index in found.items() if index is not None}


def list_columns(log: Log) -> str:
    """The columns of a log, for a message.

    Parameters
    ----------
    log
        As it was opened.

    Returns
    -------
    str
        Numbers (from 1), titles and units; of many columns the first ones.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.formats.log_columns import list_columns
    >>> from hrg_cli.formats.log import make_log
    >>> list_columns(make_log("bench", {"t": np.arange(4.0), "ch1": np.ones(4)}, {"t": "ms"}))
    '1 t [ms], 2 ch1'
    """
    return name_some(
        f"{i + 1} {c.name}" + (f" [{c.units}]" if c.units else "")
        for i, c in enumerate(log.channels)
    )


@dataclass(frozen=True)
class TimingTold:
    """What was said of the times: the sampling rate, so that no nameless column need hold them; the
    clock, so that a column of its ticks does; their unit."""

    rate: bool = False
    clock: bool = False
    units: str | None = None


def find_roles(
    log: Log, path: str, asked: dict[str, str | int | None], timing: TimingTold = TimingTold()
) -> Roles:
    """Which column of a log is what: as asked for, by its title, its unit, or by standing alone.

    Parameters
    ----------
    log
        As it was opened.
    path
        Of the log, for messages.
    asked
        Role -> title or number (from 1) of its column; "none" leaves a role out.
    timing
        What was said of the times beside the columns.

    Returns
    -------
    Roles
        Index of every role's column, from 0.

    Raises
    ------
    HrgError
        There is no such column, or the log can be read in more than one way.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.formats.log_columns import find_roles
    >>> from hrg_cli.formats.log import make_log
    >>> rows = np.arange(4.0)
    >>> log = make_log("bench", {"t": rows, "ch1": 0 * rows, "ch2": 0 * rows, "oven": 0 * rows})
    >>> find_roles(log, "bench", {"temperature": "oven"}).list_columns()
    {'time': 0, 'c': 1, 's': 2, 'temperature': 3}
    """
    left_out = {
        role
        for role, wanted in asked.items()
        if isinstance(wanted, str) and wanted.strip().lower() == "none"
    }
    taken: dict[str, int | None] = {role: None for role in ALIASES}
    for role, wanted in asked.items():
        if wanted is not None and role not in left_out:
            taken[role] = find_column_number(log, path, role, wanted)
    free = [
        i
        for i in range(len(log.channels))
        if i not in taken.values() and log.channels[i].kind != "text"
    ]
    if timing.clock and taken["time"] is None and "time" not in left_out:
        taken["time"] = next((i for i in free if log.channels[i].name.lower() in TICKS), None)
        free = [i for i in free if i != taken["time"]]
    for role in ALIASES:
        if taken[role] is None and role not in left_out:
            taken[role] = _find_told(log, role, free)
            free = [i for i in free if i != taken[role]]
    if taken["time"] is None and log.sample_rate_hz is None and "time" not in left_out:
        nameless = _unnamed_time(log, free)
        free = [i for i in free if i != nameless]
        # beside a rate that was given it counts rows
        taken["time"] = None if timing.rate else nameless
    if "time" in left_out:
        free = [i for i in free if not (log.channels[i].rising and _tells_time(log.channels[i]))]
    _fill_channels(log, path, taken, free, single="s" in left_out)
    if taken["c"] == taken["s"]:
        raise HrgError(
            f"{path}: c and s are both column {(taken['c'] or 0) + 1}; name two of"
            f" {list_columns(log)}"
        )
    free = [i for i in free if i not in taken.values()]
    open_roles = [r for r in OF_UNIT if taken[r] is None and r not in left_out]
    doubts = [
        _doubt(log, r, several) for r in open_roles if (several := _list_of_unit(log, r, free))
    ]
    return Roles(**taken, doubts=tuple(doubts))  # type: ignore[arg-type]


def _list_of_unit(log: Log, role: str, free: list[int]) -> list[int]:
    """The free columns whose unit is one of a role's."""
    fits = OF_UNIT.get(role)
    return [i for i in free if fits and _holds_numbers(log, i) and fits(log.channels[i].units)]


def _doubt(log: Log, role: str, several: list[int]) -> str:
    """That several columns may be what a role is, and what chooses."""
    names = name_some((repr(log.channels[i].name) for i in several), 60)
    first = log.channels[several[0]].name
    return (
        f"no column is taken as the {role}, for {len(several)} may be it ({names}); choose with"
        f" --{role} {first!r}, or --{role} none"
    )


def _find_told(log: Log, role: str, free: list[int]) -> int | None:
    """The free column that the log itself, its title or (a temperature, a rate) its unit alone
    gives a role; None where there is none."""
    told = [i for i in free if log.channels[i].role == role]
    if told:
        return told[0]
    others = {i for other in OF_UNIT for i in _list_of_unit(log, other, free)}
    fitting = [
        i
        for i in free
        if (role == "time" and i not in others) or (role != "time" and _holds_numbers(log, i))
    ]
    by_title = (
        i for title in ALIASES[role] for i in fitting if log.channels[i].name.lower() == title
    )
    alone = _list_of_unit(log, role, free)
    return next(by_title, alone[0] if len(alone) == 1 else None)


def _holds_numbers(log: Log, index: int) -> bool:
    return log.channels[index].kind == "number"


def _fill_channels(
    log: Log, path: str, taken: dict[str, int | None], free: list[int], single: bool
) -> None:
    """Give the channels that no title told the columns that are left. HrgError: as many are not
    left."""
    numbers = [i for i, channel in enumerate(log.channels) if channel.kind == "number"]
    missing = [role for role in (["c"] if single else ["c", "s"]) if taken[role] is None]
    left = [i for i in free if i in numbers]
    if len(left) == len(missing):
        taken.update(zip(missing, left))
        return
    if not missing:
        return
    if len([i for i in numbers if i != taken["time"]]) == 1 and not single:
        raise HrgError(
            f"{path}: has one channel only ({list_columns(log)}), two (C and S) were expected; name"
            ' the other one\'s file with s_file, or give s = "none": frequency and damping alone'
            " can then be found"
        )
    asked_for = " and which ".join(m.upper() for m in missing)
    raise HrgError(
        f"{path}: which column is channel {asked_for}? Its columns are {list_columns(log)}; name"
        f" them with c and s{_unread(log)}"
    )


def find_column_number(log: Log, path: str, role: str, wanted: str | int) -> int:
    """Index of the column that was named for a role.

    Parameters
    ----------
    log
        As it was opened.
    path
        Of the log, for messages.
    role
        "time", "c" …; only a time may be a column of clock times.
    wanted
        Title, title with its unit, end of a path of titles, or number from 1.

    Returns
    -------
    int
        From 0.

    Raises
    ------
    HrgError
        There is no such column, several are called so, or it holds no numbers.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.formats.log_columns import find_column_number
    >>> from hrg_cli.formats.log import make_log
    >>> log = make_log("bench", {"t": np.arange(4.0), "demod/x": np.ones(4)}, {"t": "ms"})
    >>> [find_column_number(log, "bench", *of) for of in (("c", "X"), ("time", "t (ms)"))]
    [1, 0]
    """
    if isinstance(wanted, int) or wanted.isdigit():
        number = int(wanted)
        if not 1 <= number <= len(log.channels):
            raise HrgError(
                f"{path}: {role} = {number}: it has {len(log.channels)} columns"
                f" ({list_columns(log)}); name one of these"
            )
        index = number - 1
    else:
        alike = _list_alike(log, wanted)
        if len(alike) != 1:
            raise HrgError(
                f"{path}: {role} = {wanted!r} is the name of"
                f" {'several columns' if alike else 'no column'}; its columns are"
                f" {list_columns(log)}"
            )
        index = alike[0]
    kind = log.channels[index].kind
    if kind == "text" or (kind == "clock" and role != "time"):
        raise HrgError(
            f"{path}: {role} = {wanted}: that column holds"
            f" {'times' if kind == 'clock' else 'text'}, numbers were expected; its columns are"
            f" {list_columns(log)}{_unread(log, index)}"
        )
    return index


def _unread(log: Log, *chosen: int) -> str:
    """That columns of text (of the chosen ones) hold digits, and what to do; mostly nothing."""
    of_text = [
        log.channels[i]
        for i in chosen or range(len(log.channels))
        if log.channels[i].kind == "text"
    ]
    told = (describe_unread(channel.name, channel.example) for channel in of_text)
    return next(filter(None, told), "")


def _list_alike(log: Log, wanted: str) -> list[int]:
    """Columns of that title: as it is written, else whatever its case, else with its unit behind,
    else as the end of a path of titles."""
    names, told = [channel.name for channel in log.channels], wanted.strip().lower()
    return (
        [i for i, name in enumerate(names) if name == wanted]
        or [i for i, name in enumerate(names) if name.lower() == told]
        or [
            i
            for i, c in enumerate(log.channels)
            if c.units
            and told
            in (
                f"{c.name} [{c.units}]".lower(),
                f"{c.name} ({c.units})".lower(),
                f"{c.name} {c.units}".lower(),
                f"{c.name}_{c.units}".lower().replace("/", "_"),
            )
        ]
        or [
            i
            for i, name in enumerate(names)
            if name.lower().endswith("/" + wanted.strip("/ ").lower())
        ]
    )


def _tells_time(channel: Channel) -> bool:
    return (
        channel.role == "time" or channel.name.lower() in ALIASES["time"] or is_time(channel.units)
    )


def _unnamed_time(log: Log, free: list[int]) -> int | None:
    clock = [i for i in free if log.channels[i].kind == "clock"]
    if clock:
        return clock[0]
    timed = [i for i in free if log.channels[i].rising and is_time(log.channels[i].units)]
    if len(timed) == 1:
        return timed[0]
    rising = [i for i in free if log.channels[i].rising]
    return rising[0] if rising and len(free) > 2 and rising[0] == free[0] else None
