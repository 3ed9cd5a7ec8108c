"""The JSON of `hrg ledger show` and `history`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from .charts import Chart
from .entry import Entry
from .gauge import GaugeStudy
from .golden import Golden
from .history import FigureHistory, History
from .judging import Bounds, Held
from .overview import FigureReport, Overview, Standing
from .times import format_time
from .trend import Move, Trend


def describe_overview(found: Overview) -> dict[str, Any]:
    """The JSON of `hrg ledger show`.

    Parameters
    ----------
    found
        What it tells.

    Returns
    -------
    dict
        Plain values.

    Examples
    --------
    >>> from hrg_cli.ledger.report import describe_overview
    >>> from hrg_cli.ledger.overview import make_overview
    >>> describe_overview(make_overview([]))["gyros"]
    []
    """
    return {
        "entries": found.entries,
        "refused": found.refused,
        "reprocessed": found.reprocessed,
        "false_alarms_expected": found.false_alarms_expected,
        "gyros": [_standing(row) for row in found.standings],
        "figures": [_figure(row) for row in found.figures],
        "golden": [_golden(row) for row in found.golden],
    }


def describe_history(found: History) -> dict[str, Any]:
    """The JSON of `hrg ledger history`.

    Parameters
    ----------
    found
        What it tells.

    Returns
    -------
    dict
        Plain values.

    Examples
    --------
    >>> from hrg_cli.ledger.entry import Entry
    >>> from hrg_cli.ledger.history import tell_history
    >>> from hrg_cli.ledger.report import describe_history
    >>> entry = Entry("1", "r.h5", "resonator", "SN-1", "2026-01-01T00:00:00Z", "refused")
    >>> told = describe_history(tell_history([entry], "SN-1"))
    >>> told["gyro_id"], told["entries"][0]["counts"]
    ('SN-1', False)
    """
    counting = {entry.sha256 for entry in found.counting}
    return {
        "gyro_id": found.gyro_id,
        "entries": [
            {
                **describe_entry(entry),
                "reasons": list(entry.reasons),
                "counts": entry.sha256 in counting,
            }
            for entry in found.entries
        ],
        "figures": [_course(row) for row in found.figures],
        "limits": [_describe_limit(row) for row in found.held],
    }


def describe_entry(entry: Entry) -> dict[str, Any]:
    """An entry without its figures, samples and reasons.

    Parameters
    ----------
    entry
        Of the ledger.

    Returns
    -------
    dict
        Plain values.

    Examples
    --------
    >>> from hrg_cli.ledger.entry import Entry
    >>> from hrg_cli.ledger.report import describe_entry
    >>> told = describe_entry(Entry("1", "r.h5", "resonator", "SN-1", "", "valid"))
    >>> told["gyro_id"], "figures" in told
    ('SN-1', False)
    """
    left_out = ("figures", "samples", "reasons")
    return {key: value for key, value in vars(entry).items() if key not in left_out}


def _standing(row: Standing) -> dict[str, Any]:
    return {
        **describe_entry(row.entry),
        "results": row.results,
        "measurements": row.measurements,
        "moved_most": row.moved_figure or None,
        "moved_sigma": row.moved_sigma,
        "changed_most": row.changed_figure or None,
        "changed": None if row.changed is None else asdict(row.changed),
        "within_limits": all(h.passed for h in row.held) if row.held else None,
        "limits": [_describe_limit(h) for h in row.held],
    }


def _describe_limit(row: Held) -> dict[str, Any]:
    return {
        "name": row.row.name,
        "value": row.row.value,
        "std": row.row.std,
        "units": row.row.units,
        "minimum": row.row.minimum,
        "maximum": row.row.maximum,
        "measurement_std": row.measurement_std,
        "passed": row.passed,
        "in_guard_band": row.in_guard_band,
        "probability_outside": row.probability_outside,
    }


def _figure(row: FigureReport) -> dict[str, Any]:
    return {
        "kind": row.kind,
        "name": row.name,
        "units": row.units,
        "gyros": row.gyros,
        "mean": row.mean,
        "std": row.std,
        "limits": _bounds(row.bounds),
        "chart": _chart(row.chart, row.points),
        "capability": None
        if row.capability is None
        else {**asdict(row.capability), "is_normal": row.capability.is_normal},
        "gauge": _gauge(row.gauge),
        "risks": None if row.risks is None else asdict(row.risks),
    }


def _gauge(study: GaugeStudy | None) -> dict[str, Any] | None:
    if study is None:
        return None
    return {
        **asdict(study),
        "share_of_variance": study.share_of_variance,
        "categories": study.categories,
    }


def _golden(row: Golden) -> dict[str, Any]:
    plain = {key: value for key, value in vars(row).items() if key not in ("chart", "measured")}
    told = {key: asdict(v) if isinstance(v, Move | Trend) else v for key, v in plain.items()}
    return {**told, "chart": _chart(row.chart, ())}


def _course(row: FigureHistory) -> dict[str, Any]:
    plain = {key: value for key, value in asdict(row).items() if key != "bounds"}
    return {
        **plain,
        "times": [format_time(t) for t in row.times],
        "limits": _bounds(row.bounds),
        "chart": _chart(row.chart, ()),
    }


def _bounds(bounds: Bounds) -> dict[str, float | None]:
    return {"minimum": bounds[0], "maximum": bounds[1]}


def _chart(chart: Chart | None, points: Sequence[str]) -> dict[str, Any] | None:
    """A chart; a violation names its gyro where the points are gyros."""
    if chart is None:
        return None
    told = asdict(chart) | {"out_of_control": chart.out_of_control}
    told["violations"] = [
        {**asdict(v), **({"gyro_id": points[v.point]} if points else {})} for v in chart.violations
    ]
    return told
