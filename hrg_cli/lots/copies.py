"""Recordings of two gyros that hold the same samples: one of them bears a wrong name."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..origins import find_samples, find_shared


def fail_copies(recordings: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """The results of a lot's recordings; of two gyros' that hold the same samples, both failed.

    Nothing tells whose they are.

    Parameters
    ----------
    recordings
        Results, each with its gyro and wave.

    Returns
    -------
    list of dict
        In their order.

    Examples
    --------
    What failed already has no samples to compare:

    >>> from hrg_cli.lots.copies import fail_copies
    >>> failed = {"status": "failed", "gyro_id": "SN-1", "error": "it is clipped"}
    >>> fail_copies([failed]) == [failed]
    True
    """
    samples = [
        () if one["status"] == "failed" else find_samples(Path(one["wave"])) for one in recordings
    ]
    twin: dict[int, int] = {}
    for first, second in find_shared(samples):
        if recordings[first]["gyro_id"] != recordings[second]["gyro_id"]:
            twin.setdefault(second, first)
            twin.setdefault(first, second)
    return [
        recording | {"status": "failed", "error": _tell_copy(recording, recordings[twin[place]])}
        if place in twin
        else recording
        for place, recording in enumerate(recordings)
    ]


def _tell_copy(recording: dict[str, Any], other: dict[str, Any]) -> str:
    return (
        f"{recording['name']}: holds the samples of {other['gyro_id']}'s {other['name']}; correct"
        " the gyro_id of one of them, or leave out the copy"
    )
