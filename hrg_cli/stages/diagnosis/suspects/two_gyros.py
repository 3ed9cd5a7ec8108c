"""Two gyros in one lot: runs that fall into two groups by their frequencies, each of which is one
gyro's and both together none's."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....fitting.causes.extended_fit import ExtendedFit
from ....records import Array, Wave
from ...one_gyro import find_two_gyros
from ...suspicion import Suspicion
from ..thresholds import AS_GOOD_WITHOUT, CLOCKS_APART, GYROS_APART
from .cases import Fitted, SuspectFound, describe_gyro, fit_or_none

FEWEST = 2
"""Runs of each group: a single one of another gyro's is found as the run that it is."""
NUMBERS = 6
"""Coordinates of a resonator that a second gyro has of its own."""


def find_second_gyro(
    waves: Sequence[Wave], fitted: Fitted, base: ExtendedFit
) -> SuspectFound | None:
    """The runs of the second of two gyros, where each group of runs by itself is one gyro's.

    Runs at two temperatures or amplitudes fall apart in the same way: they are not blamed.

    Parameters
    ----------
    waves
        As given, one a run.
    fitted
        The base model's fit to waves.
    base
        That of these waves.

    Returns
    -------
    SuspectFound or None
        The smaller group's runs; of two as large the later ones'.

    Examples
    --------
    Runs of one gyro are no two groups:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves, fit_waves
    >>> from hrg_cli.stages.diagnosis.suspects.two_gyros import find_second_gyro
    >>> waves = draw_waves()
    >>> find_second_gyro(waves, fit_waves, fit_waves(waves)) is None
    True
    """
    groups = _part_by_frequency(np.asarray(base.frequency_hz, float))
    if groups is None or not _are_alike(waves, groups):
        return None
    if find_two_gyros(base.series.names, base.frequency_hz):  # so far apart that nothing is asked
        return None
    fits = [fit_or_none([waves[k] for k in group], fitted) for group in groups]
    if any(fit is None or fit.chi2 > AS_GOOD_WITHOUT * fit.dof for fit in fits):
        return None
    first, second = (fit for fit in fits if fit is not None)
    chi2 = (first.chi2 + second.chi2) / (first.dof + second.dof)
    shown = "; ".join(
        f"{', '.join(waves[k].run_id for k in group)}: {describe_gyro(fit)}"
        for group, fit in zip(groups, (first, second), strict=True)
    )
    evidence = (
        f"the runs are two gyros' ({shown}): as such χ² per degree of freedom falls from"
        f" {base.chi2 / base.dof:.3g} to {chi2:.3g}; which of them is the right one these runs"
        " cannot tell"
    )
    told = tuple(
        Suspicion(
            waves[k].run_id,
            "another gyro",
            evidence,
            "diagnose the two groups apart; look whose they are",
        )
        for k in groups[1]
    )
    return SuspectFound(told, NUMBERS, base, first, chi2)


def _part_by_frequency(hz: Array) -> list[list[int]] | None:
    """The larger group and the smaller one of runs, in their order; None where they are no two."""
    order = np.argsort(hz)
    steps = np.diff(hz[order])
    if len(hz) < 2 * FEWEST:
        return None
    cut = int(np.argmax(steps)) + 1
    groups = [sorted(order[:cut].tolist()), sorted(order[cut:].tolist())]
    within = max(float(np.ptp(hz[group])) for group in groups)
    gap = float(steps[cut - 1])
    if min(map(len, groups)) < FEWEST or gap < max(GYROS_APART * within, CLOCKS_APART * hz.mean()):
        return None
    return sorted(groups, key=lambda group: (-len(group), group))


def _are_alike(waves: Sequence[Wave], groups: Sequence[Sequence[int]]) -> bool:
    """Whether the groups' runs share a mode, temperatures and amplitudes: by what they do not
    share, physics may part their frequencies as well."""
    one, other = ([waves[k] for k in group] for group in groups)
    if not {w.mode for w in one} & {w.mode for w in other}:
        return False
    return all(
        _overlap([read(w) for w in one], [read(w) for w in other])
        for read in (_read_temperature, _read_amplitude)
    )


def _read_temperature(wave: Wave) -> Array:
    return np.asarray([] if wave.temperature_degc is None else wave.temperature_degc, float)


def _read_amplitude(wave: Wave) -> Array:
    return np.asarray(wave.main_amplitude, float)[wave.good()]


def _overlap(one: Sequence[Array], other: Sequence[Array]) -> bool:
    """Whether the ranges of a quantity in two groups of runs overlap; not where a run has none."""
    if not all(np.isfinite(values).any() for values in (*one, *other)):
        return False
    (low, high), (other_low, other_high) = (
        (min(map(np.nanmin, group)), max(map(np.nanmax, group))) for group in (one, other)
    )
    return bool(low <= other_high and other_low <= high)
