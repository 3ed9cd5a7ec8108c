"""Tables brought up to date by coefficients that were found later: one state of everything the
tables hold, moved by minimum variance.

The state is all drift and scale-factor harmonics of all nodes, then the measured quadrature's two
coefficients of all nodes. H x = Σ_j w_j c_j are the five coefficients at the resonator's place, E
adds a change of them to every node. A group of coefficients that stood still is measured once more:
the state has its covariance P, and the better known of the two weighs more. One that moved by an
unknown amount has P + E Q Eᵀ with Q beyond all measure: the new coefficients replace what the
tables knew of their level, the differences between nodes stay.
"""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np

from ...fourier import build_harmonic_basis, compute_node_weights
from ...records import Calibration
from .record import compute_table_std

Array = np.ndarray
GROUPS = {
    "damping split": slice(0, 2),
    "scale factor": slice(2, 3),
    "frequency split": slice(3, 5),
}
"""Places in the five coefficients of what moves together."""
UNKNOWN = 1e8
"""Variance of a movement of which nothing is known, over that with which it was measured."""


@dataclass(frozen=True)
class TableState:
    """Everything the tables hold (n,), its covariance (n, n), H (5, n) and E (n, 5); the rows of
    coefficients that the tables do not hold are zero in both."""

    value: Array
    covariance: Array
    at_place: Array
    everywhere: Array
    held: Array
    """(5,) whether the tables hold the coefficient."""

    @classmethod
    def from_calibration(cls, calibration: Calibration, x: float) -> TableState:
        """The state of a calibration's tables, looked at from x of their axis."""
        nodes = np.asarray(calibration.node, float)
        kind = "linear" if calibration.interpolation in ("linear", "monotone") else "cubic"
        weights = compute_node_weights(np.array([x]), nodes, kind)[0]
        tables = np.concatenate(
            [calibration.drift_harmonics, calibration.scale_factor_harmonics], axis=1
        )
        of_tables, count = tables.size, len(nodes)
        value, covariance = tables.ravel(), np.asarray(calibration.covariance, float)
        first = np.arange(count) * tables.shape[1]
        places = [first + 1, first + 2, first + np.shape(calibration.drift_harmonics)[1]]
        measured = json.loads(calibration.details).get("measured") or {}
        if measured.get("kind") == "quadrature":
            coefficients, std = (
                np.broadcast_to(np.atleast_2d(measured[key]), (count, 2))
                for key in ("coefficients", "std")
            )
            value = np.append(value, coefficients.T)
            whole = np.zeros((len(value), len(value)))
            whole[:of_tables, :of_tables] = covariance
            beyond = np.arange(of_tables, len(value))
            whole[beyond, beyond] = std.T.ravel() ** 2
            covariance = whole
            places += list(beyond.reshape(2, count))
        at_place, everywhere = np.zeros((5, len(value))), np.zeros((len(value), 5))
        for row, of_nodes in enumerate(places):
            at_place[row, of_nodes] = weights
            everywhere[of_nodes, row] = 1.0
        return cls(value, covariance, at_place, everywhere, np.arange(5) < len(places))

    def find_level(self) -> tuple[Array, Array]:
        """The five coefficients at the place, NaN where the tables hold none, and their
        covariance."""
        level = np.where(self.held, self.at_place @ self.value, np.nan)
        return level, self.at_place @ self.covariance @ self.at_place.T

    def compute_travel(self, there: TableState) -> tuple[Array, Array]:
        """What the five coefficients change by from another place of the same tables to this one, 0
        where the tables hold none, and its covariance."""
        way = self.at_place - there.at_place
        return way @ self.value, way @ self.covariance @ way.T

    def combine(self, new: Array, covariance: Array, known: Array, moved: Array) -> TableState:
        """The state after the coefficients `new` (5,), of which `known` (5,) were found, those
        `moved` (5,) by an unknown amount."""
        level = self.at_place[known]
        spread = level @ self.covariance @ level.T + covariance[np.ix_(known, known)]
        unknown = np.where(moved[known], UNKNOWN * np.diag(spread), 0.0)
        shift = self.everywhere[:, known]
        prior = self.covariance + (shift * unknown) @ shift.T
        # at the place the weights sum to one, so that H E is the unit matrix
        total = spread + np.diag(unknown)
        scale = np.sqrt(np.diag(total))
        gain = np.linalg.solve(total / np.outer(scale, scale), (level @ prior) / scale[:, None]).T
        gain = gain / scale
        left = np.eye(len(prior)) - gain @ level
        # of a movement of which nothing is known nothing is left: (I − G H) E = 0 there
        after = left @ self.covariance @ left.T + gain @ covariance[np.ix_(known, known)] @ gain.T
        return self._with(self.value + gain @ (new[known] - level @ self.value), after)

    def shift(self, change: Array, covariance: Array, moved: Array) -> TableState:
        """The state with a change (5,) of its own covariance added to every node, where it
        moved."""
        shift = self.everywhere[:, moved]
        return self._with(
            self.value + shift @ change[moved],
            self.covariance + shift @ covariance[np.ix_(moved, moved)] @ shift.T,
        )

    def doubt_the_way(self, change: Array, moved: Array) -> Array:
        """By what a change (5,) of what moved (5,), found at the place, would be another one at the
        nodes did it grow with the coefficients c_j, δ (c_j − c)/c, of pairs as complex numbers:
        directions (n, k) of unit variance."""
        doubts = [np.zeros(len(self.value))]
        for group in (group for group in GROUPS.values() if moved[group].all()):
            of_nodes = [np.flatnonzero(column) for column in self.everywhere[:, group].T]
            at_nodes = _as_complex(self.value[np.array(of_nodes)])
            level, delta = (
                _as_complex(self.at_place[group] @ self.value),
                _as_complex(change[group]),
            )
            # one that all but vanishes now or then has no size for another to grow with
            size = max(level, level + delta, key=abs)
            apart = delta * (at_nodes - level) / size if size else 0 * at_nodes
            for turn in (1, 1j)[: len(of_nodes)]:
                doubt = np.zeros(len(self.value))
                for part, places in zip((np.real, np.imag), of_nodes, strict=False):
                    doubt[places] = part(turn * apart)
                doubts.append(doubt)
        return np.array(doubts).T

    def add_doubt(self, directions: Array) -> TableState:
        """The state with more spread along directions (n, k)."""
        return self._with(self.value, self.covariance + directions @ directions.T)

    def _with(self, value: Array, covariance: Array) -> TableState:
        return TableState(
            value, (covariance + covariance.T) / 2, self.at_place, self.everywhere, self.held
        )

    def write_into(self, calibration: Calibration) -> Calibration:
        """The calibration with this state in its tables, their standard deviations and its measured
        part."""
        count, first = np.shape(calibration.drift_harmonics)
        width = first + np.shape(calibration.scale_factor_harmonics)[1]
        of_tables = count * width
        covariance = self.covariance[:of_tables, :of_tables]
        table = self.value[:of_tables].reshape(count, width)
        std = np.sqrt(np.maximum(np.diag(covariance), 0)).reshape(count, width)
        angles, m = np.asarray(calibration.wave_angle_rad), calibration.mode_number
        of_drift, of_scale = (
            build_harmonic_basis(angles, (size - 1) // 2, m) for size in (first, width - first)
        )
        details = json.loads(calibration.details)
        if self.held[3:].all():
            own = np.sqrt(np.maximum(np.diag(self.covariance)[of_tables:], 0))
            details["measured"] |= {
                "coefficients": self.value[of_tables:].reshape(2, count).T.tolist(),
                "std": own.reshape(2, count).T.tolist(),
            }
        return calibration.replace(
            drift_harmonics=table[:, :first],
            drift_harmonics_std=std[:, :first],
            scale_factor_harmonics=table[:, first:],
            scale_factor_harmonics_std=std[:, first:],
            drift_rad_s=table[:, :first] @ of_drift.T,
            drift_rad_s_std=compute_table_std(of_drift, covariance, count, 0),
            scale_factor=table[:, first:] @ of_scale.T,
            scale_factor_std=compute_table_std(of_scale, covariance, count, first),
            covariance=covariance,
            details=json.dumps(details),
        )


def _as_complex(values: Array) -> Array:
    """A pair (2, …) as x + jy, a number alone (1, …) as it is."""
    return values[0] + 1j * values[1] if len(values) == 2 else values[0] + 0j
