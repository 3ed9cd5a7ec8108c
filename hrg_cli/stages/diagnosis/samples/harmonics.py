"""Diagnosis, odd harmonics: clipping where samples were clipped, the converter where they are many,
else the pick-off's cubic."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ....effects import converter_nonlinearity, pickoff_nonlinearity, saturation
from ....effects.effect import Effect
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.causes.fit_point import build_state
from ....records import Array, Wave
from .lines import Line, find_cell_hz
from .odd_windows import are_at_top, find_channel_amplitudes, find_odd_windows
from .offered import UNMEASURED, make_entry

CUBIC_LARGEST = 0.3
"""γa² of a pick-off's cubic beyond which it is none."""
DITHERED, EXACTLY = 0.5, 1e-3
"""Noise in codes from which they are spread, and part of a code to which the file knows it."""
CLIPPED_PEAK = 4 / np.pi
"""Fundamental of a wave that is clipped to a square, over the level."""


def measure_motion_harmonics(fit: ExtendedFit) -> float:
    """The third harmonic that the motion may have at most, root mean square over a run.

    Forces of it, F₃, of up to three times those at ω, F₁ = 2ω|u̇|, move it by F₃/8ω². It follows the
    motion: with a³ it is many times its median in a run that decays.

    Parameters
    ----------
    fit
        With its causes.

    Returns
    -------
    float
        In the signals' unit, of the run that has most; 0 where no cause is a nonlinear force.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit
    >>> from hrg_cli.stages.diagnosis.samples.harmonics import measure_motion_harmonics
    >>> measure_motion_harmonics(draw_fit())
    0.0
    """
    motion = fit.prediction.motion
    state = build_state(fit.series, fit.point)
    moved = [
        np.linalg.norm(effect.slow(values, motion, state), axis=-1)
        for effect, values in fit.point.active
        if effect.nonlinear_force
    ]
    if not moved:
        return 0.0
    third2 = (0.75 * np.sum(moved, axis=0) / state.omega_r_rad_s) ** 2
    known = fit.series.weight > 0
    mean = np.sum(third2 * known, axis=1) / np.maximum(known.sum(axis=1), 1)
    return float(np.sqrt(mean.max()))


def name_bent_channels(
    waves: Sequence[Wave],
    harmonics: dict[int, Line],
    codes: Sequence[Line],
    found: Sequence[Effect],
    of_motion: float = 0.0,
) -> list[dict[str, Any]]:
    """What the odd harmonics in the samples are.

    Parameters
    ----------
    waves
        Of the runs.
    harmonics
        Multiple -> line.
    codes
        Lines at odd multiples too many for chance: a converter's.
    found
        Causes named by the dynamics.
    of_motion
        The third harmonic that the motion itself may have, in the signals' unit.

    Returns
    -------
    list of dict
        Entries of the report; none where the dynamics found a read-out that makes the harmonics,
        and no cubic of the pick-off where the motion itself may make the third one.

    Examples
    --------
    A third harmonic of 10⁻³ in both channels:

    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.harmonics import name_bent_channels
    >>> from hrg_cli.stages.diagnosis.samples.lines import Line
    >>> third = Line(1500.0, np.full(2, 1e-3), 1e4, 3, np.ones((3, 2)))
    >>> [entry["name"] for entry in name_bent_channels(draw_waves(), {3: third}, [], [])]
    ['pickoff_nonlinearity']
    """
    odd = [n for n in sorted(harmonics) if n % 2]
    if any(effect.makes_harmonics for effect in found):
        return []
    clipped = find_clipped_windows(waves)
    if any(one.any() for one in clipped):
        clipping = _clipping(waves, clipped, [harmonics[n] for n in odd])
        return [clipping] if clipping is not None else []
    if codes:
        return [_converter(waves, codes, harmonics)]
    if 3 not in harmonics:
        return []
    line = harmonics[3]
    cubic = read_cubic(line, waves)
    bent = cubic * measure_cubed_amplitude(waves) ** 2
    if not float(np.max(line.amplitude)) > of_motion or not bent < CUBIC_LARGEST:
        return []
    offer = make_entry(
        pickoff_nonlinearity.EFFECT,
        float(np.sqrt(2 * line.ratio)),
        {"cubic": (cubic, cubic, "amplitude-2")},
        2 * line.ratio,
    )
    known = {
        "magnitude": {"cubic": cubic},
        "magnitude_std": {"cubic": cubic / np.sqrt(2 * line.ratio)},
    }
    return [offer | known | {"sign": UNMEASURED}]


def read_cubic(line: Line, waves: Sequence[Wave]) -> float:
    """The cubic of a pick-off that makes such a third harmonic, γ = 4 A₃/A³, both root mean squares
    over the runs.

    Parameters
    ----------
    line
        The third harmonic.
    waves
        Of the runs.

    Returns
    -------
    float
        1 over the square of an amplitude.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.harmonics import read_cubic
    >>> from hrg_cli.stages.diagnosis.samples.lines import Line
    >>> third = Line(1500.0, np.full(2, 1e-3), 1e4, 3, np.ones((3, 2)))
    >>> bool(0.003 < read_cubic(third, draw_waves()) < 0.01)
    True
    """
    return 4 * float(np.max(line.amplitude)) / measure_cubed_amplitude(waves) ** 3


def measure_cubed_amplitude(waves: Sequence[Wave]) -> float:
    """The amplitude whose cube is the root mean square of the runs' cubes, (⟨a⁶⟩)^⅙.

    Parameters
    ----------
    waves
        Of the runs.

    Returns
    -------
    float
        In the signals' unit.

    Examples
    --------
    Of e^{−t/2 s} over 1 s from 1, twice and once from a half:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.harmonics import measure_cubed_amplitude
    >>> round(measure_cubed_amplitude(draw_waves()[:1]), 2)
    0.83
    """
    sizes = [np.asarray(wave.main_amplitude, float)[wave.good()] for wave in waves]
    return float(np.mean(np.concatenate(sizes) ** 6) ** (1 / 6))


def find_clipped_windows(waves: Sequence[Wave]) -> list[Array]:
    """Windows of every wave in which samples were clipped.

    Parameters
    ----------
    waves
        Of the runs.

    Returns
    -------
    list of ndarray
        (n,) bool of each: those that the demodulation flagged, else odd ones that are just those of
        the largest signal.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.harmonics import find_clipped_windows
    >>> [int(one.sum()) for one in find_clipped_windows(draw_waves())]
    [0, 0, 0]
    """
    clipped = [(np.asarray(w.flags) & 1) > 0 for w in waves]
    odd = [] if any(one.any() for one in clipped) else find_odd_windows(waves)
    if are_at_top(waves, odd):
        for one in odd:
            clipped[one.run][one.row] = True
    return clipped


def _clipping(
    waves: Sequence[Wave], clipped: Sequence[Array], odd: Sequence[Line]
) -> dict[str, Any] | None:
    """The level between the largest channel that was not clipped and the smallest that was; None
    where that is no level.

    A channel clipped to a square shows 4/π of the level, so the level is no less than π/4 of the
    largest seen.
    """
    seen = [find_channel_amplitudes(w) for w in waves]
    high = np.concatenate([s[c] for s, c in zip(seen, clipped, strict=True)])
    free = np.concatenate([s[~c & np.isfinite(s)] for s, c in zip(seen, clipped, strict=True)])
    if not len(high):
        return None
    least, most = float(np.nanmax(high)) / CLIPPED_PEAK, float(np.nanmin(high))
    if len(free):
        least = max(least, float(free.max()))
    level, std = (least + max(most, least)) / 2, max(abs(most - least) / 2, 1e-3 * least)
    z = float(np.sqrt(max([2 * line.ratio for line in odd], default=float(len(high)))))
    return make_entry(
        saturation.EFFECT,
        z,
        {"inverse_level": (1 / level, std / level**2, "amplitude-1")},
        z**2,
    ) | {"clipped_windows": len(high)}


def read_least_count(waves: Sequence[Wave]) -> float | None:
    """Step of the converter's codes.

    Parameters
    ----------
    waves
        Of the runs.

    Returns
    -------
    float or None
        In the signals' unit, the median of the runs; None where no file knows it.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.harmonics import read_least_count
    >>> read_least_count([wave.replace(least_count=2e-4) for wave in draw_waves()])
    0.0002
    """
    counts = [float(step) for w in waves if (step := getattr(w, "least_count", None))]
    return float(np.median(counts)) if counts else None


def is_below_codes(line: Line, waves: Sequence[Wave]) -> bool:
    """Whether a line is smaller than half a code in runs whose noise is too small to spread the
    codes.

    Parameters
    ----------
    line
        Of the runs' spectra.
    waves
        Of the runs; their noise is too small below half a code.

    Returns
    -------
    bool
        The line may be the converter's own.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.samples.harmonics import is_below_codes
    >>> from hrg_cli.stages.diagnosis.samples.lines import Line
    >>> line = Line(1500.0, np.full(2, 1e-3), 1e4, 3, np.ones((3, 2)))
    >>> [
    ...     is_below_codes(line, [w.replace(least_count=q) for w in draw_waves()])
    ...     for q in (1e-4, 1e-2)
    ... ]
    [False, True]
    """
    step = read_least_count(waves)
    if step is None or float(line.amplitude.max()) > step / 2:
        return False
    power = [
        np.sum(np.asarray(w.spectrum_density, float).mean(axis=-1)) * find_cell_hz([w])
        for w in waves
        if w.spectrum_density is not None
    ]
    return bool(power) and float(np.sqrt(np.median(power))) < DITHERED * step


def _converter(
    waves: Sequence[Wave], codes: Sequence[Line], harmonics: dict[int, Line]
) -> dict[str, Any]:
    """The codes' own harmonics as one cause: a step h at mid-scale makes harmonics 4h/πn, so h from
    each of them, its sign unknown, as well as they agree; beside it the step of the codes."""
    gain = float(sum(2 * line.ratio for line in codes))
    low = [(n, line) for n, line in harmonics.items() if n % 2]
    sizes = [np.pi * n * float(line.amplitude.max()) / 4 for n, line in low] or [
        np.pi / 4 * float(max(line.amplitude.max() for line in codes))
    ]
    height = float(np.median(sizes))
    parameters = {"mid_scale": (height, height, "amplitude")}
    known = {"mid_scale": (height, _estimate_median_std(sizes, height / np.sqrt(gain)))}
    if (step := read_least_count(waves)) is not None:
        parameters["step"] = (step, EXACTLY * step, "amplitude")
        known["step"] = (step, EXACTLY * step)
    offer = make_entry(converter_nonlinearity.EFFECT, float(np.sqrt(gain)), parameters, gain)
    return offer | {
        "lines": len(codes),
        "magnitude": {name: size for name, (size, _) in known.items()},
        "magnitude_std": {name: std for name, (_, std) in known.items()},
        "sign": UNMEASURED,
    }


def _estimate_median_std(sizes: Sequence[float], least: float) -> float:
    """σ of the median of sizes, √(π/2) that of their mean, by their scatter; that of each alone at
    least."""
    if len(sizes) < 2:
        return least
    scatter = float(np.std(sizes, ddof=1)) / np.sqrt(len(sizes))
    return float(np.hypot(np.sqrt(np.pi / 2) * scatter, least))
