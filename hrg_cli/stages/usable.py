"""What of the runs given can be used, before any fit of them: runs that were not refused, and the
windows that their rate logs cover."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from ..errors import HrgError
from ..fitting.envelopes.envelope_runs import MIN_ROWS
from ..fitting.samples.rate_log import covered, left_out, within_log
from ..records import Wave
from ..records.record import Record

R = TypeVar("R", bound=Record)
TOLD = 4
"""Runs named in an error."""
ESTIMATE_AGAIN = "mend what it says, and demodulate and estimate the recording again"
WHY = 160
"""Characters of a refused run's own reason that are repeated."""


@dataclass(frozen=True)
class Usable:
    """Runs with the windows that cannot be used flagged, and what to say in the result: notes on
    windows left out, doubts on whole runs left out, refusals where no other run was given."""

    waves: list[Wave]
    notes: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    refusals: tuple[str, ...] = ()

    def judged(self, record: R) -> R:
        """The result with these sentences in its status."""
        noted = record.judged(self.notes, "valid").judged(self.doubts, "suspect")
        return noted.judged(self.refusals, "refused")

    @contextmanager
    def blamed(self) -> Iterator[None]:
        """A fit of these runs: where refused ones were all there is, its error names that first."""
        try:
            yield
        except HrgError as error:
            if not self.refusals:
                raise
            raise HrgError(f"{_first(self.refusals)}; {error}") from error


def not_refused(waves: Sequence[Wave]) -> Usable:
    """The runs whose waves were not refused; all of them, with refusals, where each one was."""
    kept = [w for w in waves if w.status != "refused"]
    bad = [w for w in waves if w.status == "refused"]
    if kept or not bad:
        said = (f"the wave of run {w.run_id or '?'} is refused and is left out" for w in bad)
        return Usable(kept, doubts=tuple(said))
    why = (f"the wave of run {w.run_id or '?'} is refused: {why_refused(w)}" for w in bad)
    return Usable(list(waves), refusals=tuple(why))


def with_known_rates(usable: Usable, given: Collection[str] = ()) -> Usable:
    """The windows whose rate is known, and the runs that keep enough of them; all of those runs
    whose rate is given otherwise, by their run_id.

    HrgError: no run is left.
    """
    waves, notes, doubts = [], list(usable.notes), list(usable.doubts)
    for wave in usable.waves:
        inside = np.ones(len(wave), bool) if wave.run_id in given else covered(wave)
        sentence = left_out(wave, inside)
        if not sentence:
            waves.append(wave)
        elif np.count_nonzero(inside & wave.good()) >= MIN_ROWS:
            waves.append(within_log(wave, inside))
            notes.append(sentence)
        else:
            doubts.append(sentence)
    if usable.waves and not waves:
        raise HrgError(
            f"{_first(doubts)}; no run is left: log the rate over the whole run, or give the rate"
            " with rate_rad_s"
        )
    return Usable(waves, tuple(notes), tuple(doubts), usable.refusals)


def why_refused(wave: Wave) -> str:
    """A refused wave's own last reason, which is the worst, shortened."""
    why = wave.status_reasons[-1] if wave.status_reasons else "no reason is given"
    return why if len(why) <= WHY else f"{why[:WHY]}…"


def _first(sentences: Sequence[str]) -> str:
    """Some of the sentences, and how many more there are."""
    more = len(sentences) - TOLD
    return "; ".join(sentences[:TOLD]) + (f"; and {more} more such runs" if more > 0 else "")
