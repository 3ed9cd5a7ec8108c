"""The checks that come before any fit of several runs: they are of one gyro, by what their files
say and by their frequencies, and each was recorded once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import EACH_RUN_ONCE, HrgError, name_some
from ..records import Array, Resonator, Wave
from .diagnosis.thresholds import FREQUENCIES_APART

MOST_GYROS = 3
"""Gyros that a message names."""
FIRST_ROWS = 4096
"""Rows by which a run is told from others."""


def need_same_gyro(waves: Sequence[Wave], command: str, resonator: Resonator | None = None) -> None:
    """Refuse runs of which the files name more than one gyro.

    Parameters
    ----------
    waves
        The runs; one that names no gyro goes with any.
    command
        What is asked for, for the message.
    resonator
        Given beside them, which names its gyro too.

    Raises
    ------
    HrgError
        Two gyros are named; the sentence tells the runs of each.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from hrg_cli.errors import HrgError
    >>> from hrg_cli.stages.one_gyro import need_same_gyro
    >>> runs = [SimpleNamespace(gyro_id=gyro, run_id=run) for gyro, run in (("A", "1"), ("B", "2"))]
    >>> need_same_gyro(runs[:1], "identify")
    >>> try:
    ...     need_same_gyro(runs, "identify")
    ... except HrgError as error:
    ...     print(error)
    runs of 2 gyros were given (A: 1; B: 2), one was expected; identify each gyro by itself, ...
    """
    runs: dict[str, list[str]] = {}
    for wave in waves:
        if wave.gyro_id:
            runs.setdefault(wave.gyro_id, []).append(wave.run_id or "a run")
    if resonator is not None and resonator.gyro_id:
        runs.setdefault(resonator.gyro_id, []).append("the resonator")
    if len(runs) > 1:
        said = "; ".join(
            f"{gyro}: {name_some(names, 20)}" for gyro, names in sorted(runs.items())[:MOST_GYROS]
        )
        raise HrgError(
            f"runs of {len(runs)} gyros were given ({said}), one was expected; {command} each gyro"
            " by itself, or correct gyro_id of the recordings"
        )


def need_each_once(waves: Sequence[Wave]) -> None:
    """Refuse runs of which one is a copy of another: its rows would count twice.

    Files are told apart by their sources; records in memory have none, and are by the first
    `FIRST_ROWS` of their rows, noise and all.

    Parameters
    ----------
    waves
        The runs.

    Raises
    ------
    HrgError
        Two of them hold the same rows.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> import numpy as np
    >>> from hrg_cli.errors import HrgError
    >>> from hrg_cli.stages.one_gyro import need_each_once
    >>> names = ("main_amplitude", "quadrature_amplitude", "wave_angle_rad", "phase_rad")
    >>> rows = dict(zip(names, np.random.default_rng(1).normal(size=(4, 9))))
    >>> told = dict(
    ...     mode_number=2, reference_frequency_hz=5e3, provenance=SimpleNamespace(sources=())
    ... )
    >>> one, other = (SimpleNamespace(run_id=run, **told, **rows) for run in "ab")
    >>> need_each_once([one])
    >>> try:
    ...     need_each_once([one, other])
    ... except HrgError as error:
    ...     print(error)
    runs a and b hold the same rows, so one is a copy of the other; name each run once, ...
    """
    first: dict[tuple[int, float, bytes], str] = {}
    for place, wave in enumerate(waves, start=1):
        if wave.provenance.sources:
            continue
        name = wave.run_id or f"number {place}"
        columns = (
            wave.main_amplitude,
            wave.quadrature_amplitude,
            wave.wave_angle_rad,
            wave.phase_rad,
        )
        rows = np.stack([np.asarray(column[:FIRST_ROWS], "<f8") for column in columns])
        # rows that all stand still bear no run's own noise
        moves = bool(np.any(rows[:, 1:] != rows[:, :-1]))
        key = wave.mode_number, wave.reference_frequency_hz, rows.tobytes()
        if moves and key in first:
            raise HrgError(
                f"runs {first[key]} and {name} hold the same rows, so one is a copy of the other;"
                f" {EACH_RUN_ONCE}"
            )
        first[key] = name


def find_two_gyros(names: Sequence[str], frequency_hz: Array) -> str | None:
    """The runs on either side of the widest gap between their frequencies, in words.

    Parameters
    ----------
    names
        Of the runs (r,).
    frequency_hz
        Mean frequency (r,) of each, Hz; NaN where it is not known.

    Returns
    -------
    str or None
        None where a temperature could make the gap: below `FREQUENCIES_APART` of the frequency.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.one_gyro import find_two_gyros
    >>> print(find_two_gyros(["a", "b", "c"], np.array([5000.0, 7000.0, 5000.2])))
    the runs are not of one gyro: a, c at 5000.1 Hz, b at 7000 Hz
    >>> find_two_gyros(["a", "c"], np.array([5000.0, 5000.2])) is None
    True
    """
    low, high, gap = part_by_frequency(frequency_hz)
    if gap < FREQUENCIES_APART:
        return None
    hz = np.asarray(frequency_hz, float)
    sides = [
        f"{name_some((names[i] for i in side), 30)} at {hz[side].mean():.6g} Hz"
        for side in (low, high)
    ]
    return f"the runs are not of one gyro: {', '.join(sides)}"


def part_by_frequency(frequency_hz: Array) -> tuple[Array, Array, float]:
    """The runs on either side of the widest gap between their frequencies.

    Parameters
    ----------
    frequency_hz
        Mean frequency (r,) of each, Hz; NaN where it is not known.

    Returns
    -------
    tuple
        Numbers of the runs below and above it, the lowest frequency first, and the gap as a part of
        the frequency: 0 of fewer than two runs.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.one_gyro import part_by_frequency
    >>> low, high, gap = part_by_frequency(np.array([5000.0, 7000.0, np.nan, 5000.2]))
    >>> low.tolist(), high.tolist(), round(gap, 3)
    ([0, 3], [1], 0.4)
    """
    hz = np.asarray(frequency_hz, float)
    order = np.argsort(hz)[: np.count_nonzero(np.isfinite(hz))]
    gaps = np.diff(hz[order]) / hz[order][:-1]
    if not len(gaps):
        return order, order[:0], 0.0
    first = int(np.argmax(gaps)) + 1
    return order[:first], order[first:], float(gaps.max())
