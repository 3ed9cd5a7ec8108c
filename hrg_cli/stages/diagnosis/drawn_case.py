"""Three short runs of one sound gyro, the base model's fit to them and their case, for examples and
trials by hand."""

from __future__ import annotations

import functools
from collections.abc import Sequence

import numpy as np

from ...effects import find
from ...fitting.causes import extended_fit, fit_point
from ...fitting.causes.extended_fit import ExtendedFit
from ...records import Wave
from ..rehearsing.drawn_input import draw_input
from .base.joint_fit import fit_base
from .fits.variants import list_variants
from .search.inquiry import Inquiry
from .search.search_case import Case
from .search.selection import select
from .suspects.transformations import scale_channel, scale_rate

SWING_RAD_S, SCALE_FACTOR = 0.5, 0.55
DAMPING_1_S, CUBIC_1_S = 0.5, 0.05
RATES_RAD_S = (0.0, 1.0, -1.0)


@functools.cache
def draw_waves() -> tuple[Wave, ...]:
    """Free run-downs of 1 s at rest and turning either way at 1 rad/s, 500 Hz, noise of 10⁻³.

    Returns
    -------
    tuple of Wave
        50 windows each, 20 ms apart, with the rate logged.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> [(len(wave), float(wave.rate_rad_s[0].round(3))) for wave in draw_waves()]
    [(50, 0.0), (50, 1.0), (50, -1.0)]
    """
    return tuple(draw_input(rate, seed).wave for seed, rate in enumerate(RATES_RAD_S))


@functools.cache
def draw_fit() -> ExtendedFit:
    """The base model's fit to them.

    Returns
    -------
    ExtendedFit
        Of linear damping, splits and scale factor, without any cause.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> fit = draw_fit()
    >>> fit.converged, bool(fit.chi2 / fit.dof < 1.5), round(fit.coordinate("scale_factor"), 2)
    (True, True, 0.55)
    """
    return fit_waves(draw_waves())


def fit_waves(waves: Sequence[Wave], *, quick: bool = False) -> ExtendedFit:
    """The base model fitted to waves, as the search for wrong runs asks for it again and again.

    Parameters
    ----------
    waves
        Of the runs.
    quick
        Beside nothing that a drive's log may have missed.

    Returns
    -------
    ExtendedFit
        Without any cause.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves, fit_waves
    >>> round(fit_waves(draw_waves()[1:]).coordinate("damping"), 2)
    0.5
    """
    return fit_base(waves, scale_factor=None, blocks=100, free_phase=False, quick=quick)


@functools.cache
def draw_wrong_waves() -> tuple[Wave, ...]:
    """The same three runs, of which the last, "third", logs its rate with the other sign.

    Returns
    -------
    tuple of Wave
        As draw_waves gives them but for that.

    Examples
    --------
    No scale factor serves all three:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_wrong_waves, fit_waves
    >>> fit = fit_waves(draw_wrong_waves())
    >>> bool(fit.chi2 / fit.dof > 1e4)
    True
    """
    *right, last = draw_waves()
    return *right, scale_rate(last, -1.0).replace(run_id="third")


def draw_swing(late_s: float = 0.0) -> Wave:
    """The second run on a table that swings by 0.5 rad/s at 1 Hz about its rate of 1 rad/s.

    Without splits the wave turns by −K ∫Ω dt/m more and does nothing else.

    Parameters
    ----------
    late_s
        By which the rate's log comes too late [s].

    Returns
    -------
    Wave
        Of 50 windows.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_swing, draw_waves, fit_waves
    >>> waves = draw_waves()[0], draw_swing(), draw_waves()[2]
    >>> fit = fit_waves(waves)
    >>> bool(fit.chi2 / fit.dof < 1.5), round(fit.coordinate("scale_factor"), 2)
    (True, 0.55)
    """
    wave = draw_waves()[1]
    turn = 2 * np.pi * wave.time_s
    return wave.replace(
        run_id="swing",
        rate_rad_s=RATES_RAD_S[1] + SWING_RAD_S * np.sin(turn - 2 * np.pi * late_s),
        wave_angle_rad=wave.wave_angle_rad
        - SCALE_FACTOR / wave.mode_number * SWING_RAD_S * (1 - np.cos(turn)) / (2 * np.pi),
    )


@functools.cache
def draw_case() -> Case:
    """The case of these runs, of which a gain mismatch alone was asked for.

    Returns
    -------
    Case
        Nothing is found, and nothing left over.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_case
    >>> case = draw_case()
    >>> list(case.search.found), case.remainder
    ([], None)
    """
    return _explain_by_gains(draw_fit())


@functools.cache
def draw_mismatched_fit() -> ExtendedFit:
    """The base model's fit to the same runs read with a gain of C that is 2 % beside that of S.

    Returns
    -------
    ExtendedFit
        Without any cause.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_mismatched_fit
    >>> fit = draw_mismatched_fit()
    >>> round(fit.chi2 / fit.dof, 1)
    2.4
    """
    return fit_waves([scale_channel(wave, 1.02) for wave in draw_waves()])


@functools.cache
def draw_found_case() -> Case:
    """The case of the runs of that mismatch, of which it alone was asked for.

    Returns
    -------
    Case
        A gain mismatch is found, and nothing left over.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_found_case
    >>> search = draw_found_case().search
    >>> [(one.score.name, search.final.values(one.score.name)) for one in search.found]
    [('gain_mismatch', {'gain': 0.0203...})]
    """
    return _explain_by_gains(draw_mismatched_fit())


def _explain_by_gains(fit: ExtendedFit) -> Case:
    """The case of runs of which a gain mismatch alone is asked for."""
    inquiry = Inquiry(tuple(list_variants([find("gain_mismatch")], fit)), most=1)
    return Case(inquiry, select(fit, inquiry))


@functools.cache
def draw_knocked_fit() -> ExtendedFit:
    """The base model's fit to the same runs, the wave of the second turned by 1 mrad at 0.5 s.

    Returns
    -------
    ExtendedFit
        Without any cause.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_knocked_fit
    >>> fit = draw_knocked_fit()
    >>> round(fit.chi2 / fit.dof, 1)
    1.3
    """
    first, second, third = draw_waves()
    turn = 1e-3 * (second.time_s > 0.5)
    return fit_waves([first, second.replace(wave_angle_rad=second.wave_angle_rad + turn), third])


@functools.cache
def draw_case_of_four() -> Case:
    """The case of that mismatch in four runs, of which whole ones can be held out.

    Returns
    -------
    Case
        The three runs, and another at rest.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_case_of_four
    >>> len(draw_case_of_four().search.final.series.names)
    4
    """
    waves = *draw_waves(), draw_input(0.0, seed=3).wave
    return _explain_by_gains(fit_waves([scale_channel(wave, 1.02) for wave in waves]))


@functools.cache
def draw_nonlinear_fit() -> ExtendedFit:
    """The fit with a nonlinear damping to the same runs, damped by ν + ν₂a² with ν₂ = 0.05 1/s.

    A wave without quadrature falls as e^{−νt}(1 + ν₂(1 − e^{−2νt})/ν)^{−1/2} from 1.

    Returns
    -------
    ExtendedFit
        With that cause alone.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_nonlinear_fit
    >>> fit = draw_nonlinear_fit()
    >>> round(fit.values("nonlinear_damping")["damping_1_s"], 2), bool(fit.chi2 / fit.dof < 1.5)
    (0.05, True)
    """
    ratio = CUBIC_1_S / DAMPING_1_S
    waves = [
        wave.replace(
            main_amplitude=wave.main_amplitude
            / np.sqrt(1 - ratio * np.expm1(-2 * DAMPING_1_S * wave.time_s))
        )
        for wave in draw_waves()
    ]
    base, effect = fit_waves(waves), find("nonlinear_damping")
    point = fit_point.add_effect(base.point, effect, effect.values())
    return extended_fit.fit(base.series, point, base.freedom)
