"""The tables of a diagnosis: supplied values, causes, gains on data not used, what is left, what cannot
be told apart, what was tested.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..records import Diagnosis
from .answer_words import in_words
from .diagnosis import gains, score_left
from .figure_names import name_of_figure
from .figures_in_words import words_of
from .json_text import child, entries, json_object
from .page_table import PageTable, cell
from .quantities import quantity, rounded
from .text import drop_empty_columns, number, plain


def list_diagnosis(record: Diagnosis) -> list[PageTable]:
    """All of them; one in which nothing would stand is left out."""
    report = json_object(record.report)
    remainder = child(report, "remainder")
    left = [(words_of(k), cell(v)) for k, v in remainder.items()]
    return [
        *_list_supplied(entries(report, "values")),
        *_list_causes(entries(report, "effects")),
        *_list_gains(report),
        *([PageTable("What is left unexplained", ("", ""), left)] if left else []),
        *_list_inseparable(entries(report, "not_separable")),
        *_list_tested(entries(report, "tested")),
    ]


def _list_supplied(values: Sequence[dict[str, Any]]) -> list[PageTable]:
    """What the runs say of the supplied model's values."""
    moved = [
        (
            name_of_figure(str(v.get("name"))),
            _write_parameter(v, v["believed"], None),
            _write_parameter(v, v.get("value"), v.get("std")),
            number(v.get("sigma"), 3),
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
            in_words(plain(effect.get("name"))),
            plain(_write_sizes(child(effect, "parameters"))),
            number(effect.get("z")),
            number(effect.get("p_value"), 2),
            number(effect.get("delta_bic")),
            in_words(cell(effect.get("indistinguishable_from") or None)),
            plain(effect.get("next_experiment") or "–"),
        )
        for effect in effects
    ]
    head = ("cause", "size", "σ", "p", "ΔBIC", "cannot be told from", "next experiment")
    return [PageTable("Causes found", *drop_empty_columns(head, rows))]


def _write_sizes(parameters: Mapping[str, Any]) -> str:
    """The parameters of a cause with their standard deviations."""
    return "; ".join(
        f"{words_of(k)} {quantity(k, p.get('value'), p.get('std'), str(p.get('units', '')))}"
        for k, p in parameters.items()
        if isinstance(p, dict)
    )


def _write_parameter(row: Mapping[str, Any], value: Any, std: Any) -> str:
    return quantity(str(row.get("name")), value, std, str(row.get("units", "")))


def _list_inseparable(groups: Sequence[dict[str, Any]]) -> list[PageTable]:
    """Causes that these runs cannot tell apart."""
    if not groups:
        return []
    rows = [
        (
            in_words(cell(group.get("effects"))),
            plain(cell(group.get("base"))),
            plain(cell(group.get("next_experiment"))),
        )
        for group in groups
    ]
    head = ("causes", "the same as", "what would tell")
    return [PageTable("What these runs cannot tell apart", *drop_empty_columns(head, rows))]


def _list_tested(tested: Sequence[dict[str, Any]]) -> list[PageTable]:
    """Every cause that was looked for and can be seen: its score beside what was found, and how large
    it can be at most."""
    rows = [
        (
            in_words(plain(e.get("name"))),
            "found" if e.get("upper_limit") is None else number(score_left(e), 3),
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
    return rounded("", float(limit), units, 2)


FORECAST = (
    ("angle_deg", "wave angle, °"),
    ("amplitude_percent", "amplitude, %"),
    ("quadrature_percent", "quadrature, % of the amplitude"),
)


def _list_gains(report: dict[str, Any]) -> list[PageTable]:
    """What the extended model gains where it was not fitted: held-out errors in physical units, the
    forecast cause by cause."""
    found, gain, forecast = [], child(report, "gain"), child(report, "forecast")
    rows = gains(gain)
    if rows:
        found.append(
            PageTable(
                f"Errors on held-out {plain(gain.get('held_out', 'data'))}, rms",
                ("quantity", "before", "after"),
                rows,
            )
        )
    if forecast:
        rows = [
            (name, *(cell(part.get(key)) for key, _ in FORECAST))
            for name, part in _split_forecast(forecast)
        ]
        held = plain(forecast.get("held_out", "time"))
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
    parts = child(forecast, "parts") or forecast
    return [
        (words, child(parts, when))
        for words, when in (("without the causes", "before"), ("with the causes", "after"))
    ]
