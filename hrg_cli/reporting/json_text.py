"""JSON inside records (details, verdicts), read without trusting its shape."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any


def parse_object(text: str) -> dict[str, Any]:
    """A record's JSON text as an object; anything else is an empty one."""
    value = _json(text)
    return value if isinstance(value, dict) else {}


def parse_list(text: str) -> list[Any]:
    """A record's JSON text as a list; anything else is an empty one."""
    value = _json(text)
    return value if isinstance(value, list) else []


def _json(text: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None


def list_entries(report: dict[str, Any], key: str) -> list[dict[str, Any]]:
    """The objects in a list of a JSON object."""
    value = report.get(key)
    return [e for e in value if isinstance(e, dict)] if isinstance(value, list) else []


def take_child(report: Mapping[str, Any], key: str) -> dict[str, Any]:
    """The object of that key, or an empty one."""
    value = report.get(key)
    return value if isinstance(value, dict) else {}


def read_float(value: Any) -> float:
    """A JSON number; anything else is NaN."""
    return (
        float(value)
        if isinstance(value, int | float) and not isinstance(value, bool)
        else float("nan")
    )


def read_figure_of_merit(value: Any) -> tuple[float, float, float]:
    """Value, low and high of a figure kept as a number or as {value, low, high}; NaN where
    unknown."""
    if isinstance(value, dict):
        return (
            read_float(value.get("value")),
            read_float(value.get("low")),
            read_float(value.get("high")),
        )
    return read_float(value), float("nan"), float("nan")


def read_calibration_rms(text: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """rms drift [rad/s] and scale factor [ppm] left before, after and held out, from a
    calibration's details."""
    content = parse_object(text)
    figures = take_child(content, "figures")
    drift = (
        take_child(content, "drift_rms_rad_s")
        or take_child(figures, "drift")
        or take_child(content, "residual_rms_rad_s")
    )
    return drift, take_child(content, "scale_factor_rms_ppm") or take_child(figures, "scale")
