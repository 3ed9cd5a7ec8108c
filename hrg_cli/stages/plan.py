"""plan: of a menu of feasible runs, those that best separate the open causes or shrink the worst
variances.

Informations of runs add (planning.information). A separation is the size of a cause over its
standard deviation with the base model and its rival free: √(xᵀ S x), S the Schur complement of the
information. Runs are chosen one by one, then exchanged while that helps.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from ..effects import EFFECTS, find
from ..effects.effect import Effect
from ..errors import HrgError
from ..fitting.envelopes.base_fit import nominal_scale_factor
from ..fitting.envelopes.coordinates import COUNT, from_mechanics, physical
from ..physics.resonator import PARAMETERS, Mechanics
from ..records import Diagnosis, Resonator, Status, Wave
from .planning.information import Layout, information, left_over, wave_of
from .planning.menu import candidates

Array = np.ndarray
BASE = "the base model"
TOLD = 3.0
"""σ from which a cause counts as told apart."""
NOTHING = 1e-3
"""σ that rounding alone may give."""
INHERENT = {e.name: f"{e.same_as_base}; {e.next_experiment}" for e in EFFECTS if e.same_as_base}
"""What no run of any menu can tell from the base model, and what else would."""


@dataclass(frozen=True)
class Question:
    """A cause, what it is to be told from (a cause or the base model), and the sizes of both in
    columns' units."""

    cause: str
    rival: str
    size: Array
    rival_size: Array | None = None


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
    sizes, groups = _open(known, causes)
    acting = {name: given for name, given in sizes.items() if given}
    # a thermometer's error shows only through what follows temperature; where none was found, a
    # typical coefficient is assumed
    beside = {find(name).beside for group in groups for name in group if name != BASE} - {""}
    if beside and not any(find(name).follows_temperature for name in acting):
        acting |= {name: {p.name: p.typical for p in find(name).fitted()} for name in beside}
    chosen_effects = tuple(
        find(name) for name in dict.fromkeys([*sizes, *acting, *(r for g in groups for r in g)])
    )
    layout = Layout(chosen_effects, acting)
    common, tables, feasible = candidates(menu, _device(mechanics))
    waves = {name: wave_of(run) for name, run in feasible.items()}
    references = _references([*made, *waves.values()], chosen_effects)
    offered = dict(
        zip(
            waves,
            information(list(waves.values()), mechanics, layout, references, False),
            strict=True,
        )
    )
    had = _prior(mechanics, layout) + (
        sum(information(made, mechanics, layout, references, True))
        if made
        else _known_already(known, mechanics, layout)
    )
    questions = _questions(sizes, groups, layout, [*made, *waves.values()])
    if criterion == "separate" and not questions:
        raise HrgError(
            "nothing is to be separated: name causes (--causes), or give a diagnosis that left some"
            " open"
        )
    everything = had + sum(offered.values())
    askable = [q for q in questions if separation(everything, q, layout) >= TOLD]
    separate = bool(askable) and criterion != "variance"
    worth: Callable[[Array], float] = (
        (lambda M: _separated(M, askable, layout)) if separate else (lambda M: _sharp(M, mechanics))
    )
    names = _chosen(had, offered, min(runs, len(offered)), worth)
    total = had + sum(offered[name] for name in names)
    refused = _impossible(everything, questions, layout)
    separations = tuple(
        {
            "causes": [q.cause, q.rival],
            "before_sigma": separation(had, q, layout),
            "after_sigma": separation(total, q, layout),
        }
        for q in questions
    )
    before, after = deviations(had, mechanics), deviations(total, mechanics)
    planned = tuple(
        PlannedRun(
            n,
            tables[n],
            _reason(n, names, had, offered, askable if separate else (), layout, mechanics),
        )
        for n in names
    )
    reasons = tuple(refused) if questions and len(refused) >= len(questions) else ()
    impossible = tuple(dict.fromkeys([*refused, *_never(known)]))
    return Plan(
        planned, before, after, separations, impossible, {**common, "run": [dict(tables[n]) for n in names]},
        "suspect" if reasons else "valid", reasons,
    )  # fmt: skip


def summary(made: Plan) -> dict[str, Any]:
    """The JSON of a plan."""
    return {
        "runs": [{"run_id": run.run_id, "reason": run.reason} for run in made.runs],
        "before": dict(made.before),
        "after": dict(made.after),
        "separations": [dict(row) for row in made.separations],
        "impossible": list(made.impossible),
    }


def mechanics_of(known: Resonator | Diagnosis) -> Mechanics:
    """The resonator's parameters. HrgError: neither frequency nor damping among them."""
    if isinstance(known, Diagnosis):
        given = {row["name"]: float(row["value"]) for row in json.loads(known.report)["values"]}
        mode_number = (
            int(tomllib.loads(known.extended_model)["device"]["mode_number"])
            if known.extended_model
            else 2
        )
    else:
        given = {name: value for name, (value, _, _) in known.parameters().items()}
        mode_number = known.mode_number
    values = {name: given[name] for name, _ in PARAMETERS if name in given}
    if "frequency_hz" not in values or "damping_rate_1_s" not in values:
        raise HrgError("the resonator holds neither frequency nor damping; identify it first")
    values.setdefault("scale_factor", nominal_scale_factor(mode_number))
    return Mechanics(**values, mode_number=mode_number)


def _device(m: Mechanics) -> dict[str, Any]:
    """[device] of the simulation file."""
    damping = max(m.damping_rate_1_s, 0.0)
    return {name: float(getattr(m, name)) for name, _ in PARAMETERS} | {
        "damping_rate_1_s": damping,
        "damping_split_1_s": float(np.clip(m.damping_split_1_s, -damping, damping)),
        "mode_number": m.mode_number,
    }


def _open(
    known: Resonator | Diagnosis, causes: Sequence[str]
) -> tuple[dict[str, dict[str, float]], list[list[str]]]:
    """Sizes of the causes found, and groups [cause, rivals…] to be separated.

    Open are the causes found that have rivals and those named by the user, or, where none is named,
    those that the diagnosis's runs could not show; where there is none of these, the causes found
    are to be seen better.
    """
    names = {effect.name for effect in EFFECTS}
    unknown = [name for name in causes if name not in names]
    if unknown:
        raise HrgError(f"there is no effect {unknown[0]}; `hrg effects` lists them")
    sizes: dict[str, dict[str, float]] = {name: {} for name in causes}
    groups = [[a, *(b for b in causes if b != a)] for a in causes]
    if isinstance(known, Diagnosis):
        report = json.loads(known.report)
        settled: list[list[str]] = []
        for found in report["effects"]:
            if found["name"] in names:
                sizes[found["name"]] = {
                    key: float(p["value"])
                    for key, p in (found["parameters"] | found.get("held", {})).items()
                }
                rivals = [r for r in found["indistinguishable_from"] if r in names]
                (groups if rivals else settled).append([found["name"], *rivals])
        for group in _unseen(report) if not causes else ():
            sizes |= {name: {} for name in group if name not in sizes}
            groups.append(group)
        groups = groups or settled
    return sizes, groups


def _unseen(report: Mapping[str, Any]) -> list[list[str]]:
    """Causes that the diagnosis's runs could not tell from the model, though others can, each with
    those that do the same in them."""
    names = (
        {effect.name for effect in EFFECTS}
        - set(INHERENT)
        - {found["name"] for found in report["effects"]}
    )
    entries = report.get("not_separable", [])
    hidden = [name for group in entries if group.get("base") for name in group["effects"]]
    alike = [group["effects"] for group in entries if not group.get("base")]
    out = []
    for name in dict.fromkeys(hidden):
        if name in names:
            out.append(
                [
                    name,
                    *dict.fromkeys(
                        other
                        for group in alike
                        if name in group
                        for other in group
                        if other != name and other in names
                    ),
                ]
            )
    return out


def _never(known: Resonator | Diagnosis) -> list[str]:
    """Sentences about what the diagnosis left open and no run of any menu can tell."""
    if not isinstance(known, Diagnosis):
        return []
    told = {
        name
        for group in json.loads(known.report).get("not_separable", [])
        for name in group["effects"]
    }
    return [
        f"no run can tell {name} from {same}" for name, same in INHERENT.items() if name in told
    ]


def _questions(
    sizes: Mapping[str, Mapping[str, float]],
    groups: Sequence[Sequence[str]],
    layout: Layout,
    waves: Sequence[Wave],
) -> list[Question]:
    amplitude = float(np.median([np.sqrt(np.mean(w.main_amplitude**2)) for w in waves]))
    effects = {effect.name: effect for effect in layout.causes}

    def size(name: str) -> Array:
        given = sizes.get(name, {})
        return np.array(
            [
                given.get(p.name, p.typical * amplitude**p.amplitude_power)
                for p in effects[name].fitted()
            ]
        )

    out: list[Question] = []
    for cause, *rivals in groups:
        for rival in [BASE, *rivals]:
            if not any({q.cause, q.rival} == {cause, rival} for q in out):
                out.append(
                    Question(cause, rival, size(cause), None if rival == BASE else size(rival))
                )
    return out


def _references(waves: Sequence[Wave], effects: Sequence[Effect]) -> dict[str, dict[str, float]]:
    """Temperature from which the effects count: the mean of all runs."""
    warm = [
        float(np.nanmean(w.temperature_degc))
        for w in waves
        if w.temperature_degc is not None and np.isfinite(w.temperature_degc).any()
    ]
    middle = float(np.mean(warm)) if warm else 25.0
    return {
        e.name: {"reference_temperature_degc": middle}
        for e in effects
        if "reference_temperature_degc" in e.values()
    }


def _prior(m: Mechanics, layout: Layout) -> Array:
    """Weak information that keeps what nothing measures finite: ten times the damping, thirty times
    the split, K within 3."""
    damping = max(abs(m.damping_rate_1_s), 1e-9)
    split = max(abs(m.frequency_split_rad_s), damping)
    std = np.array([10 * damping, 10 * damping, 10 * damping, 30 * split, 30 * split, 3.0, 1.0])
    M = np.zeros((layout.size, layout.size))
    M[:COUNT, :COUNT] = np.diag(1 / std**2)
    return M


def _known_already(known: Resonator | Diagnosis, m: Mechanics, layout: Layout) -> Array:
    """The resonator's own covariance as information on the coordinates; a diagnosis without its
    waves brings its stds."""
    M = np.zeros((layout.size, layout.size))
    _, slopes = physical(from_mechanics(m), m.mode_number)
    order = [name for name, _ in PARAMETERS][1:]
    if isinstance(known, Resonator):
        there = [
            k
            for k, name in enumerate(known.name)
            if str(name) in order and known.std[k] > 0 and np.isfinite(known.std[k])
        ]
        rows, covariance = (
            [order.index(str(known.name[k])) for k in there],
            known.covariance[np.ix_(there, there)],
        )
    else:
        stds = {row["name"]: float(row["std"]) for row in json.loads(known.report)["values"]}
        rows = [k for k, name in enumerate(order) if 0 < stds.get(name, 0.0) < np.inf]
        covariance = np.diag([stds[order[k]] ** 2 for k in rows])
    if rows:
        J = slopes[rows]
        M[:COUNT, :COUNT] = J.T @ np.linalg.pinv(covariance, hermitian=True) @ J
    return M


def separation(M: Array, question: Question, layout: Layout) -> float:
    """σ by which the cause stands out with the base model free; of two causes, σ of the one that
    the other, free too, follows less.

    A lag does nothing that a gradient could not do, but not the other way round: either is named
    where a gradient would stand out.
    """
    one = _beside(M, question.cause, question.size, question.rival, layout)
    if question.rival_size is None:
        return one
    return max(one, _beside(M, question.rival, question.rival_size, question.cause, layout))


def _beside(M: Array, cause: str, size: Array, rival: str, layout: Layout) -> float:
    """σ of a cause of that size with the base model, and the rival, free."""
    free = layout.free(cause, rival) + ([] if rival == BASE else layout.columns(rival))
    S = left_over(M, layout.columns(cause), free)
    whole = M[np.ix_(layout.columns(cause), layout.columns(cause))]
    left, all_of_it = float(size @ S @ size), float(size @ whole @ size)
    return float(np.sqrt(left)) if left > max(1e-9 * all_of_it, NOTHING**2) else 0.0


def _separated(M: Array, questions: Sequence[Question], layout: Layout) -> float:
    """Sum of log(1 + σ²): the least separated count most."""
    return float(sum(np.log1p(separation(M, q, layout) ** 2) for q in questions))


def _sharp(M: Array, m: Mechanics) -> float:
    """−log det of the covariance of the six parameters."""
    sign, value = np.linalg.slogdet(left_over(M, range(6), [6]) / np.outer(_units(m), _units(m)))
    return float(value) if sign > 0 else -np.inf


def _units(m: Mechanics) -> Array:
    damping, split = (
        max(abs(m.damping_rate_1_s), 1e-9),
        max(abs(m.frequency_split_rad_s), abs(m.damping_rate_1_s), 1e-9),
    )
    return 1 / np.array([damping, damping, damping, split, split, 1.0])


def deviations(M: Array, m: Mechanics) -> dict[str, float | None]:
    """Standard deviation of every parameter but the frequency from the base model's information."""
    _, slopes = physical(from_mechanics(m), m.mode_number)
    u = _units(m)
    covariance = np.zeros((COUNT, COUNT))
    covariance[:6, :6] = np.linalg.pinv(
        left_over(M, range(6), [6]) / np.outer(u, u), hermitian=True
    ) / np.outer(u, u)
    stds = np.sqrt(np.maximum(np.diag(slopes @ covariance @ slopes.T), 0))
    return {name: float(std) for (name, _), std in zip(PARAMETERS[1:], stds, strict=True)}


def _chosen(
    had: Array, offered: Mapping[str, Array], count: int, worth: Callable[[Array], float]
) -> list[str]:
    """Greedy choice of different runs, then exchanges while one helps."""
    names: list[str] = []
    for _ in range(count):
        total = had + sum(offered[n] for n in names)
        names.append(
            max((n for n in offered if n not in names), key=lambda n: worth(total + offered[n]))
        )
    improved = True
    while improved:
        improved = False
        for k in range(len(names)):
            others = had + sum(offered[n] for i, n in enumerate(names) if i != k)
            best = max(
                (n for n in offered if n not in names or n == names[k]),
                key=lambda n: worth(others + offered[n]),
            )
            if worth(others + offered[best]) > worth(others + offered[names[k]]) + 1e-9:
                names[k], improved = best, True
    return names


def _impossible(everything: Array, questions: Sequence[Question], layout: Layout) -> list[str]:
    out = []
    for q in questions:
        if q.cause in INHERENT and q.rival == BASE:
            out.append(f"no run can tell {q.cause} from {INHERENT[q.cause]}")
        elif separation(everything, q, layout) < TOLD:
            sigma = separation(everything, q, layout)
            out.append(
                f"all runs of the menu together tell {q.cause} from {q.rival} by {sigma:.1f} σ"
                " only; add other runs"
            )
    return out


def _reason(
    name: str,
    names: Sequence[str],
    had: Array,
    offered: Mapping[str, Array],
    questions: Sequence[Question],
    layout: Layout,
    m: Mechanics,
) -> str:
    """What would be lost without this run."""
    without = had + sum(offered[n] for n in names if n != name)
    total = without + offered[name]
    if questions:
        gains = [
            (
                np.log1p(separation(total, q, layout) ** 2)
                - np.log1p(separation(without, q, layout) ** 2),
                q,
            )
            for q in questions
        ]
        q = max(gains, key=lambda pair: pair[0])[1]
        before_sigma, after_sigma = separation(without, q, layout), separation(total, q, layout)
        return (
            f"tells {q.cause} from {q.rival}: {before_sigma:.3g} σ without it, {after_sigma:.3g} σ"
            " with it"
        )
    before, after = deviations(without, m), deviations(total, m)
    best = max(before, key=lambda key: (before[key] or 0.0) / max(after[key] or 0.0, 1e-300))
    return f"shrinks the standard deviation of {best} from {before[best]:.3g} to {after[best]:.3g}"
