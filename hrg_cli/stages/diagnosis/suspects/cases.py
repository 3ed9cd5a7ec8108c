"""One mistake of one run with the fit that it leaves, and what the search for wrong runs found."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ....errors import HrgError
from ....fitting.causes import extended_fit
from ....fitting.causes.extended_fit import ExtendedFit
from ....fitting.envelopes.coordinates import FREQUENCY_SPLIT
from ....records import Wave
from ...suspicion import Suspicion
from ..thresholds import MISTAKE_PRICE, UNUSUAL_SCALE_FACTOR
from .laws import is_one_law
from .logs import has_usual_scale_factor
from .readings import DAMPING, Reading

Fitted = Callable[..., ExtendedFit]
"""The base model fitted to waves, one a piece of a run; `quick=True`: beside nothing that a drive's
log may have missed."""


@dataclass(frozen=True)
class SuspectCase:
    """One reading of one run with the fit it leaves."""

    run: int
    reading: Reading
    fit: ExtendedFit
    apart: ExtendedFit | None = None
    """The fit of the run alone, where it is none of the others'."""

    @property
    def chi2(self) -> float:
        """Of all runs."""
        return self.fit.chi2 + (self.apart.chi2 if self.apart else 0.0)

    @property
    def dof(self) -> int:
        """Of all runs."""
        return self.fit.dof + (self.apart.dof if self.apart else 0)

    def compute_price(self, noise: float) -> float:
        """Excess of χ² at a noise, what its freedom costs, and a scale factor that no resonator
        has."""
        rows = len(self.fit.residual) + (len(self.apart.residual) if self.apart else 0)
        odd = 0.0 if has_usual_scale_factor(self.fit) else UNUSUAL_SCALE_FACTOR
        # less one a row: a reading that leaves rows out is not the better for it
        excess = self.chi2 / noise - rows
        return excess + self.reading.parameters * float(np.log(rows)) + odd


@dataclass(frozen=True)
class SuspectFound:
    """What explains the runs: the suspicions, the numbers free in them, the fit before and the fit
    once they are undone, and what that leaves."""

    suspicions: tuple[Suspicion, ...]
    numbers: int
    before: ExtendedFit
    fit: ExtendedFit
    chi2_per_dof: float

    @property
    def follow_a_law(self) -> bool:
        """Whether the mistakes of several runs are one law of what is logged of these."""
        return len(self.suspicions) > 1 and is_one_law(
            self.before, self.chi2_per_dof, self.numbers, MISTAKE_PRICE
        )


def fit_or_none(waves: Sequence[Wave], fitted: Fitted, quick: bool = False) -> ExtendedFit | None:
    """The base model's fit to waves; None where it finds none.

    Parameters
    ----------
    waves
        Of the runs.
    fitted
        The base model's fit to waves.
    quick
        Beside nothing that a drive's log may have missed.

    Returns
    -------
    ExtendedFit or None
        Of a finite χ².

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves, fit_waves
    >>> from hrg_cli.stages.diagnosis.suspects.cases import fit_or_none
    >>> fit_or_none(draw_waves(), fit_waves).converged, fit_or_none([], fit_waves)
    (True, None)
    """
    with contextlib.suppress(extended_fit.DivergedError, HrgError, np.linalg.LinAlgError):
        fit = fitted(waves, quick=True) if quick else fitted(waves)
        if np.isfinite(fit.chi2):
            return fit
    return None


def is_any_logged(waves: Sequence[Wave]) -> bool:
    """Whether a drive is logged, so that a fit in full takes several to allow for its log.

    Parameters
    ----------
    waves
        Of the runs.

    Returns
    -------
    bool
        Whether one holds the commands of its main force.

    Examples
    --------
    Free runs are not driven:

    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.suspects.cases import is_any_logged
    >>> is_any_logged(draw_waves())
    False
    """
    return any(wave.drive_main is not None for wave in waves)


def describe_gyro(fit: ExtendedFit) -> str:
    """A fit's resonator in a few figures.

    Parameters
    ----------
    fit
        Of the runs.

    Returns
    -------
    str
        Mean frequency, damping and frequency split.

    Examples
    --------
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves, fit_waves
    >>> from hrg_cli.stages.diagnosis.suspects.cases import describe_gyro
    >>> describe_gyro(fit_waves(draw_waves())).split(", ")[0]
    '500 Hz'
    """
    damping, split = fit.coordinate(DAMPING), float(np.hypot(*fit.point.p[FREQUENCY_SPLIT]))
    return (
        f"{fit.frequency_hz.mean():.6g} Hz, damping {damping:.4g} 1/s, frequency split {split:.4g}"
        " rad/s"
    )
