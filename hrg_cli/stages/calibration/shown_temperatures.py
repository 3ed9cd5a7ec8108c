"""Runs that oscillate at another frequency than others logged at the same temperature: the
resonator itself is a thermometer, so a log that stood still shows, or another gyro's run.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...fitting.tables.increments import AnglePath

Array = np.ndarray
SAME_DEGC = 1.5
"""Mean temperatures that are the same dwell's, °C, and the least part of all runs' range that
is."""
SAME_PART = 0.04
LEAST_DEGC = 5.0
"""Temperature by whose frequency two runs of a dwell must differ: a thermometer beside the
resonator is less wrong."""
LEAST_PART = 3e-4
"""The same as a part of the frequency, where no other temperature tells its slope."""
OF_SCATTER = 10.0
"""Times the usual step between neighbouring frequencies of a dwell that they must differ by."""


@dataclass(frozen=True)
class ShownTemperature:
    """A run's logged temperature [°C], that which the others have at its frequency (None: they tell
    no slope), its frequency and theirs where they are as warm [Hz]."""

    logged_degc: float
    shown_degc: float | None
    frequency_hz: float
    others_hz: float

    @property
    def evidence(self) -> str:
        """The figures in words."""
        at = "" if self.shown_degc is None else f", theirs at {self.shown_degc:.4g} °C"
        return (
            f"it is logged at {self.logged_degc:.4g} °C, where the others oscillate at"
            f" {self.others_hz:.6g} Hz, and oscillates at {self.frequency_hz:.6g} Hz{at}"
        )


def find_wrong_temperatures(paths: Sequence[AnglePath]) -> dict[int, ShownTemperature]:
    """Runs whose frequency contradicts that of others at the same logged temperature.

    Of two groups in a dwell, that which is farther from the line through all runs' frequencies is
    wrong; with one dwell alone, the smaller.

    Parameters
    ----------
    paths
        The runs.

    Returns
    -------
    dict
        By their places; empty where none stands out, or no side is the likelier.

    Examples
    --------
    Of four runs logged at 20 °C one oscillates as at 40 °C:

    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.stages.calibration.shown_temperatures import find_wrong_temperatures
    >>> def dwell(logged, true):
    ...     return draw_path(blocks=9, temperature_degc=logged, frequency_hz=1e3 + 0.09 * true)
    >>> runs = [(0, 0), (0, 0), (20, 20), (20, 20), (20, 20), (20, 40), (60, 60), (60, 60)]
    >>> found = find_wrong_temperatures([dwell(*run) for run in runs])
    >>> list(found), round(found[5].shown_degc, 6)
    ([5], 40.0)
    """
    degc, hz = (
        np.array([float(np.mean(getattr(path, name))) for path in paths])
        for name in ("temperature_degc", "frequency_hz")
    )
    if not (np.isfinite(degc).all() and np.isfinite(hz).all()):
        return {}
    dwells = list_dwells(degc)
    line = _fit_line(degc, hz)
    wrong = [run for dwell in dwells for run in _find_wrong_in(dwell, degc, hz, line, dwells)]
    right = np.setdiff1d(np.arange(len(paths)), wrong)
    if not wrong or 2 * len(wrong) >= len(paths):
        return {}
    line = _fit_line(degc[right], hz[right])
    return {run: _describe(run, degc, hz, right, line) for run in wrong}


def list_dwells(degc: Array) -> list[Array]:
    """Places of the runs that are logged at one temperature, dwell by dwell.

    Parameters
    ----------
    degc
        Mean temperatures of the runs (R,) [°C].

    Returns
    -------
    list of ndarray
        From the coldest on.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.calibration.shown_temperatures import list_dwells
    >>> [places.tolist() for places in list_dwells(np.array([20.1, -20.0, 19.9]))]
    [[1], [2, 0]]
    """
    order = np.argsort(degc, kind="stable")
    gap = max(SAME_DEGC, SAME_PART * float(np.ptp(degc)))
    return np.split(order, np.flatnonzero(np.diff(degc[order]) > gap) + 1)


def _fit_line(degc: Array, hz: Array) -> tuple[float, float] | None:
    """Slope [Hz/°C] and value at 0 °C of the line through most runs (Theil and Sen); None where
    they are as warm."""
    above, below = np.triu_indices(len(degc), 1)
    apart = degc[above] - degc[below]
    far = np.abs(apart) > max(SAME_DEGC, SAME_PART * float(np.ptp(degc)))
    if not far.any():
        return None
    slope = float(np.median((hz[above] - hz[below])[far] / apart[far]))
    return slope, float(np.median(hz - slope * degc))


def _find_wrong_in(
    dwell: Array, degc: Array, hz: Array, line: tuple[float, float] | None, dwells: list[Array]
) -> list[int]:
    """The runs of a dwell that are on the wrong side of a gap between its frequencies."""
    order = dwell[np.argsort(hz[dwell], kind="stable")]
    gaps = np.diff(hz[order])
    if not len(gaps):
        return []
    steps = np.concatenate([np.diff(np.sort(hz[dwell])) for dwell in dwells])
    scatter, usual = float(np.median(steps)), float(np.median(hz))
    least = max(
        LEAST_DEGC * abs(line[0]) if line else LEAST_PART * usual,
        OF_SCATTER * scatter,
        1e-5 * usual,
    )
    groups = np.split(order, np.flatnonzero(gaps > least) + 1)
    if len(groups) == 1:
        return []
    if line is None:
        by_size = sorted(groups, key=len)
        kept = by_size[-1] if len(by_size[-1]) > len(by_size[-2]) else None
    else:
        kept = min(groups, key=lambda g: abs(np.mean(hz[g] - line[0] * degc[g]) - line[1]))
    return [] if kept is None else [int(run) for run in np.setdiff1d(dwell, kept)]


def _describe(
    run: int, degc: Array, hz: Array, right: Array, line: tuple[float, float] | None
) -> ShownTemperature:
    """What a wrong run's frequency says beside those of the right ones."""
    same = right[np.abs(degc[right] - degc[run]) <= max(SAME_DEGC, SAME_PART * np.ptp(degc))]
    others = float(np.median(hz[same]))
    shown = None if line is None else float(degc[run] + (hz[run] - others) / line[0])
    return ShownTemperature(float(degc[run]), shown, float(hz[run]), others)
