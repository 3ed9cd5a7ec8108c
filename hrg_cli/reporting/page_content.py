"""What the page says in words and tables: steps of the chain, headline, parameters for people,
method comparison."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..records import Calibration, Compensated, Diagnosis, Record, Resonator, Status
from ..units import DEGREE_PER_HOUR
from .diagnosis import gains
from .json_text import calibration_rms, child, entries, figure_of_merit, json_list, json_object
from .text import number, plain

STEPS = (
    ("recording", ("import", "simulate"), "record, import or simulate"),
    ("periods", ("demodulate",), "demodulate"),
    ("wave", ("estimate",), "estimate"),
    ("resonator", ("identify",), "identify"),
    ("calibration", ("calibrate",), "calibrate"),
    ("diagnosis", ("diagnose",), "diagnose"),
    ("compensated", ("compensate",), "compensate"),
)
"""Kind of file, commands that make it, name of the step; in the order of the work."""


@dataclass(frozen=True)
class ShownStep:
    """One step of the chain: `state` is "run", "suspect", "failed" or "skipped", `note` says
    why."""

    name: str
    state: str
    note: str


@dataclass(frozen=True)
class PageTable:
    """A table: its caption, heads and rows; the first column names the row."""

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]


def cell(value: Any) -> str:
    """A value as a person reads it."""
    if isinstance(value, float | np.floating):
        return number(float(value), 7)
    if isinstance(value, list | tuple):
        return plain(", ".join(cell(v) for v in value)) or "–"
    return "–" if value is None else plain(value)


def steps(records: Iterable[tuple[str, Status]], history: Iterable[str]) -> list[ShownStep]:
    """The chain's steps from the files given (kind, status) and the commands in their histories."""
    states: dict[str, list[Status]] = {}
    for kind, status in records:
        states.setdefault(kind, []).append(status)
    ran = {command for text in history for command in text.split()[1:]}
    found = []
    for kind, commands, name in STEPS:
        given = states.get(kind, [])
        files = f"{len(given)} file{'s' if len(given) != 1 else ''}"
        if "refused" in given:
            found.append(ShownStep(name, "failed", f"{given.count('refused')} of {files} refused"))
        elif "suspect" in given:
            found.append(ShownStep(name, "suspect", f"{given.count('suspect')} of {files} suspect"))
        elif given:
            found.append(ShownStep(name, "run", f"{files}, valid"))
        elif ran.intersection(commands):
            found.append(
                ShownStep(name, "run", "named in the history; its file is not on this page")
            )
        else:
            found.append(ShownStep(name, "skipped", "no file and no line in any history"))
    return found


def for_people(name: str, value: float, std: float, frequency_hz: float | None) -> str:
    """A resonator parameter in the units people use."""

    def pair(factor: float, unit: str) -> str:
        return f"{number(value * factor, 5)} ± {number(std * factor, 2)} {unit}"

    if name == "damping_rate_1_s" and value > 0:
        quality = f", Q = {number(math.pi * frequency_hz / value, 4)}" if frequency_hz else ""
        return f"τ = {number(1 / value, 5)} ± {number(std / value / value, 2)} s{quality}"
    if name == "damping_split_1_s":
        return f"{pair(1 / DEGREE_PER_HOUR, '°/h')} of drift D"
    if name == "frequency_split_rad_s":
        return f"Δf = {pair(1e3 / math.pi, 'mHz')}"
    if name.endswith("_axis_rad"):
        return pair(180 / math.pi, "°")
    if name == "scale_factor" and value:
        return f"σ = {number(abs(std / value) * 1e6, 2)} ppm"
    if name.endswith("_hz"):
        return f"σ = {number(std * 1e3, 2)} mHz"
    if name.endswith("_rad_s"):
        return pair(1 / DEGREE_PER_HOUR, "°/h")
    return ""


def tables(record: Record) -> list[PageTable]:
    """The tables of a result."""
    if isinstance(record, Resonator):
        return _resonator(record)
    if isinstance(record, Calibration):
        return _calibration(record)
    if isinstance(record, Diagnosis):
        return _diagnosis(record)
    if isinstance(record, Compensated):
        return _figures("Figures", json_object(record.details))
    return []


def _resonator(record: Resonator) -> list[PageTable]:
    parameters = record.parameters()
    frequency = parameters.get("frequency_hz", (None,))[0]
    rows = [
        (plain(n), number(v, 8), number(s, 2), plain(u), for_people(n, v, s, frequency))
        for n, (v, s, u) in parameters.items()
    ]
    found = [
        PageTable(
            "Parameters with standard deviations",
            ("parameter", "value", "σ", "unit", "for people"),
            rows,
        )
    ]
    flat = json_list(record.flat_directions)
    if flat:
        found.append(
            PageTable(
                "What these runs cannot tell",
                ("direction",),
                [(plain(sentence),) for sentence in flat],
            )
        )
    return found + _figures("Details", json_object(record.details))


def _calibration(record: Calibration) -> list[PageTable]:
    drift, scale = calibration_rms(record.details)
    found = []
    if drift or scale:
        rows = [
            (
                key.replace("_", " "),
                _range(drift.get(key), 1 / DEGREE_PER_HOUR),
                _range(scale.get(key), 1.0),
            )
            for key in ("before", "after", "held_out")
        ]
        found.append(PageTable("Residual, rms", ("", "drift, °/h", "scale factor, ppm"), rows))
    shown = ("drift_rms_rad_s", "scale_factor_rms_ppm", "figures", "ladder", "harmonics")
    left = {k: v for k, v in json_object(record.details).items() if k not in shown}
    return found + _figures("Details", left)


def _range(value: Any, factor: float) -> str:
    middle, low, high = (number(part * factor) for part in figure_of_merit(value))
    return middle if low == "–" else f"{middle} ({low} … {high})"


def _diagnosis(record: Diagnosis) -> list[PageTable]:
    report = json_object(record.report)
    found = []
    values = [v for v in entries(report, "values") if v.get("believed") is not None]
    if values:
        moved: list[tuple[str, ...]] = [
            (
                plain(v.get("name")),
                number(v["believed"], 8),
                (
                    f"{number(v.get('value'), 8)} ± {number(v.get('std'), 2)}"
                    f" {plain(v.get('units', ''))}"
                ),
                number(v.get("sigma"), 3),
                "wrong" if v.get("wrong") else "agrees",
            )
            for v in values
        ]
        found.append(
            PageTable(
                "Values of the supplied model",
                ("parameter", "believed", "measured", "moved by, σ", ""),
                moved,
            )
        )
    if entries(report, "effects"):
        rows = []
        for effect in entries(report, "effects"):
            parameters = child(effect, "parameters")
            sizes = "; ".join(
                f"{k} = {number(p.get('value'))} ± {number(p.get('std'), 2)} {p.get('units', '')}"
                for k, p in parameters.items()
                if isinstance(p, dict)
            )
            others = cell(effect.get("indistinguishable_from") or None)
            rows.append(
                tuple(
                    plain(v)
                    for v in (
                        effect.get("name"),
                        sizes,
                        number(effect.get("z")),
                        number(effect.get("p_value"), 2),
                        number(effect.get("delta_bic")),
                        others,
                        effect.get("next_experiment") or "–",
                    )
                )
            )
        found.append(
            PageTable(
                "Causes found",
                ("effect", "size", "z", "p", "ΔBIC", "cannot be told from", "next experiment"),
                rows,
            )
        )
    found += _gain_tables(report)
    if child(report, "remainder"):
        found.append(
            PageTable(
                "What is left unexplained",
                ("", ""),
                [(plain(k), cell(v)) for k, v in child(report, "remainder").items()],
            )
        )
    if entries(report, "not_separable"):
        rows = [tuple(cell(v) for v in e.values()) for e in entries(report, "not_separable")]
        found.append(
            PageTable(
                "What these runs cannot tell apart",
                [plain(k) for k in entries(report, "not_separable")[0]],
                rows,
            )
        )
    tested = entries(report, "tested")
    if tested:
        rows = [
            tuple(
                map(
                    plain,
                    (
                        e.get("name"),
                        cell(e.get("z")),
                        cell(e.get("upper_limit")),
                        e.get("units", ""),
                    ),
                )
            )
            for e in tested
        ]
        found.append(PageTable("Causes tested", ("effect", "z", "upper limit", "unit"), rows))
    return found


FORECAST = (
    ("angle_deg", "wave angle, °"),
    ("amplitude_percent", "amplitude, %"),
    ("quadrature_percent", "quadrature, % of the amplitude"),
)


def _gain_tables(report: dict[str, Any]) -> list[PageTable]:
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
            for name, part in forecast_parts(forecast)
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


def forecast_parts(forecast: Mapping[str, Any]) -> list[tuple[str, dict[str, Any]]]:
    """The forecast's errors by the wave's quantities, without and with the causes."""
    parts = child(forecast, "parts") or forecast
    return [
        (words, child(parts, when))
        for words, when in (("without the causes", "before"), ("with the causes", "after"))
    ]


def _figures(caption: str, content: Any, depth: int = 0) -> list[PageTable]:
    """Tables of a JSON object: its numbers and sentences in one, each comparison (objects of one
    shape) in its own."""
    if not isinstance(content, Mapping):
        return []
    single, found = [], []
    for key, value in content.items():
        title = plain(key).replace("_", " ")
        if value is None or value == [] or value == {}:
            continue
        if isinstance(value, Mapping) and all(isinstance(v, Mapping) for v in value.values()):
            head = list(dict.fromkeys(k for v in value.values() for k in v))[:10]
            rows = [(plain(name), *(_short(v.get(k)) for k in head)) for name, v in value.items()]
            found.append(
                PageTable(title, ("", *(plain(h).replace("_", " ") for h in head)), rows[:60])
            )
        elif isinstance(value, list) and all(isinstance(v, Mapping) for v in value):
            head = list(dict.fromkeys(k for v in value for k in v))[:10]
            found.append(
                PageTable(
                    title,
                    [plain(h).replace("_", " ") for h in head],
                    [tuple(_short(v.get(k)) for k in head) for v in value][:60],
                )
            )
        elif (
            isinstance(value, Mapping)
            and depth < 2
            and any(isinstance(v, Mapping) or _objects(v) for v in value.values())
        ):
            found += _figures(title, value, depth + 1)
        elif isinstance(value, Mapping):
            single += [
                (f"{title}: {plain(k).replace('_', ' ')}", _short(v))
                for k, v in value.items()
                if v is not None
            ]
        else:
            single.append((title, _short(value)))
    return ([PageTable(caption, ("figure", "value"), single[:80])] if single else []) + found


def _objects(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(v, Mapping) for v in value)


def _short(value: Any) -> str:
    if isinstance(value, Mapping):
        if "value" in value:
            std = f" ± {cell(value.get('std'))}" if value.get("std") is not None else ""
            return f"{cell(value['value'])}{std} {plain(value.get('units', ''))}".strip()
        return "; ".join(f"{plain(k)} {_short(v)}" for k, v in list(value.items())[:8])
    if isinstance(value, list) and len(value) > 12:
        return f"{len(value)} values, {_short(value[:3])} …"
    text = cell(float(value) if isinstance(value, int) and abs(value) > 10**12 else value)
    return text if len(text) <= 400 else text[:400] + "…"
