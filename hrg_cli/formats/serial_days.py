"""Times of a column that names no unit which cannot be the seconds it is read in: days, as
spreadsheets count them."""

from __future__ import annotations

FIRST_DAY, LAST_DAY = 20_000.0, 80_000.0
"""Between these lie spreadsheets' days of recordings: October 1954 to January 2119."""
FASTEST_HZ = 50e6
"""Rate beyond which nobody samples an oscillation of some kHz; a rate of 600 Hz in days is."""
WAY_OUT = 'give time_units ("d" for days), or name the unit in the title'


def are_days(time: float) -> bool:
    """Whether a number may be a spreadsheet's day.

    Parameters
    ----------
    time
        The first one of a time column.

    Returns
    -------
    bool
        Seconds of a day may be such numbers too: the steps between them decide.

    Examples
    --------
    >>> from hrg_cli.formats.serial_days import are_days
    >>> are_days(46355.5), are_days(12.5)
    (True, False)
    """
    return FIRST_DAY <= time < LAST_DAY


def describe_days(first: float, why: str) -> str:
    """Why times without a unit are not taken for seconds.

    Parameters
    ----------
    first
        The first one.
    why
        What is wrong with them as seconds.

    Returns
    -------
    str
        The end of a sentence, with what to do.

    Examples
    --------
    >>> from hrg_cli.formats.serial_days import describe_days
    >>> describe_days(46355.5, "two of them are one")
    'its times name no unit and begin at 46355.5 as the days of a spreadsheet do (as seconds two ...
    """
    return (
        f"its times name no unit and begin at {first:.8g} as the days of a spreadsheet do (as"
        f" seconds {why}); {WAY_OUT}"
    )


def doubt_seconds(rate_hz: float) -> list[str]:
    """Whether times without a unit make a rate at which nobody samples.

    Parameters
    ----------
    rate_hz
        Of the rows, the times taken for seconds.

    Returns
    -------
    list of str
        One sentence, or none.

    Examples
    --------
    >>> from hrg_cli.formats.serial_days import doubt_seconds
    >>> [len(doubt_seconds(rate)) for rate in (1e4, 1.7e8)]
    [0, 1]
    """
    if rate_hz <= FASTEST_HZ:
        return []
    return [
        f"its times name no unit; taken for seconds the samples come at {rate_hz:.4g} Hz: {WAY_OUT}"
    ]
