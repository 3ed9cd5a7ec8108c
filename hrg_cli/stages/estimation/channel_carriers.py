"""The carrier's phases of the two channels: what S's is ahead of C's in a whole run.

One ψ for both is one of the three redundancies of seed B's equations, arg z_c⁺z_c⁻* = arg z_s⁺z_s⁻*
(PHYSICS §3). Cables of other lengths break it: each channel's envelope is then short by ψ's error
squared over two, by an error that moves with the wave angle, since the larger channel has ψ its
way. Of 10 mrad that is 1e-5 of the signals with 4θ, which a converter or a cubic seems to make.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...physics.signals import find_sidebands, from_sidebands
from ...records import Array, Periods
from .solution import find_finite
from .wave_block import DIRTY

SURE = 5.0
"""Standard deviations from which a difference of the phases is one: two in a million by chance."""


@dataclass(frozen=True)
class PhaseDifference:
    """ψ of S less ψ of C [rad] with its standard deviation."""

    value: float
    std: float

    @property
    def stands_out(self) -> bool:
        """Whether it is more than noise."""
        return abs(self.value) > SURE * self.std


def measure_phase_difference(periods: Periods, rows: int) -> PhaseDifference | None:
    """The carrier's phase of S less that of C over a run, from its clean windows.

    ψ of a channel is ½ arg z⁺z⁻*, its variance σ²/2|u|², and the windows are weighed by 1/(1/|u_c|²
    + 1/|u_s|²), with z⁺z⁻* ≈ |u|²e^{2jψ}.

    Parameters
    ----------
    periods
        Eight signals a window (n, 8), it may be open on disk.
    rows
        Windows read at once.

    Returns
    -------
    PhaseDifference or None
        None where no window tells.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.physics.signals import make_signals
    >>> from hrg_cli.stages.estimation.channel_carriers import align_channels
    >>> from hrg_cli.stages.estimation.channel_carriers import measure_phase_difference
    >>> ahead = align_channels(make_signals(np.array([[1.0, 0.1, 0.7, 0.2, 0.4]])), -0.01)
    >>> run = Told(signals=ahead, signals_std=np.full((1, 8), 1e-4), flags=np.zeros(1, "u1"))
    >>> found = measure_phase_difference(Told(blocks=lambda rows: [run]), 1)
    >>> round(found.value, 6), bool(found.stands_out)
    (0.01, True)
    """
    total, weight = 0j, 0.0
    for block in periods.blocks(rows):
        signals, std = np.asarray(block.signals, float), np.asarray(block.signals_std, float)
        good = find_finite(signals) & ((np.asarray(block.flags) & DIRTY) == 0)
        if not good.all():
            signals, std = signals[good], std[good]
        lower, upper = find_sidebands(signals)
        in_c, in_s = (upper * np.conj(lower)).T
        size_c, size_s = np.abs(in_c), np.abs(in_s)
        # a window's weight over |u_c|²|u_s|², which its turn has as a factor
        spread = (size_c + size_s) * np.einsum("nk,nk->n", std, std) / std.shape[1]
        share = np.divide(2.0, spread, out=np.zeros_like(spread), where=spread > 0)
        total += complex(share @ (in_s * np.conj(in_c)))
        weight += float(share @ (size_c * size_s))
    if weight == 0.0:
        return None
    return PhaseDifference(float(np.angle(total)) / 2, 1 / np.sqrt(weight))


def align_channels(signals: Array, ahead_rad: float) -> Array:
    """Signals as if S had the carrier's phase that C has.

    Parameters
    ----------
    signals
        (n, 8).
    ahead_rad
        ψ of S less that of C.

    Returns
    -------
    ndarray
        (n, 8).

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.physics.signals import make_signals
    >>> from hrg_cli.stages.estimation.channel_carriers import align_channels
    >>> z = make_signals(np.array([[1.0, 0.1, 0.7, 0.2, 0.4]]))
    >>> bool(np.allclose(align_channels(align_channels(z, 0.3), -0.3), z))
    True
    """
    lower, upper = find_sidebands(signals)
    back = np.array([1.0, np.exp(-1j * ahead_rad)])
    return from_sidebands(lower * np.conj(back), upper * back)
