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
"""Part of K by which that of one node may differ from the others'."""
STANDS_OUT, LEAST = 10.0, 2e-4
"""Times what all others differ by among themselves that one node's K stands out by, and the least
that they differ by."""
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
        """How far K at each node is from that of most others, beyond what their errors do: (J,) as
        parts of K, 0 where there is one node."""
        if len(self.values) < 2:
            return np.zeros(1)
        apart = np.empty(len(self.values))
        for j, (own, std) in enumerate(zip(self.values, self.stds)):
            others = np.delete(self.values, j)
            error = SURE * np.hypot(std, np.median(np.delete(self.stds, j)))
            apart[j] = max(abs(own - float(np.median(others))) - error, 0.0)
        return apart / self.usual

    def is_plausible(self) -> bool:
        """Whether it is that of a resonator at every node."""
        return all(check.passed for check in self._check_each())

    def _check_each(self) -> list[Check]:
        return [check_scale_factor(float(k), float(s)) for k, s in zip(self.values, self.stds)]

    def find_odd_node(self) -> int | None:
        """The node whose K is farther from the others' than a resonator makes it, or far outside of
        what three others or more agree on; None where there is none."""
        departures = self.measure_departures()
        worst = int(np.argmax(departures))
        rest = self._without(worst).measure_departures()
        alone = len(rest) > 2 and departures[worst] > STANDS_OUT * max(float(rest.max()), LEAST)
        return worst if departures[worst] > MOST_APART or alone else None

    def _without(self, node: int) -> ScaleFactors:
        return ScaleFactors(*(np.delete(one, node) for one in (self.nodes, self.values, self.stds)))

    def check(self, axis: str) -> list[Check]:
        """Whether K is that of a resonator, and that of the same one at every node."""
        odd, unit = self.find_odd_node(), "°C" if axis == "temperature" else "Hz"
        alike = ""
        if odd is not None:
            others = np.median(self._without(odd).values)
            alike = (
                f"the scale factor is {self.values[odd]:.5g} at {self.nodes[odd]:.4g} {unit} and"
                f" {others:.5g} elsewhere, as no resonator has it; look at the scale and unit of"
                " the rate logs"
            )
        return [
            min(self._check_each(), key=lambda check: check.passed),
            check_holds("scale_factor_is_alike", odd is None, alike),
        ]
