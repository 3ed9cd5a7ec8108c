"""`hrg update`: a calibration whose coefficients moved, brought up to date by a resonator found
later.

The tables hold the resonator's anisotropy, K_DC, K_DS (their first harmonic), its K (their
constant) and, beside them, the measured quadrature's −2δω(cos, sin) 2mθ_ω. A resonator identified
later, at one temperature x, gives the same five anew. What moved is
    δ = c(new) − c(then),
    c(then): the resonator of the calibration's time, else the tables' own coefficients at x
with the covariance of both. What moved (damping split, K, frequency split, each by its own χ²) is
put into every node, for nothing is known of how a change depends on temperature, and σ holds what
it would be elsewhere did it grow with the coefficients; what did not is combined with what the
tables know, by minimum variance, or stays where a reference says so.
Everything else of the tables (drive, higher harmonics, K over angle) stays, but for what its
covariance with these says.
"""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from ..errors import HrgError
from ..fitting.checks import CHANCE, check_at_most, list_failures
from ..fitting.least_squares import invert_information
from ..records import Calibration, Resonator
from ..units import DEGREE_PER_HOUR
from .calibration.moved_tables import GROUPS, TableState
from .calibration.programme import SINGLE_NODE_MARGIN_DEGC, SINGLE_NODE_MARGIN_HZ
from .calibration.resonators import NAMES, compute_coefficients, read_place

Array = np.ndarray
STOOD_STILL = 0.01
"""Chance with which a coefficient that stood still is taken for one that moved: what it costs is
the tables' knowledge of it, what a movement taken for none costs is a part of that movement."""
CLEARLY = 10.0
"""χ² of the reference against the tables, over that of the new resonator, from which the two may
have been exchanged."""
LEAST_TOLD = 1.0
"""Part of a coefficient's own size that the new resonator's standard deviation may have: beyond it,
it cannot tell a complete loss."""


def update(
    calibration: Calibration, resonator: Resonator, reference: Resonator | None = None
) -> Calibration:
    """The calibration with its anisotropy, K and measured quadrature moved to where the resonator
    has them now.

    D = K_DC cos 2mθ + K_DS sin 2mθ − 2rδω cos 2m(θ − θ_ω), K_DC = −νδμ sin 2mθ_μ, K_DS = νδμ cos
    2mθ_μ (seed A (8), (10)): these coefficients and K move by δ = c(new) − c(then) at every node.
    What the resonator does not hold (the working mode has no scale factor) stays as it was; the
    tables are refused where the windows cannot tell whether it moved.

    Parameters
    ----------
    calibration
        The tables, with the first harmonic of the wave angle.
    resonator
        The resonator as it is now, identified at one temperature within the tables' range.
    reference
        The resonator identified when the tables were made: with it only the *change* of the
        resonator is applied, so that what the drive adds to the tables stays in them.

    Returns
    -------
    Calibration
        D [rad/s] and K (nodes, angles) with their moved harmonics and covariance; details name each
        coefficient's move in σ.

    Raises
    ------
    HrgError
        Another gyro or mode number, a refused input, a resonator that holds nothing of the tables,
        outside the tables' range.

    Examples
    --------
    >>> import json
    >>> from hrg_cli import calibrate, collect, demodulate, estimate, identify, simulate
    >>> from hrg_cli.stages.update import update
    >>> def measure(mode, scale_factor):
    ...     config = {
    ...         "device": {"frequency_hz": 1000.0, "time_constant_s": 4.0,
    ...                    "damping_split": 0.02, "scale_factor": scale_factor},
    ...         "control": {"mode": mode},
    ...         "readout": {"noise": 1e-4},
    ...         "recording": {"sample_rate_hz": 8000.0, "duration_s": 6.0},
    ...         "run": [
    ...             {"run_id": "left", "environment": {"rate_rad_s": 2.0}},
    ...             {"run_id": "right", "environment": {"rate_rad_s": -2.0}},
    ...         ],
    ...     }
    ...     runs = (collect(simulate(config, model="slow", run=r)) for r in ("left", "right"))
    ...     return [collect(estimate(collect(demodulate(r, periods_per_window=20)))) for r in runs]
    >>> tables = calibrate(measure("forced", 0.550), harmonics=1, model="table")
    >>> moved = update(tables, identify(measure("free", 0.556)))
    >>> json.loads(moved.details)["update"]["changed"], float(moved.scale_factor.mean().round(3))
    (True, 0.556)
    """
    _guard(calibration, resonator, reference)
    x = _find_place(calibration, resonator)
    new, new_covariance = compute_coefficients(resonator, partly=True)
    state = TableState.from_calibration(calibration, x)
    then, then_covariance, told_by = _recall_coefficients(calibration, reference, state)
    known = np.isfinite(then) & np.isfinite(new)
    if not known.any():
        raise HrgError(
            f"the resonator file ({resonator.method}) holds none of what the tables do: neither"
            " splits with their axes nor a scale factor; identify it from windows at several angles"
        )
    change, spread = new - then, new_covariance + then_covariance
    moved = np.zeros(5, bool)
    for group in GROUPS.values():
        moved[group] = known[group].all() and _chance(change, spread, group) < STOOD_STILL
    chi2 = _chi2(change, spread, known)
    chance = _chance(change, spread, known)
    doubt = _cannot_tell(new_covariance, then, known)
    exchanged = _suspect_exchange(state, (new, new_covariance), reference, (then, then_covariance))
    held = known & state.held
    shifted = (
        state.combine(new, new_covariance, held, moved)
        if reference is None
        else state.shift(change, spread, moved & held)
    )
    way = state.doubt_the_way(change, moved & held)
    record = shifted.add_doubt(way).write_into(calibration)
    details = json.loads(record.details)
    details["update"] = {
        "moved": _rows(
            new, new_covariance, then, then_covariance, _judge_coefficients(held, moved, reference)
        ),
        "chi2": chi2,
        "p_value": chance,
        "changed": chance < CHANCE,
        "reference": told_by,
        "at": x,
    }
    of_tables = chance < CHANCE and reference is None and "resonator" not in told_by
    return (
        record.replace(details=json.dumps(details))
        .judged([*_say_kept(new), *_say_way(record, x, way)], "valid")
        .judged(doubt, "refused")
        .judged([*exchanged, *_remarks_on(resonator, of_tables)], "suspect")
    )


def _say_kept(new: Array) -> list[str]:
    """What of the tables stays, since the resonator's coefficients (5,) do not hold it."""
    kept = [name for name, group in GROUPS.items() if not np.isfinite(new[group]).all()]
    return [f"the resonator tells no {' and no '.join(kept)}: the tables' stays"] if kept else []


def _say_way(record: Calibration, x: float, way: Array) -> list[str]:
    """Where a movement found at one place is known least, and to what."""
    if not way.any():
        return []
    places, width = np.asarray(record.node, float), np.shape(record.drift_harmonics)[1]
    tables = way[: len(record.covariance)].reshape(len(places), -1, way.shape[1])
    drift, scale = (
        np.sqrt(np.sum(part**2, axis=(1, 2))) for part in (tables[:, :width], tables[:, width:])
    )
    far = int(np.argmax(drift / max(drift.max(), 1e-300) + scale / max(scale.max(), 1e-300)))
    unit = "°C" if record.axis == "temperature" else "Hz"
    moved = f"D {drift[far] / DEGREE_PER_HOUR:.2g} °/h and K {scale[far]:.2g} other"
    return [
        f"what moved is known at {x:.4g} {unit} alone and was put into every node: had it grown"
        f" with the coefficients, {moved} at {places[far]:.4g} {unit}, which σ holds; identify the"
        " resonator there too"
    ]


def _suspect_exchange(
    state: TableState,
    now: tuple[Array, Array],
    reference: Resonator | None,
    then: tuple[Array, Array],
) -> list[str]:
    """Whether the tables are those of the new resonator, and not of the reference of their time."""
    if reference is None:
        return []
    level, spread = state.find_level()
    far = []
    for coefficients, covariance in (now, then):
        known = np.isfinite(level) & np.isfinite(coefficients)
        if not known.any():
            return []
        apart = (coefficients - level, covariance + spread)
        far.append((_chi2(*apart, known), _chance(*apart, known), int(known.sum())))
    (new, _, count), (old, chance, _) = far
    if chance >= CHANCE or old < CLEARLY * max(new, count):
        return []
    return [
        f"the tables hold what the new resonator shows (χ² {new:.2g} of {count} coefficients) and"
        f" not what the reference does ({old:.2g}): the two may be exchanged; --reference is the"
        " resonator of the time when the tables were made"
    ]


def _remarks_on(resonator: Resonator, moved_from_tables: bool) -> list[str]:
    """What speaks against the moved tables: a resonator that is suspect itself, or a move told from
    the tables alone."""
    remarks = []
    if resonator.status == "suspect":
        remarks = [f"the resonator is suspect: {reason}" for reason in resonator.status_reasons]
    if moved_from_tables:
        remarks.append(
            "what moved was told from the tables themselves, which hold the drive's own errors too:"
            " those are taken for the resonator's; give the resonator of the tables' time with"
            " --reference"
        )
    return remarks


def summarise(record: Calibration) -> dict[str, Any]:
    """What an update moved, for the JSON.

    Parameters
    ----------
    record
        Made by `update`.

    Returns
    -------
    dict
        What moved, in standard deviations, with the model and the nodes of the tables.

    Examples
    --------
    >>> from types import SimpleNamespace
    >>> from hrg_cli.stages.update import summarise
    >>> details = '{"update": {"moved": {"drift": 1.5}}}'
    >>> summarise(SimpleNamespace(details=details, model="table", node=[20.0, 60.0]))
    {'moved': {'drift': 1.5}, 'model': 'table', 'nodes': [20.0, 60.0]}
    """
    return dict(json.loads(record.details)["update"]) | {
        "model": record.model,
        "nodes": [float(n) for n in record.node],
    }


def _guard(calibration: Calibration, resonator: Resonator, reference: Resonator | None) -> None:
    if calibration.status == "refused":
        raise HrgError(
            f"the calibration is refused ({'; '.join(calibration.status_reasons)}); there is"
            " nothing to bring up to date"
        )
    if calibration.drift_harmonics.shape[1] < 3:
        raise HrgError(
            "the calibration holds no harmonic of the wave angle (a table of dwells, or harmonics ="
            " 0); a resonator cannot update it"
        )
    for name, r in (("resonator", resonator), ("reference", reference)):
        if r is None:
            continue
        if r.status == "refused":
            raise HrgError(
                f"the {name} file is refused ({'; '.join(r.status_reasons)}); identify it from"
                " better windows"
            )
        if r.mode_number != calibration.mode_number:
            raise HrgError(
                f"the {name} file has mode_number {r.mode_number}, the tables have"
                f" {calibration.mode_number}"
            )
        if r.gyro_id and calibration.gyro_id and r.gyro_id != calibration.gyro_id:
            raise HrgError(
                f"the {name} file is of gyro {r.gyro_id}, the tables are of gyro"
                f" {calibration.gyro_id}; use one of {calibration.gyro_id}"
            )


def _find_place(calibration: Calibration, resonator: Resonator, which: str = "resonator") -> float:
    """The resonator's temperature or frequency, inside the tables' range."""
    x = read_place(resonator, calibration.axis)
    name, unit, margin = (
        ("temperature", "°C", SINGLE_NODE_MARGIN_DEGC)
        if calibration.axis == "temperature"
        else ("frequency", "Hz", SINGLE_NODE_MARGIN_HZ)
    )
    if not np.isfinite(x):
        if len(calibration.node) == 1:
            return float(calibration.node[0])
        raise HrgError(
            f"the {which} file says no {name}, the tables go over it; identify it again from"
            f" windows that log their {name}"
        )
    if np.isfinite([calibration.node_min, calibration.node_max]).all() and not (
        calibration.node_min - margin <= x <= calibration.node_max + margin
    ):
        raise HrgError(
            f"the {which} was identified at {x:.4g} {unit}, the tables hold from"
            f" {calibration.node_min:.4g} to {calibration.node_max:.4g} {unit}; use windows inside"
            " that range"
        )
    return float(x)


def _recall_coefficients(
    calibration: Calibration, reference: Resonator | None, state: TableState
) -> tuple[Array, Array, str]:
    """The five coefficients of the tables' time at the new resonator's place, their covariance, and
    what says so; NaN where nothing does."""
    if reference is not None:
        return _recall_from_reference(calibration, reference, state)
    by_resonator = calibration.model == "physical"
    return *state.find_level(), "the physical model's resonator" if by_resonator else "the tables"


def _recall_from_reference(
    calibration: Calibration, reference: Resonator, state: TableState
) -> tuple[Array, Array, str]:
    """Those of the reference, carried from its own place by what the tables say of the way."""
    then, covariance = compute_coefficients(reference)
    there = TableState.from_calibration(
        calibration, _find_place(calibration, reference, "reference")
    )
    change, spread = state.compute_travel(there)
    told_by = "the reference resonator"
    if change.any():
        told_by += ", carried to the new one's place by the tables"
    return then + change, covariance + spread, told_by


def _chi2(change: Array, spread: Array, places: Array | slice) -> float:
    """χ² of some of the changes (5,) at their covariance (5, 5). HrgError: it is singular there."""
    some, own = change[places], spread[places][:, places]
    inverse = invert_information(own)
    # a direction without an error would have no say in χ², as if nothing could move along it
    if round(float(np.trace(inverse @ own))) < len(some):
        raise HrgError(
            "resonator and tables state no error for a part of what they hold, so no change of it"
            " can be judged; identify the resonator from runs that measure it"
        )
    return float(some @ inverse @ some)


def _chance(change: Array, spread: Array, places: Array | slice) -> float:
    """Its probability where nothing moved."""
    from scipy.stats import chi2 as distribution

    return float(distribution.sf(_chi2(change, spread, places), len(change[places])))


def _judge_coefficients(held: Array, moved: Array, reference: Resonator | None) -> list[str]:
    """What becomes of each of the five coefficients of the tables."""
    stood = "combined" if reference is None else "kept"
    gone = "replaced" if reference is None else "shifted"
    return [(gone if m else stood) if k else "kept" for k, m in zip(held, moved, strict=True)]


def _rows(
    new: Array, new_covariance: Array, then: Array, then_covariance: Array, made: list[str]
) -> list[dict[str, Any]]:
    """One row a coefficient: before, now, the change, each with its standard deviation, the change
    in σ, and what became of the tables'."""
    rows = []
    for i, name in enumerate(NAMES):
        if not np.isfinite(new[i]):
            continue
        now_std, before_std = (
            float(np.sqrt(max(c[i, i], 0.0))) for c in (new_covariance, then_covariance)
        )
        std = float(np.hypot(now_std, before_std))
        change = float(new[i] - then[i])
        known = bool(np.isfinite(then[i]))
        rows.append(
            {
                "name": name,
                "before": float(then[i]) if known else None,
                "before_std": before_std if known else None,
                "now": float(new[i]),
                "now_std": now_std,
                "std": std,
                "moved_sigma": change / std if known and std > 0 else None,
                "tables": made[i],
            }
        )
    return rows


def _cannot_tell(covariance: Array, then: Array, known: Array) -> list[str]:
    """Sentences of what the new resonator's windows cannot tell: a standard deviation as large as
    what is to be updated."""
    sizes = {
        "the damping anisotropy K_DC, K_DS": [0, 1],
        "the scale factor K": [2],
        "the frequency anisotropy": [3, 4],
    }
    checks = []
    for name, places in sizes.items():
        if not known[places].all():
            continue
        std, size = (
            float(np.sqrt(np.trace(covariance[np.ix_(places, places)]))),
            float(np.linalg.norm(then[places])),
        )
        checks.append(
            check_at_most(
                name,
                std / size if size > 0 else np.inf,
                LEAST_TOLD,
                f"the new resonator knows {name} to {std:.2g} only, the calibration holds"
                f" {size:.2g}: these windows cannot tell whether it moved; use longer windows, or"
                " windows at other wave angles",
            )
        )
    return list_failures(checks)
