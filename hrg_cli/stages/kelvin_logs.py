"""Thermometers logged in K among ones in °C, where the runs' frequencies say that all were as warm."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .suspicion import Suspicion

Array = np.ndarray
KELVIN_DEGC = 150.0
"""Temperature that no gyro has in °C and every gyro has in K."""
SETTLED = 1e-3
"""Relative distance of two frequencies that a difference of 273 °C would exceed."""


def find_kelvin_logs(
    run_ids: Sequence[str], temperature_degc: Array, frequency_hz: Array
) -> list[Suspicion]:
    """Runs whose thermometer was logged in K.

    Parameters
    ----------
    run_ids
        Of the runs.
    temperature_degc
        Mean of each run's log, (R,); NaN: none.
    frequency_hz
        Of each run, (R,).

    Returns
    -------
    list of Suspicion
        One of each such run.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.kelvin_logs import find_kelvin_logs
    >>> logged, hz = np.array([20.0, 295.0, 40.0]), np.array([5000.0, 5000.1, 5000.9])
    >>> [one.run_id for one in find_kelvin_logs(["a", "b", "c"], logged, hz)]
    ['b']
    """
    level = np.asarray(temperature_degc, float)
    usual = level <= KELVIN_DEGC
    hz = float(np.median(frequency_hz[usual])) if usual.any() else np.nan

    out = []
    for k in np.flatnonzero(level > KELVIN_DEGC):
        evidence = f"{level[k]:.4g} is logged"
        if usual.any():
            if abs(frequency_hz[k] / hz - 1) > SETTLED:
                continue
            evidence += (
                f", {level[usual].min():.4g} to {level[usual].max():.4g} °C in the other runs, and it"
                f" oscillates as they do ({frequency_hz[k]:.6g} and {hz:.6g} Hz)"
            )
        out.append(
            Suspicion(
                run_ids[int(k)],
                "thermometer in K",
                evidence,
                "import this run's temperature with its unit, K",
            )
        )
    return out
