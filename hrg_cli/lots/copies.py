"""Recordings of two gyros that hold the same samples: one of them bears a wrong name."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..origins import overlap, samples_of


def fail_copies(recordings: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """The results of a lot's recordings; of two gyros' that go back to the same samples both failed,
    since nothing tells whose they are."""
    first: dict[str, list[tuple[int, str]]] = {}
    twin: dict[int, int] = {}
    for place, recording in enumerate(recordings):
        if recording["status"] == "failed":
            continue
        for sample in samples_of(Path(recording["wave"])):
            whole, _, part = sample.partition("@")
            for other, taken in first.get(whole, []):
                if recordings[other]["gyro_id"] != recording["gyro_id"] and overlap(part, taken):
                    twin.setdefault(place, other)
                    twin.setdefault(other, place)
            first.setdefault(whole, []).append((place, part))
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
