"""What a thermometer that one run's frequency contradicts makes of the tables: they are made again
with the temperature that the frequency shows.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ...fitting.tables.joint import fit
from ...fourier import build_harmonic_basis
from ..suspicion import Suspicion
from .choice import TriedVariant
from .late_log import follow
from .odd_thermometer import OddThermometer, find_odd_thermometer
from .others import Answer
from .preparation import PreparedRuns
from .trials import FullFit

MOVED = 1.0
"""Standard deviations of its own, rms over the wave angle, by which a thermometer may move a table
without a word."""
ANGLES = np.linspace(0, np.pi, 24, endpoint=False)
"""mθ at which tables are compared."""


@dataclass(frozen=True)
class ShownThermometer:
    """The run in words, and whether the tables made at the temperature that its frequency shows
    pass every check."""

    suspicion: Suspicion
    mended: bool

    def to_json(self) -> list[dict[str, Any]]:
        """For the JSON."""
        return [self.suspicion.to_json()]


def doubt_thermometer(
    runs: PreparedRuns, whole: FullFit, harmonics: int, answer: Answer
) -> ShownThermometer | None:
    """The run whose thermometer its frequency contradicts, where that matters to the tables.

    Parameters
    ----------
    runs
        As they were prepared.
    whole
        All of them fitted with everything free.
    harmonics
        Of 2mθ in the drift that each fold must leave.
    answer
        A fit and so many harmonics -> the model that is best of them.

    Returns
    -------
    ShownThermometer or None
        None where all agree, where their tables follow something else, or hold what the
        difference would make of them within their own errors.

    Examples
    --------
    Two runs are too few to tell whose thermometer is wrong:

    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.stages.calibration.shown_thermometer import doubt_thermometer
    >>> runs = Told(forced=[draw_path(0.2), draw_path(-0.2)], refusals=[])
    >>> doubt_thermometer(runs, Told(layout=Told(axis="temperature")), 1, None) is None
    True
    """
    if whole.layout.axis != "temperature":
        return None
    odd = find_odd_thermometer(runs.forced)
    if odd is None:
        return None
    if runs.refusals:  # there are no tables to be moved
        return ShownThermometer(odd.suspicion, False) if odd.certain else None
    shown = _fit_as_shown(odd, runs, whole)
    tables = answer(shown, harmonics)
    moved = _compare_tables(answer(whole, harmonics), tables, whole)
    if not (moved > MOVED or odd.certain):
        return None
    found = odd.suspicion
    beside = f"{found.evidence}, which moves the tables by {moved:.2g} of their standard deviations"
    return ShownThermometer(replace(found, evidence=beside), tables.fits)


def _fit_as_shown(odd: OddThermometer, runs: PreparedRuns, whole: FullFit) -> FullFit:
    """All runs fitted with everything free, the odd one at the temperature that it shows."""
    right = [odd.set_right(p) if run == odd.run else p for run, p in enumerate(runs.forced)]
    fitted, free, late = follow(fit(right, whole.layout), runs.free)
    return FullFit(fitted, free, late, whole.factors, whole.layout)


def _compare_tables(logged: TriedVariant, shown: TriedVariant, whole: FullFit) -> float:
    """The most that drift or scale factor of a node differ by, rms over the wave angle, in the σ
    that is told of all runs as logged."""
    layout, solution = whole.layout, logged.tried.solution
    apart = shown.tried.solution.coefficients - solution.coefficients
    covariance = solution.covariance * whole.fitted.chi2_per_dof
    moved = [0.0]
    for node in range(len(layout.nodes)):
        for of, harmonics in (
            (layout.drift(node), layout.drift_harmonics),
            (layout.scale(node), layout.scale_harmonics),
        ):
            basis = build_harmonic_basis(ANGLES / layout.mode_number, harmonics, layout.mode_number)
            variance = np.einsum("ai,ij,aj->a", basis, covariance[of, of], basis)
            square = (basis @ apart[of]) ** 2 / np.maximum(variance, 1e-300)
            moved.append(float(np.sqrt(np.mean(square))))
    return max(moved)
