"""What the other runs say of runs that are left out: their own tables, fitted anew, and how far
they contradict a run."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...fitting.noise.increment_noise import AngleNoise
from ...fitting.tables.increments import AnglePath
from ...fitting.tables.joint import fit
from ...fitting.tables.normal_pieces import TableSolution, accumulate
from ...fitting.tables.table_design import predict_turn
from ...fitting.tables.table_layout import Model, TableLayout
from .choice import TriedVariant
from .factors import build_factors
from .guards import compute_score, find_unseen_directions
from .late_log import follow, set_right
from .preparation import PreparedRuns
from .programme import examine
from .scale_factor_course import ScaleFactors
from .trials import FullFit
from .turn_against_log import FAR

Array = np.ndarray
Answer = Callable[[FullFit, int], TriedVariant]
"""A fit and so many harmonics of 2mθ in the drift -> the model that is best of them."""
MOST_HOPS = 0.02
"""Part of a run's increments that may hide half a turn of mθ."""


@dataclass(frozen=True)
class Rest:
    """The runs that are left without some, fitted anew, and the model that is best of them."""

    whole: FullFit
    best: TriedVariant

    def contradict(self, path: AnglePath) -> float:
        """χ² per degree of freedom of a run that was left out, as its logs say it, against what the
        others' answer predicts, at the noise that these have."""
        fitted, tried = self.whole.fitted, self.best.tried
        whites, walks = zip(*((noise.white, noise.walk) for noise in fitted.noises))
        noise, about = (
            AngleNoise(float(np.median(whites)), max(walks)),
            fitted.solution.coefficients,
        )
        path = self._without_hops(path)
        A, b, _ = accumulate([path], [noise], fitted.layout, [path.turn], about, about).sum()
        return compare_with_others(A, b, tried.solution, fitted.pieces.sum()[0], tried.model)

    def _without_hops(self, path: AnglePath) -> AnglePath:
        """The path without half turns of mθ that its gaps hide, where they are few."""
        hops = np.round((path.turn - self.predict(path)) / np.pi)
        few = np.count_nonzero(hops) <= MOST_HOPS * len(path)
        return path.remove_jumps(hops) if few and hops.any() else path

    def predict(self, path: AnglePath) -> Array:
        """The turns m·Δθ (n,) that the others' tables make of a run."""
        coefficients = self.best.tried.solution.coefficients
        return predict_turn(path, self.whole.layout, coefficients, coefficients)

    @property
    def scale_factors(self) -> ScaleFactors:
        """K of their answer at its nodes."""
        return ScaleFactors.from_solution(self.whole.layout, self.best.tried.solution)

    def set_right(self, path: AnglePath) -> AnglePath:
        """A run with its log moved in time as theirs were."""
        late = self.whole.late
        return set_right(path, late.taken_s) if late is not None and late.taken_s else path

    def find_rates(self, path: AnglePath) -> tuple[float, float]:
        """Mean rates [rad/s] of a run: as it is logged, and as the others' tables read its wave."""
        coefficients = self.best.tried.solution.coefficients
        standing = replace(path, rate_integral_rad=np.zeros_like(path.rate_integral_rad))
        drifted = float(self.predict(standing).sum())
        scale = self.whole.layout.compute_mean_scale_factor(coefficients)
        seconds = float(path.interval_s.sum())
        seen = (drifted - float(path.turn.sum())) / scale / seconds
        return float(path.rotation.sum()) / seconds, seen

    def turns_otherwise(self, path: AnglePath) -> bool:
        """Whether these rates are far apart, as no drift makes them."""
        logged, seen = self.find_rates(path)
        return abs(seen - logged) > FAR * max(abs(seen), abs(logged))


def leave_out(
    odd: Collection[int],
    runs: PreparedRuns,
    whole: FullFit,
    harmonics: int,
    answer: Answer,
    with_nodes: bool = False,
) -> Rest | None:
    """The runs without some, fitted anew.

    Parameters
    ----------
    odd
        Places of those that are left out.
    runs
        As they were prepared.
    whole
        All of them fitted with everything free.
    harmonics
        Of 2mθ in the drift that the others must still give.
    answer
        A fit and so many harmonics -> the model that is best of them.
    with_nodes
        Whether a node that the others cannot tell alone may go, with all its runs.

    Returns
    -------
    Rest or None
        None where they give no tables.

    Examples
    --------
    One run gives none:

    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.table_layout import TableLayout
    >>> from hrg_cli.stages.calibration.others import leave_out
    >>> path = draw_path(0.2)
    >>> layout = TableLayout(np.array([20.0]), "temperature", 2, 1, 0)
    >>> runs = Told(forced=[path, path], free=[], nodes=layout.nodes)
    >>> leave_out([0], runs, Told(layout=layout), 0, None) is None
    True
    """
    layout, kept = whole.layout, [p for r, p in enumerate(runs.forced) if r not in odd]
    if with_nodes and not _give_tables(kept, layout, harmonics):
        at = [_find_node(path, layout) for path in runs.forced]
        lost = {at[run] for run in odd}
        kept = [path for path, node in zip(runs.forced, at) if node not in lost]
        layout = _lay_out(kept, layout, np.delete(layout.nodes, list(lost)))
    if not _give_tables(kept, layout, harmonics):
        return None
    # with the factors that all runs have: one that the others alone have, no answer says of this
    fitted, free, late = follow(fit(kept, layout), runs.free)
    rest = FullFit(fitted, free, late, layout.factors, layout)
    return Rest(rest, answer(rest, harmonics))


def _lay_out(paths: Sequence[AnglePath], layout: TableLayout, nodes: Array) -> TableLayout:
    """The same tables and factors over other nodes."""
    if not len(nodes):
        return replace(layout, nodes=nodes)
    at = nodes, layout.axis, layout.interpolation
    factors, widths = build_factors(paths, *at, list(layout.factors))
    return replace(layout, nodes=nodes, factors=factors, factor_columns=widths)


def _give_tables(kept: Sequence[AnglePath], layout: TableLayout, harmonics: int) -> bool:
    """Whether runs tell the tables of their nodes."""
    # of K the first harmonic, where it may have any
    of_scale = min(1, layout.scale_harmonics)
    return bool(kept and len(layout.nodes)) and not any(
        lack.refuses for lack in examine(kept, layout.nodes, layout.axis, harmonics, of_scale)
    )


def _find_node(path: AnglePath, layout: TableLayout) -> int:
    """The node that is nearest to a run."""
    return int(np.argmin(np.abs(layout.nodes - np.mean(layout.find_abscissa(path)))))


def compare_with_others(
    A: Array, b: Array, others: TableSolution, known: Array, model: Model
) -> float:
    """How far a run contradicts what others predict.

    Parameters
    ----------
    A
        The run's normal matrix (P, P).
    b
        Its right-hand side (P,).
    others
        The solution without it.
    known
        The others' information (P, P).
    model
        What of the coefficients is free.

    Returns
    -------
    float
        χ² per degree of freedom; what the others do not tell contradicts nothing.

    Examples
    --------
    A coefficient of 2 ± 1 where the others have 0 ± 1:

    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.normal_pieces import solve
    >>> from hrg_cli.fitting.tables.table_layout import Model
    >>> from hrg_cli.stages.calibration.others import compare_with_others
    >>> one, model = np.eye(1), Model("", np.eye(1))
    >>> others = solve(one, np.array([0.0]), model)
    >>> float(compare_with_others(one, np.array([2.0]), others, one, model))
    2.0
    """
    unseen = find_unseen_directions(known, model)
    left = b - A @ others.coefficients
    chi2, rank = compute_score(A, left, np.eye(len(b)), others.covariance, 1.0, unseen)
    return chi2 / max(rank, 1)
