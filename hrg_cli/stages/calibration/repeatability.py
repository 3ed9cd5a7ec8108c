"""Structural stability: which harmonics of the tables repeat between programmes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ...fitting.checks import CHANCE
from ...fitting.tables.increments import AnglePath
from ...fitting.tables.joint import Fitted
from ...fitting.tables.normal_pieces import PIECES, number_pieces
from ...fitting.tables.table_layout import TableLayout

Array = np.ndarray
NOT_REPEATED = 0.01
"""Probability, over all harmonics together, below which a harmonic is said not to repeat."""
LEAST_SWEEP_DEGC_S = 1e-4
MOVED = 6.0
"""Times the scatter of a thermometer's readings that the temperature must move within a piece to
have a direction: the mean of a dwell's noise goes up or down as well."""
ROUNDING = 1e-12
"""Of a temperature, below which its rows do not bend."""
SINGULAR = 1e-7
"""Smallest eigenvalue of a programme's scaled normal matrix from which its offset is held."""


def _label_programmes(
    paths: Sequence[AnglePath], programmes: Mapping[str, str] | None
) -> tuple[Array, str]:
    """Programme (R, S) of each piece, and what told it: names given, else the day of start_time,
    else warming against cooling."""
    if programmes:
        own = [programmes.get(p.run_id, "") for p in paths]
        return np.repeat(np.array(own, object)[:, None], PIECES, axis=1), "programmes"
    days = [p.start_time[:10] for p in paths]
    if len(set(days)) > 1 and all(days):
        return np.repeat(np.array(days, object)[:, None], PIECES, axis=1), "day"
    out = np.full((len(paths), PIECES), "", object)
    for r, path in enumerate(paths):
        rate, piece = compute_sweep(path), number_pieces(len(path))
        scatter = _measure_scatter(path.temperature_degc)
        for s in range(PIECES):
            own = piece == s
            mean = float(np.mean(rate[own])) if own.any() else 0.0
            moved = abs(mean) * float(path.interval_s[own].sum()) > MOVED * scatter
            if moved and abs(mean) > LEAST_SWEEP_DEGC_S:
                out[r, s] = "warming" if mean > 0 else "cooling"
    return out, "warming and cooling"


def _measure_scatter(degc: Array) -> float:
    """σ of single readings (b,) about their course, by their third differences over two readings.

    Rows between two readings lie on the straight line from one to the other, and bend nowhere: what
    neighbouring rows differ by is that line, and no noise.
    """
    bent = np.abs(np.diff(degc, 2)) > ROUNDING * np.abs(degc).max(initial=0.0)
    if len(degc) < 4 or not bent.any():
        return 0.0
    # rows that are means bend in groups, one about each reading
    readings = int(bent[0]) + int(np.count_nonzero(bent[1:] & ~bent[:-1]))
    apart = 1 if bent.all() else min(2 * len(bent) // readings, (len(degc) - 1) // 3)
    first, second, third, last = (degc[k * apart : len(degc) - (3 - k) * apart] for k in range(4))
    return float(np.sqrt(np.mean((last - 3 * third + 3 * second - first) ** 2) / 20))


def compute_sweep(path: AnglePath) -> Array:
    """How fast the temperature moves in a run, smoothed over a twentieth of it.

    A thermometer's steps are not a sweep.

    Parameters
    ----------
    path
        The run.

    Returns
    -------
    ndarray
        dT/dt of its increments (n,) [°C/s]; zeros where no temperature is logged.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.stages.calibration.repeatability import compute_sweep
    >>> t = np.arange(4.0)
    >>> path = draw_path(blocks=4, temperature_degc=20 + 0.5 * t)
    >>> compute_sweep(path).tolist()[1]
    0.5
    """
    if len(path) < 3 or not np.isfinite(path.temperature_degc).all():
        return np.zeros(len(path))
    # A thermometer's steps are not a sweep: the slope is taken over a twentieth of the run.
    width = max(1, len(path) // 40)
    padded = np.pad(path.temperature_degc, width, mode="edge")
    time = np.pad(path.time_s, width, mode="edge")
    slope = (padded[2 * width :] - padded[: -2 * width]) / np.maximum(
        time[2 * width :] - time[: -2 * width], 1e-12
    )
    return path.average_neighbours(slope)


def compare_programmes(
    fitted: Fitted,
    coefficients: Array,
    drift_limit: int,
    scale_limit: int,
    programmes: Mapping[str, str] | None,
) -> dict[str, Any] | None:
    """How each harmonic of the tables differs between programmes.

    Each programme's own offset from the joint tables (the same at all nodes) is fitted; per
    harmonic Q = Σ(δ_g − δ̄)ᵀS_g⁻¹(δ_g − δ̄) is χ² with (G − 1) degrees a coefficient if the
    harmonic repeats; the scatter between programmes follows from its excess (DerSimonian and Laird
    1986).

    Parameters
    ----------
    fitted
        The runs.
    coefficients
        Of the tables (size,).
    drift_limit, scale_limit
        Harmonics of 2mθ that are compared.
    programmes
        Run -> its programme; None: told by the day, or by warming and cooling.

    Returns
    -------
    dict or None
        A row a harmonic: probability, scatter, amplitude, whether it repeats; None where there is
        one programme.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.drawn_path import draw_path
    >>> from hrg_cli.fitting.tables.joint import fit
    >>> from hrg_cli.fitting.tables.table_layout import Model, TableLayout
    >>> from hrg_cli.stages.calibration.repeatability import compare_programmes
    >>> random, layout = (
    ...     np.random.default_rng(1),
    ...     TableLayout(np.array([20.0]), "temperature", 2, 1, 0),
    ... )
    >>> fitted = fit([draw_path(rate, random) for rate in (-0.2, -0.1, 0.1, 0.2)], layout)
    >>> compare_programmes(fitted, fitted.solution.coefficients, 1, 0, None) is None
    True
    """
    label, told_by = _label_programmes(fitted.paths, programmes)
    layout = fitted.layout
    drift_limit = min(drift_limit, layout.drift_harmonics)
    scale_limit = min(scale_limit, layout.scale_harmonics)
    names, offsets, covariances, skipped = _offsets_by_programme(
        fitted, coefficients, label, drift_limit, scale_limit
    )
    if len(names) < 2:
        return None

    groups = [("drift", k) for k in range(drift_limit + 1)]
    groups += [("scale", k) for k in range(scale_limit + 1)]
    table: list[dict[str, Any]] = []
    place = 0
    for kind, k in groups:
        own = slice(place, place + (2 if k else 1))
        place = own.stop
        # cosine and sine of a harmonic are judged together: its phase means nothing by itself
        scatter = _scatter(np.array([o[own] for o in offsets]), [c[own, own] for c in covariances])
        amplitude = _amplitude(layout, coefficients, kind, k)
        name = _name_harmonic(layout, kind, k)
        # Bonferroni over the harmonics
        repeats = bool(scatter["p_value"] * len(groups) > NOT_REPEATED)
        # an offset that scatters more than the harmonic itself makes predictions worse, not better
        small = scatter["scatter"] ** 2 * (1 + 1 / len(names)) < amplitude**2
        table.append(
            {
                "kind": kind,
                "harmonic": k,
                **scatter,
                "amplitude": amplitude,
                "name": name,
                "repeats": repeats,
                "stable": bool(repeats or small),
            }
        )
    return {
        "told_by": told_by,
        "programmes": names,
        "not_enough_alone": skipped,
        "harmonics": table,
    }


def _offsets_by_programme(
    fitted: Fitted, coefficients: Array, label: Array, drift_limit: int, scale_limit: int
) -> tuple[list[str], list[Array], list[Array], list[str]]:
    """Programmes, each one's offset (h,) from the joint tables with its covariance, and those whose
    runs alone do not hold one."""
    layout = fitted.layout
    drift = layout.build_part_map("drift", drift_limit, one_node=True)
    matrix = np.concatenate(
        [drift, layout.build_part_map("scale", scale_limit, one_node=True)], axis=1
    )
    names, offsets, covariances, skipped = [], [], [], []
    for name in sorted({str(v) for v in label.ravel()} - {""}):
        A, b, rows = fitted.pieces.sum(label == name)
        if rows == 0:
            continue
        inverse = _inverse(matrix.T @ A @ matrix)
        if inverse is None:
            skipped.append(name)
            continue
        offsets.append(inverse @ (matrix.T @ (b - A @ coefficients)))
        covariances.append(inverse * fitted.chi2_per_dof)
        names.append(name)
    return names, offsets, covariances, skipped


def _inverse(G: Array) -> Array | None:
    """The inverse of a normal matrix, scaled to a unit diagonal; None where it is singular."""
    scale = np.sqrt(np.maximum(np.diag(G), 1e-300))
    values, vectors = np.linalg.eigh(G / np.outer(scale, scale))
    if values.min() < SINGULAR:
        return None
    return np.asarray((vectors / values) @ vectors.T / np.outer(scale, scale))


def say_unstable(found: dict[str, Any] | None, dropped: Sequence[str]) -> list[str]:
    """A sentence for each harmonic that does not repeat between programmes, beyond chance.

    Parameters
    ----------
    found
        Of `compare_programmes`; None: there is one programme.
    dropped
        Names of harmonics that were dropped, and need no sentence.

    Returns
    -------
    list of str
        Empty where all repeat.

    Examples
    --------
    >>> from hrg_cli.stages.calibration.repeatability import say_unstable
    >>> row = dict(name="drift 4θ", kind="drift", p_value=1e-12, scatter=1e-6, amplitude=1e-5)
    >>> found = dict(told_by="day", harmonics=[row])
    >>> len(say_unstable(found, [])), say_unstable(found, ["drift 4θ"]), say_unstable(None, [])
    (1, [], [])
    """
    if found is None:
        return []
    out = []
    for row in found["harmonics"]:
        if row["p_value"] * len(found["harmonics"]) >= CHANCE or row["name"] in dropped:
            continue
        unit = " rad/s" if row["kind"] == "drift" else ""
        out.append(
            f"the {row['name']} does not repeat between programmes (told by {found['told_by']}, p ="
            f" {row['p_value']:.2g}): it scatters by {row['scatter']:.2g} of"
            f" {row['amplitude']:.2g}{unit}; look for what differs, or use --stable-only"
        )
    return out


def _amplitude(layout: TableLayout, coefficients: Array, kind: str, k: int) -> float:
    table = layout.split_tables(coefficients)[0 if kind == "drift" else 1]
    return float(
        np.sqrt(
            np.mean(
                (table[:, [0]] if k == 0 else table[:, 2 * k - 1 : 2 * k + 1]) ** 2, axis=0
            ).sum()
        )
    )


def _scatter(offsets: Array, covariances: Sequence[Array]) -> dict[str, float]:
    """Weighted mean removed: p-value of "the same", and the scatter between programmes by moments
    (DerSimonian–Laird)."""
    from scipy.stats import chi2

    weights = [np.linalg.inv(c) for c in covariances]
    total = np.sum(weights, axis=0)
    mean = np.linalg.solve(total, np.sum([w @ o for w, o in zip(weights, offsets)], axis=0))
    Q = float(sum((o - mean) @ w @ (o - mean) for w, o in zip(weights, offsets)))
    size = offsets.shape[1]
    freedom = size * (len(offsets) - 1)
    spread = float(
        np.trace(total) - np.trace(np.linalg.solve(total, np.sum([w @ w for w in weights], axis=0)))
    )
    # DerSimonian and Laird 1986: E[Q] = freedom + variance·(tr W − tr W⁻¹ΣW_g²)
    variance = max(Q - freedom, 0.0) / max(spread, 1e-300)
    return {"p_value": float(chi2.sf(Q, freedom)), "scatter": float(np.sqrt(size * variance))}


def _name_harmonic(layout: TableLayout, kind: str, k: int) -> str:
    """Name of a harmonic: "drift 8θ", "scale factor constant"."""
    return (
        f"{'drift' if kind == 'drift' else 'scale factor'}"
        f" {f'{2 * layout.mode_number * k}θ' if k else 'constant'}"
    )


def drop_unstable(
    layout: TableLayout, drift_limit: int, scale_limit: int, found: dict[str, Any]
) -> tuple[Array, list[str]]:
    """A model without the harmonics that do not repeat between programmes.

    Parameters
    ----------
    layout
        Of the tables.
    drift_limit, scale_limit
        Harmonics of 2mθ in drift and scale factor.
    found
        Of `compare_programmes`.

    Returns
    -------
    tuple
        Directions (size, p) of the model, and names of what was dropped; the constant of K always
        stays.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.fitting.tables.table_layout import TableLayout
    >>> from hrg_cli.stages.calibration.repeatability import drop_unstable
    >>> layout = TableLayout(np.array([20.0]), "temperature", 2, 1, 0)
    >>> rows = [("drift", 0, True), ("drift", 1, False), ("scale", 0, False)]
    >>> told = [dict(kind=k, harmonic=h, stable=s, name=f"{k} {h}") for k, h, s in rows]
    >>> matrix, dropped = drop_unstable(layout, 1, 0, {"harmonics": told})
    >>> matrix.shape, dropped
    ((4, 2), ['drift 1'])
    """
    parts, dropped = [], []
    for row in found["harmonics"]:
        kind, k = row["kind"], row["harmonic"]
        if k > (drift_limit if kind == "drift" else scale_limit):
            continue
        if row["stable"] or (kind == "scale" and k == 0):
            parts.append(layout.build_part_map(kind, k, lowest=k))
        else:
            dropped.append(row["name"])
    return np.concatenate(parts, axis=1), dropped
