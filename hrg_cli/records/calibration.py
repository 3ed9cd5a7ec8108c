"""The correction tables: what `hrg calibrate` makes of waves on a turning table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from .. import fourier
from ..errors import HrgError
from .columns import JSON_OBJECT, ORDER, RISING, SCATTER, Array, Valid, attribute, column
from .record import Record


@dataclass(frozen=True, kw_only=True, repr=False)
class Calibration(Record):
    """Drift D(T, θ) and scale factor K(T, θ): m·dθ/dt = −K·Ω + D, as Fourier coefficients per
    temperature node and as tables.

    Harmonics are of 2mθ: value(θ) = h₀ + Σ_k h_{2k−1} cos(2mkθ) + h_{2k} sin(2mkθ). Nodes are
    temperatures (`axis` "temperature") or frequencies ("frequency").
    """

    kind: ClassVar[str] = "calibration"
    made_by: ClassVar[str] = "hrg calibrate"
    temperature_degc: Array | None = column(
        "degC", "temperature nodes", ("node",), optional=True, valid=RISING
    )
    frequency_hz: Array | None = column(
        "Hz",
        "frequency nodes, with `axis` frequency",
        ("node",),
        optional=True,
        valid=Valid(above=0, rising=True),
    )
    wave_angle_rad: Array = column(
        "rad", "wave angle nodes over one period π/m", ("angle",), valid=RISING
    )
    drift_rad_s: Array = column("rad s-1", "drift D", ("node", "angle"))
    drift_rad_s_std: Array = column(
        "rad s-1", "its standard deviation", ("node", "angle"), valid=SCATTER
    )
    scale_factor: Array = column("1", "scale factor K", ("node", "angle"))
    scale_factor_std: Array = column(
        "1", "its standard deviation", ("node", "angle"), valid=SCATTER
    )
    drift_harmonics: Array = column(
        "rad s-1", "constant, cos 2mθ, sin 2mθ, …", ("node", "harmonic")
    )
    drift_harmonics_std: Array = column(
        "rad s-1", "their standard deviations", ("node", "harmonic"), valid=SCATTER
    )
    scale_factor_harmonics: Array = column(
        "1", "constant, cos 2mθ, sin 2mθ, …", ("node", "harmonic_k")
    )
    scale_factor_harmonics_std: Array = column(
        "1", "their standard deviations", ("node", "harmonic_k"), valid=SCATTER
    )
    covariance: Array = column(
        "any",
        "covariance of all coefficients, node-major, drift then scale factor a node",
        ("coefficient", "coefficient_2"),
    )
    axis: str = attribute(
        '"temperature" or "frequency"',
        default="temperature",
        valid=Valid(one_of=("temperature", "frequency")),
    )
    model: str = attribute(
        "variant: table, parametric, quadrature, phase, combined, physical", default="table"
    )
    interpolation: str = attribute(
        "between nodes: linear, cubic, monotone",
        default="linear",
        valid=Valid(one_of=("linear", "cubic", "monotone")),
    )
    mode_number: int = attribute("angular mode number m", default=2, dtype="i8", valid=ORDER)
    gyro_id: str = attribute("the gyro", default="")
    lot_id: str = attribute("the lot", default="")
    node_min: float = attribute(
        "lowest node value the table may be used at", dtype="f8", valid=Valid(infinite=True)
    )
    node_max: float = attribute(
        "highest node value the table may be used at", dtype="f8", valid=Valid(infinite=True)
    )
    rate_min_rad_s: float = attribute("lowest rate calibrated", dtype="f8")
    rate_max_rad_s: float = attribute("highest rate calibrated", dtype="f8")

    correction: str = attribute(
        "sign and order of the correction",
        default="rate = (D - m*dtheta/dt) / K; subtract drift first, then divide",
    )
    details: str = attribute(
        "JSON: rms figures, ladder, cross-validation, stability, model coefficients",
        default="{}",
        valid=JSON_OBJECT,
    )

    @property
    def node(self) -> Array:
        """The nodes of the table's first axis."""
        nodes = self.temperature_degc if self.axis == "temperature" else self.frequency_hz
        assert nodes is not None
        return nodes

    def evaluate(self, node: Array | float, wave_angle_rad: Array | float) -> tuple[Array, Array]:
        """Drift and scale factor of the tables, m·dθ/dt = −K·Ω + D.

        Parameters
        ----------
        node
            Temperatures [°C], or frequencies [Hz] where `axis` is "frequency"; any shape.
        wave_angle_rad
            Wave angles; broadcast against the nodes.

        Returns
        -------
        tuple of ndarray
            (D [rad/s], K), each of the broadcast shape.

        Raises
        ------
        HrgError
            A node outside the range that the tables may be used in.
        """
        x, theta = np.broadcast_arrays(np.asarray(node, float), np.asarray(wave_angle_rad, float))
        low, high = (
            v if np.isfinite(v) else edge
            for v, edge in ((self.node_min, -np.inf), (self.node_max, np.inf))
        )
        if np.any((x < low) | (x > high)):
            raise HrgError(
                f"the tables are for {low:g} to {high:g}, {float(x.min()):g} to {float(x.max()):g}"
                " was asked for"
            )
        drift, scale = self.values_at(x.ravel(), theta.ravel())
        return drift.reshape(x.shape), scale.reshape(x.shape)

    def values_at(
        self, x: Array, wave_angle_rad: Array, travel_rad: Array | float = 0.0
    ) -> tuple[Array, Array]:
        """Drift and scale factor for rows of a run; no node is too far: beyond the first and the
        last one the curve goes straight on.

        Parameters
        ----------
        x
            Temperatures [°C] or frequencies [Hz] (n,), by `axis`.
        wave_angle_rad
            Wave angles (n,).
        travel_rad
            By how much the wave turns within a row, (n,) or one number: the mean along it is given.

        Returns
        -------
        tuple of ndarray
            (D [rad/s], K), (n,) each.
        """
        drift, scale = (
            fourier.evaluate(
                *(x, wave_angle_rad, self.node, np.asarray(coefficients)),
                *(self.mode_number, self.interpolation, travel_rad),
            )
            for coefficients in (self.drift_harmonics, self.scale_factor_harmonics)
        )
        return drift, scale
