"""Diagnosis: the resonator of the extended model as a record of its own, so that what takes a
resonator takes this one."""

from __future__ import annotations

import json

import numpy as np

from ....records import Diagnosis, Resonator

SURE = ("adequate", "explained")


def extended_resonator(diagnosis: Diagnosis) -> Resonator | None:
    """The base parameters beside the causes found, with their covariance; None where the report
    holds no values.

    Suspect unless the verdict says that nothing is left: parameters of a model that misses
    something are only as good as the model.
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
    covariance = np.asarray(report.get("covariance") or np.diag(np.square(stds)), float)
    if covariance.shape != (len(rows), len(rows)):
        covariance = np.diag(np.square(stds))
    record = Resonator(
        name=np.array(names, dtype=object),
        value=np.array(values),
        std=np.array(stds),
        units=np.array(units, dtype=object),
        covariance=covariance,
        method="extended model",
        mode_number=int(report.get("mode_number", 2)),
        gyro_id=diagnosis.gyro_id,
        flat_directions=json.dumps(
            [
                *(
                    f"{v['name']}: these runs do not show it; {v['value']:.3g} is assumed"
                    for v in report["values"]
                    if v.get("assumed")
                ),
                *(
                    f"{v['name']}: these runs show its sum with {' and '.join(v['sum_with'])};"
                    " a free run beside them parts these"
                    for v in report["values"]
                    if v.get("sum_with")
                ),
            ],
            ensure_ascii=False,
        ),
        chi2_per_dof=float((report.get("after") or {}).get("chi2_per_dof", np.nan)),
        details=json.dumps(
            {
                "verdict": diagnosis.verdict,
                "effects": [e.get("name") for e in report.get("effects", [])],
            }
        ),
    )
    left_open = (
        []
        if diagnosis.verdict in SURE
        else [f"the model is not whole: its verdict is {diagnosis.verdict}"]
    )
    return record.judged(left_open)
