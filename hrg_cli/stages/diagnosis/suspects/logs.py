"""What the logs show on their own, without any misfit: units and signs that every run shares,
kelvin among °C."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.envelopes.base_freedom import choose_scale_factor
from ....records import Wave
from ....units import RATE_UNITS
from ...kelvin_logs import average_log, find_kelvin_logs
from ...suspicion import Suspicion
from ..samples.lines import find_median_frequency
from ..thresholds import GROSS, SURE_OF_K, USUAL_RANGE

SCALE_FACTOR = "scale_factor"
MISTAKEN = ("°/s", "°/h")
"""Units of a rate log that a scale factor without any misfit shows."""


def find_wrong_logs(waves: Sequence[Wave], fit: ExtendedFit) -> list[Suspicion]:
    """What the logs show on their own, without any misfit.

    Parameters
    ----------
    waves
        Of the runs.
    fit
        Of the model to them.

    Returns
    -------
    list of Suspicion
        Units and signs of the rate logs, and thermometers in K.

    Examples
    --------
    Logs in °/s make the scale factor that of no resonator:

    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves, fit_waves
    >>> from hrg_cli.stages.diagnosis.suspects.logs import find_wrong_logs
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import scale_rate
    >>> waves = [scale_rate(wave, 180 / np.pi) for wave in draw_waves()]
    >>> [one.what for one in find_wrong_logs(waves, fit_waves(waves))]
    ['rate log in °/s']
    """
    return [*_rates(fit), *_temperatures(waves)]


def has_usual_scale_factor(fit: ExtendedFit) -> bool:
    """Whether K is what a resonator of that mode has, or unknown.

    Parameters
    ----------
    fit
        Of a model.

    Returns
    -------
    bool
        Within a factor of 2.5 of the usual one and 5 σ.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves, fit_waves
    >>> from hrg_cli.stages.diagnosis.suspects.logs import has_usual_scale_factor
    >>> from hrg_cli.stages.diagnosis.suspects.transformations import scale_rate
    >>> too_fast = fit_waves([scale_rate(wave, 57.3) for wave in draw_waves()])
    >>> has_usual_scale_factor(draw_fit()), has_usual_scale_factor(too_fast)
    (True, False)
    """
    if fit.layout.coordinate(SCALE_FACTOR) is None:
        return True
    K, std, usual = (
        fit.coordinate(SCALE_FACTOR),
        fit.coordinate_std(SCALE_FACTOR),
        choose_scale_factor(fit.series.mode_number),
    )
    return usual / USUAL_RANGE - SURE_OF_K * std < K < usual * USUAL_RANGE + SURE_OF_K * std


def _rates(fit: ExtendedFit) -> list[Suspicion]:
    """K far from what any resonator of that mode has, by the factor of a unit, or of the other
    sign."""
    if fit.layout.coordinate(SCALE_FACTOR) is None or fit.chi2 / fit.dof > GROSS:
        return []
    K, std = (
        fit.coordinate(SCALE_FACTOR),
        fit.coordinate_std(SCALE_FACTOR) * float(np.sqrt(max(1.0, fit.chi2 / fit.dof))),
    )
    usual = choose_scale_factor(fit.series.mode_number)
    if not abs(K) > SURE_OF_K * std:
        return []
    for unit in MISTAKEN:
        right = abs(K) / RATE_UNITS[unit]
        if usual / USUAL_RANGE < right < usual * USUAL_RANGE:
            return [
                Suspicion(
                    "all runs",
                    f"rate log in {unit}",
                    f"the scale factor comes out as {K:.4g} ± {std:.2g}, {usual:g} is usual;"
                    f" {right:.4g} with the log in {unit}",
                    f"import the rate logs with their unit, {unit}",
                )
            ]
    rates = _rates_of(fit)
    if K < 0 and usual / USUAL_RANGE < abs(K) < usual * USUAL_RANGE and _several_rates(fit):
        return [
            Suspicion(
                "all runs",
                "rate log of wrong sign",
                f"the scale factor comes out as {K:.4g} ± {std:.2g} over rates from"
                f" {rates.min():.3g} to {rates.max():.3g} rad/s",
                "turn the sign of the rate logs, or exchange the channels, where they are swapped"
                " in every run",
            )
        ]
    return []


def _rates_of(fit: ExtendedFit) -> np.ndarray:
    return fit.series.rate_rad_s[fit.series.weight > 0]


def _several_rates(fit: ExtendedFit) -> bool:
    """Whether the rates differ so that a constant drift does not stand for K."""
    rates = _rates_of(fit)
    return bool(np.ptp(rates) > 0.5 * np.abs(rates).max() > 0)


def _temperatures(waves: Sequence[Wave]) -> list[Suspicion]:
    """Kelvin beside °C, where the frequencies say that the runs were as warm."""
    levels = [average_log(wave.temperature_degc) for wave in waves]
    return find_kelvin_logs(
        [wave.run_id for wave in waves],
        np.array(levels),
        np.array([find_median_frequency(wave) for wave in waves]),
    )
