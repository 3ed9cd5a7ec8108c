"""One run that the others contradict: another gyro's of nearly the same frequency, a rate log of the
wrong sign. It is left out and everything is fitted anew, for in the joint fit it makes the noise of all
runs, and stands in for a fault of the loops.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...fitting.tables.increment_noise import AngleNoise
from ...fitting.tables.joint import Fitted, fit
from ...fitting.tables.normal_pieces import TableSolution, accumulate, solve
from ...fitting.tables.table_design import predict_turn
from ...fitting.tables.table_layout import Model
from .choice import TriedVariant
from .guards import compute_score, find_unseen_directions
from .late_log import follow
from .preparation import PreparedRuns
from .programme import examine
from .trials import FullFit

Array = np.ndarray
CANDIDATES = 3
"""Runs left out in turn, those first that the others predict worst."""
GROSS = 1e3
"""χ² a degree of freedom of a run against the others' prediction from which it is blamed, as where
`diagnose` asks whose the runs are: less may be a cause that all share, of which one shows most."""


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
    """The only run that the others contradict, and without which they pass every check.

    Parameters
    ----------
    runs
        As they were prepared.
    whole
        All of them fitted with everything free.
    harmonics
        Of 2mθ in the drift that the others must still give.
    answer
        A fit and so many harmonics -> the model that is best of them.

    Returns
    -------
    OddRun or None
        None where there is none, or several are.

    Examples
    --------
    Of two runs none can be left out, for one gives no tables:

    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.increments import AnglePath
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import Model, TableLayout
    >>> from hrg_cli.stages.calibration.odd_run import find_odd_run
    >>> def turn(rate):
    ...     t, one = np.arange(600.0), np.ones(600)
    ...     angle = -0.275 * rate * t + 1e-6 * random.standard_normal(600)
    ...     return AnglePath(
    ...         "", True, 2, "", t, one, angle, 1e-12 * one, rate * t, 20 * one, 5e3 * one, 0 * t, one,
    ...         0 * t, None, None, 600, 1.0,
    ...     )
    >>> random, layout = np.random.default_rng(1), TableLayout(np.array([20.0]), "temperature", 2, 1, 0)
    >>> fitted = fit([turn(rate) for rate in (-0.2, -0.1, 0.1, 0.2)], layout)
    >>> two = fit([turn(-0.2), turn(0.2)], layout)
    >>> runs = Told(forced=two.paths, free=[], nodes=layout.nodes)
    >>> find_odd_run(runs, Told(layout=layout, fitted=two), 0, None) is None
    True
    """
    layout, found = whole.layout, list[OddRun]()
    for run in _order_by_surprise(whole.fitted)[:CANDIDATES]:
        kept = [path for r, path in enumerate(runs.forced) if r != run]
        if not kept or any(
            lack.refuses for lack in examine(kept, runs.nodes, layout.axis, harmonics)
        ):
            continue
        # with the factors that all runs have: one that the others alone have, no answer says of this
        fitted, free, late = follow(fit(kept, layout), runs.free)
        rest = replace(whole, fitted=fitted, free=free, late=late)
        best = answer(rest, harmonics)
        if best.fits and _is_contradicted(whole.fitted, rest.fitted, run, best):
            found.append(_describe(whole.fitted, rest.fitted, run))
    return found[0] if len(found) == 1 else None


def _order_by_surprise(fitted: Fitted) -> list[int]:
    """The runs, that which the others' coefficients predict worst first."""
    everything, whole = Model("everything", np.eye(fitted.layout.size)), fitted.pieces.sum()
    surprise = []
    for run in range(len(fitted.paths)):
        own = np.zeros(fitted.pieces.square.shape, bool)
        own[run] = True
        A, b, _ = fitted.pieces.sum(own)
        others = solve(whole[0] - A, whole[1] - b, everything)
        surprise.append(_compare(A, b, others, whole[0] - A, everything))
    return [int(run) for run in np.argsort(-np.array(surprise), kind="stable")]


def _compare(A: Array, b: Array, others: TableSolution, known: Array, model: Model) -> float:
    """χ² a degree of freedom of a run's normal equations A (P, P), b (P,) against what a model
    predicts that the others, of information `known` (P, P), tell."""
    unseen = find_unseen_directions(known, model)
    left = b - A @ others.coefficients
    chi2, rank = compute_score(A, left, np.eye(len(b)), others.covariance, 1.0, unseen)
    return chi2 / max(rank, 1)


def _is_contradicted(fitted: Fitted, rest: Fitted, run: int, answer: TriedVariant) -> bool:
    """Whether a run is not what the others' answer predicts, at the noise that they have without
    it."""
    whites, walks = zip(*((noise.white, noise.walk) for noise in rest.noises))
    noise, about = AngleNoise(float(np.median(whites)), max(walks)), rest.solution.coefficients
    path, turn = fitted.paths[run], fitted.turns[run]
    A, b, _ = accumulate([path], [noise], rest.layout, [turn], about, about).sum()
    tried = answer.tried
    return _compare(A, b, tried.solution, rest.pieces.sum()[0], tried.model) > GROSS


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
    per_rad = (
        (turned - drifted) / logged if logged else -layout.compute_mean_scale_factor(coefficients)
    )
    seconds = float(path.interval_s.sum())
    shown = (float(fitted.turns[run].sum()) - drifted) / per_rad
    return OddRun(
        path.run_id or f"number {run + 1}", len(rest.paths), logged / seconds, shown / seconds
    )
