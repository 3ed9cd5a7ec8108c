"""Diagnosis, odd windows: those whose samples hold far more than their neighbours' noise.

The demodulation pools the noise of neighbouring windows, but for one whose residual is beyond any
chance: that one keeps its own, and weighs next to nothing in the fits. What made it so is no noise:
a clipped top where the signal is at its largest, else a burst that is told and not explained.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import comb

import numpy as np

from ....effects.effect import Effect
from ....fitting.envelopes.envelope_runs import compute_envelopes
from ....fitting.samples.envelope_motion import estimate_curvatures
from ....fitting.samples.neighbours import estimate_from_neighbours, find_local_median
from ....records import Array, Wave
from ..thresholds import BENT_WINDOW, BY_CHANCE, ODD_WINDOW
from .heard import compute_harmonic_power
from .lines import find_sampling_hz

NEIGHBOURS = 12
"""Windows on either side whose noise is the usual one."""
FEWEST = 4
"""Samples of the shortest window."""


@dataclass(frozen=True)
class OddWindow:
    """A window whose σ is so many times its neighbours': number of its wave, row, time; σ beside
    the neighbours' that makes it so."""

    run: int
    row: int
    time_s: float
    times: float
    beyond: float


def find_odd_windows(waves: Sequence[Wave]) -> list[OddWindow]:
    """Windows whose σ is far above that of their neighbours.

    Parameters
    ----------
    waves
        Of the runs.

    Returns
    -------
    list of OddWindow
        Among the good rows; none in runs too short to have neighbours.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.odd_windows import find_odd_windows
    >>> wave = draw_waves()[0]
    >>> burst = wave.replace(signal_std=wave.signal_std * np.where(np.arange(50) == 30, 9.0, 1.0))
    >>> [one.row for one in find_odd_windows([wave, burst])]
    [30]
    """
    found = []
    for number, wave in enumerate(waves):
        rows = np.flatnonzero(wave.good())
        if len(rows) < 2 * NEIGHBOURS + 1:
            continue
        std = np.asarray(wave.signal_std, float)[rows]
        usual = find_local_median(std, NEIGHBOURS)
        odd = (std > ODD_WINDOW * usual) & ~_kinked(wave, rows, usual)
        if odd.any():
            odd &= ~_bent(wave, rows, std, usual)
        found += [
            OddWindow(
                number,
                int(rows[k]),
                float(wave.time_s[rows[k]]),
                float(std[k] / usual[k]),
                float(np.sqrt(std[k] ** 2 - usual[k] ** 2)),
            )
            for k in np.flatnonzero(odd)
        ]
    return found


def _kinked(wave: Wave, rows: Array, usual: Array) -> Array:
    """Rows (n,) in which a logged command bends the motion by more than the noise: a change δ of a
    rate or a drive within a window of length T leaves its envelope by δT/8."""
    size = np.asarray(wave.main_amplitude, float)[rows]
    bent = np.zeros(len(rows))
    for name, scale in (("rate_rad_s", size), ("drive_main", 1.0), ("drive_quadrature", 1.0)):
        logged = getattr(wave, name, None)
        if logged is None:
            continue
        change = np.abs(np.diff(np.asarray(logged, float)[rows], prepend=np.nan))
        change = np.nan_to_num(np.fmax(change, np.append(change[1:], np.nan)))
        bent = np.maximum(bent, change * scale * wave.window_s / 8)
    return np.asarray(bent > usual)


def _bent(wave: Wave, rows: Array, std: Array, usual: Array) -> Array:
    """Rows (n,) whose σ holds no more beside the neighbours' than what the motion's bend is not
    known by: at the ends of a run it is continued, and a wave that turns fast within a window makes
    that rough."""
    doubt = _estimate_bend_std(wave)[rows]
    return np.asarray(std**2 - usual**2 < (BENT_WINDOW * doubt) ** 2)


def _estimate_bend_std(wave: Wave) -> Array:
    """σ (n,) that the doubt D about the bend gives a row's envelopes, D·T²/24, rms over the
    channels: the largest of the frames in which the demodulation may have seen the bend."""
    good = wave.good()
    u = np.where(good[:, None], compute_envelopes(wave), np.nan).T[..., None]
    doubts = [_find_doubt(u, offset, wave.window_s) for offset in _list_frames(wave, good)]
    return np.asarray(np.max(doubts, axis=0) * wave.window_s**2 / 24)


def _find_doubt(u: Array, offset_rad_s: float, window_s: float) -> Array:
    """Doubt (n,) about the bend of envelopes (channels, n, 1) in a frame that turns, rms over the
    channels; 0 where they are too few."""

    def see(rows: Array) -> tuple[Array, Array] | None:
        return estimate_curvatures(rows, np.array([offset_rad_s]), window_s)

    found = estimate_from_neighbours(see, u, offset_rad_s, window_s)
    none = np.zeros(u.shape[1])
    return none if found is None else np.asarray(np.sqrt((found[1] ** 2).mean(axis=(0, 2))))


def _list_frames(wave: Wave, good: Array) -> list[float]:
    """By what the demodulation's basis may turn against the reference, rad/s.

    By nothing, for the reference is the line that its looks saw; by as much as the frequency has
    drifted at an end. A wave that turns has two lines, at ω ± mθ̇: a reference between them is the
    median of looks of which some saw the one and some the other.
    """
    omega = 2 * np.pi * (np.asarray(wave.frequency_hz, float)[good] - wave.reference_frequency_hz)
    omega = omega[np.isfinite(omega)]
    if not len(omega):
        return [0.0]
    middle, rows = float(np.median(omega)), np.flatnonzero(good)
    steps = np.diff(np.asarray(wave.wave_angle_rad, float)[rows]) / np.diff(rows)
    line = wave.mode_number * abs(float(np.median(steps))) / wave.window_s
    lines = [middle - line, middle + line] if abs(middle) < line / 2 else []
    return [0.0, float(omega[0]) - middle, float(omega[-1]) - middle, *lines]


def _find_harmonic_std(
    wave: Wave, row: int, bends: Sequence[tuple[Effect, Mapping[str, float]]]
) -> float:
    """σ at most that harmonics of these read-outs add to a row's: of s rms in each of N samples it
    is s√(2/N), and no window has fewer than four."""
    samples = max(FEWEST, wave.window_s * (find_sampling_hz([wave]) or 0.0))
    amplitude = np.abs(compute_envelopes(wave, slice(row, row + 1)))
    power = sum(
        float(compute_harmonic_power(effect, values, amplitude).sum(axis=0).max())
        for effect, values in bends
    )
    return float(np.sqrt(2 * power / samples))


def find_channel_amplitudes(wave: Wave) -> Array:
    """The larger amplitude of the two channels.

    Parameters
    ----------
    wave
        Of a run.

    Returns
    -------
    ndarray
        (n,), in the signals' unit.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.odd_windows import find_channel_amplitudes
    >>> wave = draw_waves()[0]
    >>> bool((find_channel_amplitudes(wave) <= wave.main_amplitude * 1.001).all())
    True
    """
    u = compute_envelopes(wave)
    return np.asarray(np.abs(u).max(axis=-1))


def are_at_top(
    waves: Sequence[Wave], odd: Sequence[OddWindow], by_chance: float = BY_CHANCE
) -> bool:
    """Whether odd windows are just those of the largest signal.

    Of N windows chance makes that of k once in N over k.

    Parameters
    ----------
    waves
        Of the runs.
    odd
        Their odd windows.
    by_chance
        Below which chance is none.

    Returns
    -------
    bool
        The signal may be clipped there.

    Examples
    --------
    The first six windows of a run-down, and the last six:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.odd_windows import OddWindow, are_at_top
    >>> wave = draw_waves()[0]
    >>> rows = (range(6), range(44, 50))
    >>> first, last = ([OddWindow(0, k, 0.0, 9.0, 0.1) for k in six] for six in rows)
    >>> are_at_top([wave], first), are_at_top([wave], last)
    (True, False)
    """
    if not odd:
        return False
    size = [find_channel_amplitudes(wave) for wave in waves]
    good = [wave.good() for wave in waves]
    least = min(size[one.run][one.row] for one in odd)
    above = sum(int(np.count_nonzero(s[g] >= least)) for s, g in zip(size, good, strict=True))
    total = sum(int(np.count_nonzero(g)) for g in good)
    return above == len(odd) and 1 / comb(total, above) < by_chance


def say_odd_windows(
    waves: Sequence[Wave],
    instants: Sequence[tuple[int, float]],
    causes: Sequence[Effect],
    bends: Sequence[tuple[Effect, Mapping[str, float]]] = (),
) -> str:
    """One sentence on the odd windows that no named cause makes.

    Parameters
    ----------
    waves
        Of the runs.
    instants
        (wave, time [s]) at which a cause acts, within a window of which others may be odd.
    causes
        That are named.
    bends
        Read-outs with their values, whose harmonics stand in the windows of a single period by
        chance of where the samples fall.

    Returns
    -------
    str
        Empty where there are none.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.odd_windows import say_odd_windows
    >>> wave = draw_waves()[0].replace(run_id="a")
    >>> burst = wave.replace(signal_std=wave.signal_std * np.where(np.arange(50) == 30, 9.0, 1.0))
    >>> say_odd_windows([burst], [], []).split(":")[0]
    'one window holds more than noise'
    """
    odd = find_odd_windows(waves)
    if any(cause.sets_in for cause in causes) and are_at_top(waves, odd, by_chance=1.0):
        return ""
    odd = [
        one
        for one in odd
        if not any(
            run == one.run and abs(time_s - one.time_s) < 1.5 * waves[run].window_s
            for run, time_s in instants
        )
        and one.beyond > _find_harmonic_std(waves[one.run], one.row, bends)
    ]
    if not odd:
        return ""
    worst = max(odd, key=lambda one: one.times)
    which = "one window holds" if len(odd) == 1 else f"{len(odd)} windows hold"
    return (
        f"{which} more than noise: {worst.times:.3g} times its neighbours' in run"
        f" {waves[worst.run].run_id or worst.run} at {worst.time_s:.6g} s; look at its samples for"
        " a clipped top, a burst or a knock"
    )
