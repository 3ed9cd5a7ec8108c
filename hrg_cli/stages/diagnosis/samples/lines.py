"""Diagnosis, lines of the residual spectrum: which are the oscillation's own harmonics, which
follow the wave, which stand on their own.

All is measured in the spectrum's cells and in the oscillation's frequency. A tone from outside has
the same size whatever the wave's; a partial or a harmonic follows it; a converter puts odd
harmonics of any order, folded, where a cubic has the third and clipping a few.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ....effects.effect import Effect
from ....errors import name_some
from ....fitting.samples.frequency import fold
from ....records import Array, Wave
from ..base.data import is_mostly_rounding
from ..thresholds import BY_CHANCE, FOLLOWS_WAVE, LINE_RATIO

WIDTH_CELLS = 1.5
"""Cells of the spectrum within which two lines are one."""
WANDER = 1e-4
"""Part of its frequency that a line may differ from run to run."""
HARMONICS = 25
"""Highest multiple of the oscillation that is looked for on its own."""
ORDERS = (25, 51, 101, 201, 401)
"""Highest odd orders that a converter's harmonics are looked for to."""
FEWEST_SPURS = 4
"""Odd harmonics from which a converter is thought of."""
SAME_STEP = 1e-9
"""Part of a sampling step to which two runs' agree."""
COUNTED = 1e-3
"""Distance from a whole number that the samples between two windows may have."""
SPREAD = 1.2
"""Ratio of the runs' amplitudes from which a line's size can be held against them."""


@dataclass(frozen=True)
class Line:
    """A line: frequency, amplitudes of C and S, power over the floor, runs that show it, its
    amplitude and the wave's in each (n, 2)."""

    frequency_hz: float
    amplitude: Array
    ratio: float
    runs: int
    by_run: Array

    @property
    def std(self) -> Array:
        """σ of the amplitudes: of power ratio r the larger is known to 1/√2r of itself, and the
        other no better."""
        return np.full(2, self.amplitude.max() / np.sqrt(2 * self.ratio))

    @property
    def follows_the_wave(self) -> bool:
        """Whether its size goes with the wave's from run to run rather than stays."""
        size, wave = self.by_run.T
        if len(size) < 2 or wave.max() < SPREAD * wave.min():
            return False
        weight = 2 * self.ratio / size**2

        def misfit(shape: Array) -> float:
            scale = float(np.sum(weight * size * shape) / np.sum(weight * shape**2))
            return float(np.sum(weight * (size - scale * shape) ** 2))

        return misfit(wave) + FOLLOWS_WAVE < misfit(np.ones(len(size)))

    def make_entry(self, multiple: int, meaning: str) -> dict[str, Any]:
        """The line as the report lists it."""
        return {
            "frequency_hz": self.frequency_hz,
            "amplitude": [float(a) for a in self.amplitude],
            "power_over_floor": self.ratio,
            "multiple": multiple or None,
            "meaning": meaning,
        }


def find_cell_hz(waves: Sequence[Wave]) -> float:
    """Distance of two cells of the runs' averaged spectra.

    Parameters
    ----------
    waves
        Of the runs.

    Returns
    -------
    float
        [Hz], the median of the runs; 0 where there is no spectrum.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.lines import find_cell_hz
    >>> round(find_cell_hz(draw_waves()), 6)
    4.0
    """
    grids = [w.spectrum_frequency_hz for w in waves if w.spectrum_frequency_hz is not None]
    cells = [np.diff(grid).mean() for grid in grids if len(grid) > 1]
    return float(np.median(cells)) if cells else 0.0


def find_sampling_hz(waves: Sequence[Wave]) -> float | None:
    """Sampling rate, twice the end of the spectrum.

    Parameters
    ----------
    waves
        Of the runs.

    Returns
    -------
    float or None
        [Hz], of the first run with a spectrum; None where there is none.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.lines import find_sampling_hz
    >>> round(find_sampling_hz(draw_waves()), 6)
    2000.0
    """
    ends = [
        float(w.spectrum_frequency_hz[-1])
        for w in waves
        if w.spectrum_frequency_hz is not None and len(w.spectrum_frequency_hz)
    ]
    return 2 * ends[0] if ends else None


def find_even_step(wave: Wave) -> float | None:
    """Sampling step of an evenly sampled run, whose windows are then all equally far apart.

    Parameters
    ----------
    wave
        Of the run.

    Returns
    -------
    float or None
        [s]; None where the sampling is uneven, or nothing tells it.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.lines import find_even_step
    >>> round(find_even_step(draw_waves()[0]), 9)
    0.0005
    """
    rate = find_sampling_hz([wave])
    steps = np.diff(np.asarray(wave.time_s, float))
    regular = (
        len(steps) > 0
        and float(np.abs(steps / np.median(steps) - np.round(steps / np.median(steps))).max())
        < 1e-6
    )
    if not rate or not regular or wave.spectrum_frequency_hz is None:
        return None
    # windows are a whole number of samples apart, where the samples are even; a spectrum of an odd
    # number of samples ends half a cell below half the sampling rate
    odd = 2 * len(wave.spectrum_frequency_hz) - 1
    apart = float(np.median(steps))
    for samples in (apart * rate, apart * rate * odd / (odd - 1)):
        if abs(samples - round(samples)) < COUNTED and round(samples) > 0:
            return apart / round(samples)
    return None


def find_common_step(waves: Sequence[Wave]) -> float | None:
    """Sampling step of runs that are all evenly sampled at one rate.

    Parameters
    ----------
    waves
        Of the runs.

    Returns
    -------
    float or None
        [s]; None where one is not.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.lines import find_common_step
    >>> round(find_common_step(draw_waves()), 9)
    0.0005
    """
    steps = [find_even_step(wave) for wave in waves]
    known = [step for step in steps if step is not None]
    alike = len(known) == len(steps) > 0 and max(known) - min(known) < SAME_STEP * max(known)
    return known[0] if alike else None


def find_folding_hz(waves: Sequence[Wave]) -> float | None:
    """Sampling rate at half of which lines of all runs are folded.

    Parameters
    ----------
    waves
        Of the runs.

    Returns
    -------
    float or None
        [Hz]; None where it is not known, or where a run's samples are not evenly apart: a line
        above half the rate then has no image.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.lines import find_folding_hz
    >>> round(find_folding_hz(draw_waves()), 6)
    2000.0
    """
    return (
        find_sampling_hz(waves) if all(find_even_step(wave) is not None for wave in waves) else None
    )


def find_median_amplitude(wave: Wave) -> float:
    """Median main amplitude of the good rows.

    Parameters
    ----------
    wave
        Of a run.

    Returns
    -------
    float
        In the signals' unit; 0 where no row is good.

    Examples
    --------
    Of e^{−t/2 s} over 1 s from 1:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.lines import find_median_amplitude
    >>> round(find_median_amplitude(draw_waves()[0]), 2)
    0.78
    """
    good = wave.good()
    return float(np.median(np.asarray(wave.main_amplitude, float)[good])) if good.any() else 0.0


def find_median_frequency(wave: Wave) -> float:
    """Median frequency of the good rows, from the phase.

    Parameters
    ----------
    wave
        Of a run.

    Returns
    -------
    float
        [Hz]

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.lines import find_median_frequency
    >>> round(find_median_frequency(draw_waves()[0]), 2)
    500.0
    """
    good = wave.good()
    phase, t = np.asarray(wave.phase_rad, float)[good], np.asarray(wave.time_s, float)[good]
    above = float(np.median(np.diff(phase) / np.diff(t))) / (2 * np.pi) if len(t) > 1 else 0.0
    return wave.reference_frequency_hz + above


class _Peak(NamedTuple):
    """A line in the spectrum of one wave: amplitude in either channel (2,), power over what is
    about it, and the wave's number."""

    frequency_hz: float
    amplitude: Array
    ratio: float
    wave: int


def find_lines(waves: Sequence[Wave]) -> list[Line]:
    """Lines that a third of the runs at least show.

    Parameters
    ----------
    waves
        Of the runs, with the lines that demodulation found in their residual's spectrum.

    Returns
    -------
    list of Line
        Strongest first.

    Examples
    --------
    A sound gyro's samples hold none:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.lines import find_lines
    >>> find_lines(draw_waves())
    []
    """
    pool = list[_Peak]()
    for number, wave in enumerate(waves):
        if (
            wave.spectrum_line_frequency_hz is None
            or wave.spectrum_line_ratio is None
            or wave.spectrum_line_amplitude is None
        ):
            continue
        for f, a, ratio in zip(
            wave.spectrum_line_frequency_hz,
            wave.spectrum_line_amplitude,
            wave.spectrum_line_ratio,
            strict=True,
        ):
            if ratio > LINE_RATIO:
                pool.append(_Peak(float(f), np.asarray(a, float), float(ratio), number))
    out, cell = [], find_cell_hz(waves)
    while pool:
        f = max(pool, key=lambda peak: peak.ratio).frequency_hz
        width = WIDTH_CELLS * cell + WANDER * f
        near = [peak for peak in pool if abs(peak.frequency_hz - f) < width]
        pool = [peak for peak in pool if abs(peak.frequency_hz - f) >= width]
        runs = len({peak.wave for peak in near})
        if 3 * runs >= len(waves):
            weight = np.array([peak.ratio for peak in near])
            frequency = float(np.average([peak.frequency_hz for peak in near], weights=weight))
            size = np.array(
                [
                    [float(np.hypot(*peak.amplitude)), find_median_amplitude(waves[peak.wave])]
                    for peak in near
                ]
            )
            out.append(
                Line(
                    frequency,
                    np.sqrt(np.mean([peak.amplitude**2 for peak in near], axis=0)),
                    float(weight.max()),
                    runs,
                    size,
                )
            )
    return out


def list_harmonics(
    line: Line,
    frequency_hz: float,
    sampling: float | None,
    cell: float,
    wander_hz: float | None = None,
) -> list[int]:
    """All multiples of the oscillation, up to `HARMONICS`, that the sampling has at a line's place.

    Parameters
    ----------
    line
        Its frequency counts.
    frequency_hz
        Of the oscillation [Hz].
    sampling
        Rate at half of which lines are folded [Hz]; None: it is not known, and nothing is folded.
    cell
        Distance of two cells of the spectrum [Hz].
    wander_hz
        How far the runs' frequencies may lie apart [Hz]; None: as runs usually do.

    Returns
    -------
    list of int
        From the lowest on.

    Examples
    --------
    With eight samples a period the third stands where the fifth does:

    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.samples.lines import Line, list_harmonics
    >>> line = Line(1500.0, np.ones(2), 1e3, 3, np.ones((3, 2)))
    >>> list_harmonics(line, 500.0, 4000.0, 1.0)[:3]
    [3, 5, 11]
    """
    orders = np.arange(2, HARMONICS + 1)
    wander_hz = 2 * WANDER * frequency_hz if wander_hz is None else wander_hz
    off = np.abs(line.frequency_hz - fold(orders * frequency_hz, sampling))
    near = np.flatnonzero(off < WIDTH_CELLS * cell + orders * wander_hz)
    return [int(order) for order in orders[near]]


def describe_folded(waves: Sequence[Wave], found: Sequence[Effect]) -> str:
    """A sentence on a multiple of the oscillation that the sampling folds next to it.

    It is the lowest odd one that a named cause makes and that the windows do not part from the
    oscillation. The slow model knows a read-out's defect by what it does at the oscillation itself.

    Parameters
    ----------
    waves
        Of the runs.
    found
        Causes that are named.

    Returns
    -------
    str
        Empty where there is none.

    Examples
    --------
    Without a cause that makes harmonics:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.lines import describe_folded
    >>> describe_folded(draw_waves(), [])
    ''
    """
    sampling, makers = find_folding_hz(waves), [e.name for e in found if e.makes_harmonics]
    if not sampling or not makers:
        return ""
    window_s = max(wave.window_s for wave in waves)
    own = float(np.median([find_median_frequency(wave) for wave in waves]))
    for order in range(3, HARMONICS + 1, 2):
        apart = abs(float(fold(order * own, sampling)) - own)
        if apart * window_s < 1:
            return (
                f"multiple {order} of the oscillation, which {makers[0]} makes, is folded to"
                f" {apart:.3g} Hz beside it, which windows of {window_s:.3g} s do not part; sample"
                f" at another rate than {sampling:.6g} Hz"
            )
    return ""


def describe_rounding(waves: Sequence[Wave]) -> str:
    """A sentence on runs whose noise is mostly the converter's rounding, which is noise as far as
    it does not repeat with the wave.

    Parameters
    ----------
    waves
        Of the runs.

    Returns
    -------
    str
        Empty where there is none.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.lines import describe_rounding
    >>> wave = draw_waves()[0]
    >>> describe_rounding([wave])
    ''
    >>> describe_rounding([wave.replace(least_count=1e-3, quantisation_share=0.9)])[:48]
    'rounding to steps of 0.001 makes most of the noi'
    """
    rounded = [wave for wave in waves if is_mostly_rounding(wave)]
    if not rounded:
        return ""
    step = max(float(wave.least_count or 0.0) for wave in rounded)
    names = name_some(dict.fromkeys(wave.run_id or "a run" for wave in rounded))
    return (
        f"rounding to steps of {step:.3g} makes most of the noise of {names}, and repeats with the"
        " wave: what is left may be that; record with dither, more bits or at another rate"
    )


def find_spurs(
    found: Sequence[Line],
    frequency_hz: float,
    wander_hz: float,
    sampling: float | None,
    cell: float,
) -> list[Line]:
    """Lines at odd multiples of the oscillation, of any order, too many for chance.

    Of L lines k meet one of the odd orders up to N by chance with the binomial probability of p = Σ
    2·tolerance/(half the rate).

    Parameters
    ----------
    found
        Lines of the runs.
    frequency_hz
        Of the oscillation [Hz].
    wander_hz
        How far the runs' frequencies lie apart [Hz].
    sampling
        Rate at half of which lines are folded [Hz]; None: it is not known.
    cell
        Distance of two cells of the spectrum [Hz].

    Returns
    -------
    list of Line
        Empty where they are few.

    Examples
    --------
    Eight lines at the odd multiples 5 … 19 of 503 Hz, sampled at 20 kHz:

    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.samples.lines import Line, find_spurs
    >>> lines = [Line(503.0 * n, np.ones(2), 1e3, 3, np.ones((3, 2))) for n in range(5, 20, 2)]
    >>> len(find_spurs(lines, 503.0, 0.01, 20000.0, 1.0))
    8
    """
    from scipy.special import bdtrc

    if sampling is None or len(found) < FEWEST_SPURS:
        return []
    best: tuple[float, list[Line]] = (BY_CHANCE, [])
    places = np.array([line.frequency_hz for line in found])
    for highest in ORDERS:
        orders = np.arange(3, highest + 1, 2)
        reach = WIDTH_CELLS * cell + orders * wander_hz
        chance = float(np.sum(2 * reach) / (sampling / 2))
        if chance > 0.5:
            break
        met = (np.abs(places[:, None] - fold(orders * frequency_hz, sampling)) < reach).any(axis=1)
        count = int(met.sum())
        if count >= FEWEST_SPURS and (p := float(bdtrc(count - 1, len(found), chance))) < best[0]:
            best = p, [line for line, yes in zip(found, met, strict=True) if yes]
    return best[1]
