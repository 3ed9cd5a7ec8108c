"""Two gyros in one lot: runs that fall into two groups by their frequencies, each of which is one
gyro's and both together none's."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....fitting.causes.extended_fit import ExtendedFit
from ....records import Array, Wave
from ...one_gyro import part_by_frequency
from ...suspicion import Suspicion
from ..thresholds import AS_GOOD_WITHOUT, CLOCKS_APART, FREQUENCIES_APART, GYROS_APART
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
    groups = _part_in_groups(np.asarray(base.frequency_hz, float))
    if groups is None or not _are_alike(waves, groups):
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
        f"the runs are two gyros', or one's in two states that no log shows ({shown}): as such χ²"
        f" per degree of freedom falls from {base.chi2 / base.dof:.3g} to {chi2:.3g}; which of them"
        " is the right one these runs cannot tell"
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


def _part_in_groups(hz: Array) -> list[list[int]] | None:
    """The larger group and the smaller one of runs, in their order; None where they are no two, or
    so far apart that nothing is asked of them."""
    low, high, gap = part_by_frequency(hz)
    within = max(float(np.ptp(hz[side])) if len(side) else 0.0 for side in (low, high))
    if min(len(low), len(high)) < FEWEST or not CLOCKS_APART <= gap < FREQUENCIES_APART:
        return None
    if gap * hz[low].max() < GYROS_APART * within:
        return None
    groups = [sorted(side.tolist()) for side in (low, high)]
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
