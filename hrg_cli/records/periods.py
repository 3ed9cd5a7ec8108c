"""The demodulated signals: what `hrg demodulate` makes of a recording."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from .columns import FLAGGED, FLAGGED_STD, POSITIVE, Array, attribute, column
from .windowed import Windowed


@dataclass(frozen=True, kw_only=True, repr=False)
class Periods(Windowed):
    """Signals per window: the least-squares coefficients of both channels at the window's centre.

    Direct read-out, 4 signals c_cos, c_sin, s_cos, s_sin: C = c_cos·cos ω_r t + c_sin·sin ω_r t, so
    C0 = c_cos − j·c_sin. Carrier read-out, 8 signals: the a (cosine) and b (sine) coefficients at
    the difference and sum frequencies in the order a_c⁻, a_c⁺, b_c⁻, b_c⁺, a_s⁻, a_s⁺, b_s⁻, b_s⁺
    (PHYSICS §3, seed B (1)).
    """

    kind: ClassVar[str] = "periods"
    made_by: ClassVar[str] = "hrg demodulate"
    signals: Array = column("any", "signal coefficients", ("row", "signal"), valid=FLAGGED)
    signals_std: Array = column(
        "any", "their standard deviations", ("row", "signal"), packed=False, valid=FLAGGED_STD
    )
    residual_rms: Array = column(
        "any", "rms of what the fit leaves, channel C and S", ("row", "channel"), valid=FLAGGED_STD
    )
    periods_per_window: float = attribute(
        "oscillation periods per window", dtype="f8", valid=POSITIVE
    )
    carrier_hz: float | None = attribute(
        "carrier frequency", default=None, dtype="f8", valid=POSITIVE
    )
    units: str = attribute("unit of the signals", default="1", name="signal_units")
    details: str = attribute(
        "JSON: what import --envelope took of the log, and the noise it found; clock_origin_s where"
        " demodulate counted times from the first sample",
        default="{}",
    )
