"""Diagnosis, thermometers that are late in all runs alike, or signals that are late beside them: a
lock-in's filter delays the wave, and no log says by how much.

A frequency that follows T(t + τ) is, where τ is short beside the temperature's own course, one that
follows T and dT/dt in the ratio τ: ω(1 + αT + ατ dT/dt). A shell that is not at one temperature has
the same with a γ of its own, so that a gradient of the frequency alone is either.
"""

from __future__ import annotations

from typing import Any

from ....fitting.causes.extended_fit import ExtendedFit
from ..thresholds import CLEARLY

GRADIENT, FREQUENCY = "thermal_gradient", "thermal_frequency"
OF_SPLIT = ("split_cos_rad_k", "split_sin_rad_k")
NEXT = (
    "take the delay of the filter and of the log from their data sheets, or let a knock on the"
    " housing or a step of the table's rate show it in both; else temperature in soak steps"
)


def list_late_thermometers(fit: ExtendedFit) -> list[dict[str, Any]]:
    """That all temperature logs, or all signals, may be late in place of a gradient.

    Parameters
    ----------
    fit
        With the causes.

    Returns
    -------
    list of dict
        One entry as of what is not separable; empty where no such gradient was found, or where it
        changes the split too.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.search.late_thermometers import list_late_thermometers
    >>> list_late_thermometers(draw_fit())
    []
    """
    names = {effect.name for effect, _ in fit.point.active}
    if not {GRADIENT, FREQUENCY} <= names or _splits(fit):
        return []
    slope = fit.values(FREQUENCY)["relative_1_k"]
    if slope == 0:
        return []
    late_s = fit.values(GRADIENT)["frequency_s_k"] / slope
    std_s = abs(fit.parameter_std(GRADIENT, "frequency_s_k") / slope)
    size = f"{abs(late_s):.4g} ± {std_s:.1g} s"
    base = (
        f"the temperature logs of all runs, {size} late"
        if late_s > 0
        else f"the signals of all runs, {size} late beside the temperature logs, as behind a filter"
    )
    return [{"effects": [GRADIENT], "base": base, "next_experiment": NEXT}]


def _splits(fit: ExtendedFit) -> bool:
    """Whether the gradient clearly changes the frequency split."""
    values = fit.values(GRADIENT)
    return any(
        values[name] ** 2 > CLEARLY * fit.parameter_std(GRADIENT, name) ** 2 for name in OF_SPLIT
    )
