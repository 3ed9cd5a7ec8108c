"""The living figure's data: what is left of every run with each set of causes taken in, computed
beforehand and drawn by the page's script.

Every set was fitted anew when the diagnosis was made (`simulated_without`), so that switching is
exact; nothing is computed on the page.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from ..fitting.tables.allan import compute_allan_deviation
from ..records import Array, Diagnosis
from ..stages.diagnosis.report.shares import compute_departure_figures, compute_difference
from ..units import DEGREE_PER_HOUR
from .answer_words import say_in_words
from .json_text import list_entries, parse_list, parse_object
from .text import clean_text

POINTS = 150
"""Points of a run that are drawn."""
RUNS = 8
"""Runs that are drawn: the first ones; the figures are of all."""
FEWEST = 9
"""Rows of a run from which it has an Allan deviation."""


def gather_living_data(record: Diagnosis) -> dict[str, Any] | None:
    """What the page needs to show a diagnosis with any set of its causes taken in.

    Parameters
    ----------
    record
        The diagnosis.

    Returns
    -------
    dict or None
        Causes, and for every set of them the angle's residual a run [mrad], rms figures and Allan
        deviation; None without causes.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> from hrg_cli.reporting.living import gather_living_data
    >>> gather_living_data(Told(left_out="[]", simulated_without=None)) is None
    True
    """
    sets = [
        tuple(map(str, names)) for names in parse_list(record.left_out) if isinstance(names, list)
    ]
    if (
        record.simulated_without is None
        or not sets
        or np.ndim(record.simulated_without) != 3
        or not len(record)
    ):
        return None
    found = [str(e.get("name")) for e in list_entries(parse_object(record.report), "effects")]
    causes = [name for name in found if any(name in names for names in sets)]
    run, time_s = np.asarray(record.run), np.asarray(record.time_s)
    rows: dict[tuple[str, ...], Array] = {(): np.asarray(record.simulated_after)}
    rows |= {names: np.asarray(record.simulated_without)[:, :, k] for k, names in enumerate(sets)}
    shown = np.unique(run)[:RUNS]
    states = {}
    for names, simulated in rows.items():
        left = compute_difference(record.measured, simulated)
        of = compute_departure_figures(left, run, time_s)
        tau, deviation = _allan(left.angle, run, time_s)
        states["".join("0" if name in names else "1" for name in causes)] = {
            "runs": [_numbers(_thin(left.angle[run == k]) * 1e3) for k in shown],
            "drift": of["drift_deg_h"],
            "amplitude": of["amplitude_ppm"],
            "tau": _numbers(tau),
            "allan": _numbers(deviation),
        }
    run_ids = parse_list(record.run_ids)
    return {
        "causes": [
            {"name": clean_text(name), "words": clean_text(say_in_words(name))} for name in causes
        ],
        "runs": [clean_text(run_ids[k]) if k < len(run_ids) else str(k) for k in shown],
        "times": [_numbers(_thin(time_s[run == k] - time_s[run == k][0])) for k in shown],
        "states": states,
    }


def dump_text(data: dict[str, Any]) -> str:
    """JSON for an attribute of a page.

    Parameters
    ----------
    data
        Plain values, all finite.

    Returns
    -------
    str
        Not escaped; the page does that.

    Examples
    --------
    >>> from hrg_cli.reporting.living import dump_text
    >>> dump_text({"unit": "°/h"})
    '{"unit": "°/h"}'
    """
    return json.dumps(data, ensure_ascii=False, allow_nan=False)


def _thin(values: Array) -> Array:
    return values[
        np.unique(np.linspace(0, len(values) - 1, min(len(values), POINTS)).round().astype(int))
    ]


def _numbers(values: Array) -> list[float | None]:
    return [float(f"{v:.5g}") if np.isfinite(v) else None for v in np.asarray(values, float)]


def _allan(angle: Array, run: Array, time_s: Array) -> tuple[Array, Array]:
    """Allan deviation of the drift error m·dθ/dt in °/h: variances of the runs averaged where their
    averaging times agree."""
    pooled: dict[float, list[float]] = {}
    for k in np.unique(run):
        rows = np.flatnonzero((run == k) & np.isfinite(angle))
        t, y = time_s[rows], np.unwrap(angle[rows], period=np.pi)
        step = float(np.median(np.diff(t))) if len(t) > FEWEST else 0.0
        if step <= 0 or np.diff(t).max() > 1.5 * step:  # a row is missing: no even series
            continue
        tau, deviation, _ = compute_allan_deviation(np.diff(y) / step / DEGREE_PER_HOUR, step)
        for at, value in zip(tau, deviation):
            pooled.setdefault(float(f"{at:.3g}"), []).append(float(value) ** 2)
    taus = sorted(pooled)
    return np.array(taus), np.array([np.sqrt(np.mean(pooled[t])) for t in taus])
