"""The answer in words: the departure before and after, the causes by their share, forecast, doubts
and the next run.

A diagnosis is read without trusting its shape: files of an earlier version lack some keys, and what
is missing is not said.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..effects import EFFECTS
from ..records import Diagnosis
from ..stages.diagnosis.report.shares import compute_departure_figures, compute_difference
from .json_text import list_entries, read_float, take_child
from .quantities import format_quantity
from .text import clean_text, format_number

FAMILY = {effect.name: effect.family for effect in EFFECTS}
BETTER = 1.3
"""Ratio of the errors before and after from which a quantity is what the causes change."""


@dataclass(frozen=True)
class Departure:
    """By how much the runs depart from the model: a quantity with its unit, without and with the
    causes."""

    key: str
    words: str
    unit: str
    before: float
    after: float
    held_out: bool
    """Judged on data that the models were not fitted to."""


@dataclass(frozen=True)
class Cause:
    """A cause found: name, words, size, significance, its share of the departure, and what it
    cannot be told from."""

    name: str
    words: str
    size: str
    family: str
    z: float
    drift_deg_h: float | None
    angle_ppm: float | None
    amplitude_ppm: float | None
    frequency_hz: float | None
    rivals: tuple[str, ...]


UNMOVED = 0.9
"""Part of a departure that is left with the causes taken in from which they are not its causes."""
MORE_THAN_ALL = 1.5
"""Share over the departure from which a cause is no part of it."""
QUANTITIES = (
    ("drift_deg_h", "drift", "°/h", "drift_error_deg_h"),
    ("amplitude_ppm", "amplitude", "ppm", "amplitude_error_ppm"),
    ("frequency_hz", "frequency", "Hz", ""),
    ("angle_ppm", "wave angle", "ppm of a radian", "angle_error_ppm"),
)
"""Key of a share, its words and unit, its key among the held-out errors; the first that the causes
change is told."""


def format_short(value: float) -> str:
    """A figure without its σ in three digits.

    Parameters
    ----------
    value
        The figure.

    Returns
    -------
    str
        For a sentence.

    Examples
    --------
    >>> from hrg_cli.reporting.answer_words import format_short
    >>> format_short(2.34567), format_short(0.0001234)
    ('2.35', '0.000123')
    """
    return format_number(value, 3)


def choose_departure(record: Diagnosis) -> Departure | None:
    """The quantity by which runs depart from the model that the causes change most.

    Parameters
    ----------
    record
        A diagnosis.

    Returns
    -------
    Departure or None
        Errors held out where the file has them, else those of the fitted rows; None where neither
        is there.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from hrg_cli.reporting.answer_words import choose_departure
    >>> class Told(SimpleNamespace):
    ...     def __len__(self):
    ...         return 0
    >>> report = '{"gain": {"drift_error_deg_h": {"before": 20.0, "after": 2.0}}}'
    >>> found = choose_departure(Told(report=report))
    >>> found.words, found.before, found.unit, found.held_out
    ('drift', 20.0, '°/h', True)
    """
    from .json_text import parse_object

    report = parse_object(record.report)
    gain = take_child(report, "gain")
    fitted: list[dict[str, float | None]] = []
    if len(record) and np.ndim(record.measured) == 2 and np.shape(record.measured)[1] == 4:
        run, time_s = np.asarray(record.run), np.asarray(record.time_s)
        both = (record.simulated_before, record.simulated_after)
        fitted = [
            compute_departure_figures(compute_difference(record.measured, simulated), run, time_s)
            for simulated in both
        ]
    found = []
    for key, words, unit, held in QUANTITIES:
        out = take_child(gain, held) if held else {}
        before, after = read_float(out.get("before")), read_float(out.get("after"))
        known = math.isfinite(before) and math.isfinite(after)
        if not known and fitted:
            before, after = (read_float(of[key]) for of in fitted)
        if math.isfinite(before) and math.isfinite(after):
            found.append(Departure(key, words, unit, before, after, known))
    return next((d for d in found if d.before > BETTER * d.after), found[0] if found else None)


def order_causes(report: Mapping[str, Any], departure: Departure | None) -> tuple[Cause, ...]:
    """The causes that a diagnosis found, largest share of the departure first.

    Parameters
    ----------
    report
        Of the diagnosis.
    departure
        Of which they have shares; None: the drift.

    Returns
    -------
    tuple of Cause
        In the order of their evidence where the share of one is not known: without it the fit does
        not settle.

    Examples
    --------
    >>> from hrg_cli.reporting.answer_words import order_causes
    >>> effects = [
    ...     {"name": n, "z": 9.0, "share": {"drift_deg_h": d}} for n, d in (("a", 1.0), ("b", 5.0))
    ... ]
    >>> [cause.name for cause in order_causes({"effects": effects}, None)]
    ['b', 'a']
    """
    found = []
    for effect in list_entries(dict(report), "effects"):
        share = take_child(effect, "share")
        parts = {
            key: None if math.isnan(v := read_float(share.get(key))) else v
            for key, *_ in QUANTITIES
        }
        name = clean_text(effect.get("name"))
        rivals = effect.get("indistinguishable_from")
        others = tuple(clean_text(r) for r in rivals) if isinstance(rivals, list) else ()
        family, z = FAMILY.get(name, "own"), read_float(effect.get("z"))
        found.append(
            Cause(name, say_in_words(name), say_size(effect), family, z, rivals=others, **parts)
        )
    key = departure.key if departure else "drift_deg_h"
    shares = {cause.name: getattr(cause, key) for cause in found}
    if None in shares.values():
        return tuple(sorted(found, key=lambda cause: -cause.z))
    return tuple(sorted(found, key=lambda cause: -shares[cause.name]))


def say_in_words(name: str) -> str:
    """An effect's name as words.

    Parameters
    ----------
    name
        Its key.

    Returns
    -------
    str
        For a person.

    Examples
    --------
    >>> from hrg_cli.reporting.answer_words import say_in_words
    >>> say_in_words("gain_mismatch")
    'gain mismatch'
    """
    return name.replace("_", " ")


def say_size(effect: Mapping[str, Any]) -> str:
    """The fitted size of an effect.

    Parameters
    ----------
    effect
        Of a diagnosis's report.

    Returns
    -------
    str
        One parameter as it is, two components as they are, of more the one that stands clearest off
        zero; where a sign or a phase was not measured, what was.

    Examples
    --------
    >>> from hrg_cli.reporting.answer_words import say_size
    >>> gain = {"value": 0.0102, "std": 0.0001, "units": "1"}
    >>> say_size({"parameters": {"gain": gain}})
    '1.020(10) %'
    """
    if magnitude := _magnitude(effect):
        return magnitude
    shown = [
        (name, read_float(p.get("value")), read_float(p.get("std")), str(p.get("units", "")))
        for name, p in take_child(effect, "parameters").items()
        if isinstance(p, dict)
    ]
    if len(shown) > 2:
        # of several units the largest number would say nothing
        shown = [max(shown, key=lambda row: abs(row[1]) / row[2] if row[2] > 0 else 0.0)]
    return ", ".join(
        clean_text(format_quantity(name, value, std, units)) for name, value, std, units in shown
    )


def _magnitude(effect: Mapping[str, Any]) -> str:
    """The largest of the sizes that the samples show without sign or phase, beside those that a
    parameter tells whole."""
    stds, parameters = take_child(effect, "magnitude_std"), take_child(effect, "parameters")
    sizes = {
        name: read_float(value)
        for name, value in take_child(effect, "magnitude").items()
        if not read_float(take_child(parameters, name).get("std")) < read_float(value)
    }
    if not sizes:
        return ""
    name = max(sizes, key=lambda one: sizes[one])
    of: Mapping[str, Any] = parameters.get(name) or next(iter(parameters.values()), {})
    size = format_quantity(name, sizes[name], read_float(stds.get(name)), str(of.get("units", "")))
    return f"± {clean_text(size)}" if name in parameters else clean_text(size)


def make_sentence(
    verdict: str,
    report: Mapping[str, Any],
    departure: Departure | None,
    causes: Sequence[Cause],
    runs: int,
) -> str:
    """What a diagnosis says, in one sentence.

    Parameters
    ----------
    verdict
        Of the diagnosis.
    report
        Of the diagnosis.
    departure
        By how much the runs depart; None: not known.
    causes
        Largest first.
    runs
        How many.

    Returns
    -------
    str
        For a person.

    Examples
    --------
    >>> from hrg_cli.reporting.answer_words import make_sentence
    >>> make_sentence("adequate", {}, None, [], 4)
    'The model describes all 4 runs.'
    """
    them = f"all {runs} runs" if runs > 1 else "the run"
    if verdict == "adequate":
        left = (
            f" the {departure.words} error left is {format_short(departure.after)}"
            f" {departure.unit}."
            if departure
            else ""
        )
        return (
            f"The model describes {them} within the noise and no fault was found;{left}"
            if left
            else f"The model describes {them}."
        )
    off = (
        f"The {departure.words} is {format_short(departure.before)} {departure.unit} off"
        if departure
        else "The runs depart from the model"
    )
    rest = _left(report)
    if not causes:
        return f"{off} and no known cause explains it{f': what is left is {rest}' if rest else ''}."
    named = _named(causes, departure)
    taken = (
        "with it taken in"
        if len(causes) == 1
        else "with both taken in"
        if len(causes) == 2
        else f"with all {len(causes)} taken in"
    )
    if departure and not _is_moved(departure):
        makes = "makes" if len(causes) == 1 else "make"
        return f"{off}: {named}, which {makes} next to none of that."
    left = (
        f"; {taken} {format_short(departure.after)} {departure.unit} are left" if departure else ""
    )
    close = (
        ", which is the noise"
        if verdict == "explained"
        else f", and more than noise ({rest})"
        if rest
        else ", and more than noise"
    )
    return f"{off}: {named}{left}{close if left else ''}."


def _is_moved(departure: Departure) -> bool:
    """Whether the causes together take a part of the departure away that is worth a figure."""
    return departure.after < UNMOVED * departure.before


def _named(causes: Sequence[Cause], departure: Departure | None) -> str:
    """The causes with how much of the departure is theirs: what the errors' squares lose where the
    cause alone is taken in."""
    first, rest = causes[0], causes[1:]
    share = getattr(first, departure.key) if departure else None
    part = (
        share / departure.before
        if share is not None and departure and departure.before > 0
        else math.nan
    )
    how = (
        "what was found is"
        if departure and not _is_moved(departure)
        # left out alone it would make more than all of it: the others undo some
        else "the largest cause is"
        if part > MORE_THAN_ALL
        else "nearly all of it is"
        if part > 0.9
        else "most of it is"
        if part > 0.6
        else "part of it is"
        if part == part
        else "the cause is"
    )
    text = f"{how} a {first.words} of {first.size}" if first.size else f"{how} a {first.words}"
    if rest:
        text += (
            f", then a {rest[0].words} of {rest[0].size}"
            if rest[0].size
            else f", then a {rest[0].words}"
        )
    return text + (f" and {len(rest) - 1} more" if len(rest) > 1 else "")


def _left(report: Mapping[str, Any]) -> str:
    """What stays open, in the remainder's own words, cut to fit."""
    words = clean_text(take_child(report, "remainder").get("description") or "")
    return words if len(words) <= 90 else words[:89].rsplit(" ", 1)[0] + " …"


def say_forecast(report: Mapping[str, Any]) -> str:
    """What the model is worth on data that the causes were not chosen by.

    Parameters
    ----------
    report
        Of a diagnosis.

    Returns
    -------
    str
        Empty where it is not told.

    Examples
    --------
    >>> from hrg_cli.reporting.answer_words import say_forecast
    >>> say_forecast({"forecast": {"before": 20.0, "after": 2.0, "unit": "deg_h"}})
    'forecast of data left out: error 20 → 2 °/h'
    """
    told = take_child(report, "forecast")
    ratio, low, high = (read_float(told.get(key)) for key in ("ratio", "low", "high"))
    before, after = (read_float(told.get(key)) for key in ("before", "after"))
    if math.isfinite(before) and math.isfinite(after) and told.get("unit"):
        unit = clean_text(str(told["unit"]).replace("deg_h", "°/h"))
        unit = "" if unit == "1" else unit
        factor, unit = (1e6, f"µ{unit}") if unit == "V" and before < 1e-2 else (1.0, unit)
        by = (
            f", {format_short(ratio)} times smaller ({format_short(low)} … {format_short(high)})"
            if all(map(math.isfinite, (ratio, low, high)))
            else ""
        )
        return (
            f"forecast of data left out: error {format_short(before * factor)} →"
            f" {format_short(after * factor)}{f' {unit}' if unit else ''}{by}"
        )
    if isinstance(told.get("sentence"), str):
        return clean_text(told["sentence"])
    gain = take_child(report, "gain")
    ratio, std = read_float(gain.get("ratio")), read_float(gain.get("std"))
    if math.isfinite(ratio) and ratio > 1 and math.isfinite(std):
        return (
            f"{clean_text(gain.get('held_out', 'data'))} left out of the fit are predicted"
            f" {format_short(ratio)} ± {format_number(std, 2)} times better"
        )
    return ""


def say_failed_check(check: Mapping[str, Any]) -> str:
    """A closing check that failed: its own sentence where it has one, else its figure.

    Parameters
    ----------
    check
        Of a report.

    Returns
    -------
    str
        For a person.

    Examples
    --------
    >>> from hrg_cli.reporting.answer_words import say_failed_check
    >>> say_failed_check({"name": "noise_over_stated", "value": 3.0, "limit": 2.0})
    'check failed: noise over stated is 3, the limit is 2'
    """
    name = say_in_words(clean_text(check.get("name")))
    figures = f"{name} is {_value(check.get('value'))}, the limit is {_value(check.get('limit'))}"
    said = clean_text(check.get("sentence") or "")
    if not said:
        return f"check failed: {figures}"
    return (
        f"check failed: {said}"
        if check.get("limit") == 1.0 and check.get("value") == 0.0
        else f"check failed: {said} ({figures})"
    )


def _value(value: Any) -> str:
    return (
        format_short(float(value))
        if isinstance(value, int | float) and not isinstance(value, bool)
        else clean_text(value)
    )


def say_suspect_run(run: Mapping[str, Any]) -> str:
    """A run that stands out, and by what.

    Parameters
    ----------
    run
        Of a report.

    Returns
    -------
    str
        For a person.

    Examples
    --------
    >>> from hrg_cli.reporting.answer_words import say_suspect_run
    >>> say_suspect_run({"run_id": "left", "what": "its amplitude jumps", "evidence": 30.0})
    'run left: its amplitude jumps (30)'
    """
    evidence = run.get("evidence")
    return f"run {clean_text(run.get('run_id'))}: {clean_text(run.get('what', 'stands out'))}" + (
        f" ({_value(evidence)})" if evidence else ""
    )


def say_stability(report: Mapping[str, Any]) -> tuple[str, ...]:
    """Where the causes' names change with the windows or on a shortened record.

    Parameters
    ----------
    report
        Of a diagnosis.

    Returns
    -------
    tuple of str
        One sentence where none does; empty where nothing was changed.

    Examples
    --------
    >>> from hrg_cli.reporting.answer_words import say_stability
    >>> rows = [{"change": "half the windows", "effects": []}]
    >>> say_stability({"stability": rows, "effects": [{"name": "gain_mismatch"}]})
    ('with half the windows the causes are none',)
    """
    rows = list_entries(dict(report), "stability")
    # what the runs' frequencies show is not sought again in a part of them
    between = take_child(report, "frequencies").get("follow")
    apart = set(map(str, between)) if isinstance(between, list) else set()
    usual = sorted({str(e.get("name")) for e in list_entries(dict(report), "effects")} - apart)
    changed = []
    for row in rows:
        names = row.get("effects")
        there = sorted({str(n) for n in names} - apart) if isinstance(names, list) else []
        if there != usual:
            changed.append(
                f"with {clean_text(row.get('change'))} the causes are"
                f" {', '.join(map(clean_text, map(say_in_words, there))) or 'none'}"
            )
    if rows and not changed:
        return (f"the same causes under all {len(rows)} changes of the evaluation",)
    return tuple(dict.fromkeys(changed))


def list_next_runs(report: Mapping[str, Any]) -> tuple[str, ...]:
    """What to run next, each sentence once.

    Parameters
    ----------
    report
        Of a diagnosis.

    Returns
    -------
    tuple of str
        What would tell a cause from its rivals, or else what would pin it down.

    Examples
    --------
    >>> from hrg_cli.reporting.answer_words import list_next_runs
    >>> cause = dict(
    ...     name="a_b", indistinguishable_from=["c"], next_experiment="turn faster; then wait"
    ... )
    >>> list_next_runs({"effects": [cause]})
    ('to tell a b or c: turn faster',)
    """
    found = []
    for effect in list_entries(dict(report), "effects"):
        rivals, run = effect.get("indistinguishable_from"), effect.get("next_experiment")
        if isinstance(rivals, list) and rivals and run:
            names = " or ".join(say_in_words(clean_text(n)) for n in (effect.get("name"), *rivals))
            found.append(f"to tell {names}: {clean_text(str(run).split(';')[0])}")
    if not found and str(report.get("verdict")) in ("partly explained", "unexplained"):
        found.append(
            "repeat the run whose residual is largest; what comes back is the gyro's, what does not"
            " is the bench's"
        )
    return tuple(dict.fromkeys(found))
