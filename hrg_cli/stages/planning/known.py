"""What is known before the next runs: the resonator, and what its file or diagnosis says of its
parameters as information."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from ...effects.effect import Effect
from ...errors import HrgError
from ...fitting.envelopes.base_freedom import choose_scale_factor
from ...fitting.envelopes.coordinates import COUNT, from_mechanics, to_parameters
from ...fitting.envelopes.resonator_spread import compute_slope_covariance
from ...fitting.least_squares import invert_information
from ...physics.resonator import PARAMETERS, Mechanics
from ...records import Diagnosis, Resonator, Wave
from ...settings import parse_toml
from .information import InformationColumns

Array = np.ndarray


def make_mechanics(known: Resonator | Diagnosis) -> Mechanics:
    """The resonator's parameters. HrgError: neither frequency nor damping among them."""
    if isinstance(known, Diagnosis):
        given = {row["name"]: float(row["value"]) for row in known.told("values")}
        mode_number = _mode_number(known.extended_model)
    else:
        given = {name: value for name, (value, _, _) in known.parameters().items()}
        mode_number = known.mode_number
    values = {name: given[name] for name, _ in PARAMETERS if name in given}
    if "frequency_hz" not in values or "damping_rate_1_s" not in values:
        raise HrgError("the resonator holds neither frequency nor damping; identify it first")
    values.setdefault("scale_factor", choose_scale_factor(mode_number))
    return Mechanics(**values, mode_number=mode_number)


def _mode_number(extended_model: str) -> int:
    """The angular mode number of a written model. HrgError: it holds none."""
    device = parse_toml(extended_model).get("device", {"mode_number": 2})
    found = device.get("mode_number", 2) if isinstance(device, dict) else None
    if not isinstance(found, int) or not 1 <= found <= 1000:
        raise HrgError("the extended model it keeps is damaged (mode_number); diagnose again")
    return found


def make_device_table(m: Mechanics) -> dict[str, Any]:
    """[device] of the simulation file."""
    damping = max(m.damping_rate_1_s, 0.0)
    return {name: float(getattr(m, name)) for name, _ in PARAMETERS} | {
        "damping_rate_1_s": damping,
        "damping_split_1_s": float(np.clip(m.damping_split_1_s, -damping, damping)),
        "mode_number": m.mode_number,
    }


def find_reference_temperatures(
    waves: Sequence[Wave], effects: Sequence[Effect]
) -> dict[str, dict[str, float]]:
    """Temperature from which the effects count: the mean of all runs."""
    warm = [
        float(np.nanmean(w.temperature_degc))
        for w in waves
        if w.temperature_degc is not None and np.isfinite(w.temperature_degc).any()
    ]
    middle = float(np.mean(warm)) if warm else 25.0
    return {
        e.name: {"reference_temperature_degc": middle}
        for e in effects
        if "reference_temperature_degc" in e.values()
    }


def make_weak_prior(m: Mechanics, layout: InformationColumns) -> Array:
    """Weak information that keeps what nothing measures finite: ten times the damping, thirty times
    the split, K within 3."""
    damping = max(abs(m.damping_rate_1_s), 1e-9)
    split = max(abs(m.frequency_split_rad_s), damping)
    std = np.array([10 * damping, 10 * damping, 10 * damping, 30 * split, 30 * split, 3.0, 1.0])
    M = np.zeros((layout.size, layout.size))
    M[:COUNT, :COUNT] = np.diag(1 / std**2)
    return M


def read_information(
    known: Resonator | Diagnosis, m: Mechanics, layout: InformationColumns
) -> Array:
    """The resonator's own covariance as information on the coordinates; a diagnosis without its
    waves brings its stds."""
    M = np.zeros((layout.size, layout.size))
    _, slopes = to_parameters(from_mechanics(m), m.mode_number)
    order = [name for name, _ in PARAMETERS][1:]
    if isinstance(known, Resonator):
        there = [
            k
            for k, name in enumerate(known.name)
            if str(name) in order and known.std[k] > 0 and np.isfinite(known.std[k])
        ]
        rows, covariance = (
            [order.index(str(known.name[k])) for k in there],
            compute_slope_covariance(known)[np.ix_(there, there)],
        )
    else:
        stds = {row["name"]: float(row["std"]) for row in known.told("values")}
        rows = [k for k, name in enumerate(order) if 0 < stds.get(name, 0.0) < np.inf]
        covariance = np.diag([stds[order[k]] ** 2 for k in rows])
    if rows:
        J = slopes[rows]
        M[:COUNT, :COUNT] = J.T @ invert_information(covariance) @ J
    return M
