"""Thermometers logged in K among ones in °C, where the runs' frequencies say that all were as
warm."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..units import KELVIN_DEGC
from .suspicion import Suspicion

Array = np.ndarray
SETTLED = 1e-3
"""Relative distance from the other runs' frequencies that a difference of 273 °C would exceed."""


def average_log(temperature_degc: Array | None) -> float:
    """Mean of what a thermometer's log knows.

    Parameters
    ----------
    temperature_degc
        Its rows, (n,), NaN where none is known; None: no log.

    Returns
    -------
    float
        [°C]; NaN where nothing is known.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.kelvin_logs import average_log
    >>> average_log(np.array([20.0, np.nan, 22.0])), average_log(None)
    (21.0, nan)
    """
    log = np.asarray([] if temperature_degc is None else temperature_degc, float)
    known = log[np.isfinite(log)]
    return float(known.mean()) if len(known) else np.nan


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
    level, hz = np.asarray(temperature_degc, float), np.asarray(frequency_hz, float)
    usual = level <= KELVIN_DEGC

    out = []
    for k in np.flatnonzero(level > KELVIN_DEGC):
        evidence = f"{level[k]:.4g} is logged"
        if usual.any():
            nearest = float(np.clip(hz[k], hz[usual].min(), hz[usual].max()))
            if abs(hz[k] / nearest - 1) > SETTLED:
                continue
            evidence += (
                f", {level[usual].min():.4g} to {level[usual].max():.4g} °C in the other runs, and"
                f" it oscillates as they do ({hz[k]:.6g} and {nearest:.6g} Hz)"
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
