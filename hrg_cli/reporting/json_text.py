"""JSON inside records (details, verdicts), read without trusting its shape."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any


def parse_object(text: str) -> dict[str, Any]:
    """A record's JSON text as an object.

    Parameters
    ----------
    text
        As the file holds it.

    Returns
    -------
    dict
        Anything else than an object is an empty one.

    Examples
    --------
    >>> from hrg_cli.reporting.json_text import parse_object
    >>> parse_object('{"a": 1}'), parse_object("[1]"), parse_object("{broken")
    ({'a': 1}, {}, {})
    """
    value = _json(text)
    return value if isinstance(value, dict) else {}


def parse_list(text: str) -> list[Any]:
    """A record's JSON text as a list.

    Parameters
    ----------
    text
        As the file holds it.

    Returns
    -------
    list
        Anything else than a list is an empty one.

    Examples
    --------
    >>> from hrg_cli.reporting.json_text import parse_list
    >>> parse_list("[1, 2]"), parse_list('{"a": 1}')
    ([1, 2], [])
    """
    value = _json(text)
    return value if isinstance(value, list) else []


def _json(text: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None


def list_entries(report: dict[str, Any], key: str) -> list[dict[str, Any]]:
    """The objects in a list of a JSON object.

    Parameters
    ----------
    report
        The object.
    key
        Of the list.

    Returns
    -------
    list of dict
        Without what is no object; empty where there is no list.

    Examples
    --------
    >>> from hrg_cli.reporting.json_text import list_entries
    >>> list_entries({"effects": [{"name": "gain_mismatch"}, None]}, "effects")
    [{'name': 'gain_mismatch'}]
    """
    value = report.get(key)
    return [e for e in value if isinstance(e, dict)] if isinstance(value, list) else []


def take_child(report: Mapping[str, Any], key: str) -> dict[str, Any]:
    """The object of a key, or an empty one.

    Parameters
    ----------
    report
        The object that it is in.
    key
        Of it.

    Returns
    -------
    dict
        Never None, so that what is missing is not said.

    Examples
    --------
    >>> from hrg_cli.reporting.json_text import take_child
    >>> take_child({"gain": {"ratio": 2.0}}, "gain"), take_child({"gain": None}, "gain")
    ({'ratio': 2.0}, {})
    """
    value = report.get(key)
    return value if isinstance(value, dict) else {}


def read_float(value: Any) -> float:
    """A JSON number.

    Parameters
    ----------
    value
        As it was parsed.

    Returns
    -------
    float
        NaN where it is none; true and false are no numbers.

    Examples
    --------
    >>> from hrg_cli.reporting.json_text import read_float
    >>> read_float(2), read_float("2"), read_float(True)
    (2.0, nan, nan)
    """
    return (
        float(value)
        if isinstance(value, int | float) and not isinstance(value, bool)
        else float("nan")
    )


def read_figure_of_merit(value: Any) -> tuple[float, float, float]:
    """A figure that is kept as a number, or with its interval.

    Parameters
    ----------
    value
        A number, or an object with value, low and high.

    Returns
    -------
    tuple of float
        Value, low and high; NaN where unknown.

    Examples
    --------
    >>> from hrg_cli.reporting.json_text import read_figure_of_merit
    >>> read_figure_of_merit({"value": 2.0, "low": 1.5}), read_figure_of_merit(2.0)
    ((2.0, 1.5, nan), (2.0, nan, nan))
    """
    if isinstance(value, dict):
        return (
            read_float(value.get("value")),
            read_float(value.get("low")),
            read_float(value.get("high")),
        )
    return read_float(value), float("nan"), float("nan")


def read_calibration_rms(text: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """What a calibration leaves of drift and scale factor: before, after and held out.

    Parameters
    ----------
    text
        The calibration's details.

    Returns
    -------
    tuple of dict
        Drift [rad/s] and scale factor [ppm]; empty where they are not told.

    Examples
    --------
    >>> from hrg_cli.reporting.json_text import read_calibration_rms
    >>> read_calibration_rms('{"drift_rms_rad_s": {"after": 1e-6}}')
    ({'after': 1e-06}, {})
    """
    content = parse_object(text)
    figures = take_child(content, "figures")
    drift = (
        take_child(content, "drift_rms_rad_s")
        or take_child(figures, "drift")
        or take_child(content, "residual_rms_rad_s")
    )
    return drift, take_child(content, "scale_factor_rms_ppm") or take_child(figures, "scale")
