"""How large an effect is hidden in a user's recordings: in σ of an ideal detector that knows it,
with the base model and the background's causes as free as these runs and weak priors leave them.

Fisher's information of columns S over σ beside a model J with its covariance: SᵀS − SᵀJ Cov JᵀS.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from ..effects import EFFECTS, find
from ..effects.effect import REFERENCE_TEMPERATURE, RUN, Effect
from ..errors import HrgError
from ..fitting.causes import extended_fit, fit_point, scales
from ..fitting.causes.extended_fit import ExtendedFit
from ..records import Recording, Wave
from ..stages.diagnosis.base.base_priors import choose_freedom
from ..stages.diagnosis.base.data import prepare
from ..stages.diagnosis.base.rate_step_fit import fit_rate_steps
from .hidden import ALL_ROWS, MIDDLE, find_direction, find_onset

Array = np.ndarray
Row = dict[str, Any]
LARGEST = 100.0
"""Times its typical size that an effect is hidden with at most."""
TONE_AWAY = (0.01, 0.05)
"""Part of the oscillation's frequency by which a tone is beside it."""


def choose_values(
    effect: Effect,
    fit: ExtendedFit,
    recordings: Sequence[Recording],
    waves: Sequence[Wave],
    random: np.random.Generator,
) -> Callable[[float], dict[str, float]]:
    """An effect's parameters at a size, in a random direction.

    Parameters
    ----------
    effect
        That is hidden.
    fit
        Of the model and the background's causes.
    recordings
        In which it is hidden.
    waves
        Of them.
    random
        Of the draw.

    Returns
    -------
    callable
        Size in σ of an ideal detector -> parameters.

    Raises
    ------
    HrgError
        These runs cannot show it.

    Examples
    --------
    Twice the size is twice as far from doing nothing:

    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.effects import find
    >>> from hrg_cli.studies.hidden import hide
    >>> from hrg_cli.studies.recovery_sizes import choose_values
    >>> random = np.random.default_rng(1)
    >>> hiding = hide("gain_mismatch", random, 3e-4)
    >>> record = Recording(c=np.zeros(99), s=np.zeros(99), sample_rate_hz=2e4, mode="free")
    >>> values_at = choose_values(find("gain_mismatch"), hiding.fit, [record], [], random)
    >>> round(values_at(10.0)["gain"] / values_at(5.0)["gain"], 9)
    2.0
    """
    first = recordings[0]
    neutral = _neutral_values(effect, fit, first, random)
    if effect.whole_samples:
        (lost,) = effect.fitted()
        step = float(np.median(np.diff(first.times(0, 10_000))))
        return lambda size: {**neutral, lost.name: step}
    if effect.seen_in == "waveform":
        away = float(random.choice([-1, 1]) * random.uniform(*TONE_AWAY))
        neutral["frequency_hz"] = float(np.median(fit.frequency_hz)) * (1 + away)
        vector = _tone_of_one_sigma(effect, waves[0], random)
        return lambda size: {
            name: value + size * vector.get(name, 0.0) for name, value in neutral.items()
        }
    louder = float(np.sqrt(max(1.0, fit.chi2 / fit.dof)))
    if effect.sets_in:
        return lambda size: {
            **neutral,
            **find_onset(effect, neutral, fit, size * louder, _beside_model),
        }
    direction = find_direction(effect, fit, neutral, random, _beside_model)
    return lambda size: {
        name: value + size * louder * direction.get(name, 0.0) for name, value in neutral.items()
    }


def _neutral_values(
    effect: Effect, fit: ExtendedFit, first: Recording, random: np.random.Generator
) -> dict[str, float]:
    """The effect doing nothing, with what says where it stands: the runs' temperature, an instant
    within the first of them."""
    neutral = effect.values()
    if effect.follows_temperature and fit.series.has_temperature:
        warm = fit.series.temperature_degc[fit.series.weight > 0]
        neutral[REFERENCE_TEMPERATURE] = float(np.round(warm.mean(), 3))
    if "time_s" in neutral:
        length = float(first.times(len(first) - 1)[-1])
        neutral["time_s"] = float(random.uniform(*MIDDLE)) * length
    if effect.of_one_run:
        neutral[RUN] = 0.0
    return neutral


def _tone_of_one_sigma(effect: Effect, wave: Wave, random: np.random.Generator) -> dict[str, float]:
    """A random vector of a tone, as long as the windows' noise of one component over the root of
    their number: what an ideal detector sees at one σ."""
    windows = max(1, int(np.count_nonzero(wave.good())))
    sigma = float(np.median(wave.signal_std)) / np.sqrt(windows)
    vector = random.standard_normal(len(effect.fitted()))
    vector = sigma * vector / np.linalg.norm(vector)
    return {p.name: float(v) for p, v in zip(effect.fitted(), vector, strict=True)}


def _beside_model(fit: ExtendedFit, columns: Array) -> Array:
    """Fisher information (K, K) of columns over σ (N, K) beside the model with its priors, which
    one run needs: SᵀS − SᵀJ Cov JᵀS."""
    shared = fit.design.multiply_transposed(columns)
    return columns.T @ columns - shared.T @ fit.covariance @ shared


def need_thinkable(effect: Effect, values: dict[str, float], size: float, fit: ExtendedFit) -> None:
    """Refuse a size that no such cause can have.

    Parameters
    ----------
    effect
        That is to be hidden.
    values
        Its parameters.
    size
        In σ of an ideal detector, for the message.
    fit
        Of whose amplitude and frequency a typical size is.

    Raises
    ------
    HrgError
        More than a hundred times a typical size.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.effects import find
    >>> from hrg_cli.studies.hidden import hide
    >>> from hrg_cli.studies.recovery_sizes import need_thinkable
    >>> fit = hide("gain_mismatch", np.random.default_rng(1), 3e-4).fit
    >>> need_thinkable(find("gain_mismatch"), {"gain": 50.0}, 1e6, fit)
    Traceback (most recent call last):
    ...
    hrg_cli.errors.HrgError: gain_mismatch: 1e+06 σ would be gain = 50 1, more than 100 times ...
    """
    amplitude, frequency = scales.measure_amplitude(fit.series), fit.series.reference_frequency_hz
    for p in effect.fitted():
        typical = scales.find_typical_size(p, amplitude, frequency)
        if not effect.whole_samples and abs(values[p.name] - p.neutral) > LARGEST * typical:
            found = (
                f"{p.name} = {values[p.name]:.3g} {p.units}, more than {LARGEST:g} times the"
                f" typical {typical:.2g}"
            )
            raise HrgError(f"{effect.name}: {size:g} σ would be {found}")


def fit_background(
    waves: Sequence[Wave], scale_factor: float | None, background: Row
) -> ExtendedFit:
    """The base model's fit at the windows' own rate, with the causes that are there already.

    Parameters
    ----------
    waves
        The runs.
    scale_factor
        Known K, held; None: fitted.
    background
        Report of the recordings as they are.

    Returns
    -------
    ExtendedFit
        Without causes where none were found.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.studies.hidden import draw_programme, make_waves
    >>> from hrg_cli.studies.recovery_sizes import fit_background
    >>> table = draw_programme(np.random.default_rng(1), "gain_mismatch", 3e-4)
    >>> fit = fit_background(make_waves(table, 1, "gain_mismatch"), None, {"effects": []})
    >>> bool(0.9 < fit.chi2 / fit.dof < 1.1), fit.point.active
    (True, ())
    """
    series, point, _ = prepare(waves, scale_factor, ALL_ROWS)
    fit = fit_rate_steps(
        extended_fit.fit(series, point, choose_freedom(series, point, scale_factor))
    )
    names = {effect.name for effect in EFFECTS}
    for entry in background["effects"]:
        if entry["name"] not in names or find(entry["name"]).seen_in == "waveform":
            continue
        values = {
            name: float(p["value"])
            for name, p in (entry["parameters"] | entry.get("held", {})).items()
        }
        effect = find(entry["name"])
        with contextlib.suppress(extended_fit.DivergedError):
            fit = extended_fit.fit(
                fit.series,
                fit_point.add_effect(fit.point, effect, effect.values(values)),
                fit.freedom,
            )
    return fit
