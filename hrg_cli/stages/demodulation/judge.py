"""What a stream of windows shows as it passes: those that settle or lie outside the run-down are
flagged, all flags counted, and the last block says what the whole is worth.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...fitting.samples.demodulator import UNHELD, Demodulator
from ...fitting.samples.run_down import RunDown
from ...fitting.samples.signal_rows import Rows
from ...fitting.samples.wild import tell_wild
from ...records import FLAG_CLIPPED, FLAG_GAP, FLAG_NOT_FINITE, FLAG_SETTLING, Array, Periods
from .auxiliary_log import WindowLog

SETTLING_FACTOR, SETTLING_SHARE = 5.0, 0.1
"""A settling start has a residual so many times the run's, absolutely and relative to the wave, and
is at most this part of the run."""
GAPS_SHARE = 0.1
"""Part of the windows above which gaps make the result suspect."""
CLIPPED_SHARE = NOT_FINITE_SHARE = 0.01
"""Parts of the windows above which clipped and not finite samples do."""


@dataclass
class StreamJudge:
    """What the rows so far have shown, and the log beside them."""

    run: Demodulator
    begin_s: float
    end_s: float
    part: RunDown | None
    rows: int = 0
    flagged: dict[int, int] = field(default_factory=dict)
    settled: bool = False
    settle: int = 0

    def __post_init__(self) -> None:
        self.log = WindowLog(self.run.recording, self.run.name)

    def _flag_outside(self, rows: Rows) -> Array:
        """Flag the rows that reach beyond the run-down; those before it (n,) bool."""
        if self.part is None:
            return np.zeros(len(rows["flags"]), bool)
        half = self.run.window_s / 2
        before, behind = (
            rows["time_s"] - half < self.part.begin_s,
            rows["time_s"] + half > self.part.end_s,
        )
        rows["flags"][before | behind] |= FLAG_SETTLING
        return np.asarray(before)

    def flag_settling(self, rows: Rows) -> None:
        """Flag the rows outside the run-down, and its leading ones whose residual is far above the
        run's, until the first that is not."""
        before = self._flag_outside(rows)
        if self.settled:
            return
        power, relative = self.run.calm
        residual2 = (rows["residual_rms"] ** 2).sum(1)
        wave2 = (rows["signals"] ** 2).sum(1) / 2
        least2 = max(self.run.find_least_variance(0), self.run.find_least_variance(1))
        far = (residual2 > SETTLING_FACTOR**2 * max(power, least2)) & (
            residual2 > SETTLING_FACTOR**2 * relative * wave2
        )
        far &= rows["time_s"] - self.begin_s < SETTLING_SHARE * (self.end_s - self.begin_s)
        far &= rows["flags"] & FLAG_CLIPPED == 0
        calm = np.flatnonzero(~far & ~before & np.isfinite(residual2))
        stop = int(calm[0]) if len(calm) else len(far)
        far[:stop] &= ~before[:stop]
        rows["flags"][:stop][far[:stop]] |= FLAG_SETTLING
        self.settle += int(far[:stop].sum())
        self.settled = len(calm) > 0

    def count(self, flags: Array) -> None:
        """Keep count of the flags."""
        self.rows += len(flags)
        if flags.any():
            for bit in (FLAG_CLIPPED, FLAG_GAP, FLAG_NOT_FINITE, FLAG_SETTLING):
                self.flagged[bit] = self.flagged.get(bit, 0) + int(np.count_nonzero(flags & bit))

    def judge(self, periods: Periods) -> Periods:
        """The last block with the reasons to note, suspect or refuse the whole."""
        found = self.run.survey
        notes, suspect, refused = list(self.run.notes), list(found.suspect), list(found.refused)
        self._judge_samples(notes, suspect)
        self._note_ends(notes)
        suspect += [*self._tell_units(), *self._tell_bent(), *self._tell_unheld()]
        if self.flagged.get(FLAG_NOT_FINITE, 0) == self.rows:
            refused.append("no window holds finite samples only")
        return periods.judged(notes, "valid").judged(suspect, "suspect").judged(refused, "refused")

    def _judge_samples(self, notes: list[str], suspect: list[str]) -> None:
        """Windows with clipped, missing or not finite samples: a note, or a doubt where they are
        many."""
        of = f"of {self.rows} windows"
        clipped, gaps, bad = (
            self.flagged.get(bit, 0) for bit in (FLAG_CLIPPED, FLAG_GAP, FLAG_NOT_FINITE)
        )
        if clipped:
            (suspect if clipped > CLIPPED_SHARE * self.rows else notes).append(
                f"{clipped} {of} {_hold(clipped)} clipped samples"
            )
        still = self.run.still
        if still:
            (suspect if still > GAPS_SHARE * self.rows else notes).append(
                f"both channels repeat one value in {still} {of}, first at"
                f" {self.run.still_since_s:.4g} s: no wave stands still, the recorder did; the"
                " windows are left out as a gap"
            )
            gaps -= still
        if gaps:
            (suspect if gaps > GAPS_SHARE * self.rows else notes).append(
                f"{gaps} {of} {'lies' if gaps == 1 else 'lie'} in or beside gaps of the"
                f" sampling{self._advise_shorter(gaps)}"
            )
        if bad:
            wild = tell_wild(self.run.recording)
            (suspect if bad > NOT_FINITE_SHARE * self.rows else notes).append(
                f"{bad} {of} {_hold(bad)} samples that are not finite"
                + (f" or belong to no wave: {wild}" if wild else "")
            )

    def _advise_shorter(self, flagged: int) -> str:
        """Advice where gaps touch many windows and would touch fewer shorter ones."""
        gaps = self.run.gaps
        if gaps is None or flagged <= GAPS_SHARE * self.rows:
            return ""
        periods = gaps.find_shorter_periods(self.end_s - self.begin_s, GAPS_SHARE)
        return "" if periods is None else f"; use periods_per_window of at most {periods:.2g}"

    def _note_ends(self, notes: list[str]) -> None:
        """Windows that settle, and those outside the log."""
        if self.settle:
            struck = self.part is not None and np.isfinite(self.part.begin_s)
            after = " after the strike" if struck else ""
            some = "window" if self.settle == 1 else f"{self.settle} windows"
            notes.append(f"the first {some}{after} settle{'s' if self.settle == 1 else ''}")
        if self.log.rows_outside:
            notes.append(
                f"{self.log.rows_outside} of {self.rows} windows lie outside the auxiliary log;"
                " their temperature and rate are NaN"
            )
        notes += self.log.list_notes()
        if self.log.columns and len(self.log.time_s) == 1:
            notes.append(
                f"the auxiliary log has one row, at {self.log.time_s[0]:.4g} s, which is taken for"
                " the whole run"
            )

    def _tell_units(self) -> list[str]:
        """Channels in two units."""
        recording = self.run.recording
        if recording.s_units == recording.c_units:
            return []
        return [
            f"channel C is in {recording.c_units!r} and S in {recording.s_units!r}; the same"
            " unit was expected"
        ]

    def _tell_unheld(self) -> list[str]:
        """Windows that leave far more than the noise, which their neighbours do not foretell: what
        moves so fast is seen as something slow, or not at all."""
        run = self.run
        if run.unheld < UNHELD:
            return []
        periods = run.window_s * run.reference_hz
        advice = (
            f"use shorter ones, periods_per_window of {max(1.0, periods / 10):.2g} say"
            if periods > 1
            else "another oscillation is near"
        )
        return [
            f"within windows of {periods:.3g} periods the wave moves by more than they hold: beside"
            f" the noise they leave {100 * run.unheld:.2g} % of it; {advice}"
        ]

    def _tell_bent(self) -> list[str]:
        """Windows within which the envelope moves more than their average corrects."""
        run = self.run
        if not run.bent > 2 * max(8, 0.01 * self.rows):
            return []
        periods = run.window_s * run.reference_hz
        shorter = periods * min(0.7, 0.5 * run.bent_by ** (-1 / 6))
        advice = (
            f"use periods_per_window of at most {shorter:.2g}"
            if shorter >= 1
            else "another oscillation is near"
        )
        return [
            f"the envelope moves too much within windows of {periods:.3g} periods: what the"
            f" window's average leaves uncorrected is {run.bent_by:.2g} times the noise; {advice}"
        ]


def _hold(count: int) -> str:
    return "holds" if count == 1 else "hold"
