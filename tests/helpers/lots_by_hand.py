"""Lots without files: what `work_gyro` returns for every gyro, drawn at random from a population with
causes put in by hand."""

from __future__ import annotations

import numpy as np

CAUSES = (
    ("gain_mismatch.gain", "1", 3e-4),
    ("electrode_nonorthogonality.angle_rad", "rad", 3e-4),
    ("phase_mismatch.phase_rad", "rad", 2e-4),
    ("quadrature_crosstalk.coupling", "1", 2e-4),
    ("cubic_stiffness.pull_rad_s", "rad s-1", 1e-3),
    ("nonlinear_damping.damping_1_s", "s-1", 1e-4),
    ("rate_bias.rate_rad_s", "rad s-1", 2e-5),
    ("thermal_frequency.relative_1_k", "K-1", 1e-6),
    ("damping_drift.slope_1_s2", "s-2", 1e-5),
    ("ageing.frequency_1_s", "s-1", 1e-9),
)
"""Parameter, unit, σ of one gyro's runs."""
ALIKE = 0.9
"""Correlation of the first two with the next two, as a gain mismatch and a damping split have."""


def correlation() -> np.ndarray:
    """How alike the causes are to a gyro's runs."""
    out = np.eye(len(CAUSES))
    for a, b in ((0, 2), (1, 3)):
        out[a, b] = out[b, a] = ALIKE
    return out


def scores(rng, sizes=None, spread=0.0) -> dict:
    """A diagnosis's `scores`: sizes by parameter in σ of one gyro, and a spread of every cause
    between gyros, in σ, too.

    The scores of one gyro have the covariance C, and each cause of size μ σ moves all by C μ.
    """
    C = correlation()
    names = [name for name, *_ in CAUSES]
    true = np.array([(sizes or {}).get(name, 0.0) for name in names])
    true = true + spread * rng.standard_normal(len(names))
    std = np.array([s for *_, s in CAUSES]) * rng.uniform(0.8, 1.25, len(names))
    size = true * np.array([s for *_, s in CAUSES]) / std
    z = C @ size + np.linalg.cholesky(C) @ rng.standard_normal(len(names))
    return {
        "names": names,
        "units": [unit for _, unit, _ in CAUSES],
        "value": (z * std).tolist(),
        "std": std.tolist(),
        "correlation": [C[k, :k].round(6).tolist() for k in range(len(names))],
    }


def gyro(rng, name, *, sizes=None, spread=0.0, fault=None, moved=None, status="valid") -> dict:
    """A gyro's result. fault: (effect, size in words, share, error before in °/h); moved: parameter
    -> by how much."""
    truth = {
        "frequency_hz": (5000 + 8 * rng.standard_normal(), 2e-4, "Hz"),
        "damping_rate_1_s": (0.31 + 0.01 * rng.standard_normal(), 1e-4, "s-1"),
        "damping_split_1_s": (abs(0.012 + 0.002 * rng.standard_normal()), 1e-4, "s-1"),
        "damping_axis_rad": (rng.uniform(0, 1.5), 1e-3, "rad"),
        "frequency_split_rad_s": (abs(0.11 + 0.02 * rng.standard_normal()), 1e-3, "rad s-1"),
        "stiffness_axis_rad": (rng.uniform(0, 1.5), 1e-3, "rad"),
        "scale_factor": (0.554 + 1e-4 * rng.standard_normal(), 2e-5, "1"),
    }
    parameters = {
        key: {"value": float(v + (moved or {}).get(key, 0.0)), "std": s, "units": u}
        for key, (v, s, u) in truth.items()
    }
    effect, size, share, before = fault or ("", "", None, 1.3)
    answer = {
        "sentence": f"The drift is {before} °/h off." if fault else "No fault was found.",
        "health": "fault found" if fault else "sound",
        "causes": [{"name": effect, "size": size, "share": share, "rivals": []}] if fault else [],
        "departure": {"words": "drift", "unit": "°/h", "before": before, "after": 1.2},
    }
    identified = {"parameters": parameters, "chi2_per_dof": 1.0 + 0.02 * rng.standard_normal()}
    diagnosed = {
        "verdict": "explained" if fault else "adequate",
        "effects": [{"name": effect}] if fault else [],
        "scores": scores(rng, sizes, spread),
    }
    judged = {"status": status, "status_reasons": ["too few runs"]}
    return {
        "gyro_id": name,
        "status": status,
        "results": {"identify": identified | judged, "diagnose": diagnosed | judged},
        "checks": [],
        "answer": answer,
        "error": "",
    }
