"""Diagnosis, harmonics that a cause must make: a read-out that bends each channel's value puts odd
multiples of the oscillation into the samples, and one whose multiples are not there is none.

What a curve y = f(c) makes of c = A cos φ, cos nφ with b_n(A) = (1/π)∫ f(A cos φ) cos nφ dφ, has
the power b_n²/2 in the samples' residual; all power that stands within the line's width is held
against that, noise included.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ....effects import pickoff_nonlinearity
from ....effects.effect import Effect
from ....fitting.causes.evidence import score_candidates
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.envelopes.envelope_runs import compute_envelopes
from ....fitting.samples.looks import LOOKS
from ....physics.plant import Readout, Samples
from ....records import Array, Wave
from ..thresholds import SMALLER_BY_CHANCE, UNHEARD
from .lines import WANDER, WIDTH_CELLS, find_cell_hz, find_median_frequency

ORDERS = (3, 5, 7)
"""Multiples that are looked for."""
INSIDE = 0.9
"""Part of the spectrum's width up to which a multiple is heard: beyond it the sampling folds it,
and a filter may have taken it away."""
POINTS, LEVELS, NODES = 256, 24, 16
"""Points of a period, amplitudes (and as many near the largest), and values of the noise at which a
curve is drawn."""
CUBIC_STEP = 1e-3
"""Of the largest amplitude's inverse square, to differentiate by."""
TAPERED = 32
"""Instants of a stretch at which what comes and goes is looked at."""
NEAREST_TOP = 1e-6
"""Distance of the last of these amplitudes from the largest, over it."""


def find_unheard(fit: ExtendedFit, waves: Sequence[Wave]) -> list[str]:
    """The causes of a fit that would make harmonics which the samples do not have.

    Parameters
    ----------
    fit
        With its causes.
    waves
        Of the runs.

    Returns
    -------
    list of str
        Their names.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.heard import find_unheard
    >>> find_unheard(draw_fit(), draw_waves())
    []
    """
    return [
        effect.name
        for effect, values in fit.point.active
        if effect.makes_harmonics
        and is_excluded(effect, _find_least_values(effect, values, fit), waves)
    ]


def _find_least_values(
    effect: Effect, values: Mapping[str, float], fit: ExtendedFit
) -> dict[str, float]:
    """The values nearest to neutral that are within `SMALLER_BY_CHANCE` σ of the fitted ones."""
    out = dict(values)
    neutral = {p.name: p.neutral for p in effect.parameters}
    for name in fit.layout.parameters(effect.name):
        off, std = values[name] - neutral[name], fit.parameter_std(effect.name, name)
        out[name] = neutral[name] + float(np.sign(off)) * max(
            abs(off) - SMALLER_BY_CHANCE * std, 0.0
        )
    return out


def find_largest_cubic(fit: ExtendedFit) -> float:
    """The largest cubic of the pick-off that the motion allows: one that bends the channels bends
    the wave's own angle and amplitude as well.

    Parameters
    ----------
    fit
        Of the final model, without it.

    Returns
    -------
    float
        Of either sign, 1 over the square of an amplitude; infinite where the runs do not tell.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.samples.heard import find_largest_cubic
    >>> find_largest_cubic(draw_fit()) < 0.1
    True
    """
    effect = pickoff_nonlinearity.EFFECT
    neutral = {p.name: p.neutral for p in effect.parameters}
    wanted = (
        effect,
        neutral,
        {"cubic": CUBIC_STEP / float(np.nanmax(np.abs(fit.prediction.seen))) ** 2},
    )
    columns = fit.find_sensitivities([wanted])
    score = score_candidates([effect.name], fit.residual, columns, fit.basis)[0]
    if not score.visible:
        return float("inf")
    std = float(score.std[0]) * float(np.sqrt(max(1.0, fit.chi2 / fit.dof)))
    return float(abs(score.estimate[0]) + SMALLER_BY_CHANCE * std)


def is_excluded(effect: Effect, values: Mapping[str, float], waves: Sequence[Wave]) -> bool:
    """Whether an effect would make a harmonic clearly stronger than all that a run's samples hold
    there.

    Parameters
    ----------
    effect
        A read-out.
    values
        Of its parameters.
    waves
        Of the runs, with their residual's spectra.

    Returns
    -------
    bool
        One run is enough.

    Examples
    --------
    Multiples of 500 Hz from the third on lie beyond samples at 2 kHz, which exclude nothing:

    >>> from hrg_cli.effects import find
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.heard import is_excluded
    >>> is_excluded(find("saturation"), {"inverse_level": 2.0}, draw_waves())
    False
    """
    for wave in waves:
        if wave.readout != "direct" or wave.spectrum_density is None:
            continue
        frequency, grid = find_median_frequency(wave), np.asarray(wave.spectrum_frequency_hz, float)
        density, cell = np.asarray(wave.spectrum_density, float), find_cell_hz([wave])
        noise = float(np.sqrt(density.sum(axis=0).mean() * cell))
        good = wave.good()
        courses = compute_harmonic_power(
            effect, values, np.abs(compute_envelopes(wave, good)), noise
        )
        made = bound_power_in_looks(courses, np.asarray(wave.time_s)[good], 1 / cell)
        for order, power in zip(ORDERS, made, strict=True):
            width = WIDTH_CELLS * cell + WANDER * order * frequency
            near = np.abs(grid - order * frequency) < width + cell
            if order * frequency > INSIDE * grid[-1] or not near.any():
                continue
            if np.any(power > UNHEARD * density[near].sum(axis=0) * cell):
                return True
    return False


def compute_harmonic_power(
    effect: Effect, values: Mapping[str, float], amplitude: Array, noise: float = 0.0
) -> Array:
    """Power of the odd multiples that an effect's curve makes of channels, its corners rounded by
    noise.

    Parameters
    ----------
    effect
        A read-out.
    values
        Of its parameters.
    amplitude
        Of the channels, (n, channels).
    noise
        σ of the samples, in the same unit.

    Returns
    -------
    ndarray
        (orders, n, channels): mean squares of the multiples `ORDERS`.

    Examples
    --------
    A cubic y = x + cx³ makes the third harmonic ca³/4:

    >>> import numpy as np
    >>> from hrg_cli.effects import find
    >>> from hrg_cli.stages.diagnosis.samples.heard import compute_harmonic_power
    >>> power = compute_harmonic_power(
    ...     find("pickoff_nonlinearity"), {"cubic": 0.04}, np.ones((1, 1))
    ... )
    >>> float(np.sqrt(2 * power[0, 0, 0]).round(6))
    0.01
    """
    readout = Readout()
    effect.readout(dict(values), readout)
    # a clip sets in just under the top, and within a thousandth its harmonics grow tenfold
    near_top = 1 - np.geomspace(0.5 / LEVELS, NEAREST_TOP, LEVELS)
    share = np.sort(np.concatenate([np.linspace(0.0, 1.0, LEVELS), near_top]))
    level = float(amplitude.max()) * share
    phase = 2 * np.pi * np.arange(POINTS) / POINTS
    seen, around = np.zeros((len(level), POINTS)), _period(level[:, None], phase)
    place, weight = np.polynomial.hermite_e.hermegauss(NODES)
    for x, part in zip(place, weight / weight.sum(), strict=True):
        one = level[:, None] * np.cos(phase) + noise * x
        for step in (*readout.steps, *readout.after):
            one = step(around, one)
        seen += part * one
    # complex: what remembers where the channel turned is behind it, by sines
    made = 2 * np.fft.rfft(seen, axis=1)[:, list(ORDERS)] / POINTS
    return np.stack([np.abs(np.interp(amplitude, level, b)) ** 2 / 2 for b in made.T])


def bound_power_in_looks(power: Array, time_s: Array, length_s: float) -> Array:
    """The least that a spectrum may hold of a power that comes and goes.

    A spectrum is the mean of `LOOKS` stretches spread evenly along a run, each tapered by sin². A
    wave that is clipped while it passes an axis may do so between them, or at the end of one: of
    all places of the stretches, moved together by up to half their distance, those count that see
    least.

    Parameters
    ----------
    power
        (orders, n, channels).
    time_s
        Of the rows [s], (n,).
    length_s
        Of a stretch [s].

    Returns
    -------
    ndarray
        (orders, channels), in the unit of the power.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.samples.heard import bound_power_in_looks
    >>> bound_power_in_looks(np.ones((1, 50, 2)), np.arange(50.0), 2.0).round(6).tolist()
    [[1.0, 1.0]]
    """
    span = time_s[-1] - time_s[0]
    pitch = (span - length_s) / (LOOKS - 1)
    if len(time_s) < 2 or pitch <= 0:
        return np.asarray(power.mean(axis=1))
    shift = np.linspace(-pitch / 2, pitch / 2, 2 * int(np.ceil(4 * pitch / length_s)) + 1)
    places = pitch * np.arange(LOOKS) + shift[:, None]
    begin = time_s[0] + np.clip(places, 0.0, span - length_s)
    within = (np.arange(TAPERED) + 0.5) / TAPERED
    weight = np.sin(np.pi * within) ** 4
    instants = begin[..., None] + length_s * within
    seen = [
        [np.interp(instants, time_s, one) @ (weight / weight.sum()) for one in order.T]
        for order in power
    ]
    return np.asarray(np.mean(seen, axis=-1).min(axis=-1))


def _period(level: Array, phase: Array) -> Samples:
    """Channels that oscillate with these amplitudes (n, 1) through the phases of a period, at rest
    and undriven: z − j·v/ω is the analytic signal a e^{jφ}."""
    z, late = level * np.cos(phase), -level * np.sin(phase)
    still = np.zeros(len(phase))
    return Samples(phase / (2 * np.pi), z, late, np.zeros(z.shape, complex), still, still)
