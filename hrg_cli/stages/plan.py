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

from ..effects import find
from ..errors import HrgError
from ..records import Diagnosis, Resonator, Status, Wave
from .planning.information import InformationColumns, information, wave_of
from .planning.known import (
    device_table,
    information_of,
    mechanics_of,
    reference_temperatures,
    weak_prior,
)
from .planning.menu import candidates
from .planning.questions import BASE, Question, never_told, open_causes, questions_of
from .planning.worth import (
    TOLD,
    choose_runs,
    deviations,
    find_impossible,
    log_information,
    reason_of,
    separation,
    sum_of_separations,
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

    Each run of the menu adds JᵀJ/σ² to the information of the open causes and the resonator; the runs
    that separate the closest pair, or shrink the worst variance, are taken one after another.

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
    mechanics = mechanics_of(known)
    sizes, groups = open_causes(known, causes)
    acting = _acting(sizes, groups)
    rivals = (rival for group in groups for rival in group)
    effects = tuple(find(name) for name in dict.fromkeys([*sizes, *acting, *rivals]))
    layout = InformationColumns(effects, acting)
    common, tables, feasible = candidates(menu, device_table(mechanics))
    waves = {name: wave_of(run) for name, run in feasible.items()}
    references = reference_temperatures([*made, *waves.values()], effects)
    brought = information(list(waves.values()), mechanics, layout, references, False)
    offered = dict(zip(waves, brought, strict=True))
    # the runs made, where they are at hand, know what the result's covariance has forgotten
    known_by_runs = (
        sum(information(made, mechanics, layout, references, True))
        if made
        else information_of(known, mechanics, layout)
    )
    had = weak_prior(mechanics, layout) + known_by_runs
    questions = questions_of(sizes, groups, layout, [*made, *waves.values()])
    if criterion == "separate" and not questions:
        raise HrgError(
            "nothing is to be separated: name causes (--causes), or give a diagnosis that left some"
            " open"
        )
    everything = had + sum(offered.values())
    askable = [q for q in questions if separation(everything, q, layout) >= TOLD]
    separate = bool(askable) and criterion != "variance"
    worth: Callable[[Array], float] = partial(log_information, m=mechanics)
    if separate:
        worth = partial(sum_of_separations, questions=askable, layout=layout)
    names = choose_runs(had, offered, min(runs, len(offered)), worth)
    why = partial(
        reason_of, names=names, had=had, offered=offered,
        questions=askable if separate else (), layout=layout, m=mechanics,
    )  # fmt: skip
    total = had + sum(offered[name] for name in names)
    refused = find_impossible(everything, questions, layout)
    told_nothing = bool(questions) and len(refused) >= len(questions)
    return Plan(
        runs=tuple(PlannedRun(name, tables[name], why(name)) for name in names),
        before=deviations(had, mechanics),
        after=deviations(total, mechanics),
        separations=_separations(questions, had, total, layout),
        impossible=tuple(dict.fromkeys([*refused, *never_told(known)])),
        file={**common, "run": [dict(tables[name]) for name in names]},
        status="suspect" if told_nothing else "valid",
        status_reasons=tuple(refused) if told_nothing else (),
    )


def _acting(
    sizes: Mapping[str, dict[str, float]], groups: Sequence[Sequence[str]]
) -> dict[str, dict[str, float]]:
    """The causes with a size, by name; a thermometer's error shows only through what follows
    temperature: where none was found, a typical coefficient is assumed."""
    acting = {name: given for name, given in sizes.items() if given}
    beside = {find(name).beside for group in groups for name in group if name != BASE} - {""}
    if beside and not any(find(name).follows_temperature for name in acting):
        acting |= {name: {p.name: p.typical for p in find(name).fitted()} for name in beside}
    return acting


def _separations(
    questions: Sequence[Question], had: Array, total: Array, layout: InformationColumns
) -> tuple[dict[str, Any], ...]:
    """How many σ apart each cause and its rival are, before and after the planned runs."""
    return tuple(
        {
            "causes": [q.cause, q.rival],
            "before_sigma": separation(had, q, layout),
            "after_sigma": separation(total, q, layout),
        }
        for q in questions
    )


def summary(made: Plan) -> dict[str, Any]:
    """The JSON of a plan."""
    return {
        "runs": [{"run_id": run.run_id, "reason": run.reason} for run in made.runs],
        "before": dict(made.before),
        "after": dict(made.after),
        "separations": [dict(row) for row in made.separations],
        "impossible": list(made.impossible),
    }
