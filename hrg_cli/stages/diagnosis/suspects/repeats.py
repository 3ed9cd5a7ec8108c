"""Columns or channels of a run that stand still: no measurement, whatever the physics."""

from __future__ import annotations

from collections.abc import Sequence

from ....fitting.envelopes.frozen import CORRECTION, find_frozen
from ....records import Wave
from ...suspicion import Suspicion


def find_stuck_columns(waves: Sequence[Wave]) -> list[Suspicion]:
    """What repeats one value where noise is stated, by run."""
    return [
        Suspicion(wave.run_id, f"{one.what} stuck", one.evidence, CORRECTION)
        for wave, found in zip(waves, find_frozen(waves), strict=True)
        for one in found
    ]
