"""One run that the others contradict: another gyro's of nearly the same frequency, a rate log of the
wrong sign. It is left out and everything is fitted anew, for in the joint fit it makes the noise of all
runs, and stands in for a fault of the loops.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...fitting.tables.increment_noise import build_covariance_bands, whiten
from ...fitting.tables.joint import Fitted
from ...fitting.tables.normal_pieces import TableSolution, solve
from ...fitting.tables.table_design import predict_turn
from ...fitting.tables.table_layout import Model
from .choice import TriedVariant
from .guards import find_unseen_directions, score
from .preparation import PreparedRuns
from .programme import examine
from .trials import FullFit, fit_everything

Array = np.ndarray
CANDIDATES = 3
"""Runs left out in turn, those first that the others predict worst."""
CHANCE = 1e-6
"""Probability with which leaving out a run of the same gyro makes the others so much likelier."""


@dataclass(frozen=True)
class OddRun:
    """The run without which the others pass every check: its mean rate as logged and as their tables
    read its wave."""

    run_id: str
    others: int
    logged_rad_s: float
    shown_rad_s: float

    @property
    def sentence(self) -> str:
        """What to say of it, and what to do."""
        return (
            f"run {self.run_id} contradicts the other {self.others}, which agree without it: by their"
            f" tables its wave turns as at {self.shown_rad_s:.6g} rad/s, {self.logged_rad_s:.6g} is"
            " logged; look whose run it is, correct its logs or leave it out, and calibrate again"
        )


def find_odd_run(
    runs: PreparedRuns,
    whole: FullFit,
    harmonics: int,
    answer: Callable[[FullFit, int], TriedVariant],
) -> OddRun | None:
    """The only run without which the others pass every check, and are likelier by far; None where
    there is none, or several are.

    harmonics: of the drift that the others must still give; answer: the model that is best of a fit
    and so many harmonics.
    """
    layout, found = whole.layout, list[OddRun]()
    limits = (layout.drift_harmonics, layout.scale_harmonics)
    for run in _order_by_surprise(whole.fitted)[:CANDIDATES]:
        kept = [path for r, path in enumerate(runs.forced) if r != run]
        if not kept or any(
            lack.refuses for lack in examine(kept, runs.nodes, layout.axis, harmonics)
        ):
            continue
        rest = fit_everything(replace(runs, forced=kept), limits, layout.axis, layout.interpolation)
        if _are_likelier(whole.fitted, rest.fitted, run) and answer(rest, harmonics).fits:
            found.append(_describe(whole.fitted, rest.fitted, run))
    return found[0] if len(found) == 1 else None


def _order_by_surprise(fitted: Fitted) -> list[int]:
    """The runs, that which the others' coefficients predict worst first."""
    everything, whole = Model("everything", np.eye(fitted.layout.size)), fitted.pieces.sum()
    surprise = []
    for run in range(len(fitted.paths)):
        A, b, _ = fitted.pieces.sum(_pieces_of(fitted, run))
        others: TableSolution = solve(whole[0] - A, whole[1] - b, everything)
        chi2, rank = score(
            A,
            b - A @ others.coefficients,
            np.eye(len(b)),
            others.covariance,
            1.0,
            find_unseen_directions(whole[0] - A, everything),
        )
        surprise.append(chi2 / max(rank, 1))
    return [int(run) for run in np.argsort(-np.array(surprise), kind="stable")]


def _pieces_of(fitted: Fitted, run: int) -> Array:
    """Which pieces (R, S) are a run's."""
    own = np.zeros(fitted.pieces.square.shape, bool)
    own[run] = True
    return own


def _are_likelier(fitted: Fitted, rest: Fitted, run: int) -> bool:
    """Whether the other runs' likelihood rises without one by more than the coefficients that they
    then have for themselves."""
    from scipy.stats import chi2

    fall = sum(_list_log_likelihoods(rest)) - sum(
        value for r, value in enumerate(_list_log_likelihoods(fitted)) if r != run
    )
    return bool(2 * fall > chi2.isf(CHANCE, fitted.layout.size))


def _list_log_likelihoods(fitted: Fitted) -> list[float]:
    """ln L of every run, but for what its number of rows alone adds."""
    out = []
    for run, (path, noise) in enumerate(zip(fitted.paths, fitted.noises)):
        log_determinant = whiten(build_covariance_bands(path, noise), np.zeros(len(path)))[1]
        square = fitted.pieces.compute_chi_square(
            fitted.solution.coefficients, _pieces_of(fitted, run)
        )
        out.append(-0.5 * (log_determinant + square))
    return out


def _describe(fitted: Fitted, rest: Fitted, run: int) -> OddRun:
    """The run with the mean rate at which the others' tables read its wave."""
    path, layout = fitted.paths[run], rest.layout
    coefficients = rest.solution.coefficients
    standing = replace(path, rate_integral_rad=np.zeros_like(path.rate_integral_rad))
    drifted, turned = (
        float(predict_turn(p, layout, coefficients, coefficients).sum()) for p in (standing, path)
    )
    logged = float(path.rotation.sum())
    # of a run at rest the mean scale factor tells, since it turned by no rate that could be divided by
    per_rad = (turned - drifted) / logged if logged else -layout.mean_scale_factor(coefficients)
    seconds = float(path.interval_s.sum())
    shown = (float(fitted.turns[run].sum()) - drifted) / per_rad
    return OddRun(
        path.run_id or f"number {run + 1}", len(rest.paths), logged / seconds, shown / seconds
    )
