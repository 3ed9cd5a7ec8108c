"""The oscillation of a run between its windows: the envelope's spline, turned by the reference
frequency.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...errors import HrgError
from ...fitting.envelopes.envelope_runs import compute_envelopes
from ...records import Wave

Array = np.ndarray
FEWEST = 8
"""Windows without which there is no envelope."""


@dataclass(frozen=True)
class Oscillation:
    """The envelopes u(t) of a run against its reference frequency, smooth between the windows."""

    spline: Callable[[Array], Array]
    omega_r: float

    def interpolate(self, t: Array) -> Array:
        """Analytic signal u e^{jω_r t} (n, 2)."""
        return self.spline(t) * np.exp(1j * self.omega_r * t)[:, None]


def interpolate_oscillation(wave: Wave) -> Oscillation:
    """The oscillation of a run through its finite windows, by a cubic spline of its envelopes.

    Parameters
    ----------
    wave
        The run.

    Returns
    -------
    Oscillation
        Smooth between the windows.

    Raises
    ------
    HrgError
        Fewer than `FEWEST` windows show it.

    Examples
    --------
    >>> from hrg_cli.stages.injection.oscillation import interpolate_oscillation
    >>> from hrg_cli.stages.rehearsing.drawn_input import draw_input
    >>> wave = draw_input().wave
    >>> u = interpolate_oscillation(wave).spline(wave.time_s)
    >>> u.shape, bool(abs(u[0, 0].real - wave.main_amplitude[0]) < 0.01)
    ((50, 2), True)
    """
    from scipy.interpolate import CubicSpline

    u = compute_envelopes(wave)
    good = np.isfinite(u).all(axis=-1)
    if np.count_nonzero(good) < FEWEST:
        found = f"{np.count_nonzero(good)} windows show the oscillation"
        raise HrgError(
            f"run {wave.run_id or '?'}: {found}, at least {FEWEST} are needed; give a longer record"
        )
    return Oscillation(
        CubicSpline(wave.time_s[good], u[good]), 2 * np.pi * wave.reference_frequency_hz
    )
