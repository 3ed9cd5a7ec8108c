"""Diagnosis: the resonator of the extended model as a record of its own, so that what takes a
resonator takes this one."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ....records import Diagnosis, Resonator
from ....records.replaced import EXTENDED

SURE = ("adequate", "explained")


def build_extended_resonator(diagnosis: Diagnosis) -> Resonator | None:
    """The base parameters beside the causes found, with their covariance, as a resonator.

    Suspect unless the verdict says that nothing is left: parameters of a model that misses
    something are only as good as the model.

    Parameters
    ----------
    diagnosis
        With its report.

    Returns
    -------
    Resonator or None
        None where the report holds no values.

    Examples
    --------
    >>> from hrg_cli import diagnose
    >>> from hrg_cli.stages.diagnosis.drawn_case import draw_waves
    >>> from hrg_cli.stages.diagnosis.extended.extended_resonator import build_extended_resonator
    >>> found = build_extended_resonator(diagnose(draw_waves()))
    >>> found.status, round(found.parameters()["scale_factor"][0], 2)
    ('valid', 0.55)
    """
    try:
        report = diagnosis.read_report()
        rows = [
            (str(v["name"]), float(v["value"]), float(v["std"]), str(v["units"]))
            for v in report["values"]
        ]
    except (ValueError, KeyError, TypeError):
        return None
    if not rows:
        return None
    names, values, stds, units = zip(*rows, strict=True)
    effects = [cause.get("name") for cause in report.get("effects", [])]
    record = Resonator(
        name=np.array(names, dtype=object),
        value=np.array(values),
        std=np.array(stds),
        units=np.array(units, dtype=object),
        covariance=_covariance_of(report, stds),
        method=EXTENDED,
        mode_number=int(report.get("mode_number", 2)),
        gyro_id=diagnosis.gyro_id,
        flat_directions=json.dumps(_say_unknown(report["values"]), ensure_ascii=False),
        chi2_per_dof=float((report.get("after") or {}).get("chi2_per_dof", np.nan)),
        details=json.dumps({"verdict": diagnosis.verdict, "effects": effects}),
    )
    if diagnosis.verdict in SURE:
        return record.judged([])
    return record.judged([f"the model is not whole: its verdict is {diagnosis.verdict}"])


def _covariance_of(report: Mapping[str, Any], stds: Sequence[float]) -> np.ndarray:
    """The report's covariance of the values; a diagonal one where it holds none of their number, as
    reports of older versions do."""
    covariance = np.asarray(report.get("covariance") or np.diag(np.square(stds)), float)
    whole = covariance.shape == (len(stds), len(stds))
    return covariance if whole else np.diag(np.square(stds))


def _say_unknown(values: Sequence[Mapping[str, Any]]) -> list[str]:
    """What these runs do not show: numbers that are assumed, and sums whose parts are not known."""
    assumed = [
        f"{v['name']}: these runs do not show it; {v['value']:.3g} is assumed"
        for v in values
        if v.get("assumed")
    ]
    sums = [
        f"{v['name']}: these runs show its sum with {' and '.join(v['sum_with'])};"
        " a free run beside them parts these"
        for v in values
        if v.get("sum_with")
    ]
    doubts = [
        f"{v['name']}: σ holds what {' and '.join(v['doubted_for'])}, neither named nor excluded,"
        " may move it by"
        for v in values
        if v.get("doubted_for")
    ]
    return assumed + sums + doubts
