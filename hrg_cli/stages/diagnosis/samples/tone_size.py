"""Diagnosis, a tone so near the resonance that the model of the motion takes a part of it: its size
together with what the model leaves free."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ....effects import find
from ....fitting.causes.extended_fit import ExtendedFit
from .tone import Tone

Array = np.ndarray
NEAREST_CYCLES = 1.0
"""Cycles of beat with every run's own frequency in the shortest run from which a tone is looked
for: within them the model of the motion takes nearly all of it."""
NEAR = 8.0
"""Cycles of beat in the shortest run up to which a model takes a part of a tone that matters: its
bends reach no further."""
SLOW = 0.1
"""Cycles from row to row up to which rows show a tone whole, to 2 %."""
WIDEST, ROUNDS = 0.3, 3
"""Part of a cycle over the longest run within which a tone's frequency is looked for at first, and
parabolas through its gain."""
STEP = 1e-3
PARTS = ("c_cos", "c_sin", "s_cos", "s_sin")


def count_cycles(fit: ExtendedFit, tone: Tone) -> float:
    """Cycles by which a tone beats with the nearest run in the shortest.

    Parameters
    ----------
    fit
        Of a model.
    tone
        With its frequency.

    Returns
    -------
    float
        Less than 1: not even one.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.samples.tone import Tone
    >>> from hrg_cli.stages.diagnosis.samples.tone_size import count_cycles
    >>> fit, nothing = draw_fit(), np.zeros((3, 2))
    >>> cycles = count_cycles(fit, Tone(fit.frequency_hz.max() + 1.0, nothing, nothing, 0.0))
    >>> bool(np.isclose(cycles, min(np.ptp(t) for t in fit.series.time_s)))
    True
    """
    beat_hz = float(np.min(np.abs(tone.frequency_hz - fit.frequency_hz)))
    return beat_hz * min(_list_lengths(fit))


def _list_lengths(fit: ExtendedFit) -> list[float]:
    """Lengths of the runs [s]."""
    rows = zip(fit.series.time_s, fit.series.weight, strict=True)
    return [float(np.ptp(t[weight > 0])) for t, weight in rows]


def _is_near(fit: ExtendedFit, tone: Tone) -> bool:
    """Whether the model of the motion takes a part of a tone that matters, and its rows show it
    whole."""
    beat_hz = float(np.max(np.abs(tone.frequency_hz - fit.frequency_hz)))
    row_s = max(float(np.median(np.diff(t))) for t in fit.series.time_s)
    return count_cycles(fit, tone) < NEAR and beat_hz * row_s < SLOW


def place_beside(fit: ExtendedFit, tone: Tone) -> Tone:
    """A tone near the resonance where it takes most away beside all that the model leaves free.

    Parameters
    ----------
    fit
        Of the model, to waves that hold the tone.
    tone
        Its frequency about right.

    Returns
    -------
    Tone
        With that frequency, and the amplitudes that it has there; as it was where the model takes
        no part of it.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.samples.tone import Tone
    >>> from hrg_cli.stages.diagnosis.samples.tone_size import place_beside
    >>> far = Tone(draw_fit().frequency_hz[0] + 20.0, np.zeros((3, 2)), np.zeros((3, 2)), 0.0)
    >>> place_beside(draw_fit(), far) is far
    True
    """
    if not _is_near(fit, tone):
        return tone
    best = size_beside(fit, tone)
    width = WIDEST / max(_list_lengths(fit))
    for _ in range(ROUNDS):
        sides = [
            size_beside(fit, replace(tone, frequency_hz=best.frequency_hz + side))
            for side in (-width, width)
        ]
        below, above = (side.gain - best.gain for side in sides)
        bend = below + above
        # of the parabola through the three its top, at most a step away
        step = width * float(np.clip((below - above) / (2 * bend), -1, 1)) if bend < 0 else 0.0
        tried = size_beside(fit, replace(tone, frequency_hz=best.frequency_hz + step))
        best = max([best, *sides, tried], key=lambda one: one.gain)
        width /= 4
    return best


def size_beside(fit: ExtendedFit, tone: Tone) -> Tone:
    """A tone's amplitudes in every run together with all that the model leaves free.

    Least squares of the residual r on the tone's columns S, both less what the model's design
    takes: e = (S⊥ᵀS⊥)⁻¹ S⊥ᵀ r.

    Parameters
    ----------
    fit
        Of the model, to waves that hold the tone.
    tone
        With its frequency.

    Returns
    -------
    Tone
        With amplitudes, σ and χ² that it takes away.

    Examples
    --------
    Nothing but noise is a tone of some σ:

    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.samples.tone import Tone
    >>> from hrg_cli.stages.diagnosis.samples.tone_size import size_beside
    >>> fit, nothing = draw_fit(), np.zeros((3, 2))
    >>> found = size_beside(fit, Tone(fit.frequency_hz[0] + 1.0, nothing, nothing, 0.0))
    >>> found.vector.shape, bool(np.all(np.abs(found.vector) < 6 * found.std)), found.gain < 40
    ((3, 2), True, True)
    """
    values = dict.fromkeys(PARTS, 0.0) | {"frequency_hz": tone.frequency_hz}
    wanted = (find("mains_tone"), values, dict.fromkeys(PARTS, STEP))
    columns = fit.find_sensitivities([wanted])[0]
    runs = len(fit.series.weight)
    own = columns[:, None, :] * (fit.rows[:, :1] == np.arange(runs))[:, :, None]
    own = fit.basis.project_out(own.reshape(len(columns), -1))

    U, scale, Vt = np.linalg.svd(own, full_matrices=False)
    component = U.T @ fit.residual
    size = (Vt.T @ (component / scale)).reshape(runs, 2, 2)
    std = np.sqrt(np.sum((Vt.T / scale) ** 2, axis=1)).reshape(runs, 2, 2)
    vector = size[..., 0] - 1j * size[..., 1]
    return replace(
        tone,
        vector=vector,
        std=np.sqrt(np.mean(std**2, axis=2)),
        gain=float(component @ component),
    )
