"""What is wrong with a run that the others contradict: each usual mistake of a bench is undone, and
that which leaves least of the contradiction is told.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...fitting.tables.increments import AnglePath
from ..suspicion import Suspicion
from ..usual_scale_factor import LOGGED_IN
from .shown_temperatures import ShownTemperature

Undo = Callable[[AnglePath], AnglePath]
EXPLAINED = 1e-2
"""Part of a run's χ² that a mistake may leave once it is undone, to be told."""
ALIKE = 3.0
"""χ² of one mistake over that of another below which both are told."""
SILENT = 0.1
"""Least over largest amplitude of a wave of which one channel is not seen, and how near its angle
stays to the other's axis, of mθ."""
IMPORT_WITH_UNIT = "import its rate log with its unit"


@dataclass(frozen=True)
class Mistake:
    """A mistake with its cure, and the run as it should have been."""

    what: str
    correction: str
    undo: Undo


def find_silent_channel(path: AnglePath) -> str | None:
    """The channel that a run does not hold: its wave stays on the other's axis and swings there.

    Parameters
    ----------
    path
        The run.

    Returns
    -------
    str or None
        "C" or "S"; None where both are seen.

    Examples
    --------
    A wave that turns, of which only C is measured:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.stages.calibration.odd_readings import find_silent_channel
    >>> seen = np.cos(0.1 * np.arange(99.0))
    >>> path = draw_path(
    ...     blocks=99, main_amplitude=np.abs(seen), angle_rad=np.pi / 2 * (seen < 0)
    ... )
    >>> find_silent_channel(path)
    'S'
    """
    amplitude = path.main_amplitude
    if not np.min(amplitude) < SILENT * np.max(amplitude):
        return None
    strong = amplitude > np.median(amplitude)
    # mθ = 0 or π is C alone, ±π/2 is S alone
    across = np.abs(np.sin(path.mode_number * path.angle_rad[strong]))
    if np.median(across) < SILENT:
        return "S"
    return "C" if np.median(across) > np.sqrt(1 - SILENT**2) else None


def list_mistakes(shown: ShownTemperature | None) -> list[Mistake]:
    """The mistakes that are tried on a run.

    Parameters
    ----------
    shown
        What its frequency says of its temperature; None: what is logged.

    Returns
    -------
    list of Mistake
        Each with the run as it should have been.

    Examples
    --------
    >>> from hrg_cli.stages.calibration.odd_readings import list_mistakes
    >>> [mistake.what for mistake in list_mistakes(None)][:2]
    ['rate log of wrong sign', 'one channel inverted']
    """
    mistakes = [
        Mistake("rate log of wrong sign", "turn the sign of its rate log", _scale_rate(-1.0)),
        Mistake("one channel inverted", "turn the sign of one of its channels", _mirror(0.0)),
        Mistake("channels exchanged", "exchange its channels", _mirror(np.pi / 2)),
        *(
            Mistake(f"rate log in {unit}", IMPORT_WITH_UNIT, _scale_rate(size))
            for unit, size in LOGGED_IN.items()
        ),
    ]
    if shown is not None and shown.shown_degc is not None:
        warmer = _warm(shown.shown_degc - shown.logged_degc)
        mistakes.append(Mistake("thermometer wrong", "correct its temperature log", warmer))
    return mistakes


def _scale_rate(factor: float) -> Undo:
    return lambda path: replace(path, rate_integral_rad=factor * path.rate_integral_rad)


def _mirror(about_rad: float) -> Undo:
    """mθ → about − mθ, and the other sign of the quadrature."""
    return lambda path: replace(
        path, angle_rad=about_rad / path.mode_number - path.angle_rad, ratio=-path.ratio
    )


def _warm(degc: float) -> Undo:
    return lambda path: replace(path, temperature_degc=path.temperature_degc + degc)


def read_mistake(
    path: AnglePath, shown: ShownTemperature | None, contradict: Callable[[AnglePath], float]
) -> tuple[str, str] | None:
    """What is wrong with a run and what to do, where one usual mistake says it.

    Parameters
    ----------
    path
        The run, as logged.
    shown
        What its frequency says of its temperature; None: what is logged.
    contradict
        A path -> how far the other runs contradict it, χ² per degree of freedom.

    Returns
    -------
    tuple or None
        In words; None where no mistake removes the contradiction.

    Examples
    --------
    A run that agrees with the others once its rate is turned round:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.stages.calibration.odd_readings import read_mistake
    >>> path = draw_path(0.5, rate_integral_rad=-0.5 * np.arange(600.0))
    >>> def contradict(path):
    ...     return float(1e6 * np.sum((path.turn + 0.55 * path.rotation) ** 2))
    >>> read_mistake(path, None, contradict)[0]
    'rate log of wrong sign or one channel inverted or channels exchanged'
    """
    channel = find_silent_channel(path)
    if channel is not None:
        return (
            f"channel {channel} silent",
            f"look at the cable and the gain of channel {channel}, leave the run out",
        )
    mistakes = list_mistakes(shown)
    left = np.array([contradict(mistake.undo(path)) for mistake in mistakes])
    if left.min() < EXPLAINED * contradict(path):
        alike = [m for m, chi2 in zip(mistakes, left) if chi2 <= ALIKE * left.min() + ALIKE]
        return _join(alike)
    if shown is None:
        return None
    return "another gyro's run, or another sampling rate", "look whose run it is, leave it out"


def _join(mistakes: Sequence[Mistake]) -> tuple[str, str]:
    """Mistakes that say as much, as alternatives."""
    return " or ".join(m.what for m in mistakes), " or ".join(
        dict.fromkeys(m.correction for m in mistakes)
    )


def describe_odd_run(name: str, read: tuple[str, str] | None, evidence: str) -> Suspicion:
    """A run that the others contradict, in words.

    Parameters
    ----------
    name
        Of the run.
    read
        What is wrong and what to do, where that is known.
    evidence
        The figures that show it.

    Returns
    -------
    Suspicion
        With what to do.

    Examples
    --------
    >>> from hrg_cli.stages.calibration.odd_readings import describe_odd_run
    >>> describe_odd_run("a", None, "its wave turns as at 1 rad/s, 2 is logged").what
    'not as they predict'
    """
    unknown = "not as they predict", "look whose run it is, correct its logs or leave it out"
    what, correction = read or unknown
    return Suspicion(name, what, evidence, correction)
