"""What windows so far apart say of a frequency: with a phase, all but its aliases; without one, the
band that their rate spans about the reference."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any


def find_aliases(frequency_hz: float, spacing_s: float) -> list[float]:
    """The nearest frequencies that windows so far apart show alike."""
    return [frequency_hz - 1 / spacing_s, frequency_hz + 1 / spacing_s]


def describe_aliases(modes: Sequence[dict[str, Any]], spacing_s: float) -> str:
    """The aliases of modes in words."""
    each = "; ".join(
        f"{m['frequency_hz']:.8g} Hz for {m['aliases_hz'][0]:.8g} or {m['aliases_hz'][1]:.8g} Hz"
        for m in modes
    )
    return (
        f"windows every {spacing_s:.3g} s cannot tell {each}: shorter windows move these aliases"
        " away"
    )


def compute_band_hz(spacing_s: float) -> float:
    """Half the windows' rate, within which of its reference a demodulator passes a frequency:
    all that an amplitude says of it, and taken for its standard deviation."""
    return 1 / (2 * spacing_s)


def describe_band(frequency_hz: float, std_hz: float) -> str:
    """Why the frequency is not a measured one."""
    return (
        f"frequency_hz is not measured, for no phase was recorded: {frequency_hz:.6g} Hz is the"
        f" reference that was given, ± {std_hz:.3g} Hz (half the windows' rate); record the phase"
        " beside the amplitude"
    )
