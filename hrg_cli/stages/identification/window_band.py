"""What windows so far apart say of a frequency: with a phase, all but its aliases; without one, the
band that their rate spans about the reference."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any


def find_aliases(frequency_hz: float, spacing_s: float) -> list[float]:
    """The nearest frequencies that windows show alike.

    Parameters
    ----------
    frequency_hz
        As they show it.
    spacing_s
        Between two windows.

    Returns
    -------
    list of float
        f − 1/T, where that is a frequency, and f + 1/T [Hz].

    Examples
    --------
    >>> from hrg_cli.stages.identification.window_band import find_aliases
    >>> find_aliases(5000.0, 0.5)
    [4998.0, 5002.0]
    """
    beside = (frequency_hz - 1 / spacing_s, frequency_hz + 1 / spacing_s)
    return [alias for alias in beside if alias > 0]


def describe_aliases(modes: Sequence[dict[str, Any]], spacing_s: float) -> str:
    """The aliases of modes, in words.

    Parameters
    ----------
    modes
        With their aliases.
    spacing_s
        Between two windows.

    Returns
    -------
    str
        With what to do.

    Examples
    --------
    >>> from hrg_cli.stages.identification.window_band import describe_aliases
    >>> describe_aliases([{"frequency_hz": 5000.0, "aliases_hz": [4998.0, 5002.0]}], 0.5)[:60]
    'windows every 0.5 s cannot tell 5000 Hz for 4998 or 5002 Hz:'
    """
    each = "; ".join(
        f"{m['frequency_hz']:.8g} Hz for {' or '.join(f'{a:.8g}' for a in m['aliases_hz'])} Hz"
        for m in modes
    )
    return (
        f"windows every {spacing_s:.3g} s cannot tell {each}: shorter windows move these aliases"
        " away"
    )


def compute_band_hz(spacing_s: float) -> float:
    """The band within which a demodulator passes a frequency: half its windows' rate.

    It is all that an amplitude says of the frequency, and taken for its standard deviation.

    Parameters
    ----------
    spacing_s
        Between two windows.

    Returns
    -------
    float
        1/(2T) [Hz], on either side of the reference.

    Examples
    --------
    >>> from hrg_cli.stages.identification.window_band import compute_band_hz
    >>> compute_band_hz(0.5)
    1.0
    """
    return 1 / (2 * spacing_s)


def describe_band(frequency_hz: float, std_hz: float) -> str:
    """Why a frequency is not a measured one.

    Parameters
    ----------
    frequency_hz
        The reference.
    std_hz
        Half the windows' rate.

    Returns
    -------
    str
        With what to do.

    Examples
    --------
    >>> from hrg_cli.stages.identification.window_band import describe_band
    >>> describe_band(5000.0, 1.0).split(";")[1]
    ' record the phase beside the amplitude'
    """
    return (
        f"frequency_hz is not measured, for no phase was recorded: {frequency_hz:.6g} Hz is the"
        f" reference that was given, ± {std_hz:.3g} Hz (half the windows' rate); record the phase"
        " beside the amplitude"
    )
