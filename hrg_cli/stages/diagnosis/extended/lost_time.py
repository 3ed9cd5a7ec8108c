"""Diagnosis, the time that a run lost as its slow motion shows it.

A step of the phase leaves open how many periods are missing, and where some periods are a whole
number of samples, how many samples. The wave turned and died away meanwhile: the fitted motion of
the piece behind the loss, carried back along the whole equation, meets that of the piece before it
at one time lost alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....fitting.causes.extended_fit import ExtendedFit, place_on_rows
from ....fitting.causes.wave_frame import to_complex
from ....records import Wave
from ..drive.command_log import shift_commands
from ..samples.lost_samples import PhaseStep
from .carried_start import find_start

Array = np.ndarray
ROUNDS = 5
"""Times that the meeting is looked for from where it was last."""
SMALL = 1e-6
"""Part of the wave's size by which its shape is differentiated."""
SETTLED = 1e-2
"""σ of the time to which the meeting is settled."""


def time_losses(
    steps: Sequence[PhaseStep], fit: ExtendedFit, waves: Sequence[Wave], origin: Sequence[int]
) -> list[PhaseStep]:
    """The steps with the time by which the fitted motion moved on at each, where the fit knows that
    better than the windows beside the step.

    Parameters
    ----------
    steps
        Of the runs' phases.
    fit
        Of the final model to the pieces.
    waves
        Of the runs, whole.
    origin
        The wave that each piece is of.

    Returns
    -------
    list of PhaseStep
        As many.

    Examples
    --------
    Where nothing was lost there is nothing to time:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_fit, draw_waves
    >>> from hrg_cli.stages.diagnosis.extended.lost_time import time_losses
    >>> time_losses([], draw_fit(), draw_waves(), [0, 1, 2])
    []
    """
    out = []
    for step in steps:
        meeting = _find_meeting(step, fit, waves[step.run], origin)
        found = None if meeting is None else meeting.find()
        if found is not None and found[1] < step.shift_std_s:
            step = replace(step, shift_s=found[0], shift_std_s=found[1])
        out.append(step)
    return out


@dataclass(frozen=True)
class _Meeting:
    """Two pieces of a run, of which the second is carried back by the time lost to the last row of
    the first, where the shapes of both waves are the same; `doubt` (3, 3): covariance of the
    shapes' difference."""

    fit: ExtendedFit
    wave: Wave
    second: int
    at_s: float
    shape: Array
    doubt: Array

    def miss(self, lost_s: float) -> Array:
        """Difference of the shapes (3,) for a time lost."""
        start = find_start(self.fit, self.second, self.wave, False, self.at_s - lost_s)
        off = _find_shape(start) - self.shape
        return np.array([off[0], np.angle(np.exp(1j * off[1])), off[2]])

    def find(self) -> tuple[float, float] | None:
        """The time lost and its σ, which holds what no time lost explains; None: none is found."""
        lost, step_s = 0.0, float(self.wave.window_s)
        for _ in range(ROUNDS):
            off = self.miss(lost)
            slope = (self.miss(lost + step_s) - self.miss(lost - step_s)) / (2 * step_s)
            weighted = np.linalg.solve(self.doubt, slope)
            known = float(weighted @ slope)
            if not (np.isfinite(known) and known > 0):
                return None
            change = -float(weighted @ off) / known
            lost += change
            if abs(change) < SETTLED / np.sqrt(known):
                left = self.miss(lost)
                beside = float(left @ np.linalg.solve(self.doubt, left)) / (len(left) - 1)
                return lost, float(np.sqrt(max(1.0, beside) / known))
        return None


def _find_meeting(
    step: PhaseStep, fit: ExtendedFit, wave: Wave, origin: Sequence[int]
) -> _Meeting | None:
    """The two pieces beside a step; None where one was too short, or where the rows of the fit are
    not each other's own, as beside a drive's log."""
    series = fit.series
    own = [k for k, number in enumerate(origin) if number == step.run]
    begins = [float(series.time_s[k][series.weight[k] > 0][0]) for k in own]
    before = [k for k, t in zip(own, begins, strict=True) if t < step.time_s]
    behind = [k for k, t in zip(own, begins, strict=True) if t > step.time_s]
    if not before or not behind or series.scatter is not None or series.unsettled is not None:
        return None
    first, second = before[-1], behind[0]
    rows = np.flatnonzero(series.weight[first] > 0)
    last, at_s = int(rows[-1]), float(series.time_s[first, rows[-1]])
    gap = float(series.time_s[second, 0]) - at_s
    shown = fit.flow.rows.compute_displacement(fit.prediction.motion)
    changes = _find_changes(fit)
    early, late, there = (
        _change_shape(shown[k, row], changes[k, row])
        for k, row in ((first, int(rows[0])), (first, last), (second, 0))
    )
    # what a coordinate does to the shape between the pieces it does as fast as along the first
    grown = (late - early) * gap / (at_s - float(series.time_s[first, rows[0]]))
    apart = there - late - grown
    noise = max(1.0, fit.chi2 / fit.dof)
    doubt = noise * (apart @ fit.covariance @ apart.T)
    wave = shift_commands(wave, series.drive_late_s)
    return _Meeting(fit, wave, second, at_s, _find_shape(shown[first, last]), doubt)


def _find_changes(fit: ExtendedFit) -> Array:
    """Changes (R, n, 2, k) of the envelopes by the fit's numbers, in the signals' unit."""
    placed = np.moveaxis(place_on_rows(fit, fit.design.to_matrix()), -1, 0)
    return np.stack([fit.series.to_units(to_complex(one)) for one in placed], axis=-1)


def _find_shape(u: Array) -> Array:
    """Size, twice the angle and ellipticity (..., 3) of envelopes (..., 2): all but the phase."""
    C, S = u[..., 0], u[..., 1]
    power = np.abs(C) ** 2 + np.abs(S) ** 2
    cross = 2 * C * np.conj(S)
    angle = np.arctan2(cross.real, np.abs(C) ** 2 - np.abs(S) ** 2)
    return np.stack([np.log(power), angle, cross.imag / power], axis=-1)


def _change_shape(u: Array, changes: Array) -> Array:
    """Changes (3, k) of the shape of envelopes u (2,) by changes of these (2, k)."""
    size = float(np.linalg.norm(u))
    largest = np.maximum(np.linalg.norm(changes, axis=0), np.finfo(float).tiny)
    step = SMALL * size * changes / largest
    off = _find_shape(u + step.T) - _find_shape(u - step.T)
    off[:, 1] = np.angle(np.exp(1j * off[:, 1]))
    return (off * (largest / (2 * SMALL * size))[:, None]).T
