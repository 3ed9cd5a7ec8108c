"""The tables of a diagnosis: supplied values, causes, gains on data not used, what is left, what cannot
be told apart, what was tested.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..records import Diagnosis
from .diagnosis import gains
from .json_text import child, entries, json_object
from .page_table import PageTable, cell
from .text import drop_empty_columns, number, plain


def list_diagnosis(record: Diagnosis) -> list[PageTable]:
    """All of them; one in which nothing would stand is left out."""
    report = json_object(record.report)
    remainder = child(report, "remainder")
    left = [(plain(k), cell(v)) for k, v in remainder.items()]
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
            plain(v.get("name")),
            number(v["believed"], 8),
            f"{number(v.get('value'), 8)} ± {number(v.get('std'), 2)} {plain(v.get('units', ''))}",
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
            plain(effect.get("name")),
            plain(_write_sizes(child(effect, "parameters"))),
            number(effect.get("z")),
            number(effect.get("p_value"), 2),
            number(effect.get("delta_bic")),
            plain(cell(effect.get("indistinguishable_from") or None)),
            plain(effect.get("next_experiment") or "–"),
        )
        for effect in effects
    ]
    head = ("effect", "size", "z", "p", "ΔBIC", "cannot be told from", "next experiment")
    return [PageTable("Causes found", *drop_empty_columns(head, rows))]


def _write_sizes(parameters: Mapping[str, Any]) -> str:
    """The parameters of a cause with their standard deviations."""
    return "; ".join(
        f"{k} = {number(p.get('value'))} ± {number(p.get('std'), 2)} {p.get('units', '')}"
        for k, p in parameters.items()
        if isinstance(p, dict)
    )


def _list_inseparable(groups: Sequence[dict[str, Any]]) -> list[PageTable]:
    """Causes that these runs cannot tell apart."""
    if not groups:
        return []
    rows = [tuple(cell(v) for v in group.values()) for group in groups]
    return [PageTable("What these runs cannot tell apart", [plain(k) for k in groups[0]], rows)]


def _list_tested(tested: Sequence[dict[str, Any]]) -> list[PageTable]:
    """Every cause that was looked for, and how large it can be at most."""
    rows = [
        (
            plain(e.get("name")),
            plain(cell(e.get("z"))),
            plain(cell(e.get("upper_limit"))),
            plain(e.get("units", "")),
        )
        for e in tested
    ]
    return (
        [PageTable("Causes tested", ("effect", "z", "upper limit", "unit"), rows)] if rows else []
    )


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
