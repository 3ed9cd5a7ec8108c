"""The scale factor over the nodes: K is geometry and moves by parts per million a kelvin, so that a
node of another K has a rate log of another scale."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...fitting.checks import Check, check_holds
from ...fitting.tables.normal_pieces import TableSolution
from ...fitting.tables.table_layout import TableLayout
from ..usual_scale_factor import check_scale_factor

Array = np.ndarray
MOST_APART = 0.01
"""Part of K by which that of one node may be off the others' course."""
STANDS_OUT, LEAST = 10.0, 2e-4
"""Times what all others are off a course of theirs that one node's K stands out by, and the least
that they are off it."""
SMOOTHEST = 2
"""Order of the course through the others: an even rise and its bend are a gyro's, whatever their
size; a wrong log's step is neither."""
SURE = 5.0
"""Standard deviations that are no difference."""


@dataclass(frozen=True)
class ScaleFactors:
    """K at the nodes (J,), its mean over the wave angle, with its standard deviation."""

    nodes: Array
    values: Array
    stds: Array

    @classmethod
    def from_solution(
        cls, layout: TableLayout, solution: TableSolution, inflation: float = 1.0
    ) -> ScaleFactors:
        """Of a solution, whose variances are larger by a factor."""
        variance = np.maximum(np.diag(solution.covariance) * inflation, 0.0)
        values, squares = (
            layout.split_tables(one)[1][:, 0] for one in (solution.coefficients, variance)
        )
        return cls(layout.nodes, values, np.sqrt(squares))

    @property
    def usual(self) -> float:
        """That of most nodes."""
        return max(abs(float(np.median(self.values))), 1e-300)

    def measure_departures(self) -> Array:
        """How far K at each node is off a smooth course of the others, beyond what their errors do:
        (J,) as parts of K, 0 where there is one node.

        The course is that which suits the node best: as at the nearest of the others, a line or a
        parabola through all of them. A log of another scale is off each; a mean of nodes that
        differ from one another would blame the last of an even rise.
        """
        nodes = range(len(self.values))
        if len(nodes) < 2:
            return np.zeros(1)
        return np.array([self._depart(j, np.delete(nodes, j)) for j in nodes]) / self.usual

    def _depart(self, node: int, others: Array) -> float:
        """K of a node off the course of the others (J − 1,) that suits it best."""
        x = (self.nodes - self.nodes[node]) / max(float(np.ptp(self.nodes)), 1e-300)
        nearest = int(others[np.argmin(np.abs(x[others]))])
        courses = [(others == nearest).astype(float)]
        for order in range(1, min(SMOOTHEST, len(others) - 1) + 1):
            # the fitted course's value where the node is: its constant
            courses.append(np.linalg.pinv(np.vander(x[others], order + 1, increasing=True))[0])
        off = [
            abs(self.values[node] - weight @ self.values[others])
            - SURE * np.hypot(self.stds[node], np.linalg.norm(weight * self.stds[others]))
            for weight in courses
        ]
        return float(max(min(off), 0.0))

    def is_plausible(self) -> bool:
        """Whether it is that of a resonator at every node."""
        return all(check.passed for check in self._check_each())

    def _check_each(self) -> list[Check]:
        return [check_scale_factor(float(k), float(s)) for k, s in zip(self.values, self.stds)]

    def find_odd_node(self) -> int | None:
        """The node whose K is farther off the others' course than a resonator makes it, or far off
        one that three others or more agree on; None where there is none.

        It is the one without which the others are smoothest: they depart from a course that it is
        part of.
        """
        departures = self.measure_departures()
        left = [float(self._without(j).measure_departures().max()) for j in range(len(self.values))]
        worst = min(range(len(left)), key=lambda j: (left[j], -departures[j]))
        alone = len(left) > 3 and departures[worst] > STANDS_OUT * max(left[worst], LEAST)
        return worst if departures[worst] > MOST_APART or alone else None

    def _without(self, node: int) -> ScaleFactors:
        return ScaleFactors(*(np.delete(one, node) for one in (self.nodes, self.values, self.stds)))

    def check(self, axis: str) -> list[Check]:
        """Whether K is that of a resonator, and that of the same one at every node."""
        odd, unit = self.find_odd_node(), "°C" if axis == "temperature" else "Hz"
        alike = ""
        if odd is not None:
            others = self._without(odd).values
            off = float(self.measure_departures()[odd])
            alike = (
                f"the scale factor is {self.values[odd]:.5g} at {self.nodes[odd]:.4g} {unit},"
                f" {off:.2g} of it off the course of the others ({others.min():.5g} to"
                f" {others.max():.5g}), as no resonator has it; look at the scale and unit of the"
                " rate logs"
            )
        return [
            min(self._check_each(), key=lambda check: check.passed),
            check_holds("scale_factor_is_alike", odd is None, alike),
        ]
