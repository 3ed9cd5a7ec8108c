"""What every method of identification answers over the whole range of programmes: how often it is
quiet, and whether a quiet answer is right.

Most programmes are envelopes of the exact slow model with noise, a part of them raw samples of the
second-order equations, demodulated and estimated. An answer is quiet where neither the stages
before, nor the method, nor the closing checks say a word. Errors are in the method's own standard
deviations: those of axes modulo their period, those of a split lost in noise of its components; the
likelihood's standard deviations are also held against the Cramér–Rao bound.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import Field

from ..errors import HrgError
from ..executors import run_tasks, start_processes
from ..fitting.envelopes.coordinates import SPLITS
from ..fitting.envelopes.inference import CLEAR
from ..records import Resonator
from ..stages.identify import identify
from .run_downs import DrawnProgramme, draw

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Array = np.ndarray
Answer = dict[str, Any]
AT_ONCE = 4
"""Programmes a process after which the answers are kept: what an interrupted study loses."""
WRONG = 5.0
"""Standard deviations from which a quiet answer is wrong."""
LEVELS = {"68": 1.0, "95": 1.96}
"""Percentage of an interval -> half its width in standard deviations."""
UNKNOWN_RATE = "unknown rate"
"""Answers to programmes whose logs leave out a rate that nobody tells: its offset is fitted."""


def programmes_study(
    known: Sequence[Answer] = (),
    keep: Callable[[Sequence[Answer]], None] = lambda answers: None,
    *,
    programmes: Annotated[int, Field(ge=1, description="programmes drawn")] = 500,
    raw: Annotated[
        float, Field(ge=0, le=1, description="part of them simulated sample by sample")
    ] = 0.1,
    seed: Annotated[int, Field(ge=0, description="seed of programmes and noise")] = 0,
    jobs: Annotated[int, Field(ge=1, description="processes")] = 1,
) -> dict[str, Any]:
    """What every identification method says on random programmes, and how often it is quiet and
    wrong.

    Parameters
    ----------
    known
        Answers of an interrupted study, whose programmes are not done again.
    keep
        Told all answers whenever there are more.
    programmes
        How many are drawn.
    raw
        Part of them that is simulated sample by sample.
    seed
        Of programmes and noise.
    jobs
        Processes.

    Returns
    -------
    dict
        For every method how many answers are quiet, doubted and refused, of the quiet ones the
        largest and rms error and the coverage; every quiet answer beyond 5 σ.

    Examples
    --------
    >>> from hrg_cli.studies.programmes import programmes_study
    >>> found = programmes_study(programmes=1, raw=0.0)
    >>> found["rows"][0]["method"], found["wrong"]
    ('likelihood', [])
    """
    every = round(1 / raw) if raw > 0 else 0
    tasks = [
        (seed * 1_000_003 + k, bool(every and k % every == every - 1)) for k in range(programmes)
    ]
    answers = [_taken_up(answer) for answer in known]
    done = {(answer["programme"], answer["raw"]) for answer in answers}
    missing = [task for task in tasks if task not in done]
    for first in range(0, len(missing), AT_ONCE * jobs):
        some = missing[first : first + AT_ONCE * jobs]
        for rows in run_tasks(_answers_of, some, lambda: start_processes(jobs)):
            answers += rows or []
        keep(list(answers))
    wanted = [answer for answer in answers if (answer["programme"], answer["raw"]) in set(tasks)]
    return assemble(wanted) | {"programmes": programmes, "raw": raw, "seed": seed}


def _taken_up(answer: Answer) -> Answer:
    """A kept answer with the numbers that a JSON has no word for."""
    numbers = {
        key: {n: float("nan") if v is None else v for n, v in answer[key].items()}
        for key in ("errors", "over_bound")
    }
    return {**answer, **numbers}


def _answers_of(task: tuple[int, bool]) -> list[Answer]:
    """{programme, raw, method, said, errors, over_bound} of every method on one programme; said:
    "quiet", "doubted" or "refused"."""
    seed, raw = task
    drawn = draw(seed, raw)
    told = drawn.earth_told or drawn.earth_rad_s == 0
    mark = {"programme": seed, "raw": raw}
    before = [reason for wave in drawn.waves for reason in wave.status_reasons]
    try:
        if not told:
            record = identify(drawn.waves, fit_rate=True, scale_factor=drawn.scale_factor)
            return [{**mark, "method": UNKNOWN_RATE, **_judge_record(record, drawn, before)}]
        record = identify(
            drawn.waves,
            method="all",
            scale_factor=drawn.scale_factor,
            earth_rate_deg_h=np.degrees(drawn.earth_rad_s) * 3600,
        )
    except HrgError as error:
        refused = {"said": "refused", "errors": {}, "over_bound": {}, "why": str(error)}
        return [{**mark, "method": "likelihood" if told else UNKNOWN_RATE, **refused}]
    rows = [{**mark, "method": "likelihood", **_judge_record(record, drawn, before)}]
    for row in json.loads(record.details).get("methods", []):
        if row["method"] != "likelihood":
            said = "doubted" if before or row["warnings"] else "quiet"
            said = "refused" if row["refused"] else said
            cells = {n: (c["value"], c["std"]) for n, c in row["parameters"].items()}
            rows.append(
                {
                    **mark,
                    "method": row["method"],
                    "said": said,
                    "errors": _errors(cells, row.get("split_components", {}), drawn),
                    "over_bound": {},
                    "why": "; ".join([*row["warnings"], *before]) or row["refused"],
                }
            )
    return rows


def _judge_record(record: Resonator, drawn: DrawnProgramme, before: list[str]) -> dict[str, Any]:
    """The likelihood's answer: what it says, its errors, its standard deviations over the bound;
    before: what was said of its waves."""
    cells = {name: (value, std) for name, (value, std, _) in record.parameters().items()}
    details = json.loads(record.details)
    bound = details.get("cramer_rao_std", {})
    said = {"valid": "doubted" if before else "quiet", "suspect": "doubted"}
    return {
        "said": said.get(record.status, "refused"),
        "errors": _errors(cells, details.get("split_components", {}), drawn),
        "over_bound": {n: cells[n][1] / b for n, b in bound.items() if n in cells and b > 0},
        "why": "; ".join([*record.status_reasons, *before]),
    }


def _errors(
    cells: Mapping[str, tuple[float, float]],
    components: Mapping[str, Mapping[str, float]],
    drawn: DrawnProgramme,
) -> dict[str, float]:
    """(value − true)/σ of parameters {name: (value, σ)}; of a split below 8 of its σ, whose size
    and axis are not Gaussian, that of its components."""
    true = dataclasses.asdict(drawn.gyro)
    period = np.pi / drawn.gyro.mode_number
    lost: set[str] = set()
    found: dict[str, float] = {}
    for size, axis, names in SPLITS:
        if size in cells and not cells[size][0] >= CLEAR * cells[size][1]:
            lost |= {size, axis}
            vector = true[size] * np.exp(2j * np.pi * true[axis] / period)
            found |= {
                name: float((components[name]["value"] - put_in) / components[name]["std"])
                for name, put_in in zip(names, (vector.real, vector.imag), strict=True)
                if name in components and components[name]["std"] > 0
            }
    for name, (value, std) in cells.items():
        if std > 0 and name not in lost:
            off = value - true[name]
            off -= period * np.round(off / period) * name.endswith("axis_rad")
            found[name] = float(off / std)
    return found


def assemble(answers: list[dict[str, Any]]) -> dict[str, Any]:
    """The figures of the study, from the answers of all methods.

    Parameters
    ----------
    answers
        One a programme and method.

    Returns
    -------
    dict
        A row a method, and the quiet answers that are wrong.

    Examples
    --------
    A quiet answer that is 6 of its σ off:

    >>> from hrg_cli.studies.programmes import assemble
    >>> mark = dict(programme=1, raw=False, method="likelihood", said="quiet", over_bound={})
    >>> found = assemble([mark | {"errors": {"scale_factor": 6.0}}])
    >>> found["wrong"][0]["parameter"], found["rows"][0]["beyond_5"]
    ('scale_factor', 1)
    """
    methods = list(dict.fromkeys(a["method"] for a in answers))
    wrong = [
        {key: a[key] for key in ("programme", "raw", "method")} | {"parameter": n, "error": e}
        for a in answers
        if a["said"] == "quiet"
        for n, e in a["errors"].items()
        if not abs(e) < WRONG
    ]
    return {
        "rows": [_row(m, [a for a in answers if a["method"] == m]) for m in methods],
        "wrong": wrong,
    }


def _row(method: str, answers: list[dict[str, Any]]) -> dict[str, Any]:
    """One method's figures over all programmes."""
    said = [a["said"] for a in answers]
    quiet = [a for a in answers if a["said"] == "quiet"]
    scores = np.abs([e for a in quiet for e in a["errors"].values()])
    over = [x for a in quiet for x in a["over_bound"].values()]
    worst = [max(map(abs, a["errors"].values()), default=0.0) for a in quiet]
    return {
        "method": method,
        **{word: said.count(word) for word in ("quiet", "doubted", "refused")},
        "beyond_5": sum(not w < WRONG for w in worst),
        "worst": max(worst, default=None),
        "rms": float(np.sqrt(np.mean(scores**2))) if len(scores) else None,
        **{
            f"coverage_{level}": float(100 * np.mean(scores < width)) if len(scores) else None
            for level, width in LEVELS.items()
        },
        "std_over_bound": float(np.median(over)) if over else None,
    }


def tabulate(study: dict[str, Any]) -> tuple[tuple[str, ...], list[tuple[Any, ...]]]:
    """The study as a table for a person.

    Parameters
    ----------
    study
        Of `programmes_study`.

    Returns
    -------
    tuple
        Headings, and a row a method.

    Examples
    --------
    >>> from hrg_cli.studies.programmes import assemble, tabulate
    >>> mark = dict(programme=1, raw=False, method="likelihood", said="quiet", over_bound={})
    >>> tabulate(assemble([mark | {"errors": {"scale_factor": 1.0}}]))[1][0][:2]
    ('likelihood', 1)
    """

    def number(value: float | None, form: str) -> str:
        return "" if value is None else f"{value:{form}}"

    rows = [
        (
            r["method"],
            r["quiet"],
            r["doubted"],
            r["refused"],
            r["beyond_5"],
            number(r["worst"], ".1f"),
            number(r["rms"], ".2f"),
            number(r["coverage_68"], ".1f"),
            number(r["coverage_95"], ".1f"),
            number(r["std_over_bound"], ".2f"),
        )
        for r in study["rows"]
    ]
    return (
        "method",
        "quiet",
        "doubted",
        "refused",
        "beyond 5 σ",
        "largest error/σ",
        "rms error/σ",
        "68 % covers",
        "95 % covers",
        "σ / bound",
    ), rows


def draw_figure(study: dict[str, Any]) -> Figure:
    """What each method says, and the errors of its quiet answers.

    Parameters
    ----------
    study
        Of `programmes_study`.

    Returns
    -------
    matplotlib.figure.Figure
        Two panels.

    Examples
    --------
    >>> from hrg_cli.studies.programmes import assemble, draw_figure
    >>> mark = dict(programme=1, raw=False, method="likelihood", said="quiet", over_bound={})
    >>> study = assemble([mark | {"errors": {"scale_factor": 1.0}}]) | {"programmes": 1}
    >>> len(draw_figure(study).axes)
    2
    """
    from matplotlib.figure import Figure

    drawing = Figure(figsize=(11, 5), layout="constrained")
    left, right = drawing.subplots(1, 2, sharey=True)
    rows = study["rows"][::-1]
    place = np.arange(len(rows))
    start = np.zeros(len(rows))
    for k, word in enumerate(("quiet", "doubted", "refused")):
        count = np.array([r[word] for r in rows], float)
        left.barh(place, count, left=start, color=("C2", "C1", "0.7")[k], label=word)
        start = start + count
    left.set_yticks(place, [r["method"] for r in rows])
    left.set(xlabel="answers", title=f"{study['programmes']} programmes")
    left.legend(fontsize=8)
    nothing = float("nan")
    for key, mark in (("rms", "o"), ("worst", "x")):
        values = [nothing if r[key] is None else r[key] for r in rows]
        right.plot(values, place, mark, color="0.2", label={"rms": "rms", "worst": "largest"}[key])
    right.axvline(1.0, color="0.5", linewidth=0.8)
    right.axvline(WRONG, color="C3", linewidth=0.8)
    right.set(xlabel="error/σ of the quiet answers", xlim=(0, None))
    right.legend(fontsize=8)
    return drawing
