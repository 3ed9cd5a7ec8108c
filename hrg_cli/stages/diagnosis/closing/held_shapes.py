"""Diagnosis, what a cause's held shape leaves unknown: a power that the catalogue fixes is one of
several that the data may allow, and every number beside it goes with it. The cause's own size is
that at the power named beside it: at another it is another number, in another unit of the
amplitude.

With χ²(p) about the held power p₀ taken as a parabola through p₀ − 1, p₀ and p₀ + 1, and a prior of
one, the power is p₀ + d ± σ, σ = (χ²″/2 + 1)^−½. The model refitted at √(d² + σ²) from p₀, on the
side of d, shows by how much each number may be off.
"""

from __future__ import annotations

import contextlib

import numpy as np

from ....fitting.causes import extended_fit, fit_point
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.causes.scales import measure_amplitude

SHAPE = "power"
"""Name of a parameter that sets a cause's shape and not its size."""


def refit_one_sigma_off(fit: ExtendedFit, inflation: float) -> dict[str, ExtendedFit]:
    """Refits of a model with the held power of each cause that has one moved by one σ.

    Parameters
    ----------
    fit
        The final one.
    inflation
        Of its variances.

    Returns
    -------
    dict
        By the cause's name; none of a cause without a power, or without such a fit.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.closing.held_shapes import refit_one_sigma_off
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> refit_one_sigma_off(draw_fit(), 1.0)
    {}
    """
    return {
        effect.name: moved
        for effect, values in fit.point.active
        if any(p.name == SHAPE and not p.fitted for p in effect.parameters)
        and (moved := _moved(fit, effect.name, values[SHAPE], inflation)) is not None
    }


def _moved(fit: ExtendedFit, name: str, power: float, inflation: float) -> ExtendedFit | None:
    below, above = (_refit_with_power(fit, name, power + step) for step in (-1.0, 1.0))
    if below is None or above is None:
        return above or below
    less, more = (below.chi2 - fit.chi2) / inflation, (above.chi2 - fit.chi2) / inflation
    # χ²″/2 of the parabola, and the prior of one
    curvature = max((less + more) / 2, 0.0) + 1.0
    best = (less - more) / 4 / curvature
    return _refit_with_power(
        fit, name, power + float(np.copysign(np.hypot(best, curvature**-0.5), best))
    )


def _refit_with_power(fit: ExtendedFit, name: str, power: float) -> ExtendedFit | None:
    """The model refitted with another power of a cause."""
    effect, values = next(pair for pair in fit.point.active if pair[0].name == name)
    # begun at the same strength at the runs' own amplitude, whatever that is in its unit
    more = measure_amplitude(fit.series) ** (values[SHAPE] - power)
    start = {
        p.name: values[p.name] * (more if p.amplitude_power else 1.0) for p in effect.parameters
    }
    with contextlib.suppress(extended_fit.DivergedError):
        point = fit_point.add_effect(fit.point, effect, {**start, SHAPE: power})
        again = extended_fit.fit(fit.series, point, fit.freedom, near=fit.flow.near)
        return again if again.converged else None
    return None
