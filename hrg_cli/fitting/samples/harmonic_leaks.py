"""Harmonics of the oscillation, folded by even sampling, that leak into the signals of its windows.

A read-out's own defect (a square of the motion, a cubic, a clipped top) makes lines at k f, which
samples at f_s show at |k f − n f_s|. A window that does not hold whole periods of such a line, or
fits t·cos and t·sin beside cos and sin, takes part of it for signal: H(f_k) times its amplitude,
H the transfer function of the signals' rows. Where the sampling is locked to the oscillation that
part is the same in every window, and does not average out.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .basis import WindowBasis, build_window_basis
from .frequency import fold
from .survey import Survey

Array = np.ndarray

HIGHEST, FIRST = 16, 4
"""Harmonics that are looked for, those above are weak, and their leak with them; harmonics taken
out of samples whose spectrum is not asked."""
LINE_BINS = 3.0
"""Bins of the spectrum within which a line is the harmonic."""
HARMLESS = 0.1
"""Standard deviations of the mean over all windows up to which a leak may stay."""
DEARER = 1.1
"""Times by which a harmonic's own columns may enlarge the variance of a signal."""


def find_leaking_harmonics(
    survey: Survey, basis: WindowBasis, samples: int, windows: int, moving: bool
) -> tuple[float, ...]:
    """Frequencies [Hz] of the lines that want columns of their own in windows of so many samples.

    Those that the spectrum shows at a harmonic, whose leak into the mean over all windows exceeds
    `HARMLESS` of its σ (white noise at the spectrum's floor), and that a window can tell from the
    oscillation. None with a carrier, whose side bands have harmonics of their own.

    Parameters
    ----------
    survey
        With the lines of the residual's spectrum.
    basis
        Of one window, without them.
    samples
        Of a window.
    windows
        Of the recording.
    moving
        Whether windows fit t·cos and t·sin too.

    Returns
    -------
    tuple of float
        Between 0 and half the sampling rate, strongest leak first; mostly empty.

    Examples
    --------
    A square of the motion sampled 2.7 times a period: its line at 2f folds to 0.7 f, and ten
    periods are 27 samples.

    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.fitting.samples.basis import build_window_basis
    >>> from hrg_cli.fitting.samples.harmonic_leaks import find_leaking_harmonics
    >>> from hrg_cli.fitting.samples.survey import survey
    >>> t = np.arange(60000) / 2700
    >>> c = np.cos(2 * np.pi * 1000 * t)
    >>> noise = 1e-4 * np.random.default_rng(0).standard_normal((2, len(t)))
    >>> x = np.stack([c + 2e-3 * c**2, 0.5 * c]) + noise
    >>> found = survey(Recording(c=x[0], s=x[1], sample_rate_hz=2700.0, mode="free"), "")
    >>> basis = build_window_basis(27, 2700.0, (1000.0,), moving=True)
    >>> [round(hz) for hz in find_leaking_harmonics(found, basis, 27, 2222, True)]
    [700]
    """
    if survey.carrier_hz is not None or not len(survey.line_hz):
        return ()
    rate = 1 / survey.step_s
    # a one-sided density reaches to half the sampling rate: the variance of a sample
    noise2 = survey.average_floor() * rate / 2
    leaking: list[tuple[float, float]] = []
    for hz, amplitude in _find_harmonics(survey):
        with np.errstate(divide="ignore", invalid="ignore"):
            sigma = np.sqrt(np.multiply.outer(noise2, basis.variance) / windows)
            leak = np.multiply.outer(amplitude, _respond(basis, samples, hz, rate)) / sigma
        if np.nanmax(leak) > HARMLESS:
            leaking.append((float(np.nanmax(leak)), hz))
    order = [hz for _, hz in sorted(leaking, reverse=True)]
    return choose_apart(survey, basis, samples, order, moving)


def list_harmonics(
    survey: Survey, basis: WindowBasis, samples: int, moving: bool
) -> tuple[float, ...]:
    """Frequencies [Hz] of the first harmonics that windows of so many samples can tell from the
    oscillation, whether the samples hold them or not.

    For samples without noise, whose spectrum nobody asks.

    Parameters
    ----------
    survey, basis, samples, moving
        As in `find_leaking_harmonics`.

    Returns
    -------
    tuple of float
        Folded.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.fitting.samples.basis import build_window_basis
    >>> from hrg_cli.fitting.samples.harmonic_leaks import list_harmonics
    >>> from hrg_cli.fitting.samples.survey import survey_quiet
    >>> c = np.cos(2 * np.pi * 1000 * np.arange(60000) / 2700)
    >>> found = survey_quiet(Recording(c=c, s=c, sample_rate_hz=2700.0, mode="free"), "")
    >>> basis = build_window_basis(27, 2700.0, (1000.0,), moving=True)
    >>> [round(hz) for hz in list_harmonics(found, basis, 27, True)]
    [700, 300, 1300, 400]
    """
    return choose_apart(survey, basis, samples, _fold_harmonics(survey)[:FIRST].tolist(), moving)


def choose_apart(
    survey: Survey, basis: WindowBasis, samples: int, wanted: Sequence[float], moving: bool
) -> tuple[float, ...]:
    """Tones that can have columns of their own beside the oscillation's, the first first.

    They cost no more than `DEARER` of a signal's variance and half of a window's samples.

    Parameters
    ----------
    survey, basis, samples, moving
        As in `find_leaking_harmonics`.
    wanted
        Frequencies of the tones, Hz.

    Returns
    -------
    tuple of float
        Those of them that are taken.

    Examples
    --------
    Ten periods of 27 samples tell a tone at 700 Hz from the oscillation at 1 kHz, but none at 1001
    Hz:

    >>> import numpy as np
    >>> from hrg_cli import Recording
    >>> from hrg_cli.fitting.samples.basis import build_window_basis
    >>> from hrg_cli.fitting.samples.harmonic_leaks import choose_apart
    >>> from hrg_cli.fitting.samples.survey import survey_quiet
    >>> c = np.cos(2 * np.pi * 1000 * np.arange(60000) / 2700)
    >>> found = survey_quiet(Recording(c=c, s=c, sample_rate_hz=2700.0, mode="free"), "")
    >>> basis = build_window_basis(27, 2700.0, (1000.0,), moving=True)
    >>> choose_apart(found, basis, 27, (1001.0, 700.0), True)
    (700.0,)
    """
    taken: tuple[float, ...] = ()
    for hz in wanted:
        own = build_window_basis(
            samples, 1 / survey.step_s, (survey.reference_hz,), (*taken, hz), moving
        )
        if own is None or own.freedom < samples / 2:
            continue
        if (own.variance / basis.variance).max() < DEARER:
            taken = (*taken, hz)
    return taken


def _fold_harmonics(survey: Survey) -> Array:
    """Where harmonics from the second on stand among even samples, (orders,)."""
    return np.asarray(fold(np.arange(2, HIGHEST + 1) * survey.reference_hz, 1 / survey.step_s))


def _find_harmonics(survey: Survey) -> list[tuple[float, Array]]:
    """Folded frequency and amplitudes (channels,) of every harmonic that is a line."""
    width = LINE_BINS * float(survey.spectrum_hz[1] - survey.spectrum_hz[0])
    found: dict[float, Array] = {}
    for hz in _fold_harmonics(survey):
        line = int(np.argmin(np.abs(survey.line_hz - hz)))
        # two harmonics that fold onto one place are one line
        near = [other for other in found if abs(other - hz) < width]
        if abs(survey.line_hz[line] - hz) < width and not near:
            found[float(hz)] = survey.line_amplitude[line]
    return list(found.items())


def _respond(basis: WindowBasis, samples: int, hz: float, rate: float) -> Array:
    """Root mean square over its phase of what a tone of amplitude 1 makes of the coefficients
    (2F,)."""
    tau = (np.arange(samples) - (samples - 1) / 2) / rate
    rows = basis.orthonormal @ basis.triangle
    # cos(ωt + ψ) gives Re(e^{jψ}H), of which the mean square over ψ is |H|²/2
    return np.asarray(np.abs(np.exp(-2j * np.pi * hz * tau) @ rows) / np.sqrt(2))
