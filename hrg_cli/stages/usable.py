"""What of the runs given can be used, before any fit of them: runs that were not refused, and the
windows that their rate logs cover."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from ..errors import HrgError, name_some
from ..fitting.envelopes.envelope_runs import MIN_ROWS
from ..fitting.envelopes.wild_rows import flag_wild_rows
from ..fitting.samples.rate_log import describe_left_out, find_stretches, restrict_to_log
from ..records import Wave, list_doubts, name_record
from ..records.record import Record

R = TypeVar("R", bound=Record)
Array = np.ndarray
LEAST_STRETCH = 32
"""Good windows between two holes of a rate log from which they are a run of their own: its start
and its frequency cost some six values of the four in each window."""
TOLD = 4
"""Runs named in an error."""
ESTIMATE_AGAIN = "mend what it says, and demodulate and estimate the recording again"
WHY = 160
"""Characters of a refused run's own reason that are repeated."""


@dataclass(frozen=True)
class Usable:
    """Runs with the windows that cannot be used flagged, and what to say in the result: notes on
    windows left out, doubts on whole runs left out, refusals where no other run was given, and what
    is inherited from runs that are suspect themselves."""

    waves: list[Wave]
    notes: tuple[str, ...] = ()
    doubts: tuple[str, ...] = ()
    refusals: tuple[str, ...] = ()
    inherited: tuple[str, ...] = ()

    def judge(self, record: R) -> R:
        """The result with these sentences in its status."""
        noted = record.judged(self.notes, "valid").judged(self.doubts, "suspect")
        return noted.judged(self.refusals, "refused").judged(self.inherited, "suspect")

    @contextmanager
    def blame_refusals(self) -> Iterator[None]:
        """A fit of these runs: where refused ones were all there is, its error names that first."""
        try:
            yield
        except HrgError as error:
            if not self.refusals:
                raise
            raise HrgError(f"{_tell_first(self.refusals)}; {error}") from error


def _flag_wild(waves: Sequence[Wave]) -> tuple[list[Wave], tuple[str, ...]]:
    """The runs with windows that hold what no wave can flagged, and a note on each of these
    runs."""
    flagged = [flag_wild_rows(wave) for wave in waves]
    return [wave for wave, _ in flagged], tuple(said for _, said in flagged if said)


def drop_refused(waves: Sequence[Wave]) -> Usable:
    """The runs whose waves were not refused; all of them, with refusals, where each one was.

    Parameters
    ----------
    waves
        The runs.

    Returns
    -------
    Usable
        With what to say of those that are left out.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.usable import drop_refused
    >>> bad = Told(status="refused", run_id="a", status_reasons=("it is clipped",))
    >>> drop_refused([bad]).refusals
    ('the wave of run a is refused: it is clipped',)
    """
    kept, notes = _flag_wild([w for w in waves if w.status != "refused"])
    notes = (*notes, *_tell_same_names(kept))
    bad = [w for w in waves if w.status == "refused"]
    if kept or not bad:
        said = (f"the wave of run {w.run_id or '?'} is refused and is left out" for w in bad)
        doubted = ((name_record(w), w) for w in kept if w.status == "suspect")
        return Usable(kept, notes, tuple(said), inherited=tuple(list_doubts(doubted)))
    why = (f"the wave of run {w.run_id or '?'} is refused: {explain_refusal(w)}" for w in bad)
    return Usable(list(waves), refusals=tuple(why))


def _tell_same_names(waves: Sequence[Wave]) -> list[str]:
    """A sentence where runs bear one name, by which nothing that is said of them tells them
    apart."""
    counts = Counter(wave.run_id for wave in waves if wave.run_id)
    same = {name: count for name, count in counts.items() if count > 1}
    if not same:
        return []
    said = name_some(f"{count} runs have the run_id {name!r}" for name, count in same.items())
    return [
        f"{said}, by which results name them: give each its own; where they are numbered, it is in"
        " the order given"
    ]


def restrict_to_known_rates(usable: Usable, given: Collection[str] = ()) -> Usable:
    """The windows whose rate is known, and the runs that keep enough of them.

    Parameters
    ----------
    usable
        The runs.
    given
        Names of those whose rate is given otherwise, and that keep all.

    Returns
    -------
    Usable
        Stretches between holes of a log become runs of their own where they are long enough.

    Raises
    ------
    HrgError
        No run is left.

    Examples
    --------
    A log that ends half-way leaves half of the run:

    >>> import numpy as np
    >>> from hrg_cli.stages.planning.information import make_wave
    >>> from hrg_cli.stages.simulation_file import list_runs
    >>> from hrg_cli.stages.usable import Usable, restrict_to_known_rates
    >>> (run,) = list_runs(
    ...     {
    ...         "device": {"frequency_hz": 5000.0, "quality_factor": 1e6},
    ...         "recording": {"sample_rate_hz": 20_000.0, "duration_s": 3.0},
    ...         "readout": {"noise": 1e-3},
    ...     }
    ... )
    >>> wave = make_wave(run).replace(rate_rad_s=np.where(np.arange(1500) < 750, 0.1, np.nan))
    >>> (half,) = restrict_to_known_rates(Usable([wave])).waves
    >>> int(half.good().sum())
    750
    """
    waves, notes, doubts = [], list(usable.notes), list(usable.doubts)
    for wave in usable.waves:
        stretch = np.ones(len(wave), np.int32) if wave.run_id in given else find_stretches(wave)
        if stretch.all():
            waves.append(wave)
            continue
        own = _choose_stretches(wave, stretch)
        waves += [restrict_to_log(wave, stretch == number) for number in own]
        sentence = describe_left_out(wave, np.isin(stretch, own))
        if short := np.count_nonzero(~np.isin(stretch, [0, *own])):
            sentence += f", {short} of them in stretches of it that are too short for runs"
        if len(own) > 1:
            sentence += f"; its {len(own)} stretches of log are taken as runs of their own"
        (notes if own else doubts).append(sentence)
    if usable.waves and not waves:
        raise HrgError(
            f"{_tell_first(doubts)}; no run is left: log the rate over the whole run, or give"
            " the rate with rate_rad_s"
        )
    notes += _tell_unlogged(usable.waves, given)
    return replace(usable, waves=waves, notes=tuple(notes), doubts=tuple(doubts))


def _tell_unlogged(waves: Sequence[Wave], given: Collection[str]) -> list[str]:
    """A sentence on runs that log no rate among runs that log theirs, where none is given."""
    told = [wave for wave in waves if wave.run_id not in given]
    names = list(dict.fromkeys(wave.run_id or "?" for wave in told if wave.rate_rad_s is None))
    if not names or all(wave.rate_rad_s is None for wave in told):
        return []
    one = len(names) == 1
    return [
        f"run{'' if one else 's'} {name_some(names)} {'logs' if one else 'log'} no rate, unlike the"
        f" others, and {'is' if one else 'are'} taken to be at rest: where the table turned, add"
        f" the rate to {'its log' if one else 'their logs'}"
    ]


def name_apart(waves: Sequence[Wave]) -> tuple[Wave, ...]:
    """Waves by names that differ: those whose name an earlier one has are numbered from 2.

    Parameters
    ----------
    waves
        The runs.

    Returns
    -------
    tuple of Wave
        In their order.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from hrg_cli.stages.usable import name_apart
    >>> class Told(SimpleNamespace):
    ...     def replace(self, run_id):
    ...         return Told(run_id=run_id)
    >>> [wave.run_id for wave in name_apart([Told(run_id="a"), Told(run_id="a"), Told(run_id="b")])]
    ['a', 'a (2)', 'b']
    """
    seen: dict[str, int] = {}
    out = []
    for wave in waves:
        count = seen[wave.run_id] = seen.get(wave.run_id, 0) + 1
        out.append(wave if count == 1 else wave.replace(run_id=f"{wave.run_id or 'run'} ({count})"))
    return tuple(out)


def _choose_stretches(wave: Wave, stretch: Array) -> list[int]:
    """The stretches (n,) of a rate log that are worth a start of their own, in order of time: those
    of `LEAST_STRETCH` good windows; the longest may be as short as any run."""
    good = np.bincount(np.where(wave.good(), stretch, 0), minlength=2)
    good[0] = 0
    longest = int(np.argmax(good))
    least = {longest: MIN_ROWS}
    return [k for k in range(1, len(good)) if good[k] >= least.get(k, LEAST_STRETCH)]


def explain_refusal(wave: Wave) -> str:
    """Why a wave is refused: its own last reason, which is the worst.

    Parameters
    ----------
    wave
        That is refused.

    Returns
    -------
    str
        Shortened to 160 characters.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.stages.usable import explain_refusal
    >>> explain_refusal(Told(status_reasons=("it is noisy", "it is clipped")))
    'it is clipped'
    """
    why = wave.status_reasons[-1] if wave.status_reasons else "no reason is given"
    return why if len(why) <= WHY else f"{why[:WHY]}…"


def _tell_first(sentences: Sequence[str]) -> str:
    """Some of the sentences, and how many more there are."""
    more = len(sentences) - TOLD
    return "; ".join(sentences[:TOLD]) + (f"; and {more} more such runs" if more > 0 else "")
