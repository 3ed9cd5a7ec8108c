"""The tables of a diagnosis: supplied values, causes, gains on data not used, what is left, what
cannot be told apart, what was tested.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..records import Diagnosis
from .answer_words import say_in_words
from .diagnosis import score_left, tabulate_gains
from .figure_names import name_figure
from .figures_in_words import say_key
from .json_text import list_entries, parse_object, take_child
from .page_table import PageTable, format_cell
from .quantities import format_quantity, format_rounded
from .text import clean_text, drop_empty_columns, format_number


def list_diagnosis(record: Diagnosis) -> list[PageTable]:
    """The tables of a diagnosis.

    Parameters
    ----------
    record
        The diagnosis.

    Returns
    -------
    list of PageTable
        Without those in which nothing would stand.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.reporting.page_diagnosis import list_diagnosis
    >>> list_diagnosis(Told(report='{"remainder": {}, "effects": []}'))
    []
    """
    report = parse_object(record.report)
    remainder = take_child(report, "remainder")
    left = [(say_key(k), format_cell(v)) for k, v in remainder.items()]
    return [
        *_list_supplied(list_entries(report, "values")),
        *_list_causes(list_entries(report, "effects")),
        *_list_gains(report),
        *([PageTable("What is left unexplained", ("", ""), left)] if left else []),
        *_list_inseparable(list_entries(report, "not_separable")),
        *_list_tested(list_entries(report, "tested")),
    ]


def _list_supplied(values: Sequence[dict[str, Any]]) -> list[PageTable]:
    """What the runs say of the supplied model's values."""
    moved = [
        (
            name_figure(str(v.get("name"))),
            _write_parameter(v, v["believed"], None),
            _write_parameter(v, v.get("value"), v.get("std")),
            format_number(v.get("sigma"), 3),
            "wrong" if v.get("wrong") else "agrees",
        )
        for v in values
        if v.get("believed") is not None
    ]
    head = ("parameter", "believed", "measured", "moved by, σ", "")
    return [PageTable("Values of the supplied model", head, moved)] if moved else []


def _list_causes(effects: Sequence[dict[str, Any]]) -> list[PageTable]:
    """The causes named, with sizes and what they are known by."""
    if not effects:
        return []
    rows = [
        (
            say_in_words(clean_text(effect.get("name"))),
            clean_text(_write_sizes(take_child(effect, "parameters"))),
            format_number(effect.get("z")),
            format_number(effect.get("p_value"), 2),
            format_number(effect.get("delta_bic")),
            say_in_words(format_cell(effect.get("indistinguishable_from") or None)),
            clean_text(effect.get("next_experiment") or "–"),
        )
        for effect in effects
    ]
    head = ("cause", "size", "σ", "p", "ΔBIC", "cannot be told from", "next experiment")
    return [PageTable("Causes found", *drop_empty_columns(head, rows))]


def _write_sizes(parameters: Mapping[str, Any]) -> str:
    """The parameters of a cause with their standard deviations."""
    return "; ".join(
        f"{say_key(k)} {format_quantity(k, p.get('value'), p.get('std'), str(p.get('units', '')))}"
        for k, p in parameters.items()
        if isinstance(p, dict)
    )


def _write_parameter(row: Mapping[str, Any], value: Any, std: Any) -> str:
    return format_quantity(str(row.get("name")), value, std, str(row.get("units", "")))


def _list_inseparable(groups: Sequence[dict[str, Any]]) -> list[PageTable]:
    """Causes that these runs cannot tell apart."""
    if not groups:
        return []
    rows = [
        (
            say_in_words(format_cell(group.get("effects"))),
            clean_text(format_cell(group.get("base"))),
            clean_text(format_cell(group.get("next_experiment"))),
        )
        for group in groups
    ]
    head = ("causes", "the same as", "what would tell")
    return [PageTable("What these runs cannot tell apart", *drop_empty_columns(head, rows))]


def _list_tested(tested: Sequence[dict[str, Any]]) -> list[PageTable]:
    """Every cause that was looked for and can be seen: its score beside what was found, and how
    large it can be at most."""
    rows = [
        (
            say_in_words(clean_text(e.get("name"))),
            "found" if e.get("upper_limit") is None else format_number(score_left(e), 3),
            _round_limit(e.get("upper_limit"), str(e.get("units", ""))),
        )
        for e in tested
        if e.get("visible", True)
    ]
    head = ("cause", "σ beside those found", "at most (95 %)")
    return [PageTable("Causes tested", head, rows)] if rows else []


def _round_limit(limit: Any, units: str) -> str:
    """A limit in the unit of its size, in two digits."""
    if not isinstance(limit, int | float) or isinstance(limit, bool):
        return "–"
    return format_rounded("", float(limit), units, 2)


FORECAST = (
    ("angle_deg", "wave angle, °"),
    ("amplitude_percent", "amplitude, %"),
    ("quadrature_percent", "quadrature, % of the amplitude"),
)


def _list_gains(report: dict[str, Any]) -> list[PageTable]:
    """What the extended model gains where it was not fitted: held-out errors in physical units, the
    forecast cause by cause."""
    found, gain, forecast = [], take_child(report, "gain"), take_child(report, "forecast")
    rows = tabulate_gains(gain)
    if rows:
        found.append(
            PageTable(
                f"Errors on held-out {clean_text(gain.get('held_out', 'data'))}, rms",
                ("quantity", "before", "after"),
                rows,
            )
        )
    if forecast:
        rows = [
            (name, *(format_cell(part.get(key)) for key, _ in FORECAST))
            for name, part in _split_forecast(forecast)
        ]
        held = clean_text(forecast.get("held_out", "time"))
        found.append(
            PageTable(
                f"Forecast of {held} left out, rms errors",
                ("model", *(words for _, words in FORECAST)),
                rows,
            )
        )
    return found


def _split_forecast(forecast: Mapping[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """The forecast's errors by the wave's quantities, without and with the causes."""
    parts = take_child(forecast, "parts") or forecast
    return [
        (words, take_child(parts, when))
        for words, when in (("without the causes", "before"), ("with the causes", "after"))
    ]
