"""Counts of windows over the whole stream, and the status they give its last block."""

from __future__ import annotations

import numpy as np

from ...records import FLAG_CLIPPED, FLAG_GAP, FLAG_NOT_FINITE, Wave
from .continuity import DETECTED
from .wave_block import DIRTY

FEWEST_USABLE = 1e-3
FAILED_LIMIT = 0.02
FLAGGED_LIMIT = 0.2
"""Fractions of the windows above which failed or flagged ones make the whole suspect."""
FLAGGED = {
    FLAG_CLIPPED: "clipped",
    FLAG_GAP: "in or beside a gap",
    FLAG_NOT_FINITE: "without a number",
}


class Tally:
    """Counts of rows over the whole stream."""

    def __init__(self) -> None:
        self.rows = self.failed = self.flagged = self.usable = self.faint = 0
        self.of_flag = dict.fromkeys(FLAGGED, 0)

    def add(self, wave: Wave) -> None:
        """Count a block's windows."""
        good, finite = wave.good(), np.isfinite(wave.main_amplitude)
        self.rows += len(wave)
        self.failed += int((finite & (wave.iterations < 0)).sum())
        self.flagged += int(((wave.flags & DIRTY) != 0).sum())
        for flag in FLAGGED:
            self.of_flag[flag] += int(((wave.flags & flag) != 0).sum())
        faint = good & (
            (wave.main_amplitude <= 0) | (wave.main_amplitude < DETECTED * wave.signal_std)
        )
        self.faint += int(faint.sum())
        self.usable += int((good & ~faint).sum())

    def _say_flags(self) -> str:
        """What the flagged windows are."""
        return " or ".join(said for flag, said in FLAGGED.items() if self.of_flag[flag])

    def judge(self, wave: Wave, solver: str) -> Wave:
        """The last block with the whole stream's status."""
        run = wave.run_id or "this run"
        if self.usable <= FEWEST_USABLE * self.rows or self.failed > self.rows / 2:
            return wave.judged(
                [
                    f"{run}: {self.usable} of {self.rows} windows are usable: {self.flagged} are"
                    f" flagged, {self.failed} did not converge, in {self.faint} the amplitude is"
                    f" below {DETECTED:g} standard deviations; check the recording"
                ],
                "refused",
            )
        reasons = []
        if self.failed > FAILED_LIMIT * self.rows:
            reasons.append(
                f"{run}: {solver} did not converge in {self.failed} of {self.rows} windows; use the"
                " solver closed-form"
            )
        if self.flagged > FLAGGED_LIMIT * self.rows:
            reasons.append(
                f"{run}: {self.flagged} of {self.rows} windows are {self._say_flags()}; check the"
                " recording"
            )
        if self.faint > FLAGGED_LIMIT * self.rows:
            reasons.append(
                f"{run}: in {self.faint} of {self.rows} windows the amplitude is below {DETECTED:g}"
                " standard deviations; demodulate with longer windows"
            )
        return wave.judged(reasons)
