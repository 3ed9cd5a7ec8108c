"""Three short runs of one sound gyro, the base model's fit to them and their case, for examples and
trials by hand."""

from __future__ import annotations

import functools

from ...effects import find
from ...fitting.causes.extended_fit import ExtendedFit
from ...records import Wave
from ..rehearsing.drawn_input import draw_input
from .base.joint_fit import fit_base
from .fits.variants import list_variants
from .search.inquiry import Inquiry
from .search.search_case import Case
from .search.selection import select

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
    return fit_base(draw_waves(), scale_factor=None, blocks=100, free_phase=False)


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
    inquiry = Inquiry(tuple(list_variants([find("gain_mismatch")], draw_fit())), most=1)
    return Case(inquiry, select(draw_fit(), inquiry))
