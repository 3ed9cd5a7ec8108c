"""Diagnosis, the last step: what the form of a damping, a wander and the forecast add to the verdict and to the report."""

from __future__ import annotations

from typing import Any

from . import wander
from .forecast import WORDS, Trained, forecast
from .form import Form
from .search import Search


def opened(verdict: str, search: Search, form: Form | None) -> str:
    """The verdict's word: a wander, and a catalogued form that fits only roughly, stay open."""
    if form is None and search.base.series.colour is None:
        return verdict
    return "partly explained" if search.found else "unexplained"


def completed(report: dict[str, Any], search: Search, form: Form | None, trained: Trained) -> dict[str, Any]:
    """The report with `forecast` (blocks of time held out), `wander`, and the remainder's sentences.

    Under a coloured noise one window's error says little of the dynamics: the gain is then that of the forecast.
    """
    coloured = search.base.series.colour is not None
    out = report | {"wander": wander.said(search.base), "forecast": None}
    if report["gain"]["held_out"] == "time":
        found = out["forecast"] = forecast(trained, search, *((form.shape, form.other_shapes) if form else (None, ())))
        if coloured and found is not None:
            whole = {name: found[name]["wave_percent"] / 100 for name in ("before", "after")}
            out["gain"] = {"held_out": "time", **whole, "ratio": found["ratio"], "std": found["std"], "of": "forecast"}
    if form is not None:
        out["effects"] = [form.amended(e) for e in report["effects"]]
        out["remainder"] = form.completed(report["remainder"])
    missed = [WORDS[name] for name in out["forecast"]["open"]] if coloured and out["forecast"] else []
    if coloured:
        rest = out["remainder"] or {"covariate": "time", "harmonic": None, "formula": None, "terms": []}
        said = [rest["description"]] if out["remainder"] else []
        said += [wander.sentence(search.base)]
        said += [f"open is what the {' and the '.join(missed)} did in the last part, beyond fit and wander"] if missed else []
        out["remainder"] = rest | {"description": "; ".join(said)}
    return out
