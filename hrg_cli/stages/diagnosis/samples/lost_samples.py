"""Diagnosis, samples lost or repeated: both channels of a run turn alike between two windows, by a
whole number of samples."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ....effects import dropped_samples
from ....fitting.envelopes.envelope_runs import compute_envelopes
from ....records import Wave
from ..fits.whole_samples import count_whole
from .jumps import TOUCHED, find_jumps
from .lines import find_even_step
from .offered import make_entry

FEWEST_ROWS = 40
KNOWN_STEP = 0.15
"""σ of a loss in samples up to which it can be asked to be whole."""
SHIFTED = 5.0
"""σ of the slow motion's shift within which the time lost lies, and squared the χ² by which one
number of samples is told from another."""
MOST_PERIODS = 40
"""Whole periods that may be lost beside what the phase shows, where the slow motion does not
tell."""


@dataclass(frozen=True)
class PhaseStep:
    """A step of the phase of one run: last row before and first row after it, instant, size in (−π,
    π], its σ, frequency about it."""

    run: int
    before: int
    after: int
    time_s: float
    step_rad: float
    std_rad: float
    frequency_hz: float
    shift_s: float = 0.0
    shift_std_s: float = np.inf
    """Time by which the slow motion moved on, and its σ."""


def find_phase_steps(waves: Sequence[Wave]) -> list[PhaseStep]:
    """Where both channels of a run turn alike between two windows and do nothing else.

    Parameters
    ----------
    waves
        Of the runs.

    Returns
    -------
    list of PhaseStep
        At most a few a run.

    Examples
    --------
    A wave whose phase steps by 0.3 rad behind its 25th window:

    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.lost_samples import find_phase_steps
    >>> wave = draw_waves()[0]
    >>> stepped = wave.replace(phase_rad=wave.phase_rad + 0.3 * (np.arange(50) > 24))
    >>> [(step.before, round(step.step_rad, 1)) for step in find_phase_steps([stepped])]
    [(24, 0.3)]
    """
    found = (
        (number, jump)
        for number, wave in enumerate(waves)
        for jump in find_jumps(wave)
        if jump.alike
    )
    return [
        PhaseStep(
            run=number,
            before=jump.before,
            after=jump.after,
            time_s=jump.time_s,
            step_rad=jump.turn_rad,
            std_rad=jump.turn_std_rad,
            frequency_hz=waves[number].reference_frequency_hz + jump.rate_rad_s / (2 * np.pi),
            shift_s=jump.shift_s,
            shift_std_s=jump.shift_std_s,
        )
        for number, jump in found
    ]


def split_at(waves: Sequence[Wave], steps: Sequence[PhaseStep]) -> tuple[list[Wave], list[int]]:
    """The waves cut at every step, each piece a run of its own.

    Parameters
    ----------
    waves
        Of the runs.
    steps
        Of their phases.

    Returns
    -------
    tuple
        The pieces, and the wave that each comes from; pieces too short are left out, but for the
        longest of a run.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.lost_samples import find_phase_steps, split_at
    >>> wave = draw_waves()[0]
    >>> stepped = wave.replace(phase_rad=wave.phase_rad + 0.3 * (np.arange(50) > 24))
    >>> pieces, origin = split_at([stepped], find_phase_steps([stepped]))
    >>> [len(piece) for piece in pieces], origin
    ([19, 19], [0, 0])
    """
    pieces, origin = [], []
    for number, wave in enumerate(waves):
        own: list[Wave] = []
        cuts = sorted(
            (max(0, s.before + 1 - TOUCHED), min(len(wave), s.after + TOUCHED))
            for s in steps
            if s.run == number
        )
        begin = 0
        for stop, start in [*cuts, (len(wave), len(wave))]:
            piece = wave.rows(begin, stop)
            if cuts:
                # the window over the step has spoilt the noise estimate of those it was pooled with
                piece = piece.replace(signal_std=np.minimum(piece.signal_std, _rough(piece)))
            own.append(piece)
            begin = start
        rows = [int(np.count_nonzero(piece.good())) for piece in own]
        enough = min(FEWEST_ROWS, max(rows))
        kept = [piece for piece, count in zip(own, rows, strict=True) if count >= enough]
        pieces += kept
        origin += [number] * len(kept)
    return pieces, origin


def _rough(wave: Wave) -> float:
    """Noise of one signal coefficient from the envelopes' third differences."""
    good = wave.good()
    u = compute_envelopes(wave, good)
    return (
        float(np.sqrt(np.median(np.abs(np.diff(u, n=3, axis=0)) ** 2) / (20 * 2 * np.log(2))))
        if len(u) > 3
        else np.inf
    )


def join_steps(steps: Sequence[PhaseStep], waves: Sequence[Wave]) -> list[list[PhaseStep]]:
    """Steps at the same instant and of the same size in several runs, which are one cause.

    Parameters
    ----------
    steps
        Of the runs' phases.
    waves
        Of the runs.

    Returns
    -------
    list of list
        The steps by causes.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.lost_samples import find_phase_steps, join_steps
    >>> wave = draw_waves()[0]
    >>> waves = 2 * [wave.replace(phase_rad=wave.phase_rad + 0.3 * (np.arange(50) > 24))]
    >>> [len(group) for group in join_steps(find_phase_steps(waves), waves)]
    [2]
    """
    groups: list[list[PhaseStep]] = []
    for step in steps:
        for group in groups:
            first = group[0]
            # runs of another frequency turn by another angle in the same time
            own = 2 * np.pi * abs(first.frequency_hz - step.frequency_hz)
            slack = 8 * float(np.hypot(first.std_rad, step.std_rad)) + 2 * own * max(
                abs(first.shift_s), abs(step.shift_s)
            )
            same_size = abs(np.angle(np.exp(1j * (first.step_rad - step.step_rad)))) < slack
            if (
                abs(first.time_s - step.time_s) < waves[step.run].window_s
                and same_size
                and first.run != step.run
            ):
                group.append(step)
                break
        else:
            groups.append([step])
    return groups


def count_lost(
    group: Sequence[PhaseStep], waves: Sequence[Wave], frequency_hz: float
) -> dict[str, Any] | None:
    """How many samples a step of the phase lost, or repeated where the time is negative.

    Parameters
    ----------
    group
        The step in every run that has it.
    waves
        Of the runs.
    frequency_hz
        Of the oscillation [Hz].

    Returns
    -------
    dict or None
        An entry of the report; None where the sampling is even and no whole number of samples does
        it.

    Examples
    --------
    Five samples of 0.5 ms of a wave of 498.7 Hz turn it by 2π·498.7·0.0025 rad:

    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.lost_samples import PhaseStep, count_lost
    >>> turn = float(np.angle(np.exp(2j * np.pi * 498.7 * 0.0025)))
    >>> step = PhaseStep(0, 24, 25, 0.5, turn, 1e-4, 498.7)
    >>> found = count_lost([step], draw_waves(), 498.7)
    >>> found["name"]
    'dropped_samples'
    """
    omega, first = 2 * np.pi * frequency_hz, group[0]
    weight = np.array([s.std_rad**-2 for s in group])
    mean = first.step_rad + float(
        np.sum(weight * [np.angle(np.exp(1j * (s.step_rad - first.step_rad))) for s in group])
        / weight.sum()
    )
    std = float(weight.sum() ** -0.5)
    missing, std_s = float(np.mod(mean, 2 * np.pi)) / omega, std / omega
    counted: dict[str, Any] = {}
    step_s = find_even_step(waves[first.run])
    if step_s is not None and std_s < KNOWN_STEP * step_s:
        counts = _count_whole(group, step_s)
        if not counts:
            return None
        missing = counts[0] * step_s
        counted = {"samples": counts[0]}
        if others := sorted(counts[1:]):
            # the phase is known to a part of a sample, but not which of these numbers it is
            std_s = max(abs(n - counts[0]) for n in others) * step_s
            counted["or_samples"] = others
    elif mean < 0 and abs(mean) < np.pi / 2:
        missing = mean / omega
    parameters = {
        "lost_s": (missing, std_s, "s"),
        "time_s": (first.time_s, float(waves[first.run].window_s) / 2, "s"),
    }
    offer = make_entry(dropped_samples.EFFECT, abs(mean) / std, parameters, (mean / std) ** 2)
    offer |= {
        "runs": [waves[s.run].run_id for s in group],
        "ambiguity_s": 1 / frequency_hz,
        "what": "lost" if missing > 0 else "repeated",
    }
    return offer | counted


def _count_whole(group: Sequence[PhaseStep], step_s: float) -> list[int]:
    """Numbers of samples whose time agrees with a step of the phase, but for whole periods, and
    with the shift of the slow motion: the likeliest alone where that tells, else those it does not
    tell apart, the fewest lost first."""
    best = min(group, key=lambda s: s.std_rad)
    period_s = 1 / best.frequency_hz
    turns = best.step_rad / (2 * np.pi), best.std_rad / (2 * np.pi)
    known = [s for s in group if np.isfinite(s.shift_std_s)]
    weight = np.array([s.shift_std_s**-2 for s in known])
    shift, std = 0.0, np.inf
    if known:
        shift = float(weight @ [s.shift_s for s in known] / weight.sum())
        std = float(weight.sum() ** -0.5)
    most = MOST_PERIODS
    if std < MOST_PERIODS * period_s:
        most = max(most, int((abs(shift) + SHIFTED * std) / period_s) + 1)
    times = (turns[0] + np.arange(-most, most + 1)) * period_s
    whole, fits = count_whole(times, turns[1] * period_s, step_s)
    off = ((times - shift) / std) ** 2
    fits &= off < SHIFTED**2
    if not fits.any():
        return []
    likely = fits & (off < off[fits].min() + SHIFTED**2)
    return sorted((int(n) for n in whole[likely]), key=lambda n: (n < 0, abs(n)))
