"""The checks that come before any fit of several runs: they are of one gyro, by what their files say
and by their frequencies, and each was recorded once."""

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
    """HrgError naming the runs of each gyro where the files name more than one; runs that name none
    go with any."""
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
    """HrgError: two runs hold the same rows, noise and all; files are told apart by their sources,
    records in memory have none."""
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
    """The runs on either side of the widest gap between their frequencies (r,), in words, where no
    temperature makes it; else None."""
    hz = np.asarray(frequency_hz, float)
    order = np.argsort(hz)[: np.count_nonzero(np.isfinite(hz))]
    gaps = np.diff(hz[order]) / hz[order][:-1]
    if not len(gaps) or gaps.max() < FREQUENCIES_APART:
        return None
    first = int(np.argmax(gaps)) + 1
    sides = [
        f"{name_some((names[i] for i in side), 30)} at {hz[side].mean():.6g} Hz"
        for side in (order[:first], order[first:])
    ]
    return f"the runs are not of one gyro: {', '.join(sides)}"
