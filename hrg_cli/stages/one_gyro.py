"""The check that comes before any fit of several runs: they are of one gyro, by what their files
say."""

from __future__ import annotations

from collections.abc import Sequence

from ..errors import HrgError, name_some
from ..records import Resonator, Wave

MOST_GYROS = 3
"""Gyros that a message names."""


def of_one_gyro(waves: Sequence[Wave], command: str, resonator: Resonator | None = None) -> None:
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
