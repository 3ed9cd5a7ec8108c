"""Coefficients of the drift from resonator files: K_DC, K_DS, K, and of the measured quadrature,
over temperature or frequency.

D = K_DC cos 2mθ + K_DS sin 2mθ − 2rδω cos 2m(θ − θ_ω),
K_DC = −νδμ sin 2mθ_μ, K_DS = νδμ cos 2mθ_μ   (seed A (8), (10)).
Components, not sizes and axes, are interpolated: an axis turns round, a size has no sign.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...errors import HrgError
from ...fitting.checks import Check, check_goodness
from ...fitting.envelopes.resonator_spread import compute_slope_covariance
from ...fitting.least_squares import invert_information
from ...fitting.tables.table_layout import TableLayout
from ...fourier import compute_node_weights
from ...records import Resonator
from .programme import SINGLE_NODE_MARGIN_DEGC, SINGLE_NODE_MARGIN_HZ

Array = np.ndarray
NAMES = ("K_DC_rad_s", "K_DS_rad_s", "K", "quadrature_cos_rad_s", "quadrature_sin_rad_s")
"""Order of a resonator's coefficients; the last two are −2δω(cos 2mθ_ω, sin 2mθ_ω)."""
DAMPING = ("damping_split_1_s", "damping_axis_rad")
STIFFNESS = ("frequency_split_rad_s", "stiffness_axis_rad")
NEEDED = (*DAMPING, *STIFFNESS, "scale_factor")
ROUNDING = 1e-12
"""Part of the largest variance below which a direction has none: it is held."""


def list_held(resonator: Resonator) -> set[str]:
    """Parameters that a resonator's file holds and its runs did not measure: given to `hrg
    identify`, they have no standard deviation.

    Parameters
    ----------
    resonator
        The file's record.

    Returns
    -------
    set of str
        Names among `NEEDED`.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Resonator
    >>> from hrg_cli.stages.calibration.resonators import list_held
    >>> given = dict(name=np.array(["scale_factor"]), units=np.array(["1"]), value=np.array([0.55]))
    >>> list_held(Resonator(std=np.zeros(1), covariance=np.zeros((1, 1)), **given))
    {'scale_factor'}
    """
    return {
        name for name, (_, std, _) in resonator.parameters().items() if name in NEEDED and std == 0
    }


def compute_coefficients(resonator: Resonator, partly: bool = False) -> tuple[Array, Array]:
    """The five coefficients of `NAMES` and their covariance, by the Jacobian of the resonator's
    parameters.

    K_DC = −νδμ sin 2mθ_μ, K_DS = νδμ cos 2mθ_μ (seed A (8), (10)), K, −2δω(cos, sin) 2mθ_ω.

    Parameters
    ----------
    resonator
        The file's record.
    partly
        What the resonator did not measure is NaN, with zeros in the covariance: what it lacks is no
        error, and what it holds is no knowledge.

    Returns
    -------
    tuple of ndarray
        (5,) and (5, 5); what is held has no variance.

    Raises
    ------
    HrgError
        A parameter is missing, or its standard deviation is not finite.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Resonator
    >>> from hrg_cli.stages.calibration.resonators import compute_coefficients
    >>> k = dict(name=np.array(["scale_factor"]), units=np.array(["1"]), value=np.array([0.55]))
    >>> found = Resonator(std=np.array([1e-3]), covariance=np.array([[1e-6]]), **k)
    >>> value, covariance = compute_coefficients(found, partly=True)
    >>> float(value[2]), float(covariance[2, 2]), bool(np.isnan(value[0]))
    (0.55, 1e-06, True)
    """
    names = [str(n) for n in resonator.name]
    told = set(names) - list_held(resonator) if partly else set(names)
    for name in () if partly else NEEDED:
        if name not in names:
            raise HrgError(
                f"the resonator file of gyro {resonator.gyro_id or '?'} has no {name} (it was not"
                " determined); identify free runs at both signs of rotation"
            )
    covariance = compute_slope_covariance(resonator)
    if not np.isfinite(covariance).all():
        raise HrgError(
            "the resonator file's covariance is not finite: its runs do not tell all parameters;"
            " add free runs at other angles"
        )
    two_m = 2 * resonator.mode_number
    value, slope = np.full(5, np.nan), np.zeros((5, len(names)))
    if set(DAMPING) <= told:
        split, axis = (resonator.get(name) for name in DAMPING)
        # K_DC = −νδμ sin 2mθ_μ, K_DS = νδμ cos 2mθ_μ and their Jacobian
        sin, cos = np.sin(two_m * axis), np.cos(two_m * axis)
        value[:2] = -split * sin, split * cos
        slope[:2, names.index(DAMPING[0])] = -sin, cos
        slope[:2, names.index(DAMPING[1])] = -two_m * split * cos, -two_m * split * sin
    if "scale_factor" in told:
        value[2] = resonator.get("scale_factor")
        slope[2, names.index("scale_factor")] = 1.0
    if set(STIFFNESS) <= told:
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

    def interpolate_at_nodes(self, layout: TableLayout) -> tuple[Array, Array]:
        """Coefficients at the layout's nodes (J·5,) and their covariance (J·5, J·5)."""
        return self.interpolate(layout.nodes)

    def interpolate(self, x: Array) -> tuple[Array, Array]:
        """Coefficients interpolated to x (J·5,), and their covariance."""
        # linear in the measured coefficients, so the covariance follows by the same weights
        weights = compute_node_weights(np.asarray(x, float), self.place, self.interpolation)
        spread = np.kron(weights, np.eye(5))
        whole = np.zeros((5 * len(self.place), 5 * len(self.place)))
        for k, block in enumerate(self.covariance):
            whole[5 * k : 5 * k + 5, 5 * k : 5 * k + 5] = block
        return spread @ self.value.ravel(), spread @ whole @ spread.T

    def build_node_map(self, layout: TableLayout) -> Array:
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

    def list_rows(self) -> list[dict[str, Any]]:
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
    """HrgError: a resonator that is refused, or whose runs span more than its coefficients hold
    for."""
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

    Parameters
    ----------
    resonators
        One file's record each, at least one.
    axis
        "temperature" or "frequency".
    nodes
        Nodes of the tables, (j,).
    low, high
        The range that the runs to be described take, in the nodes' unit.
    interpolation
        Between places, as the tables': "linear", "monotone" or a smooth one.

    Returns
    -------
    ResonatorCoefficients
        At the places, with the checks that files of one place agree.

    Raises
    ------
    HrgError
        A refused resonator, one without its temperature where it matters, runs of a wide range in
        one file, a range that the resonators do not span, a parameter held at one place and
        measured at another.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Resonator
    >>> from hrg_cli.physics.resonator import PARAMETERS
    >>> from hrg_cli.stages.calibration.resonators import pool_resonators
    >>> names, units = zip(*PARAMETERS)
    >>> value, std = np.array([1e3, 0.2, 0.01, 0.0, 0.02, 0.1, 0.55]), np.full(7, 1e-3)
    >>> known = dict(
    ...     name=np.array(names), units=np.array(units), std=std, covariance=np.diag(std**2)
    ... )
    >>> file = Resonator(value=value, temperature_degc=20.0, **known)
    >>> pooled = pool_resonators([file] * 4, "temperature", np.array([20.0]), 20.0, 20.0, "linear")
    >>> round(float(pooled.value[0, 2]), 6), round(float(pooled.covariance[0, 2, 2] ** 0.5), 6)
    (0.55, 0.0005)
    """
    margin, name, unit = (
        (SINGLE_NODE_MARGIN_DEGC, "temperature", "°C")
        if axis == "temperature"
        else (SINGLE_NODE_MARGIN_HZ, "frequency", "Hz")
    )
    for r in resonators:
        _need_usable(r, 2 * margin if axis == "temperature" else np.inf)
    places = np.array([read_place(r, axis) for r in resonators])
    found = [compute_coefficients(r) for r in resonators]
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
    _need_measured_alike([[resonators[i] for i in group] for group in groups], f"another {name}")
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


def read_place(resonator: Resonator, axis: str) -> float:
    """Temperature or frequency a resonator was identified at.

    Parameters
    ----------
    resonator
        The file's record.
    axis
        "temperature" or "frequency".

    Returns
    -------
    float
        °C or Hz; NaN where its file does not say.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli import Resonator
    >>> from hrg_cli.stages.calibration.resonators import read_place
    >>> k = dict(name=np.array(["scale_factor"]), units=np.array(["1"]), value=np.array([0.55]))
    >>> made = Resonator(std=np.zeros(1), covariance=np.zeros((1, 1)), temperature_degc=20.0, **k)
    >>> read_place(made, "temperature"), read_place(made, "frequency")
    (20.0, nan)
    """
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


def _need_measured_alike(groups: Sequence[Sequence[Resonator]], elsewhere: str) -> None:
    """HrgError: a parameter was measured at one place and only held at another, where it would
    stand beside the measured one as if it were known without error; or files of one place hold it
    at different values."""
    for name in NEEDED:
        held = [all(name in list_held(one) for one in group) for group in groups]
        if any(held) and not all(held):
            raise HrgError(
                f"a resonator file holds {name} at a value that was given, and one of {elsewhere}"
                " measured it; identify it there from runs that show it, or leave that file out"
            )
        for group in groups:
            given = {one.get(name) for one in group} if all(held) else set()
            if len(given) > 1:
                raise HrgError(
                    f"resonator files of one place hold {name} at {min(given):.6g} and"
                    f" {max(given):.6g}; identify them with one value"
                )


def _pool(found: Sequence[tuple[Array, Array]], at: str) -> tuple[Array, Array, Check | None]:
    """Generalised mean of coefficients of one place, its covariance, and the check that they
    agree.

    A direction without variance is held, no measurement: it has no weight beside one that is
    measured, and keeps its value where it is held in every file.
    """
    if len(found) == 1:
        return (*found[0], None)
    values = [value for value, _ in found]
    weights = [_invert(covariance) for _, covariance in found]
    together = np.sum(weights, axis=0)
    total = _invert(together)
    first = np.mean(values, axis=0)
    mean = first + total @ np.sum([w @ (v - first) for w, v in zip(weights, values)], axis=0)
    excess = float(sum((v - mean) @ w @ (v - mean) for w, v in zip(weights, values)))
    freedom = sum(_rank(covariance) for _, covariance in found) - _rank(together)
    sentence = (
        f"the resonator files at {at} contradict each other beyond their errors; leave one out, or"
        " identify all their runs together"
    )
    if freedom == 0:
        return mean, total, None
    return mean, total, check_goodness(excess, freedom, sentence, "resonators_agree")


def _rank(matrix: Array) -> int:
    """Directions (k, k) that are measured: the trace of the projector on them."""
    return round(float(np.trace(_invert(matrix) @ matrix)))


def _invert(matrix: Array) -> Array:
    """The pseudo-inverse (5, 5) of a covariance or an information, its rank judged with the two
    anisotropies and K in units of their own.

    Both components of an anisotropy have one unit: an axis that is held leaves one direction of
    them, which units of their own would turn.
    """
    units = np.ones(5)
    for places in ([0, 1], [2], [3, 4]):
        units[places] = np.sqrt(max(float(np.diag(matrix)[places].sum()), 0.0)) or 1.0
    return invert_information(matrix, ROUNDING, units)
