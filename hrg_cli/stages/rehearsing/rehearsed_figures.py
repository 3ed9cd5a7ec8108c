"""What one rehearsal found of every figure that has an error, beside what was put in:
t = (estimate − truth)/σ.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...fitting.envelopes.coordinates import SPLITS
from ...fourier import interpolate_coefficients
from ...records import Calibration, Diagnosis, Record, Resonator
from .twin import Twin
from .twin_diagnosis import find_sign, list_base_values, list_causes, list_held_causes

CLEAR = 4.0
"""Standard deviations from which a split's size is Gaussian, and its axis; below, its components
are judged instead, for a size lost in noise is Rice's and never comes out as small as it is."""


@dataclass(frozen=True)
class RehearsedFigure:
    """What one rehearsal found of one figure, and what was put in."""

    value: float
    std: float
    truth: float
    period: float = 0.0
    doubted: bool = False
    """Whether its σ holds, beside what repeats scatter by, what the data could not have shown."""
    stated: float = 0.0
    """The σ that the file itself states of it; 0 where it states none of the very same figure."""

    def compute_t(self) -> float:
        """(estimate − truth)/σ, an angle modulo its period."""
        error = self.value - self.truth
        if self.period:
            error = float(np.mod(error + self.period / 2, self.period) - self.period / 2)
        return error / self.std


@dataclass(frozen=True)
class Rehearsed:
    """One rehearsal: its figures, its status, or the sentence why it failed; of a diagnosis, the
    causes that were named."""

    figures: Mapping[str, RehearsedFigure] = field(default_factory=dict)
    status: str = "failed"
    reason: str = ""
    named: tuple[str, ...] = ()


def compare_figures(record: Record, twin: Twin) -> dict[str, RehearsedFigure]:
    """Every figure of a rehearsal's result that has an error, beside the truth.

    Parameters
    ----------
    record
        What the rehearsal gave.
    twin
        Whose truth it is held against.

    Returns
    -------
    dict
        Figure -> value, σ and truth in the figure's own unit. Of a split lost in noise its
        components stand for size and axis; of tables, each coefficient at each of the rehearsal's
        nodes.

    Examples
    --------
    >>> from types import SimpleNamespace as Told
    >>> import numpy as np
    >>> from hrg_cli import Resonator
    >>> from hrg_cli.stages.rehearsing.rehearsed_figures import compare_figures
    >>> known = dict(name=np.array(["scale_factor"]), units=np.array(["1"]), std=np.array([1e-3]))
    >>> known |= dict(covariance=np.array([[1e-6]]), details="{}")
    >>> truth, found = (Resonator(value=np.array([K]), **known) for K in (0.55, 0.552))
    >>> round(compare_figures(found, Told(truth=truth))["scale_factor"].compute_t(), 6)
    2.0
    """
    truth = twin.truth
    if isinstance(record, Diagnosis) and isinstance(truth, Diagnosis):
        return _compare_sizes(record, truth, twin)
    if isinstance(record, Resonator) and isinstance(truth, Resonator):
        return _compare_parameters(record, truth)
    assert isinstance(record, Calibration) and isinstance(truth, Calibration)
    return _compare_coefficients(record, truth, twin.settings)


def _compare_parameters(record: Resonator, truth: Resonator) -> dict[str, RehearsedFigure]:
    true, period = truth.parameters(), np.pi / truth.mode_number
    # what a read-out may add to them no twin has
    sums = json.loads(truth.details).get("sum_with", {})
    found = {
        name: RehearsedFigure(
            value,
            std,
            true[name][0],
            period if name.endswith("axis_rad") else 0.0,
            doubted=name in sums,
            stated=true[name][1],
        )
        for name, (value, std, _) in record.parameters().items()
        if name in true and np.isfinite(std) and std > 0
    }
    for size, axis, components in SPLITS:
        if size in true and axis in true and not true[size][0] >= CLEAR * true[size][1]:
            found.pop(size, None)
            found.pop(axis, None)
            vector = true[size][0] * np.exp(2j * truth.mode_number * true[axis][0])
            seen, own = (json.loads(r.details).get("split_components", {}) for r in (record, truth))
            found |= {
                name: RehearsedFigure(
                    seen[name]["value"],
                    seen[name]["std"],
                    put_in,
                    doubted=size in sums,
                    stated=own.get(name, {}).get("std", 0.0),
                )
                for name, put_in in zip(components, (vector.real, vector.imag), strict=True)
                if name in seen and seen[name]["std"] > 0
            }
    rate, true_rate = (json.loads(r.details).get("rate_rad_s") for r in (record, truth))
    if rate and true_rate and rate["std"] > 0:
        found["rate_rad_s"] = RehearsedFigure(
            rate["value"], rate["std"], true_rate["value"], stated=true_rate["std"]
        )
    return found


def _compare_sizes(record: Diagnosis, truth: Diagnosis, twin: Twin) -> dict[str, RehearsedFigure]:
    """The named causes' parameters, and the resonator beside them."""
    found: dict[str, RehearsedFigure] = {}
    named = list_causes(record)
    for name, (true, _) in list_held_causes(twin).items():
        seen = named[name][0] if name in named else {}
        sign = find_sign(name, seen, true)
        for key, (value, std) in seen.items():
            if key in true:
                put_in, stated = true[key]
                found[f"{name} {key}"] = RehearsedFigure(sign * value, std, put_in, stated=stated)
    period = np.pi / int(truth.read_report().get("mode_number", 2))
    beside = list_base_values(truth)
    lost = {
        name
        for size, axis, _ in SPLITS
        if size in beside and not beside[size][0] >= CLEAR * beside[size][1]
        for name in (size, axis)
    }
    sums = {row["name"] for row in truth.told("values") if row.get("sum_with")}
    for name, (value, std) in list_base_values(record).items():
        if name in beside and name not in lost and np.isfinite(std) and std > 0:
            axis = period if name.endswith("axis_rad") else 0.0
            put_in, stated = beside[name]
            found[name] = RehearsedFigure(value, std, put_in, axis, name in sums, stated)
    return found


def _compare_coefficients(
    record: Calibration, truth: Calibration, settings: Mapping[str, Any]
) -> dict[str, RehearsedFigure]:
    """Fourier coefficients of both tables at the rehearsal's nodes; the truth's tables are read
    there.

    A harmonic that is not seen, of a table whose band limit was left open, is averaged over how
    large it may be: its σ says that, and its estimate hardly moves.
    """
    found = {}
    same_nodes = len(record.node) == len(truth.node)
    for kind, limit in (
        ("drift_harmonics", "harmonics"),
        ("scale_factor_harmonics", "scale_factor_harmonics"),
    ):
        values, std = np.asarray(getattr(record, kind)), np.asarray(getattr(record, f"{kind}_std"))
        true, known = (
            interpolate_coefficients(
                np.asarray(record.node, float),
                np.asarray(truth.node, float),
                np.asarray(getattr(truth, name)),
                truth.interpolation,
            )
            for name in (kind, f"{kind}_std")
        )
        for node, x in enumerate(record.node):
            for k in range(min(values.shape[1], true.shape[1])):
                if np.isfinite(std[node, k]) and std[node, k] > 0:
                    name = f"{kind.removesuffix('_harmonics')} {_name_harmonic(k)} at {x:.4g} °C"
                    # what the file does not see a rehearsal may hold absent for sure, and neither
                    # says more of it than the file
                    told = max(float(std[node, k]), abs(float(known[node, k])))
                    unseen = k > 0 and abs(true[node, k]) < CLEAR * told
                    doubted = bool(unseen and settings.get(limit) is None)
                    found[name] = RehearsedFigure(
                        float(values[node, k]),
                        told if unseen else float(std[node, k]),
                        float(true[node, k]),
                        doubted=doubted,
                        stated=float(known[node, k]) if same_nodes and not unseen else 0.0,
                    )
    return found


def _name_harmonic(k: int) -> str:
    return "constant" if k == 0 else f"{'cos' if k % 2 else 'sin'} {(k + 1) // 2}·2mθ"
