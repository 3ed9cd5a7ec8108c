"""Coefficients of the drift from resonator files: K_DC, K_DS, K, and of the measured quadrature,
over temperature or frequency.

D = K_DC cos 2mθ + K_DS sin 2mθ − 2rδω cos 2m(θ − θ_ω), K_DC = −νδμ sin 2mθ_μ, K_DS = νδμ cos 2mθ_μ   (seed A (8), (10))
Components, not sizes and axes, are interpolated: an axis turns round, a size has no sign.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import HrgError
from ...fitting.checks import Check, goodness
from ...fitting.envelopes.resonator_spread import slope_covariance
from ...fitting.tables.table_layout import TableLayout
from ...fourier import node_weights
from ...records import Resonator
from .programme import SINGLE_NODE_MARGIN_DEGC, SINGLE_NODE_MARGIN_HZ

Array = np.ndarray
NAMES = ("K_DC_rad_s", "K_DS_rad_s", "K", "quadrature_cos_rad_s", "quadrature_sin_rad_s")
"""Order of a resonator's coefficients; the last two are −2δω(cos 2mθ_ω, sin 2mθ_ω)."""
DAMPING = ("damping_split_1_s", "damping_axis_rad")
STIFFNESS = ("frequency_split_rad_s", "stiffness_axis_rad")
NEEDED = (*DAMPING, *STIFFNESS, "scale_factor")


def coefficients_of(resonator: Resonator, partly: bool = False) -> tuple[Array, Array]:
    """The five coefficients of `NAMES` and their covariance (5, 5), by the Jacobian of the
    resonator's parameters.

    partly: what the resonator does not hold is NaN, with zeros in the covariance; else an error.
    HrgError: a parameter is missing, or its standard deviation is not finite.
    """
    names = [str(n) for n in resonator.name]
    for name in () if partly else NEEDED:
        if name not in names:
            raise HrgError(
                f"the resonator file of gyro {resonator.gyro_id or '?'} has no {name} (it was not"
                " determined); identify free runs at both signs of rotation"
            )
    covariance = slope_covariance(resonator)
    if not np.isfinite(covariance).all():
        raise HrgError(
            "the resonator file's covariance is not finite: its runs do not tell all parameters;"
            " add free runs at other angles"
        )
    two_m = 2 * resonator.mode_number
    value, slope = np.full(5, np.nan), np.zeros((5, len(names)))
    if set(DAMPING) <= set(names):
        split, axis = (resonator.get(name) for name in DAMPING)
        # K_DC = −νδμ sin 2mθ_μ, K_DS = νδμ cos 2mθ_μ and their Jacobian
        sin, cos = np.sin(two_m * axis), np.cos(two_m * axis)
        value[:2] = -split * sin, split * cos
        slope[:2, names.index(DAMPING[0])] = -sin, cos
        slope[:2, names.index(DAMPING[1])] = -two_m * split * cos, -two_m * split * sin
    if "scale_factor" in names:
        value[2] = resonator.get("scale_factor")
        slope[2, names.index("scale_factor")] = 1.0
    if set(STIFFNESS) <= set(names):
        split, axis = (resonator.get(name) for name in STIFFNESS)
        sin, cos = np.sin(two_m * axis), np.cos(two_m * axis)
        value[3:] = -2 * split * cos, -2 * split * sin
        slope[3:, names.index(STIFFNESS[0])] = -2 * cos, -2 * sin
        slope[3:, names.index(STIFFNESS[1])] = 2 * two_m * split * sin, -2 * two_m * split * cos
    return value, slope @ covariance @ slope.T


@dataclass(frozen=True)
class ResonatorCoefficients:
    """Coefficients (R, 5) of `NAMES` at R values of the nodes' quantity, ascending, their
    covariances (R, 5, 5), and checks."""

    place: Array
    value: Array
    covariance: Array
    axis: str
    interpolation: str
    checks: tuple[Check, ...] = ()

    def at_nodes(self, layout: TableLayout) -> tuple[Array, Array]:
        """Coefficients at the layout's nodes (J·5,) and their covariance (J·5, J·5)."""
        return self.at(layout.nodes)

    def at(self, x: Array) -> tuple[Array, Array]:
        """Coefficients interpolated to x (J·5,), and their covariance."""
        # linear in the measured coefficients, so the covariance follows by the same weights
        weights = node_weights(np.asarray(x, float), self.place, self.interpolation)
        spread = np.kron(weights, np.eye(5))
        whole = np.zeros((5 * len(self.place), 5 * len(self.place)))
        for k, block in enumerate(self.covariance):
            whole[5 * k : 5 * k + 5, 5 * k : 5 * k + 5] = block
        return spread @ self.value.ravel(), spread @ whole @ spread.T

    def spread(self, layout: TableLayout) -> Array:
        """Map (size, J·5) from the coefficients at the nodes to the layout's."""
        out = np.zeros((layout.size, 5 * len(layout.nodes)))
        for j in range(len(layout.nodes)):
            places = [layout.drift(j).start + 1, layout.drift(j).start + 2, layout.scale(j).start]
            for h, place in enumerate(places):
                out[place, 5 * j + h] = 1.0
            for h in (0, 1):
                if "quadrature_course" in layout.factors:
                    out[layout.factor("quadrature_course").start + 2 * j + h, 5 * j + 3 + h] = 1.0
                if "ellipticity_course" in layout.factors:
                    out[layout.factor("ellipticity_course").start + 2 * j + h, 5 * j + h] = 1.0
        return out

    def table(self) -> list[dict[str, Any]]:
        """One row a resonator: where it was identified, each coefficient and its standard
        deviation, their covariance."""
        key = "temperature_degc" if self.axis == "temperature" else "frequency_hz"
        rows = []
        for x, value, covariance in zip(self.place, self.value, self.covariance):
            row: dict[str, Any] = {key: float(x) if np.isfinite(x) else None}
            for i, name in enumerate(NAMES):
                row[name], row[f"{name}_std"] = (
                    float(value[i]),
                    float(np.sqrt(max(covariance[i, i], 0.0))),
                )
            rows.append(row | {"covariance": covariance.tolist()})
        return rows


def _need_usable(resonator: Resonator, widest_degc: float) -> None:
    """HrgError: a resonator that is refused, or whose runs span more than its coefficients hold for."""
    if resonator.status == "refused":
        raise HrgError(
            f"a resonator file is refused ({'; '.join(resonator.status_reasons)}); identify it from"
            " better runs"
        )
    span = resonator.temperature_span_degc
    if span is not None and span > widest_degc:
        raise HrgError(
            f"a resonator file was identified from runs that span {span:.3g} °C, of one temperature"
            " were expected; identify each temperature by itself and give each file with"
            " --resonator"
        )


def pool_resonators(
    resonators: Sequence[Resonator],
    axis: str,
    nodes: Array,
    low: float,
    high: float,
    interpolation: str,
) -> ResonatorCoefficients:
    """The resonators' coefficients over temperature or frequency, those of one place pooled.

    low, high: the range the runs to be described take. HrgError: a resonator without its
    temperature where it matters, a range that the resonators do not span, a refused resonator.
    """
    margin, name, unit = (
        (SINGLE_NODE_MARGIN_DEGC, "temperature", "°C")
        if axis == "temperature"
        else (SINGLE_NODE_MARGIN_HZ, "frequency", "Hz")
    )
    for r in resonators:
        _need_usable(r, 2 * margin if axis == "temperature" else np.inf)
    places = np.array([place_of(r, axis) for r in resonators])
    found = [coefficients_of(r) for r in resonators]
    wide = np.isfinite([low, high]).all() and len(nodes) > 1
    # a file that names no temperature serves a programme of one temperature, and only alone
    if not np.isfinite(places).all():
        if wide or len(resonators) > 1:
            raise HrgError(
                f"a resonator file says no {name} and the runs go from {low:.4g} to {high:.4g}"
                f" {unit}; identify it again from runs that log their {name}, one resonator file a"
                f" {name}"
            )
        places = np.full(1, nodes[0])
    groups = _groups(places, margin)
    if np.isfinite([low, high]).all() and np.isfinite(places).all():
        lowest, highest = float(places.min()), float(places.max())
        if low < lowest - margin or high > highest + margin:
            raise HrgError(
                f"the resonators are of {lowest:.4g} to {highest:.4g} {unit}, the runs go from"
                f" {low:.4g} to {high:.4g} {unit}; add by --resonator those of free runs at the"
                f" outer {name}s"
            )
    pooled = [
        _pool([found[i] for i in group], f"{np.mean(places[group]):.4g} {unit}") for group in groups
    ]
    return ResonatorCoefficients(
        np.array([np.mean(places[group]) for group in groups]),
        np.array([value for value, _, _ in pooled]),
        np.array([covariance for _, covariance, _ in pooled]),
        axis,
        "linear" if interpolation in ("linear", "monotone") else "cubic",
        tuple(check for _, _, check in pooled if check is not None),
    )


def place_of(resonator: Resonator, axis: str) -> float:
    """Temperature or frequency a resonator was identified at; NaN where its file does not say."""
    if axis == "temperature":
        return (
            float("nan")
            if resonator.temperature_degc is None
            else float(resonator.temperature_degc)
        )
    names = [str(n) for n in resonator.name]
    return resonator.get("frequency_hz") if "frequency_hz" in names else float("nan")


def _groups(places: Array, margin: float) -> list[Array]:
    """Indices of the resonators of each place, ascending."""
    order = np.argsort(places)
    cut = np.flatnonzero(np.diff(places[order]) > margin) + 1
    return list(np.split(order, cut))


def _pool(found: Sequence[tuple[Array, Array]], at: str) -> tuple[Array, Array, Check | None]:
    """Generalised mean of coefficients of one place, its covariance, and the check that they
    agree."""
    if len(found) == 1:
        return (*found[0], None)
    weights = [np.linalg.pinv(covariance, hermitian=True) for _, covariance in found]
    total = np.linalg.pinv(np.sum(weights, axis=0), hermitian=True)
    mean = total @ np.sum([w @ v for w, (v, _) in zip(weights, found)], axis=0)
    excess = float(sum((v - mean) @ w @ (v - mean) for w, (v, _) in zip(weights, found)))
    sentence = (
        f"the resonator files at {at} contradict each other beyond their errors; leave one out, or"
        " identify all their runs together"
    )
    return mean, total, goodness(excess, 5 * (len(found) - 1), sentence, "resonators_agree")
