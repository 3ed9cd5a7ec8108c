"""Charts of individuals and moving ranges (XmR): limits from the ranges, and what breaks a rule.

The standard deviation is that between neighbours, MR̄/d₂ with d₂(2) = 2/√π, so that a slow change
does not widen the limits it should break. Rules: Western Electric, Statistical Quality Control
Handbook (1956), pp. 25-28; their false alarms: Champ & Woodall, Technometrics 29 (1987) 393.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

Array = np.ndarray
FEWEST_POINTS = 8
"""Points from which a chart has limits; below, the mean range is too uncertain."""
RANGE_MEAN = 2 / np.sqrt(np.pi)
"""d₂(2): mean range of two normal numbers over their σ."""
RANGE_STD = np.sqrt(2 - 4 / np.pi)
"""d₃(2): standard deviation of that range over their σ."""
BEYOND = "beyond 3 σ"
"""The rule that alone puts a chart out of control; the others are warnings."""
FALSE_ALARMS = 0.0027
"""Points in control that lie beyond 3 σ, with known limits (normal distribution)."""


@dataclass(frozen=True)
class Violation:
    """A point (its index, and the rule it breaks)."""

    point: int
    rule: str


@dataclass(frozen=True)
class Chart:
    """Centre, σ between neighbours, limits of the individuals (lower, upper) and of the moving
    range (upper), and the violations in the order of the points."""

    centre: float
    sigma: float
    lower: float
    upper: float
    range_upper: float
    violations: tuple[Violation, ...]

    @property
    def out_of_control(self) -> bool:
        """Whether a point lies beyond 3 σ."""
        return any(v.rule == BEYOND for v in self.violations)


def make_chart(values: Array) -> Chart | None:
    """The chart of individuals and moving ranges of values in the order of time.

    σ is MR̄/d₂(2) of the ranges between neighbours, d₂(2) = 2/√π: a slow change does not widen the
    limits that it should break.

    Parameters
    ----------
    values
        (n,).

    Returns
    -------
    Chart or None
        None for fewer than 8 points, or where neighbours do not differ at all.

    Examples
    --------
    A step of ten times what neighbours differ by:

    >>> import numpy as np
    >>> from hrg_cli.ledger.charts import make_chart
    >>> found = make_chart(np.tile([-0.5, 0.5], 10) + np.repeat([0.0, 10.0], [18, 2]))
    >>> found.out_of_control, [v.point for v in found.violations if v.rule == "beyond 3 σ"]
    (True, [18, 19])
    """
    x = np.asarray(values, float)
    if len(x) < FEWEST_POINTS:
        return None
    ranges = np.abs(np.diff(x))
    sigma = float(ranges.mean() / RANGE_MEAN)
    if not sigma > 0:
        return None
    centre = float(x.mean())
    range_upper = sigma * (RANGE_MEAN + 3 * RANGE_STD)
    found = find_zone_violations((x - centre) / sigma)
    found += [Violation(int(i) + 1, "moving range") for i in np.flatnonzero(ranges > range_upper)]
    ordered = tuple(sorted(found, key=lambda v: v.point))
    return Chart(centre, sigma, centre - 3 * sigma, centre + 3 * sigma, float(range_upper), ordered)


def find_zone_violations(z: Array) -> list[Violation]:
    """The points that complete a pattern which chance makes seldom (Western Electric, 1956).

    One beyond 3 σ, two of three beyond 2 σ, four of five beyond 1 σ, eight in a row, each on one
    side.

    Parameters
    ----------
    z
        (x − centre)/σ (n,).

    Returns
    -------
    list of Violation
        Rule by rule.

    Examples
    --------
    >>> import numpy as np
    >>> from hrg_cli.ledger.charts import find_zone_violations
    >>> [(v.point, v.rule) for v in find_zone_violations(np.array([0.0, 2.5, -0.1, 2.5, -3.5]))]
    [(4, 'beyond 3 σ'), (3, '2 of 3 beyond 2 σ')]
    """
    rules: tuple[tuple[str, int, int, float], ...] = (
        (BEYOND, 1, 1, 3.0),
        ("2 of 3 beyond 2 σ", 2, 3, 2.0),
        ("4 of 5 beyond 1 σ", 4, 5, 1.0),
        ("8 on one side", 8, 8, 0.0),
    )
    return [
        Violation(int(i), name)
        for name, wanted, of, zone in rules
        for i in np.flatnonzero(
            _completed(z > zone, wanted, of) | _completed(z < -zone, wanted, of)
        )
    ]


def _completed(beyond: Array, wanted: int, of: int) -> Array:
    """Points (n,) that lie beyond and with the `of − 1` before them are at least `wanted`."""
    count = np.convolve(beyond.astype(int), np.ones(of, int))[: len(beyond)]
    return np.asarray(beyond & (count >= wanted))
