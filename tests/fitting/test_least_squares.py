"""Least squares: units of the columns do not matter, and the one Gauss–Newton loop says truly how it
ended."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from hrg_cli.fitting import least_squares
from hrg_cli.fitting.least_squares import StepTaken, descend

TIME_S = np.linspace(0.0, 4.0, 80)
TRUE = np.array([1.3, 0.7, 2.5])
NOISE = 1e-3


@dataclass(frozen=True)
class Point:
    """Amplitude, decay and frequency of a ring-down, and what it leaves of χ²."""

    x: np.ndarray
    left: np.ndarray
    cost: float


@dataclass
class RingDown:
    """y = a e^{−νt} cos ωt fitted to its samples; tried: the costs of all points asked for."""

    samples: np.ndarray
    tried: list = field(default_factory=list)

    def at(self, x):
        left = (self.samples - x[0] * np.exp(-x[1] * TIME_S) * np.cos(x[2] * TIME_S)) / NOISE
        self.tried.append(float(left @ left))
        return Point(x, left, self.tried[-1])

    def linearise(self, point):
        a, nu, omega = point.x
        decay, cos, sin = (
            np.exp(-nu * TIME_S),
            np.cos(omega * TIME_S),
            np.sin(omega * TIME_S),
        )
        slopes = np.column_stack(
            [decay * cos, -a * TIME_S * decay * cos, -a * TIME_S * decay * sin]
        )
        if not np.isfinite(slopes).all():
            return None
        return least_squares.solve(slopes / NOISE, point.left)

    def move(self, point, step, size):
        return self.at(point.x + size * step[0])

    def is_settled(self, step, taken: StepTaken):
        return bool(np.all(np.abs(step[0]) < 1e-3 * np.sqrt(np.diag(step[1]))))


def ring_down(seed):
    true = TRUE[0] * np.exp(-TRUE[1] * TIME_S) * np.cos(TRUE[2] * TIME_S)
    return RingDown(true + NOISE * np.random.default_rng(seed).normal(size=len(TIME_S)))


def test_the_optimum_of_a_far_start_is_unbiased_and_its_errors_are_its_own():
    """From a frequency that turns the wave by two radians over the record, 200 draws: the mean of
    error²/σ² is 1 within four of its own standard deviations, √(2/600)."""
    ratios = []
    for seed in range(200):
        problem = ring_down(seed)
        found = descend(problem, problem.at(np.array([0.8, 0.2, 2.0])), 30)
        assert found.converged and found.reason == "settled"
        ratios.append((found.point.x - TRUE) / np.sqrt(np.diag(found.step[1])))
    assert np.mean(np.square(ratios)) == pytest.approx(1.0, abs=4 * np.sqrt(2 / 600))


def test_the_end_is_the_lowest_point_tried_though_whole_steps_overshoot():
    problem = ring_down(1)
    found = descend(problem, problem.at(np.array([0.1, 3.0, 1.5])), 30)
    assert found.converged and found.point.cost == pytest.approx(min(problem.tried), rel=1e-9)
    assert len(problem.tried) > found.steps + 1, "no step was halved: the start is not far enough"


def test_every_other_end_is_told_and_is_no_optimum():
    problem = ring_down(2)
    start = problem.at(np.array([0.8, 0.2, 2.0]))
    early = descend(problem, start, 2)
    assert early.reason == "too many steps" and early.steps == 2
    wild = descend(problem, problem.at(np.array([np.nan, 0.2, 2.0])), 9)
    assert wild.reason == "no numbers" and wild.step is None

    class Uphill(RingDown):
        def linearise(self, point):
            step, covariance = super().linearise(point)
            return -step, covariance

    uphill = Uphill(problem.samples)
    stuck = descend(uphill, start, 9)
    assert stuck.reason == "no part of the step lowers χ²" and stuck.point is start
    assert not (early.converged or wild.converged or stuck.converged)


def test_a_column_in_a_small_unit_is_no_column_that_repeats_others():
    rng = np.random.default_rng(3)
    design, answer = rng.normal(size=(40, 4)), np.array([1.0, -2.0, 0.5, 3.0])
    unit = 10.0 ** np.array([0, -12, 9, -5])
    found, covariance = least_squares.solve(design * unit, design @ answer)
    assert found * unit == pytest.approx(answer)
    assert covariance * np.outer(unit, unit) == pytest.approx(np.linalg.inv(design.T @ design))
