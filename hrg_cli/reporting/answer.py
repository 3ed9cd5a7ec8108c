"""The answer: what the results of one gyro say, once, for terminal, page, JSON and JUnit alike.

Two words that are easily mixed up are kept apart: the gyro's *health* ("sound", "fault found",
"bench fault", "in doubt", "not examined") and the fit's *validity* ("valid", "suspect", "refused").
A gyro with a fault that was found and taken in has a valid fit.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..limits import Row
from ..records import REHEARSAL, Calibration, Compensated, Diagnosis, Record, Resonator
from ..units import DEGREE_PER_HOUR
from . import answer_use, answer_words
from .answer_words import Cause, Departure
from .figure_names import name_figure, name_figures
from .json_text import (
    list_entries,
    parse_list,
    parse_object,
    read_calibration_rms,
    read_figure_of_merit,
)
from .quantities import format_parameter, format_quantity, label_of
from .text import clean_text

SURE = ("adequate", "explained")
"""Verdicts under which the extended model describes the runs."""


@dataclass(frozen=True)
class Requirement:
    """A figure against its limit: what was found, what was wanted, how many σ lie between, and
    whether it passes."""

    name: str
    label: str
    value: str
    limit: str
    margin_sigma: float | None
    passed: bool


@dataclass(frozen=True)
class ShownParameter:
    """A parameter of the (extended) model: in words for people, and as it stands in the file."""

    name: str
    label: str
    text: str
    value: float
    std: float
    units: str


@dataclass(frozen=True)
class MovedFigure:
    """A value of the supplied model that the runs contradict."""

    name: str
    label: str
    believed: str
    measured: str
    sigma: float


@dataclass(frozen=True)
class Answer:
    """All of it; every sentence fits on two lines."""

    gyro_id: str
    sentence: str
    health: str
    validity: str
    verdict: str | None
    why: tuple[str, ...]
    """Why the word was given, or not: failed checks, then reasons, each once."""
    requirements: tuple[Requirement, ...]
    departure: Departure | None
    causes: tuple[Cause, ...]
    parameters: tuple[ShownParameter, ...]
    parameters_of: str
    moved: tuple[MovedFigure, ...]
    forecast: str
    suspect_runs: tuple[str, ...]
    stability: tuple[str, ...]
    next_runs: tuple[str, ...]
    equation: str
    snippet: str
    commands: tuple[str, ...]

    def to_json(self) -> dict[str, Any]:
        """The JSON key `answer`."""
        return dataclasses.asdict(self)


def answer(
    records: Sequence[Record], rows: Sequence[Row] = (), names: Mapping[str, str] | None = None
) -> Answer | None:
    """The answer of one gyro's results; None where none of the records is a result.

    Parameters
    ----------
    records
        Results of one gyro; the last record of a kind speaks for it.
    rows
        Figures held against limits (`limits.check`).
    names
        Kind -> name of its file, for the commands.

    Returns
    -------
    Answer or None
        Health of the gyro, validity of the fit, causes, parameters, what to do next.

    Examples
    --------
    >>> from hrg_cli import answer
    >>> answer([]) is None
    True
    """
    results = Results.from_records(records)
    if not results.deciding:
        return None
    diagnosis, tables = results.diagnosis, results.tables
    report = parse_object(diagnosis.report) if diagnosis is not None else {}
    departure = answer_words.choose_departure(diagnosis) if diagnosis is not None else None
    causes = answer_words.order_causes(report, departure)
    verdict = clean_text(diagnosis.verdict) if diagnosis is not None else None
    examined = _examined(results.deciding)
    parameters, of = _parameters(diagnosis, results.resonator)
    moved = _moved(report)
    of_runs = None
    if diagnosis is not None:
        runs = len(parse_list(diagnosis.run_ids))
        of_runs = answer_words.make_sentence(
            clean_text(diagnosis.verdict), report, departure, causes, runs
        )
    farthest = "" if causes else _say_farthest(moved)
    return Answer(
        gyro_id=results.gyro_id,
        sentence=_say_results(of_runs, tables, results.deciding[-1], farthest),
        health=_health(verdict, causes),
        validity=_validity(verdict, examined),
        verdict=verdict,
        why=_why(report, examined),
        requirements=_requirements(rows),
        departure=departure,
        causes=causes,
        parameters=parameters,
        parameters_of=of,
        moved=moved,
        forecast=answer_words.say_forecast(report),
        suspect_runs=tuple(
            answer_words.say_suspect_run(e) for e in list_entries(report, "suspect_runs")
        ),
        stability=answer_words.say_stability(report),
        next_runs=answer_words.list_next_runs(report),
        equation=_equation(results, causes),
        snippet=answer_use.write_snippet(report, tables, parameters),
        commands=answer_use.list_commands(_usable_files(results, names), diagnosis, tables),
    )


@dataclass(frozen=True)
class Results:
    """The results of one gyro: the last record of each kind, and those of a kind that decides."""

    deciding: Sequence[Record]
    diagnosis: Diagnosis | None
    tables: Calibration | None
    resonator: Record | None

    @classmethod
    def from_records(cls, records: Sequence[Record]) -> Results:
        """What of the records is a result."""
        of_kind = {record.kind: record for record in records}
        diagnosis, tables = of_kind.get("diagnosis"), of_kind.get("calibration")
        kinds = ("diagnosis", "calibration", "resonator", "compensated")
        return cls(
            [of_kind[kind] for kind in kinds if kind in of_kind],
            diagnosis if isinstance(diagnosis, Diagnosis) else None,
            tables if isinstance(tables, Calibration) else None,
            of_kind.get("resonator"),
        )

    @property
    def gyro_id(self) -> str:
        """The first name that a result gives its gyro."""
        return clean_text(next((g for r in self.deciding if (g := getattr(r, "gyro_id", ""))), ""))

    @property
    def one_signal(self) -> bool:
        """Whether the resonator is of one channel alone: no wave angle is seen."""
        return isinstance(self.resonator, Resonator) and self.resonator.modes_alone


def _equation(results: Results, causes: Sequence[Cause]) -> str:
    """The equation that the result gives the numbers of; none where no wave angle was seen that an
    equation of the rate could be of."""
    if results.one_signal and results.tables is None:
        return ""
    return answer_use.choose_equation(results.tables, [cause.name for cause in causes])


def _usable_files(results: Results, names: Mapping[str, str] | None) -> dict[str, str]:
    """Kind -> file that a next command can take: a resonator of one channel is none."""
    return {
        kind: name
        for kind, name in (names or {}).items()
        if not (results.one_signal and kind == "resonator")
    }


def _say_results(
    of_diagnosis: str | None, tables: Calibration | None, last: Record, farthest: str
) -> str:
    """What the gyro is, in a few sentences: by its diagnosis, else by its tables, else by the last
    of its results; then the value of the supplied model that is the farthest off."""
    gained = "" if tables is None else _of_tables(tables)
    if of_diagnosis is None:
        return (gained or _of_resonator(last)) + farthest
    return of_diagnosis + farthest + (f" {gained}" if gained else "")


def _examined(results: Sequence[Record]) -> list[Record]:
    """The results that decide: a resonator beside others only by what its rehearsal says of it, for
    that no diagnosis explains."""
    deciding: list[Record] = []
    for record in results:
        if record.kind != "resonator" or len(results) == 1:
            deciding.append(record)
            continue
        blamed = tuple(r for r in record.status_reasons if r.startswith(REHEARSAL))
        if blamed:
            deciding.append(record.replace(status_reasons=blamed))
    return deciding


def _health(verdict: str | None, causes: Sequence[Cause]) -> str:
    if verdict is None:
        return "not examined"
    if any(cause.family != "bench" for cause in causes):
        return "fault found"
    if causes:
        return "bench fault"
    return "sound" if verdict == "adequate" else "in doubt"


def _validity(verdict: str | None, examined: Sequence[Record]) -> str:
    """The worst status of the results that decide; a diagnosis that leaves something open is
    suspect."""
    order = ("valid", "suspect", "refused")
    worst = max((record.status for record in examined), key=order.index)
    return "suspect" if worst == "valid" and verdict is not None and verdict not in SURE else worst


def _why(report: Mapping[str, Any], examined: Sequence[Record]) -> tuple[str, ...]:
    checks = list_entries(dict(report), "checks")
    failed = [answer_words.say_failed_check(c) for c in checks if c.get("passed") is False]
    if checks and not failed:
        failed = [f"all {len(checks)} closing checks passed"]
    reasons = [
        clean_text(reason)
        for record in examined
        if record.status != "valid"
        for reason in record.status_reasons
    ]
    said = [clean_text(c.get("sentence") or "") for c in checks if c.get("passed") is False]
    reasons = [reason for reason in reasons if not any(one and one in reason for one in said)]
    return tuple(dict.fromkeys([*failed, *reasons]))


def _requirements(rows: Sequence[Row]) -> tuple[Requirement, ...]:
    """Rows of several files for people, by names that tell them apart; what several files of a
    kind say alike once."""
    names = name_figures({(row.kind, row.name) for row in rows})
    return tuple(
        dict.fromkeys(describe_requirement(row, names[row.kind, row.name]) for row in rows)
    )


def describe_requirement(row: Row, label: str = "") -> Requirement:
    """A figure held against its limit, for people.

    Parameters
    ----------
    row
        Of `hrg check`.
    label
        The figure in words; empty: by its key.

    Returns
    -------
    Requirement
        With how many σ lie between.

    Examples
    --------
    >>> from hrg_cli.limits import Row
    >>> from hrg_cli.reporting.answer import describe_requirement
    >>> row = Row("scale_factor", 0.55, 0.5, None, True, std=0.01)
    >>> shown = describe_requirement(row)
    >>> shown.limit, round(shown.margin_sigma, 9)
    ('≥ 0.5', 5.0)
    """
    label = label or name_figure(row.name)
    if row.words is not None:
        return Requirement(row.name, label, *row.words, None, row.passed)
    units = row.units
    bounds = (
        [f"≥ {format_quantity(row.name, row.minimum, None, units)}"]
        if row.minimum is not None
        else []
    )
    bounds += (
        [f"≤ {format_quantity(row.name, row.maximum, None, units)}"]
        if row.maximum is not None
        else []
    )
    value = (
        "not in the file"
        if row.value is None
        else format_quantity(row.name, row.value, row.std, units)
    )
    return Requirement(row.name, label, value, " and ".join(bounds), row.margin_sigma, row.passed)


def _parameters(
    diagnosis: Record | None, resonator: Record | None
) -> tuple[tuple[ShownParameter, ...], str]:
    """Those beside the causes where there is a diagnosis, else the identified ones; and whose they
    are."""
    report = parse_object(diagnosis.report) if isinstance(diagnosis, Diagnosis) else {}
    if list_entries(report, "values"):
        rows = [
            (str(v.get("name")), v.get("value"), v.get("std"), str(v.get("units", "")))
            for v in list_entries(report, "values")
            if not v.get("assumed")
        ]
        of = _name_extended_model(report) if list_entries(report, "effects") else "model"
    elif isinstance(resonator, Resonator):
        rows, of = [(name, *row) for name, row in resonator.parameters().items()], "resonator"
    else:
        return (), ""
    found = [
        ShownParameter(
            clean_text(name),
            label_of(name, float(value), float(std)),
            format_parameter(name, value, std, units),
            float(value),
            float(std),
            clean_text(units),
        )
        for name, value, std, units in rows
        if isinstance(value, int | float) and isinstance(std, int | float)
    ]
    return tuple(found), of


def _name_extended_model(report: Mapping[str, Any]) -> str:
    """With the temperature that its values are those of, where they follow it."""
    temperatures = {
        float(one["value"])
        for effect in list_entries(dict(report), "effects")
        if isinstance(one := effect.get("held", {}).get("reference_temperature_degc"), dict)
    }
    at = f" at {temperatures.pop():.4g} °C" if len(temperatures) == 1 else ""
    return f"extended model{at}"


def _say_farthest(moved: tuple[MovedFigure, ...]) -> str:
    """Which value of the supplied model is the farthest off; a cause found may be what moved it."""
    if not moved:
        return ""
    far = max(moved, key=lambda m: abs(m.sigma))
    return (
        f" The supplied model's {far.label} is wrong by"
        f" {answer_words.format_short(abs(far.sigma))} σ."
    )


def _moved(report: Mapping[str, Any]) -> tuple[MovedFigure, ...]:
    found = []
    for v in list_entries(dict(report), "values"):
        numbers = [v.get(key) for key in ("value", "std", "believed", "sigma")]
        if v.get("wrong") and all(isinstance(n, int | float) for n in numbers):
            name, units = str(v.get("name")), str(v.get("units", ""))
            value, std, believed, sigma = (float(n) for n in numbers)  # type: ignore[arg-type]
            said = format_parameter(name, value, std, units)
            found.append(
                MovedFigure(
                    clean_text(name),
                    label_of(name, value, std),
                    format_parameter(name, believed, 0.0, units),
                    said,
                    sigma,
                )
            )
    return tuple(found)


def _of_tables(calibration: Calibration) -> str:
    """What the tables gain, from the rms of the rate errors."""
    said = _gains(*read_calibration_rms(calibration.details))
    return (
        f"The tables take {' and '.join(said)} on data held out."
        if said
        else "The tables are made."
    )


def _gains(drift: Mapping[str, Any], scale: Mapping[str, Any]) -> list[str]:
    found = []
    for rms, words, factor, unit in (
        (drift, "the drift", 1 / DEGREE_PER_HOUR, "°/h"),
        (scale, "the scale factor's error", 1.0, "ppm"),
    ):
        before, after = (
            read_figure_of_merit(rms.get(key))[0] * factor for key in ("before", "held_out")
        )
        if before == before and after == after:
            found.append(
                f"{words} from {answer_words.format_short(before)} to"
                f" {answer_words.format_short(after)} {unit}"
            )
    return found


def _of_resonator(record: Record) -> str:
    if isinstance(record, Resonator):
        known = record.parameters()
        said = [
            (
                f"{label_of(name, *known[name][:2]).rsplit(' ', 1)[1]} ="
                f" {format_parameter(name, *known[name])}"
            )
            for name in ("frequency_hz", "damping_rate_1_s", "frequency_split_rad_s")
            if name in known
        ]
        if record.modes_alone:
            return (
                f"The resonator: {', '.join(said)}; the runs are one signal each, in which no wave"
                " turns and no cause can be sought."
            )
        return (
            f"The resonator: {', '.join(said)}; whether the runs hold more than it says is for hrg"
            " diagnose."
        )
    if isinstance(record, Compensated):
        return "The tables were applied to a run; the page shows the rate error that is left."
    return ""


def _group_records(records: Sequence[Record]) -> dict[str, list[Record]]:
    """Records by gyro, in the order they came."""
    found: dict[str, list[Record]] = {}
    for record in records:
        found.setdefault(str(getattr(record, "gyro_id", "")), []).append(record)
    return found
