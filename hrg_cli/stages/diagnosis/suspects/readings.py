"""Readings of one run: mistakes that could have made it what it is, each undone on its wave, with
what of it was free to choose."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....errors import HrgError
from ....fitting.causes import extended_fit
from ....fitting.causes.coordinate_priors import CoordinatePriors
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.envelopes.coordinates import COORDINATES, COUNT
from ....fitting.parabola import fit_parabola
from ....records import Array, Wave
from ..base.data import prepare
from ..fits.refits import hold_effect
from ..samples.jumps import find_jumps
from ..thresholds import SURE_ROTATION
from . import transformations as change

CLOCK = "sampling rate wrong"
DAMPING, SCALE_FACTOR = "damping", "scale_factor"
KNOCK = 6
"""Numbers that a knock takes: a state and a frequency after it, and its instant."""
TIME_LEAST = 3e-4
"""Relative difference of two frequencies that a clock may make and a temperature hardly."""
TRIALS = 13
SHARPENED = 2
"""Rounds in which the factor of a clock is taken from the run's fitted frequency: the rates beside
it change by the factor, of which the second round takes what that moved."""
LATEST, FINEST = 0.2, 1e-3
"""Parts of the run by which a log may be late, and to which that is found."""
LARGEST_GAIN, LARGEST_LEAD_RAD = 20.0, 3.0
"""What one channel's amplifier may multiply by, or be late by, in one run and not in the others."""


@dataclass(frozen=True)
class Reading:
    """One mistake undone: short name, the pieces in place of the run, parameters chosen for it,
    what was found, what to do."""

    what: str
    pieces: tuple[Wave, ...]
    parameters: int
    found: str
    correction: str
    degc_apart: float = np.inf
    """Its mean temperature's distance from the other runs'; infinite where no thermometer is
    doubted."""


def fit_held(
    waves: Sequence[Wave],
    others: ExtendedFit,
    free: Sequence[str] = (),
    *,
    causes_free: bool = False,
) -> ExtendedFit:
    """Runs beside one another, their starts and frequencies fitted, all else as in the others.

    Ways that one run may have been stand beside one another, so that a cause fitted to all of them
    would be bent by the wrong ones.

    Parameters
    ----------
    waves
        Of the runs.
    others
        The others' fit, whose coordinates are held.
    free
        Names of the coordinates that are fitted all the same.
    causes_free
        The causes of the others are fitted too.

    Returns
    -------
    ExtendedFit
        With the causes of the others.

    Examples
    --------
    The third run beside the first two, which say of it all but its start and its frequency:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves, fit_waves
    >>> from hrg_cli.stages.diagnosis.suspects.readings import fit_held
    >>> others = fit_waves(draw_waves()[:2])
    >>> held = fit_held(draw_waves()[2:], others)
    >>> held.coordinate("damping") == others.coordinate("damping"), bool(held.chi2 / held.dof < 1.5)
    (True, True)
    """
    series, point, _ = prepare(waves, None, others.series.time_s.shape[1])
    std = np.zeros(COUNT)
    std[[COORDINATES.index(name) for name in free]] = np.inf
    p = others.point.p.copy()
    series = replace(series, free_phase=others.series.free_phase)
    causes = others.point.active
    active = causes if causes_free else tuple((hold_effect(e), values) for e, values in causes)
    return extended_fit.fit(
        series,
        replace(point, p=p, active=active),
        CoordinatePriors(p, std, passive=False),
    )


def compute_misfits(waves: Sequence[Wave], others: ExtendedFit) -> Array:
    """χ² of every one of several ways a run may have been, each beside the others' coordinates;
    infinite where no fit is found.

    Parameters
    ----------
    waves
        One for each of the ways.
    others
        The others' fit, whose coordinates are held.

    Returns
    -------
    ndarray
        χ² (k,) of each.

    Examples
    --------
    The second run as it is, and as though its rate had been logged with the other sign:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.readings import compute_misfits
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import scale_rate
    >>> wave = draw_waves()[1]
    >>> right, wrong = compute_misfits([wave, scale_rate(wave, -1.0)], draw_fit())
    >>> bool(right < 300), bool(wrong > 1e6)
    (True, True)
    """
    with contextlib.suppress(extended_fit.DivergedError, HrgError, np.linalg.LinAlgError):
        fit = fit_held(waves, others)
        return np.bincount(fit.rows[:, 0], fit.residual**2, len(waves))
    return np.full(len(waves), np.inf)


def _misfit_of_row(wave: Wave, others: ExtendedFit) -> float:
    """χ² a row of a way that a run may have been: of ways that leave different rows."""
    return float(compute_misfits([wave], others)[0]) / max(1, len(wave))


def estimate_own(wave: Wave, others: ExtendedFit, coordinate: str) -> tuple[float, float] | None:
    """A coordinate as this run alone shows it beside the others' values, and its σ; None where the
    fit finds no end.

    Parameters
    ----------
    wave
        Of the run.
    others
        The others' fit, whose coordinates are held.
    coordinate
        Its name.

    Returns
    -------
    tuple of float or None
        In the unit of the coordinate.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.readings import estimate_own
    >>> value, std = estimate_own(draw_waves()[1], draw_fit(), "scale_factor")
    >>> round(value, 3), round(std, 5)
    (0.55, 0.00015)
    """
    with contextlib.suppress(extended_fit.DivergedError, HrgError, np.linalg.LinAlgError):
        fit = fit_held([wave], others, [coordinate])
        return fit.coordinate(coordinate), fit.coordinate_std(coordinate)
    return None


def find_channel_mistakes(wave: Wave, others: ExtendedFit) -> Iterator[Reading]:
    """Channels exchanged or inverted.

    Parameters
    ----------
    wave
        Of the run that is doubted.
    others
        The others' fit, whose coordinates are held.

    Returns
    -------
    iterator of Reading
        Three, without a free number.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.readings import (
    ...     compute_misfits,
    ...     find_channel_mistakes,
    ... )
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import swap_channels
    >>> swapped = swap_channels(draw_waves()[1])
    >>> made = find_channel_mistakes(swapped, draw_fit())
    >>> min(made, key=lambda one: compute_misfits(one.pieces, draw_fit())[0]).what
    'channels swapped'
    """

    def likelier(mirrored: Wave) -> Wave:
        # a recorder that exchanges channels leaves the loops' log as it was; cables that do so
        # before the board mirror what it commands as well
        if wave.drive_quadrature is None:
            return mirrored
        ways = [mirrored, change.invert_quadrature_drive(mirrored)]
        return ways[int(np.argmin(compute_misfits(ways, others)))]

    yield Reading(
        "channels swapped",
        (likelier(change.swap_channels(wave)),),
        0,
        "with C and S exchanged",
        "exchange the columns of C and S of this run and import it anew",
    )
    yield Reading(
        "one channel inverted",
        (likelier(change.invert_channel(wave)),),
        0,
        "with one channel's sign turned",
        "turn the sign of one channel of this run (a negative scale factor) and import it anew",
    )
    yield Reading(
        "channels swapped and one inverted",
        (change.swap_and_invert(wave),),
        0,
        "with C and S exchanged and one of them turned",
        "exchange C and S of this run, turn the sign of one and import it anew",
    )


def find_amplifier_mistakes(wave: Wave, others: ExtendedFit) -> Iterator[Reading]:
    """One channel read with another gain, or later, than in the other runs.

    Parameters
    ----------
    wave
        Of the run that is doubted.
    others
        The others' fit, whose coordinates are held.

    Returns
    -------
    iterator of Reading
        At most two, of one number each.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.readings import find_amplifier_mistakes
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import scale_channel
    >>> next(find_amplifier_mistakes(scale_channel(draw_waves()[1], 2.0), draw_fit())).found[:43]
    'its C is read 2 times as large beside S as '
    """

    def scale(logarithm: float) -> Wave:
        return change.scale_channel(wave, np.exp(-logarithm))

    def delay(lead_rad: float) -> Wave:
        return change.scale_channel(wave, np.exp(-1j * lead_rad))

    logarithm = find_least_misfit(scale, others, np.log(LARGEST_GAIN), FINEST)
    if logarithm:
        times = _round_factor(float(np.exp(logarithm)))
        yield Reading(
            "one channel's gain changed",
            (scale(logarithm),),
            1,
            f"its C is read {times} times as large beside S as the others': with that taken back",
            (
                f"divide this run's C by {times}, or multiply its S by it (a range switched, a"
                " contact)"
            ),
        )
    lead = find_least_misfit(delay, others, LARGEST_LEAD_RAD, FINEST)
    if lead:
        late_s = abs(lead) / (2 * np.pi * float(np.median(others.frequency_hz)))
        channel = "S" if lead > 0 else "C"
        yield Reading(
            "one channel late",
            (delay(lead),),
            1,
            f"its {channel} comes {abs(lead):.4g} rad of the oscillation ({late_s:.4g} s) late"
            " beside the others': with that taken back",
            f"shift this run's {channel} by {late_s:.4g} s, or sample both channels together",
        )


def find_time_mistakes(
    wave: Wave, others: ExtendedFit, least: float = TIME_LEAST
) -> Iterator[Reading]:
    """A sampling rate that is not the recording's.

    Parameters
    ----------
    wave
        Of the run that is doubted.
    others
        The others' fit, whose coordinates are held.
    least
        Relative difference of the frequencies from which it is asked for.

    Returns
    -------
    iterator of Reading
        At most one, where the run oscillates beside the others.

    Examples
    --------
    A run imported with times too long by 1 %:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.readings import find_time_mistakes
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import scale_times
    >>> slow = scale_times(draw_waves()[1], 1.01)
    >>> [one.found[:39] for one in find_time_mistakes(slow, draw_fit())]
    ['with all its times multiplied by 0.9900']
    """
    hz = float(np.median(others.frequency_hz))
    own = wave.reference_frequency_hz + float(np.median(_turning_hz(wave)))
    factor = own / hz
    if abs(factor - 1) < least or not 1e-2 < factor < 1e2:
        return
    # logs of the samples' own clock go with them; those of another keep their times
    ways = (change.scale_times, change.scale_times_of_samples)
    scale = ways[int(np.argmin([_misfit_of_row(way(wave, factor), others) for way in ways]))]
    factor = _sharpen_factor(lambda by: scale(wave, by), others, factor)
    yield Reading(
        CLOCK,
        (scale(wave, factor),),
        1,
        f"with all its times multiplied by {factor:.6g} (it oscillates at {factor * hz:.6g} Hz, the"
        f" others at {hz:.6g} Hz)",
        f"correct the sampling rate of this run: divide it by {factor:.6g}",
    )


def _sharpen_factor(scaled: Callable[[float], Wave], others: ExtendedFit, factor: float) -> float:
    """The factor of a run's times with which it has the others' frequency beside the same splits:
    a wave's own turning is the frequency only up to the split."""
    hz = float(np.median(others.frequency_hz))
    for _ in range(SHARPENED):
        with contextlib.suppress(extended_fit.DivergedError, HrgError, np.linalg.LinAlgError):
            factor *= float(fit_held([scaled(factor)], others).frequency_hz[0]) / hz
    return factor


def _turning_hz(wave: Wave) -> Array:
    good = wave.good()
    t, phase = np.asarray(wave.time_s, float)[good], np.asarray(wave.phase_rad, float)[good]
    return np.asarray(np.diff(phase) / np.diff(t) / (2 * np.pi))


def find_rate_mistakes(wave: Wave, others: ExtendedFit) -> Iterator[Reading]:
    """A rate log of another sign, unit or size, late, or none.

    Parameters
    ----------
    wave
        Of the run that is doubted.
    others
        The others' fit, whose coordinates are held.

    Returns
    -------
    iterator of Reading
        None of a gyro that feels no rate.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_wrong_waves
    >>> from hrg_cli.stages.diagnosis.suspects.readings import find_rate_mistakes
    >>> for one in find_rate_mistakes(draw_wrong_waves()[2], draw_fit()):
    ...     print(one.what)
    rate log of wrong sign
    rate log in °/s
    rate log of wrong scale
    """
    common = others.coordinate(SCALE_FACTOR)
    if not abs(common) > 0:  # a gyro that feels no rate says nothing of a log
        return
    turning = is_turning(wave)
    varies = has_varying_rate(wave)
    if turning:
        yield from _of_the_rates_size(wave, others, common)
    if not turning or varies:
        yield from _of_a_constant_rate(wave, others, common)
    if varies:
        yield from _of_the_rates_clock(wave, others)


def _of_the_rates_size(wave: Wave, others: ExtendedFit, common: float) -> Iterator[Reading]:
    """The log multiplied by −1, by a degree, or by whatever number serves best; `common`: the
    others' scale factor."""
    logged = average_rate(wave)
    yield Reading(
        "rate log of wrong sign",
        (change.scale_rate(wave, -1.0),),
        0,
        f"{logged:.4g} rad/s is logged, its wave turns as at {-logged:.4g}: with the log's sign"
        " turned",
        "turn the sign of this run's rate log",
    )
    yield Reading(
        "rate log in °/s",
        (change.scale_rate(wave, np.pi / 180),),
        0,
        f"{logged:.4g} is logged, its wave turns as at {np.radians(logged):.4g} rad/s: with the"
        " log read as °/s",
        "import this run's rate log with its unit, °/s",
    )
    factor = _factor_of_log(wave, others, common)
    if factor is not None:
        yield Reading(
            "rate log of wrong scale",
            (change.scale_rate(wave, factor),),
            1,
            f"{logged:.6g} rad/s is logged, its wave turns as at {factor * logged:.6g}: with"
            f" the log multiplied by {_round_factor(factor)}",
            f"multiply this run's rate log by {_round_factor(factor)}, or find its unit",
        )


def _factor_of_log(wave: Wave, others: ExtendedFit, common: float) -> float | None:
    """The number by which the log has to be multiplied for this run to show the others' scale
    factor; None where none is found.

    The fit of the run's own scale factor is linear near its end only, so that it starts from the
    log multiplied by what the mean turn of the wave asks for.
    """
    logged, shown = average_rate(wave), compute_shown_rate(wave, common)
    near = shown / logged if abs(logged) > 0.1 * abs(shown) > 0 else 1.0
    seen = estimate_own(change.scale_rate(wave, near), others, SCALE_FACTOR)
    factor = 0.0 if seen is None else near * seen[0] / common
    return factor if np.isfinite(factor) and factor != 0 else None


def _of_a_constant_rate(wave: Wave, others: ExtendedFit, common: float) -> Iterator[Reading]:
    """A constant rate in the place of no log, or of one that changes with time."""
    shown = compute_shown_rate(wave, common)
    seen = estimate_own(change.hold_rate(wave, shown), others, SCALE_FACTOR) if shown else None
    if seen is None or not abs(seen[0]) > SURE_ROTATION * seen[1]:
        return
    rate = shown * seen[0] / common
    logged = "no rate" if wave.rate_rad_s is None else f"{average_rate(wave):.4g} rad/s"
    yield Reading(
        "rate log missing" if not is_turning(wave) else "rate log of another run",
        (change.hold_rate(wave, rate),),
        1,
        f"{logged} is logged, its wave turns as at {rate:.4g}"
        f"{' rad/s' if wave.rate_rad_s is None else ''}: with that constant rate",
        "add the rate that was turned to this run's log, or leave the run out",
    )


def _of_the_rates_clock(wave: Wave, others: ExtendedFit) -> Iterator[Reading]:
    """The log earlier or later than the wave."""
    late = _lateness(wave, others)
    if late is None:
        return
    yield find_late_log_mistakes("rate log", change.advance_rate(wave, late), late)


def find_late_log_mistakes(log: str, undone: Wave, late_s: float) -> Reading:
    """A log on a clock beside that of the samples.

    Parameters
    ----------
    log
        What it is called.
    undone
        The run with its log in time.
    late_s
        By which the log comes too late [s]; negative: too early.

    Returns
    -------
    Reading
        Of one number.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_swing
    >>> from hrg_cli.stages.diagnosis.suspects.readings import find_late_log_mistakes
    >>> one = find_late_log_mistakes("rate log", draw_swing(), -0.05)
    >>> one.what, one.found
    ('rate log early', 'with its rate log moved by +0.05 s')
    """
    early = "late" if late_s > 0 else "early"
    return Reading(
        f"{log} {early}",
        (undone,),
        1,
        f"with its {log} moved by {-late_s:+.4g} s",
        f"the {log} comes {abs(late_s):.4g} s too {early}: shift its times, or start both clocks"
        " together",
    )


def _round_factor(factor: float) -> str:
    """A factor to four digits of it, or to three of what it is beside one."""
    apart = abs(factor - 1)
    digits = 4 if apart == 0 else max(4, min(12, 3 - int(np.floor(np.log10(apart)))))
    return f"{factor:.{digits}g}"


def average_rate(wave: Wave) -> float:
    """Mean logged rate; 0 where none is logged.

    Parameters
    ----------
    wave
        Of the run.

    Returns
    -------
    float
        [rad/s].

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.readings import average_rate
    >>> [round(average_rate(wave), 6) for wave in draw_waves()]
    [0.0, 1.0, -1.0]
    """
    rates = None if wave.rate_rad_s is None else np.asarray(wave.rate_rad_s, float)
    return 0.0 if rates is None or not np.isfinite(rates).any() else float(np.nanmean(rates))


def compute_shown_rate(wave: Wave, scale_factor: float) -> float:
    """Mean rate that the wave angle shows, −m·θ̇/K, from which the fit starts.

    Parameters
    ----------
    wave
        Of the run.
    scale_factor
        K.

    Returns
    -------
    float
        [rad/s].

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.readings import compute_shown_rate
    >>> [round(compute_shown_rate(wave, 0.55), 2) for wave in draw_waves()[1:]]
    [1.0, -1.0]
    """
    good = wave.good()
    t, angle = np.asarray(wave.time_s, float)[good], np.asarray(wave.wave_angle_rad, float)[good]
    slope = float(np.polyfit(t, angle, 1)[0])
    return -wave.mode_number * slope / scale_factor


def is_turning(wave: Wave) -> bool:
    """Whether any rate but zero is logged.

    Parameters
    ----------
    wave
        Of the run.

    Returns
    -------
    bool
        False of a run that logs none.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.readings import is_turning
    >>> [is_turning(wave) for wave in draw_waves()]
    [False, True, True]
    """
    return wave.rate_rad_s is not None and bool(
        np.nanmax(np.abs(np.where(np.isfinite(wave.rate_rad_s), wave.rate_rad_s, 0.0))) > 0
    )


def is_log_stuck(wave: Wave, others: Sequence[Wave]) -> bool:
    """Whether a run's rate log holds one value to the last digit, while those of other runs change.

    Parameters
    ----------
    wave
        Of the run.
    others
        Of the other runs.

    Returns
    -------
    bool
        A table that is held at a rate may show one value, too.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_swing, draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.readings import is_log_stuck
    >>> is_log_stuck(draw_waves()[1], [draw_swing()]), is_log_stuck(draw_swing(), draw_waves())
    (True, False)
    """
    if not is_turning(wave):
        return False
    rate = np.asarray(wave.rate_rad_s, float)
    held = float(np.nanmax(rate) - np.nanmin(rate)) <= 1e-9 * float(np.nanmax(np.abs(rate)))
    return held and any(has_varying_rate(other) for other in others)


def has_varying_rate(wave: Wave) -> bool:
    """Whether a rate is logged that is not one constant.

    Parameters
    ----------
    wave
        Of the run.

    Returns
    -------
    bool
        By more than 2 % of the largest.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_swing, draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.readings import has_varying_rate
    >>> has_varying_rate(draw_waves()[1]), has_varying_rate(draw_swing())
    (False, True)
    """
    if not is_turning(wave):
        return False
    rate = np.asarray(wave.rate_rad_s, float)
    rate = rate[np.isfinite(rate)]
    return bool(np.ptp(rate) > 0.02 * np.abs(rate).max())


def _lateness(wave: Wave, others: ExtendedFit) -> float | None:
    """By how much the log is late."""
    span = float(wave.time_s[-1] - wave.time_s[0])
    return find_least_misfit(
        lambda late: change.advance_rate(wave, late), others, LATEST * span, FINEST * span
    )


def find_least_misfit(
    made: Callable[[float], Wave], others: ExtendedFit, reach: float, finest: float
) -> float | None:
    """The number within ± `reach` with which a wave made by it misfits least.

    Parameters
    ----------
    made
        The wave of a number.
    others
        The others' fit, whose coordinates are held.
    reach
        Farthest number tried.
    finest
        Spacing of the trials at which the parabola is laid.

    Returns
    -------
    float or None
        None where no fit is found.

    Examples
    --------
    A rate logged as half of what it was, and what is to be added to a factor of 1:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.readings import find_least_misfit
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import scale_rate
    >>> half = scale_rate(draw_waves()[1], 0.5)
    >>> round(find_least_misfit(lambda x: scale_rate(half, 1 + x), draw_fit(), 2.0, 0.01), 2)
    1.0
    """
    return search_least(
        lambda trials: compute_misfits([made(float(x)) for x in trials], others), reach, finest
    )


def search_least(
    compute_each: Callable[[Array], Array], reach: float, finest: float
) -> float | None:
    """The number within ± `reach` of the least of a function of many numbers at once.

    Trials side by side, finer and finer, then a parabola.

    Parameters
    ----------
    compute_each
        Of numbers (k,), its values (k,).
    reach
        Farthest number tried.
    finest
        Spacing of the trials at which the parabola is laid.

    Returns
    -------
    float or None
        None where the least value found is infinite.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.suspects.readings import search_least
    >>> round(search_least(lambda x: (x - 0.3) ** 2, reach=1.0, finest=0.01), 6)
    0.3
    """
    best = 0.0
    while True:
        trials = best + reach * np.linspace(-1, 1, TRIALS)
        values = compute_each(trials)
        k = int(np.argmin(values))
        if not np.isfinite(values[k]):
            return None
        best, step = float(trials[k]), float(trials[1] - trials[0])
        if step < finest:
            break
        reach = 1.5 * step
    if 0 < k < len(trials) - 1:
        parabola = fit_parabola(*values[k - 1 : k + 2])
        best += parabola.lowest * step if parabola else 0.0
    return best


def fit_own_damping(wave: Wave, others: ExtendedFit) -> tuple[float, float] | None:
    """The damping rate that this run alone shows beside the others' splits and scale factor, and
    its σ.

    Parameters
    ----------
    wave
        Of the run.
    others
        The others' fit, whose coordinates are held.

    Returns
    -------
    tuple of float or None
        ν and its σ [1/s].

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.readings import fit_own_damping
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import undo_damping
    >>> damping, std = fit_own_damping(undo_damping(draw_waves()[1], -0.1), draw_fit())
    >>> round(damping, 2), bool(std < 1e-3)
    (0.6, True)
    """
    return estimate_own(wave, others, DAMPING)


def find_damping_mistakes(wave: Wave, others: ExtendedFit) -> Iterator[Reading]:
    """Another damping and nothing else: the vacuum.

    Parameters
    ----------
    wave
        Of the run that is doubted.
    others
        The others' fit, whose coordinates are held.

    Returns
    -------
    iterator of Reading
        At most one.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.readings import find_damping_mistakes
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import undo_damping
    >>> leaking = undo_damping(draw_waves()[1], -0.1)
    >>> [(one.what, one.found[:20]) for one in find_damping_mistakes(leaking, draw_fit())]
    [('loss of pressure', 'its damping is 0.599')]
    """
    seen = fit_own_damping(wave, others)
    common = others.coordinate(DAMPING)
    if seen is None or not np.isfinite(seen[0]):
        return
    changed = seen[0] - common
    yield Reading(
        "damping changed" if changed < 0 else "loss of pressure",
        (change.undo_damping(wave, changed),),
        1,
        f"its damping is {seen[0]:.5g} 1/s, the others' {common:.5g}: with that alone its own",
        (
            "check the vacuum between the runs: gas damping; calibrate these runs apart"
            if changed > 0
            else "calibrate this run apart"
        ),
    )


def find_knock_mistakes(wave: Wave) -> Iterator[Reading]:
    """Momentum at an instant, or several.

    Parameters
    ----------
    wave
        Of the run that is doubted.

    Returns
    -------
    iterator of Reading
        At most one, its pieces the run between the knocks.

    Examples
    --------
    A wave that a knock turns by 0.1 rad behind its 25th window:

    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.readings import find_knock_mistakes
    >>> wave = draw_waves()[1]
    >>> knocked = wave.replace(wave_angle_rad=wave.wave_angle_rad + 0.1 * (np.arange(50) > 24))
    >>> [(one.what, [len(piece) for piece in one.pieces]) for one in find_knock_mistakes(knocked)]
    [('knock', [25, 25])]
    """
    found = [jump for jump in find_jumps(wave) if jump.knock]
    if not found:
        return
    pieces, rest = [], wave
    shift = 0
    for jump in found:
        first, rest = change.cut_rows(rest, jump.before - shift, jump.after - shift)
        shift = jump.after
        pieces.append(first)
    pieces.append(rest.replace(run_id=f"{wave.run_id} after"))
    instants = ", ".join(f"{jump.time_s:.6g} s" for jump in found)
    yield Reading(
        "knock",
        tuple(piece for piece in pieces if np.count_nonzero(piece.good()) >= 8),
        KNOCK * len(found),
        f"at {instants} amplitude, angle, quadrature and phase jump together and before and after"
        " it moves as the others do: cut there",
        f"cut the run at {instants}, or simulate the knock as momentum_kick",
    )
