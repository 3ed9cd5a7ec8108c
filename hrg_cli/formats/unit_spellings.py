"""Units as laboratories spell them: factors to SI, and the unit written into a column's name."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any

from ..errors import HrgError

DEGREE = math.pi / 180
TIME = {
    1.0: ("s", "sec", "secs", "second", "seconds", "sek", "sekunden"),
    1e-3: ("ms", "msec", "millisecond", "milliseconds"),
    1e-6: ("us", "µs", "μs", "usec", "microsecond", "microseconds"),
    1e-9: ("ns", "nsec", "nanosecond", "nanoseconds"),
    60.0: ("min", "minute", "minutes"),
    3600.0: ("h", "hr", "hour", "hours"),
    86_400.0: ("d", "day", "days", "tage"),
}
RATE = {
    1.0: ("rad/s", "rad s-1", "rad s^-1", "rad/sec", "rad_s", "rads"),
    DEGREE: ("deg/s", "°/s", "dps", "deg s-1", "deg/sec", "deg_s", "degrees/s", "degree/s"),
    DEGREE / 60: ("deg/min", "°/min"),
    DEGREE / 3600: ("deg/h", "°/h", "dph", "deg/hr", "deg/hour", "deg_h"),
    2 * math.pi / 60: ("rpm", "r/min", "1/min", "rev/min", "u/min", "turns/min", "min-1", "min^-1"),
    2 * math.pi: ("rps", "rev/s", "r/s", "turns/s", "u/s"),
    1e-3: ("mrad/s",),
    1e-3 * DEGREE: ("mdps", "mdeg/s"),
}
PHASE = {
    1.0: ("rad", "radian", "radians"),
    DEGREE: ("deg", "°", "degree", "degrees"),
    2 * math.pi: ("turns", "turn", "cycles", "rev"),
}
TEMPERATURE = {
    (1.0, 0.0): ("degc", "°c", "c", "celsius", "deg_c", "deg c", "° c", "degrees c"),
    (1.0, -273.15): ("k", "kelvin", "degk", "°k", "deg k"),
    (5 / 9, -160 / 9): ("degf", "°f", "f", "fahrenheit", "deg_f", "deg f", "° f", "degrees f"),
}
"""Unit factor and offset: °C = factor·value + offset."""
CHANNEL = (
    "v",
    "mv",
    "µv",
    "uv",
    "volt",
    "volts",
    "a",
    "ma",
    "m",
    "mm",
    "µm",
    "um",
    "nm",
    "px",
    "pixel",
    "pixels",
    "pf",
    "g",
    "m/s",
    "m/s2",
    "counts",
    "lsb",
    "adc",
    "t",
    "hz",
    "deg",
    "rad",
    "°",
    "%",
    "1",
)
LEVELS = (
    "db",
    "dbm",
    "dbv",
    "dbmv",
    "dbuv",
    "dbµv",
    "dbu",
    "dbfs",
    "dbc",
    "dbw",
    "dbvrms",
    "dbrel",
)
"""Units that are logarithms: 20 dB a decade of amplitude."""
_KNOWN = (
    set(LEVELS)
    | {
        spelling
        for table in (TIME, RATE, TEMPERATURE)
        for spellings in table.values()
        for spelling in spellings
    }
    | set(CHANNEL)
)
_SUFFIXES = {
    spelling.replace("/", joint).replace(" ", "_"): spelling
    for table in (RATE, TEMPERATURE)
    for spellings in table.values()
    for spelling in spellings
    for joint in ("_", "_per_", "/")
    if len(spelling) > 1 and re.fullmatch(r"[a-z°][a-z°/ ]+", spelling)
} | {
    unit: unit
    for unit in ("k", "s", "ms", "us", "ns", "min", "d", "hz", "v", "mv", *LEVELS[:3], "dbfs")
}
"""Units as they end a title: `rate_deg_per_s`, `rate_deg/s`, `rate_rpm`."""
_SUFFIX = re.compile(
    rf"^(.*?)_({'|'.join(sorted(_SUFFIXES, key=len, reverse=True))})$", re.IGNORECASE
)
_SIGNS = str.maketrans({"º": "°", "˚": "°", "℃": "°c", "℉": "°f"})
"""Signs that look like the ones of the tables, and are other ones."""


def _spelled(unit: str) -> str:
    """A unit as the tables spell it."""
    return re.sub(r"\s*(/|\bper\b)\s*", "/", unit.strip().translate(_SIGNS).lower())


def is_unit(text: str) -> bool:
    """Whether a cell of a units row is a unit we know, bare or in brackets.

    Parameters
    ----------
    text
        The cell.

    Returns
    -------
    bool
        True for units of times, rates, temperatures and channels, and for levels in decibels.

    Examples
    --------
    >>> from hrg_cli.formats.unit_spellings import is_unit
    >>> is_unit("[mV]"), is_unit("deg per s"), is_unit("CH1")
    (True, True, False)
    """
    return _spelled(text.strip().strip("()[]")) in _KNOWN


def is_level(unit: str) -> bool:
    """Whether a unit is a logarithm of an amplitude or a power.

    Parameters
    ----------
    unit
        As in `is_of`.

    Returns
    -------
    bool
        False also for a unit that is not known.

    Examples
    --------
    >>> from hrg_cli.formats.unit_spellings import is_level
    >>> is_level("dBm"), is_level("mV")
    (True, False)
    """
    return _spelled(unit) in LEVELS


def is_time(unit: str) -> bool:
    """Whether a unit is one of time.

    Parameters
    ----------
    unit
        As in `is_of`.

    Returns
    -------
    bool
        False also for a unit that is not known.

    Examples
    --------
    >>> from hrg_cli.formats.unit_spellings import is_time
    >>> is_time("ms"), is_time("mV")
    (True, False)
    """
    return is_of(TIME, unit)


def is_temperature(unit: str) -> bool:
    """Whether a unit is one of temperature.

    Parameters
    ----------
    unit
        As in `is_of`.

    Returns
    -------
    bool
        False also for a unit that is not known.

    Examples
    --------
    >>> from hrg_cli.formats.unit_spellings import is_temperature
    >>> is_temperature("℃"), is_temperature("mV")
    (True, False)
    """
    return is_of(TEMPERATURE, unit)


def is_rate(unit: str) -> bool:
    """Whether a unit is one of angular rate.

    Parameters
    ----------
    unit
        As in `is_of`.

    Returns
    -------
    bool
        False also for a unit that is not known.

    Examples
    --------
    >>> from hrg_cli.formats.unit_spellings import is_rate
    >>> is_rate("deg per s"), is_rate("Hz")
    (True, False)
    """
    return is_of(RATE, unit)


def is_of(table: Mapping[Any, tuple[str, ...]], unit: str) -> bool:
    """Whether a unit is one of a table's.

    Parameters
    ----------
    table
        Factor (or factor and offset) -> the spellings of a unit, as `TIME`.
    unit
        Any spelling of it; capitals and look-alike signs do not matter.

    Returns
    -------
    bool
        False also for a unit that is not known.

    Examples
    --------
    >>> from hrg_cli.formats.unit_spellings import PHASE, is_of
    >>> is_of(PHASE, "turns"), is_of(PHASE, "turns/s")
    (True, False)
    """
    return any(_spelled(unit) in spellings for spellings in table.values())


def are_same_unit(table: Mapping[Any, tuple[str, ...]], unit: str, other: str) -> bool:
    """Whether two spellings are of one unit.

    Parameters
    ----------
    table
        As in `is_of`.
    unit, other
        Any spellings.

    Returns
    -------
    bool
        False also where either is not known.

    Examples
    --------
    >>> from hrg_cli.formats.unit_spellings import RATE, are_same_unit
    >>> are_same_unit(RATE, "dps", "°/s"), are_same_unit(RATE, "dps", "rad/s")
    (True, False)
    """
    return any({_spelled(unit), _spelled(other)} <= set(spelled) for spelled in table.values())


def split_name(name: str) -> tuple[str, str]:
    """A column's name and its unit, as laboratories write both into one title.

    Parameters
    ----------
    name
        The title: `time (ms)`, `CH1 [V]`, `CH1 in V`, `gyrox rad/s`, `rate_deg_s`, `rate_deg/s`,
        `T/K`.

    Returns
    -------
    tuple of str
        The name, and its unit, "" where none is seen.

    Examples
    --------
    The bracket of the last names a channel, not a unit:

    >>> from hrg_cli.formats.unit_spellings import split_name
    >>> split_name("time (ms)"), split_name("rate_deg_s"), split_name("X(CH1)")
    (('time', 'ms'), ('rate', 'deg/s'), ('CH1', ''))
    """
    name = name.strip().strip('"').strip()
    found = re.match(r"^(.*?)\s*[\[(]([^\])]*)[\])]\s*$", name) or re.match(
        r"^(?:(.*?)\s)?in (\S+)$", name
    )
    if found and re.match(r"^ch\w*\s*\d$", found[2].strip(), re.IGNORECASE):
        return found[2].strip(), ""  # X(CH1): the bracket names the channel
    if found and (found[1] or is_unit(found[2])) and (name[-1] in "])" or is_unit(found[2])):
        unit = found[2].strip()
        return (found[1] or "").strip(" /") or ("time" if is_time(unit) else ""), unit
    found = _SUFFIX.match(name)
    likely = {
        "s": ("time", "t", "elapsed", "timestamp"),
        "k": ("temp", "temperature"),
        "min": ("time", "t"),
        "d": ("time", "t", "elapsed", "timestamp"),
    }
    if found and found[1].lower() in likely.get(found[2].lower(), (found[1].lower(),)):
        unit = _SUFFIXES[found[2].lower()]
        return found[1], found[2] if len(unit) == len(found[2]) and "/" not in unit else unit
    head, _, last = name.rpartition(" ")
    shortest = 2  # a letter after a blank numbers a channel rather than names a unit
    if not head and "/" in name and not is_unit(name):
        (head, _, last), shortest = name.partition("/"), 1  # T/K, as quantities are tabulated
    if head and is_unit(last) and len(last) >= shortest:
        return head.strip(), last.strip()
    if name.lower().endswith("_c") and "temp" in name.lower():
        return name[:-2], "degC"
    return name, ""


def spell_channel_unit(unit: str) -> str:
    """A channel's unit as recordings spell it.

    Parameters
    ----------
    unit
        As the log spells it; "" where it names none.

    Returns
    -------
    str
        "1" for counts and where none is known; a spelling that files do not have otherwise is kept.

    Examples
    --------
    >>> from hrg_cli.formats.unit_spellings import spell_channel_unit
    >>> spell_channel_unit("Volts"), spell_channel_unit("LSB"), spell_channel_unit("mV")
    ('V', '1', 'mV')
    """
    return {"volt": "V", "volts": "V", "": "1", "counts": "1", "lsb": "1", "adc": "1"}.get(
        unit.lower(), unit
    )


def find_time_factor(unit: str) -> float:
    """Seconds per unit of time.

    Parameters
    ----------
    unit
        Any spelling in `TIME`.

    Returns
    -------
    float
        s.

    Raises
    ------
    HrgError
        An unknown unit; the sentence lists those that are known.

    Examples
    --------
    >>> from hrg_cli.formats.unit_spellings import find_time_factor
    >>> find_time_factor("ms"), find_time_factor("hours")
    (0.001, 3600.0)
    """
    return float(_look_up(TIME, unit, "time_units"))


def find_phase_factor(unit: str) -> float:
    """Radians per unit of phase.

    Parameters
    ----------
    unit
        Any spelling in `PHASE`.

    Returns
    -------
    float
        rad.

    Raises
    ------
    HrgError
        An unknown unit; the sentence lists those that are known.

    Examples
    --------
    >>> from hrg_cli.formats.unit_spellings import find_phase_factor
    >>> round(find_phase_factor("deg"), 6), round(find_phase_factor("turns"), 6)
    (0.017453, 6.283185)
    """
    return float(_look_up(PHASE, unit, "phase_units"))


def find_rate_factor(unit: str) -> float:
    """Radians per second in a unit of angular rate.

    Parameters
    ----------
    unit
        Any spelling in `RATE`.

    Returns
    -------
    float
        rad/s.

    Raises
    ------
    HrgError
        An unknown unit; the sentence lists those that are known.

    Examples
    --------
    >>> from hrg_cli.formats.unit_spellings import find_rate_factor
    >>> round(find_rate_factor("rpm"), 6), round(find_rate_factor("°/h") * 3600, 6)
    (0.10472, 0.017453)
    """
    return float(_look_up(RATE, unit, "rate_units"))


def find_temperature_scale(unit: str) -> tuple[float, float]:
    """What turns a temperature in some unit into °C, factor·value + offset.

    Parameters
    ----------
    unit
        Any spelling in `TEMPERATURE`.

    Returns
    -------
    tuple of float
        Factor [°C per unit] and offset [°C].

    Raises
    ------
    HrgError
        An unknown unit; the sentence lists those that are known.

    Examples
    --------
    >>> from hrg_cli.formats.unit_spellings import find_temperature_scale
    >>> find_temperature_scale("K")
    (1.0, -273.15)
    """
    scale: tuple[float, float] = _look_up(TEMPERATURE, unit, "temperature_units")
    return scale


def _look_up(table: dict, unit: str, setting: str):  # type: ignore[no-untyped-def, type-arg]
    for factor, spellings in table.items():
        if _spelled(unit) in spellings:
            return factor
    raise HrgError(f"{setting} is {unit!r}, expected one of {list_units(table)}")


def list_units(table: Mapping[Any, tuple[str, ...]]) -> str:
    """A table's units, for a sentence.

    Parameters
    ----------
    table
        As in `is_of`.

    Returns
    -------
    str
        The first spelling of each, joined by commas.

    Examples
    --------
    >>> from hrg_cli.formats.unit_spellings import TEMPERATURE, list_units
    >>> list_units(TEMPERATURE)
    'degC, K, degF'
    """
    shown = {"degc": "degC", "k": "K", "degf": "degF"}
    return ", ".join(shown.get(first, first) for first, *_ in table.values())


OF_ROLE: dict[str, tuple[Mapping[Any, tuple[str, ...]], str]] = {
    "time": (TIME, "s"),
    "rate": (RATE, "rad/s"),
    "temperature": (TEMPERATURE, "degC"),
}
"""Units of a role, and the one of a column that names none."""
