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
    unit: unit for unit in ("k", "s", "ms", "us", "ns", "min", "hz", "v", "mv", *LEVELS[:3], "dbfs")
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
    """Whether a cell of a units row is a unit we know, bare or in brackets."""
    return _spelled(text.strip().strip("()[]")) in _KNOWN


def is_level(unit: str) -> bool:
    """Whether a unit is a logarithm of an amplitude or a power."""
    return _spelled(unit) in LEVELS


def is_time(unit: str) -> bool:
    """Whether a unit is one of time."""
    return is_of(TIME, unit)


def is_temperature(unit: str) -> bool:
    """Whether a unit is one of temperature."""
    return is_of(TEMPERATURE, unit)


def is_rate(unit: str) -> bool:
    """Whether a unit is one of angular rate."""
    return is_of(RATE, unit)


def is_of(table: Mapping[Any, tuple[str, ...]], unit: str) -> bool:
    """Whether a unit is one of a table's."""
    return any(_spelled(unit) in spellings for spellings in table.values())


def split_name(name: str) -> tuple[str, str]:
    """Column title -> (name, unit): `time (ms)`, `CH1 [V]`, `CH1 in V`, `gyrox rad/s`,
    `rate_deg_s`, `rate_deg/s`; unit empty where none is seen."""
    name = name.strip().strip('"').strip()
    found = re.match(r"^(.*?)\s*[\[(]([^\])]*)[\])]\s*$", name) or re.match(
        r"^(?:(.*?)\s)?in (\S+)$", name
    )
    if found and re.match(r"^ch\w*\s*\d$", found[2].strip(), re.IGNORECASE):
        return found[2].strip(), ""  # X(CH1): the bracket names the channel
    if found and (found[1] or is_unit(found[2])) and (name[-1] in "])" or is_unit(found[2])):
        unit = found[2].strip()
        return (found[1] or "").strip() or ("time" if is_time(unit) else ""), unit
    found = _SUFFIX.match(name)
    likely = {
        "s": ("time", "t", "elapsed", "timestamp"),
        "k": ("temp", "temperature"),
        "min": ("time", "t"),
    }
    if found and found[1].lower() in likely.get(found[2].lower(), (found[1].lower(),)):
        unit = _SUFFIXES[found[2].lower()]
        return found[1], found[2] if len(unit) == len(found[2]) and "/" not in unit else unit
    head, _, last = name.rpartition(" ")
    if not head and "/" in name and not is_unit(name):
        head, _, last = name.partition("/")
    if head and is_unit(last) and len(last) > 1:
        return head.strip(), last.strip()
    if name.lower().endswith("_c") and "temp" in name.lower():
        return name[:-2], "degC"
    return name, ""


def spell_channel_unit(unit: str) -> str:
    """A channel's unit as files spell it; "1" where none is known."""
    return {"volt": "V", "volts": "V", "": "1", "counts": "1", "lsb": "1", "adc": "1"}.get(
        unit.lower(), unit
    )


def find_time_factor(unit: str) -> float:
    """Seconds a unit of time."""
    return float(_look_up(TIME, unit, "time_units"))


def find_phase_factor(unit: str) -> float:
    """rad a unit of phase."""
    return float(_look_up(PHASE, unit, "phase_units"))


def find_rate_factor(unit: str) -> float:
    """rad/s a unit of rate."""
    return float(_look_up(RATE, unit, "rate_units"))


def find_temperature_scale(unit: str) -> tuple[float, float]:
    """Factor and offset to °C."""
    scale: tuple[float, float] = _look_up(TEMPERATURE, unit, "temperature_units")
    return scale


def _look_up(table: dict, unit: str, setting: str):  # type: ignore[no-untyped-def, type-arg]
    for factor, spellings in table.items():
        if _spelled(unit) in spellings:
            return factor
    raise HrgError(f"{setting} is {unit!r}, expected one of {list_units(table)}")


def list_units(table: Mapping[Any, tuple[str, ...]]) -> str:
    """A table's units, for a sentence."""
    shown = {"degc": "degC", "k": "K", "degf": "degF"}
    return ", ".join(shown.get(first, first) for first, *_ in table.values())


OF_ROLE: dict[str, tuple[Mapping[Any, tuple[str, ...]], str]] = {
    "time": (TIME, "s"),
    "rate": (RATE, "rad/s"),
    "temperature": (TEMPERATURE, "degC"),
}
"""Units of a role, and the one of a column that names none."""
