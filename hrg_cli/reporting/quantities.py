"""Numbers for people: rounded by their standard deviation, in the units of the trade (°/h, ppm, °,
mHz).

The concise notation of the GUM (7.2.2): 1003.7000003(10) Hz is 1003.700 000 3 Hz with a standard
deviation of 0.000 001 0 Hz. The number of digits of σ follows the Particle Data Group: two where
its leading digits are 10 … 35, else one; 95 … 99 count as 100.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from typing import Any

from ..units import DEGREE, DEGREE_PER_HOUR
from .text import clean_text, format_number, format_power_of_ten

TWO_DIGITS = 354
"""Three leading digits of σ up to which two of them are kept; beyond, one, which for 950 and more
rounds to 10."""


def round_with_std(value: Any, std: Any) -> str:
    """A value with its standard deviation in brackets, in units of the last digit shown.

    Parameters
    ----------
    value
        Finite; anything else is a dash.
    std
        σ in the same unit; None, or no positive number: not known.

    Returns
    -------
    str
        In the GUM's concise notation (JCGM 100:2008, 7.2.2); without a σ in six digits.

    Examples
    --------
    >>> from hrg_cli.reporting.quantities import round_with_std
    >>> (
    ...     round_with_std(1003.70000031, 1.04e-6),
    ...     round_with_std(2.5e-9, 4e-10),
    ...     round_with_std(0.5, None),
    ... )
    ('1003.7000003(10)', '2.5(4)×10⁻⁹', '0.5')
    """
    if not isinstance(value, int | float) or not math.isfinite(value):
        return "–"
    known = isinstance(std, int | float) and math.isfinite(std) and std >= sys.float_info.min
    if not known:
        return format_number(float(value), 6)
    last = _last_digit(std)
    biggest = max(abs(value), std)
    power = math.floor(math.log10(biggest))
    if -5 < power < 7 and last <= 1:
        return _concise(value, std, last).replace("-", "−")
    scaled = _concise(value / 10.0**power, std / 10.0**power, last - power)
    return f"{scaled}×{format_power_of_ten(power)}".replace("-", "−")


def _last_digit(std: float) -> int:
    """Power of ten of the last digit that is shown."""
    power = math.floor(math.log10(std))
    leading = round(std / 10.0**power * 100)
    return power - 1 if leading <= TWO_DIGITS else power


def _concise(value: float, std: float, last: int) -> str:
    bracket = round(std / 10.0**last)
    if last >= 0:
        return f"{round(value / 10**last) * 10**last:.0f}({bracket * 10**last})"
    return f"{value:.{-last}f}({bracket})"


def format_quantity(name: str, value: Any, std: Any, units: str) -> str:
    """A value as people say it: unit and power by what it is and how large it is, rounded by its σ.

    Parameters
    ----------
    name
        As in the JSON, such as "damping_split_1_s"; of a path the last part counts.
    value
        Finite; anything else is a dash.
    std
        σ in the same unit; None: not known.
    units
        Of the value, as files spell them.

    Returns
    -------
    str
        Number and unit.

    Examples
    --------
    >>> from hrg_cli.reporting.quantities import format_quantity
    >>> format_quantity("drift_rad_s", 4.848e-8, 5e-9, "rad s-1")
    '0.0100(10) °/h'
    """
    if not isinstance(value, int | float) or not math.isfinite(value):
        return "–"
    factor, unit = choose_unit(name, float(value), units)
    shown = round_with_std(value * factor, None if std is None else std * abs(factor))
    return f"{shown} {unit}".strip()


def format_rounded(name: str, value: float, units: str, digits: int) -> str:
    """A value of which no σ is known, in the unit that its size asks for.

    Parameters
    ----------
    name
        As in the JSON, such as "damping_split_1_s"; of a path the last part counts.
    value
        Finite.
    units
        Of the value, as files spell them.
    digits
        Significant ones.

    Returns
    -------
    str
        Number and unit.

    Examples
    --------
    >>> from hrg_cli.reporting.quantities import format_rounded
    >>> format_rounded("drift_rad_s", 4.8e-8, "rad s-1", 2)
    '0.0099 °/h'
    """
    factor, unit = choose_unit(name, value, units)
    return f"{format_number(value * factor, digits)} {unit}".strip()


def choose_unit(name: str, value: float, units: str) -> tuple[float, str]:
    """The unit in which people say a quantity of this name, size and unit.

    Parameters
    ----------
    name
        As in the JSON, such as "damping_split_1_s"; of a path the last part counts.
    value
        Its size, in `units`.
    units
        Of the value, as files spell them.

    Returns
    -------
    tuple
        Factor to that unit, and how it is printed.

    Examples
    --------
    >>> from hrg_cli.reporting.quantities import choose_unit
    >>> choose_unit("gain", 2e-4, "1"), choose_unit("scale_factor", 0.55, "1")
    ((1000000.0, 'ppm'), (1.0, ''))
    """
    size = abs(value)
    name = next((n for n in reversed(name.split(".")) if n not in ("value", "std")), name)
    if name.startswith("frequency_split_") and name.endswith("_rad_s"):
        return (1e3 / math.pi, "mHz") if size <= math.pi else (1 / math.pi, "Hz")
    if name.startswith("damping_split_") and name.endswith(
        "_1_s"
    ):  # as the drift it makes, where the limits are written in °/h
        return 1 / DEGREE_PER_HOUR, "°/h"
    if name == "pull_rad_s":
        return 1e3 / (2 * math.pi), "mHz"
    choose: Callable[[float], tuple[float, str]] | None = _BY_UNIT.get(units)
    if units == "1" and name.startswith(("scale_factor", "power", "order")):
        return 1.0, ""
    if units == "rad" and name.endswith("axis_rad"):
        return 1 / DEGREE, "°"
    return choose(size) if choose is not None else (1.0, format_unit(units))


def _plain_number(size: float) -> tuple[float, str]:
    return (1e6, "ppm") if size < 1e-3 else (1e2, "%") if size < 1 else (1.0, "")


def _angle(size: float) -> tuple[float, str]:
    return (1e6, "µrad") if size < 1e-3 else (1e3, "mrad") if size < 0.02 else (1 / DEGREE, "°")


def _rate(size: float) -> tuple[float, str]:
    return (1 / DEGREE_PER_HOUR, "°/h") if size < 10 * DEGREE else (1 / DEGREE, "°/s")


def _time(size: float) -> tuple[float, str]:
    return (1e6, "µs") if size < 1e-3 else (1e3, "ms") if size < 0.1 else (1.0, "s")


_BY_UNIT: dict[str, Callable[[float], tuple[float, str]]] = {
    "1": _plain_number,
    "rad": _angle,
    "rad s-1": _rate,
    "s": _time,
    "": lambda size: (1.0, ""),
    "deg/h": lambda size: (1.0, "°/h"),
    "deg": lambda size: (1.0, "°"),
    "rad s-1/2": lambda size: (60 / DEGREE, "°/√h"),
    "rad s-3/2": lambda size: (60 / DEGREE_PER_HOUR, "°/h/√h"),
    "degC": lambda size: (1.0, "°C"),
    "K-1": lambda size: (1e6, "ppm/K") if size < 1e-2 else (1e2, "%/K"),
    "amplitude": lambda size: (1e6, "ppm of the unit amplitude"),
    "Hz": lambda size: (
        (1.0, "Hz") if size >= 0.1 or size == 0 else (1e3, "mHz") if size >= 1e-5 else (1e6, "µHz")
    ),
}


def format_unit(units: str) -> str:
    """A unit as it is printed.

    Parameters
    ----------
    units
        As files spell it: base units with their powers.

    Returns
    -------
    str
        With a stroke and raised powers; "" of a plain number.

    Examples
    --------
    >>> from hrg_cli.reporting.quantities import format_unit
    >>> format_unit("rad s-1 K-1"), format_unit("m s-2"), format_unit("1")
    ('rad/(s·K)', 'm/s²', '')
    """
    above, below = [], []
    for part in units.split():
        base = part.rstrip("-0123456789")
        power = part[len(base) :]
        if power.startswith("-"):
            below.append(base if power == "-1" else f"{base}{_raised(power[1:])}")
        else:
            above.append(base if not power else f"{base}{_raised(power)}")
    top = "·".join(above) or "1"
    if not below:
        return "" if units == "1" else top
    return f"{top}/{below[0]}" if len(below) == 1 else f"{top}/({'·'.join(below)})"


def _raised(digits: str) -> str:
    return digits.translate(str.maketrans("0123456789", "⁰¹²³⁴⁵⁶⁷⁸⁹"))


LABELS = {
    "frequency_hz": "frequency f",
    "damping_rate_1_s": "decay time τ",
    "damping_split_1_s": "damping split ν·δμ",
    "damping_axis_rad": "damping axis θ_μ",
    "frequency_split_rad_s": "frequency split Δf",
    "stiffness_axis_rad": "stiffness axis θ_ω",
    "scale_factor": "scale factor K",
}
"""The resonator's parameters in words."""


RATE_OF_DECAY = "damping rate ν"
DECAYS = 3.0
"""Standard deviations of the damping from which it is told as a decay time: below, the inverse of
what may be none says nothing."""


def label_of(name: str, value: float, std: float) -> str:
    """A parameter in words, as `format_parameter` tells its value.

    Parameters
    ----------
    name
        Of a resonator's parameter; another one stays as it is.
    value, std
        In its unit.

    Returns
    -------
    str
        A damping that may be none is told as a rate, others as a decay time.

    Examples
    --------
    >>> from hrg_cli.reporting.quantities import label_of
    >>> label_of("damping_rate_1_s", 0.1, 0.001), label_of("damping_rate_1_s", 0.1, 0.1)
    ('decay time τ', 'damping rate ν')
    """
    if name == "damping_rate_1_s" and not value > DECAYS * std:
        return RATE_OF_DECAY
    return LABELS.get(name, clean_text(name))


def format_parameter(name: str, value: float, std: float, units: str) -> str:
    """A resonator's parameter for people.

    Parameters
    ----------
    name
        As in the resonator.
    value, std
        In its unit.
    units
        As files spell it.

    Returns
    -------
    str
        The damping as decay time [s], the damping split as the drift it makes [°/h].

    Examples
    --------
    >>> from hrg_cli.reporting.quantities import format_parameter
    >>> format_parameter("damping_rate_1_s", 0.1, 0.001, "s-1")
    '10.00(10) s'
    >>> format_parameter("damping_split_1_s", 4.848e-7, 5e-9, "s-1")
    '0.1000(10) °/h of drift'
    """
    if name == "damping_rate_1_s" and value > DECAYS * std:
        return f"{round_with_std(1 / value, std / value / value)} s"
    if name == "damping_split_1_s":
        return f"{round_with_std(value / DEGREE_PER_HOUR, std / DEGREE_PER_HOUR)} °/h of drift"
    if name == "frequency_hz":
        return f"{round_with_std(value, std)} Hz"
    return format_quantity(name, value, std, units)
