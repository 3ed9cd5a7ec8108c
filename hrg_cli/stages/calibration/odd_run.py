"""Runs that the others contradict: another gyro's of nearly the same frequency, a rate log in
another unit or of the wrong sign, a channel that is silent. They are left out and everything is
fitted anew, for in the joint fit such a run makes the noise of all runs, and stands in for a fault
of the loops.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...fitting.tables.increments import AnglePath
from ...fitting.tables.joint import Fitted
from ...fitting.tables.normal_pieces import solve
from ...fitting.tables.table_layout import Model
from ..suspicion import Suspicion
from .odd_readings import describe_odd_run, read_mistake
from .others import Answer, Rest, compare_with_others, leave_out
from .preparation import PreparedRuns
from .scale_factor_course import ScaleFactors
from .shown_temperatures import ShownTemperature, find_wrong_temperatures
from .trials import FullFit
from .turn_against_log import find_wrong_turns

CANDIDATES = 3
"""Runs left out in turn, those first that the others predict worst."""
GROSS = 1e3
"""χ² per degree of freedom of a run against the others' prediction from which it is blamed, as
where `diagnose` asks whose the runs are: less may be a cause that all share, of which one shows
most."""

BETTER = 0.2
"""Part of the others' departure of K from node to node that a run must leave, to be the one that is
wrong."""


@dataclass(frozen=True)
class OddRuns:
    """Runs that the others contradict, and whether these pass every check without them."""

    suspicions: tuple[Suspicion, ...]
    others: int
    agree: bool

    @property
    def sentences(self) -> list[str]:
        """What to say of them, and what to do: one a run."""
        without = "it" if len(self.suspicions) == 1 else "them"
        agree = f", which agree without {without}" if self.agree else ""
        return [
            f"run {one.run_id} contradicts the other {self.others}{agree}: {one.what}"
            f" ({one.evidence}); {one.correction}, and calibrate again"
            for one in self.suspicions
        ]

    def to_json(self) -> list[dict[str, Any]]:
        """For the JSON."""
        return [one.to_json() for one in self.suspicions]


def find_odd_runs(
    runs: PreparedRuns,
    whole: FullFit,
    harmonics: int,
    answer: Answer,
    fixed_nodes: bool = False,
    doubted: bool = True,
) -> OddRuns | None:
    """The runs that the others contradict.

    Runs that turn by nothing like their logs, or that oscillate unlike others of their temperature,
    are left out together; else each of those that the others predict worst, of which one alone may
    be it.

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
    fixed_nodes
        Whether the answer knows these nodes alone.
    doubted
        Whether the tables of all runs fail a check; else only turns far from their logs are looked
        at, which few runs at a node fit as well.

    Returns
    -------
    OddRuns or None
        None where there is none, or where any of several may be it.

    Examples
    --------
    Of two runs none can be left out, for one gives no tables:

    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import Model, TableLayout
    >>> from hrg_cli.stages.calibration.odd_run import find_odd_runs
    >>> random, layout = (
    ...     np.random.default_rng(1),
    ...     TableLayout(np.array([20.0]), "temperature", 2, 1, 0),
    ... )
    >>> fitted = fit([draw_path(rate, random) for rate in (-0.2, -0.1, 0.1, 0.2)], layout)
    >>> two = fit([draw_path(-0.2, random), draw_path(0.2, random)], layout)
    >>> runs = Told(forced=two.paths, free=[], nodes=layout.nodes)
    >>> find_odd_runs(runs, Told(layout=layout, fitted=two), 0, None) is None
    True
    """
    turned = find_wrong_turns(runs.forced)
    shown = find_wrong_temperatures(runs.forced) if doubted else {}
    for marked in dict.fromkeys(
        (frozenset({*shown, *turned}), frozenset(turned), frozenset(shown))
    ):
        # a turn far from its log is told by tables of other nodes too
        sure = marked <= set(turned) and not fixed_nodes
        rest = leave_out(marked, runs, whole, harmonics, answer, sure) if marked else None
        if rest is not None and all(
            (rest.turns_otherwise(runs.forced[run]) if run in turned else rest.best.fits)
            and (run in shown or _is_contradicted(rest, runs.forced[run]))
            for run in marked
        ):
            return _describe(sorted(marked), runs, rest, shown)
    found, untold = dict[int, Rest](), False
    for run in _order_by_surprise(whole.fitted)[:CANDIDATES] if doubted else ():
        rest = leave_out({run}, runs, whole, harmonics, answer)
        untold |= rest is None
        if rest is not None and rest.best.fits and _is_contradicted(rest, runs.forced[run]):
            found[run] = rest
    odd = _choose_by_scale_factor(found, whole if untold else None)
    return None if odd is None else _describe([odd], runs, found[odd], shown)


def _choose_by_scale_factor(found: Mapping[int, Rest], whole: FullFit | None) -> int | None:
    """The one of runs, any of which may be wrong, without which K is that of one resonator; None
    where several are. `whole`: all runs, where one that may be wrong leaves too few without it."""
    if len(found) == 1 and whole is None:
        return next(iter(found))
    apart = {
        run: float(rest.scale_factors.measure_departures().max())
        for run, rest in found.items()
        if rest.scale_factors.is_plausible()
    }
    best = min(apart, key=lambda run: apart[run], default=None)
    others = [apart[run] for run in apart if run != best]
    if whole is not None:
        fitted = whole.fitted
        of_all = ScaleFactors.from_solution(fitted.layout, fitted.solution)
        others.append(float(of_all.measure_departures().max()))
    if best is None or (others and not apart[best] < BETTER * min(others)):
        return None
    return best


def _order_by_surprise(fitted: Fitted) -> list[int]:
    """The runs, that which the others' coefficients predict worst first."""
    everything, whole = Model("everything", np.eye(fitted.layout.size)), fitted.pieces.sum()
    surprise = []
    for run in range(len(fitted.paths)):
        own = np.zeros(fitted.pieces.square.shape, bool)
        own[run] = True
        A, b, _ = fitted.pieces.sum(own)
        others = solve(whole[0] - A, whole[1] - b, everything)
        surprise.append(compare_with_others(A, b, others, whole[0] - A, everything))
    return [int(run) for run in np.argsort(-np.array(surprise), kind="stable")]


def _is_contradicted(rest: Rest, path: AnglePath) -> bool:
    """Whether a run is grossly not what the others' answer predicts."""
    return rest.contradict(rest.set_right(path)) > GROSS


def _describe(
    odd: list[int], runs: PreparedRuns, rest: Rest, shown: dict[int, ShownTemperature]
) -> OddRuns:
    """What is wrong with runs, where one usual mistake says it, and the figures that show it."""
    suspicions = list[Suspicion]()
    for run in odd:
        path, of_frequency = rest.set_right(runs.forced[run]), shown.get(run)
        logged, seen = rest.find_rates(path)
        evidence = f"by their tables its wave turns as at {seen:.6g} rad/s, {logged:.6g} is logged"
        if of_frequency is not None:
            evidence += f"; {of_frequency.evidence}"
        read = read_mistake(path, of_frequency, rest.contradict)
        name = path.run_id or f"number {run + 1}"
        suspicions.append(describe_odd_run(name, read, evidence))
    return OddRuns(tuple(suspicions), len(rest.whole.fitted.paths), rest.best.fits)
