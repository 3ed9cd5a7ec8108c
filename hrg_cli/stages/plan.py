"""plan: of a menu of feasible runs, those that best separate the open causes or shrink the worst
variances.

Informations of runs add (planning.information). A separation is the size of a cause over its
standard deviation with the base model and its rival free: √(xᵀ S x), S the Schur complement of the
information. Runs are chosen one by one, then exchanged while that helps.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ..errors import HrgError
from ..records import Diagnosis, Resonator, Status, Wave
from .planning.known import make_device_table, make_mechanics
from .planning.menu import make_candidates
from .planning.prospects import Prospects, explain_run, weigh_menu
from .planning.questions import Question, list_never_told
from .planning.worth import (
    choose_runs,
    compute_log_information,
    compute_separation,
    compute_std,
    find_impossible,
    sum_separations,
)

Array = np.ndarray


@dataclass(frozen=True)
class PlannedRun:
    """A chosen run: its name, its table in the simulation file, what it is for."""

    run_id: str
    table: Mapping[str, Any]
    reason: str


@dataclass(frozen=True)
class Plan:
    """The runs to do next, what is known before and expected after them, and what no run of the
    menu can tell."""

    runs: tuple[PlannedRun, ...]
    before: Mapping[str, float | None]
    after: Mapping[str, float | None]
    separations: tuple[Mapping[str, Any], ...]
    impossible: tuple[str, ...]
    file: Mapping[str, Any] = field(repr=False)
    """The plan as a simulation file."""
    status: Status = "valid"
    status_reasons: tuple[str, ...] = ()


def plan(
    known: Resonator | Diagnosis,
    menu: Mapping[str, Any],
    made: Sequence[Wave] = (),
    *,
    runs: Annotated[int, Field(ge=1, le=50, description="runs to choose")] = 3,
    criterion: Annotated[
        Literal["auto", "separate", "variance"],
        Field(description="auto: separate where causes are open, else variance"),
    ] = "auto",
    causes: Annotated[
        list[str], Field(description="causes to separate, beside those the diagnosis left open")
    ] = [],  # noqa: B006
) -> Plan:
    """Choose runs of a menu by their Fisher information.

    Each run of the menu adds JᵀJ/σ² to the information of the open causes and the resonator; the
    runs that separate the closest pair, or shrink the worst variance, are taken one after another.

    Parameters
    ----------
    known
        The resonator, or a diagnosis with its open groups.
    menu
        The feasible runs, as tables of a simulation file.
    made
        Waves measured already.

    Returns
    -------
    Plan
        The chosen runs with reasons, standard deviations before and after, and the simulation file.

    Raises
    ------
    HrgError
        An unknown cause, a wrong menu, nothing to separate.

    Examples
    --------
    >>> from hrg_cli import collect, demodulate, estimate, identify, plan, simulate
    >>> common = {
    ...     "readout": {"noise": 1e-4},
    ...     "recording": {"sample_rate_hz": 8000.0, "duration_s": 4.0},
    ... }
    >>> config = {"device": {"frequency_hz": 1000.0, "quality_factor": 20_000.0}, **common}
    >>> recording = collect(simulate(config, model="slow"))
    >>> known = identify([collect(estimate(collect(demodulate(recording, periods_per_window=20))))])
    >>> turning = {"run_id": "turning", "environment": {"rate_rad_s": 2.0}}
    >>> menu = {**common, "run": [{"run_id": "still"}, turning]}
    >>> [run.run_id for run in plan(known, menu, runs=1).runs]
    ['turning']
    """
    mechanics = make_mechanics(known)
    common, tables, feasible = make_candidates(menu, make_device_table(mechanics))
    prospects = weigh_menu(known, made, feasible, causes)
    if criterion == "separate" and not prospects.questions:
        raise HrgError(
            "nothing is to be separated: name causes (--causes), or give a diagnosis that left some"
            " open"
        )
    asked = [] if criterion == "variance" else prospects.list_answerable()
    offered = prospects.offered
    worth = _worth_of(prospects, asked)
    names = choose_runs(prospects.had, offered, min(runs, len(offered)), worth)
    refused = find_impossible(
        prospects.sum_all_information(), prospects.questions, prospects.layout
    )
    wanted = _list_wanted(prospects.questions, known, causes, criterion)
    unmet = find_impossible(prospects.sum_all_information(), wanted, prospects.layout)
    answers_nothing = bool(wanted) and len(unmet) == len(wanted)
    return Plan(
        runs=tuple(
            PlannedRun(name, tables[name], explain_run(name, names, prospects, asked))
            for name in names
        ),
        before=compute_std(prospects.had, mechanics),
        after=compute_std(prospects.sum_information(names), mechanics),
        separations=_separations(prospects, names),
        impossible=tuple(dict.fromkeys([*refused, *list_never_told(known)])),
        file={**common, "run": [dict(tables[name]) for name in names]},
        status="suspect" if answers_nothing else "valid",
        status_reasons=tuple(unmet) if answers_nothing else (),
    )


def _list_wanted(
    questions: Sequence[Question],
    known: Resonator | Diagnosis,
    causes: Sequence[str],
    criterion: str,
) -> list[Question]:
    """What the plan is there for: causes that were found or are named. A cause that the runs so far
    could not show is offered beside them; where no run of the menu shows it either, that is a
    note."""
    if criterion != "auto":
        return list(questions) if criterion == "separate" else []
    found = [row["name"] for row in known.told("effects")] if isinstance(known, Diagnosis) else []
    return [question for question in questions if question.cause in (*causes, *found)]


def _worth_of(prospects: Prospects, asked: Sequence[Question]) -> Callable[[Array], float]:
    """What an information is worth: separations where causes are to be told apart, else
    variance."""
    if asked:
        return partial(sum_separations, questions=asked, layout=prospects.layout)
    return partial(compute_log_information, m=prospects.mechanics)


def _separations(prospects: Prospects, names: Sequence[str]) -> tuple[dict[str, Any], ...]:
    """How many σ apart each cause and its rival are, before and after the runs of these names."""
    layout, after = prospects.layout, prospects.sum_information(names)
    return tuple(
        {
            "causes": [q.cause, q.rival],
            "before_sigma": compute_separation(prospects.had, q, layout),
            "after_sigma": compute_separation(after, q, layout),
        }
        for q in prospects.questions
    )


def summarise(made: Plan) -> dict[str, Any]:
    """The JSON of a plan.

    Parameters
    ----------
    made
        Made by `plan`.

    Returns
    -------
    dict
        The runs with their reasons, standard deviations before and after, which causes they
        separate, and what no run can tell.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from hrg_cli.stages.plan import summarise
    >>> run = SimpleNamespace(run_id="turning", reason="it shows the scale factor")
    >>> known = dict(before={"scale_factor": 0.1}, after={"scale_factor": 1e-4})
    >>> made = SimpleNamespace(runs=[run], separations=[], impossible=[], **known)
    >>> summarise(made)["runs"], summarise(made)["after"]
    ([{'run_id': 'turning', 'reason': 'it shows the scale factor'}], {'scale_factor': 0.0001})
    """
    return {
        "runs": [{"run_id": run.run_id, "reason": run.reason} for run in made.runs],
        "before": dict(made.before),
        "after": dict(made.after),
        "separations": [dict(row) for row in made.separations],
        "impossible": list(made.impossible),
    }
