"""Envelopes without what their own motion within a window pulls them by.

A window's fit takes the envelope for constant (or for a straight line); a slope or a bend that it
does not hold moves the coefficients by a known factor times itself (`basis.compute_pull`), and
slope and bend are known from the neighbouring windows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..medians import find_known_median, find_median
from ..noise.window_scatter import estimate_scattered_variance
from .envelope_motion import (
    compute_motion_residual,
    compute_pull_noise,
    does_motion_count,
    estimate_better_slopes,
    estimate_curvatures,
    estimate_slopes,
    measure_bend_power,
    take_off_pull,
)
from .neighbours import estimate_from_neighbours
from .windows import Fits

Array = np.ndarray

TAKEN_OFF = 3
"""Times the slopes are found anew beside their own pull: of short windows at the ends it is a
tenth of the wave's motion, and goes down to a fifth each time."""
UNSURE = 3.0
"""Times its usual variance at which a window is no neighbour that tells a motion: the bend of nine
rows would be made of its noise alone."""
PROBE, PROBED = 16, 256
"""One row of so many tells whether the curvature within short windows is worth its correction; of
the scatter too where so many rows tell it."""


def _find_sure(fits: Fits) -> Array | None:
    """Windows (n,) that tell the motion of those beside them: not those a gap has left few samples
    of. None: all of them are alike."""
    variance = fits.variance.mean(axis=1)
    if len(variance) == 1:
        return None
    return np.asarray(variance < UNSURE * find_known_median(variance))


@dataclass(frozen=True)
class Still:
    """Envelopes (channels, windows, tones) without the pull of their motion within a window; the
    part of the squared residual that the motion explains, by what taking it off raises the standard
    deviation, and the variance that the doubt of the bend leaves; None where there is none."""

    envelope: Array
    known_residual2: Array | None
    noisier: float
    doubt2: Array | None


@dataclass(frozen=True)
class MotionWithin:
    """How the motion within windows is taken off: their length, whether their fit holds the slope,
    whether every bend counts."""

    window_s: float
    moving: bool
    """Whether the fit holds t·cos, t·sin."""
    takes_bends_off: bool
    """Whether every window's bend is taken off; of shorter ones only where it counts."""
    judged_s: tuple[float, float]
    """Times between which the envelope's motion is judged: of a struck body, its run-down."""

    def take_off(self, fits: Fits, u: Array, turn: Array, times: Array, offset: Array) -> Still:
        """The envelopes without what their slope, and where it is needed their bend, within the
        window pulls them by.

        Parameters
        ----------
        fits
            Of the windows.
        u
            Their envelopes (channels, windows, tones) in reference phase.
        turn
            By what u was turned to it, (windows, tones).
        times
            Centres (windows,), s.
        offset
            Of the basis from the reference (tones,), rad/s.

        Returns
        -------
        Still
            With what the motion explains and leaves unsure.
        """
        sure = _find_sure(fits)
        smooth, known = self._take_slope_off(fits, u, turn, offset, sure)
        bend = doubt = None
        judged = self._keep_judged(smooth, times)
        if self.takes_bends_off or self._do_bends_count(judged, offset, fits):
            bends = estimate_from_neighbours(
                lambda rows: estimate_curvatures(rows, offset, self.window_s),
                judged,
                offset,
                self.window_s,
                sure,
            )
            bend, doubt = bends or (None, None)
        noisier = compute_pull_noise(
            fits.slope, fits.curvature if bend is not None else None, self.window_s
        )
        if bend is not None:
            smooth = take_off_pull(smooth, bend, turn, fits.curvature)
            if does_motion_count(fits.residual2, bend, fits.curvature):
                more = compute_motion_residual(bend, turn, fits.curvature)
                known = more + (0.0 if known is None else known)
        doubt2 = None
        if doubt is not None:
            # a bend pulls by α times itself, and so does its doubt: the largest α serves all
            doubt2 = (np.abs(fits.curvature.alpha).mean(0).max() * doubt) ** 2
        return Still(smooth, known, noisier, doubt2)

    def _take_slope_off(
        self, fits: Fits, u: Array, turn: Array, offset: Array, sure: Array | None
    ) -> tuple[Array, Array | None]:
        """The envelopes without the pull of their slopes, and the part of the squared residual that
        these explain where they count; as they are where the fit holds the slopes."""
        slope = None if self.moving else self._see_beside(estimate_slopes, u, offset, sure)
        if slope is None:
            return u, None
        known = None
        if fits.apart or does_motion_count(fits.residual2, slope, fits.slope):
            for _ in range(TAKEN_OFF):
                still = take_off_pull(u, slope, turn, fits.slope)
                better = self._see_beside(estimate_better_slopes, still, offset, sure)
                slope = slope if better is None else better
            known = None if fits.apart else compute_motion_residual(slope, turn, fits.slope)
        return take_off_pull(u, slope, turn, fits.slope), known

    def _see_beside(
        self,
        slope_of: Callable[[Array, Array, float], Array | None],
        u: Array,
        offset: Array,
        sure: Array | None,
    ) -> Array | None:
        """The envelopes' slopes from their neighbours, past windows that hold no number or few
        samples."""

        def motion(rows: Array) -> tuple[Array] | None:
            slope = slope_of(rows, offset, self.window_s)
            return None if slope is None else (slope,)

        found = estimate_from_neighbours(motion, u, offset, self.window_s, sure)
        return None if found is None else found[0]

    def _do_bends_count(self, u: Array, offset: Array, fits: Fits) -> bool:
        """Whether the envelopes' curvature moves a short window by more than a tenth of its noise,
        judged by one row of `PROBE`."""
        pull2 = (
            measure_bend_power(u, offset, self.window_s, PROBE)
            * float(np.abs(fits.curvature.alpha[::PROBE]).mean(0).max()) ** 2
        )
        freedom = fits.freedom if np.ndim(fits.freedom) == 0 else fits.freedom[::PROBE]
        variance = float(find_median(fits.variance[::PROBE]))
        own, every = fits.variance.mean(1), PROBE if u.shape[1] >= PROBED * PROBE else 1
        for k in range(2):
            noise2 = fits.residual2[k, ::PROBE] / np.maximum(freedom, 1) * variance
            noise2 = noise2[np.isfinite(noise2)]
            if not len(noise2):
                continue
            # the residual of few samples is their motion's: the scatter from window to window is
            # not
            seen = estimate_scattered_variance(u[k], own, every) * variance
            if pull2[k] > 0.01 * np.fmin(find_median(noise2), seen):
                return True
        return False

    def _keep_judged(self, u: Array, times: Array) -> Array:
        """The envelopes (channel, rows, F), NaN where they are outside the run-down: a strike's
        bend is not that of the rows beside it."""
        if times[0] > self.judged_s[0] and times[-1] < self.judged_s[1]:
            return u
        return np.where(
            ((times > self.judged_s[0]) & (times < self.judged_s[1]))[:, None], u, np.nan
        )
