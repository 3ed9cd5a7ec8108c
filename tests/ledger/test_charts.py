"""XmR charts: limits against closed forms, false alarms against published rates, a shift found."""

import numpy as np
import pytest

from hrg_cli.ledger.charts import BEYOND, FALSE_ALARMS, find_zone_violations, make_chart

RNG = np.random.default_rng(20)


def test_limits_are_the_textbooks():
    """X̄ ± 2.660 MR̄ and 3.267 MR̄ (the printed constants E₂ and D₄ of two), by hand."""
    x = np.array([39, 41, 41, 41, 43, 44, 41, 42, 40, 41, 44, 40.0])
    found = make_chart(x)
    mean_range = np.abs(np.diff(x)).mean()
    assert found.centre == pytest.approx(x.mean())
    assert found.upper == pytest.approx(x.mean() + 2.660 * mean_range, rel=1e-3)
    assert found.lower == pytest.approx(x.mean() - 2.660 * mean_range, rel=1e-3)
    assert found.range_upper == pytest.approx(3.267 * mean_range, rel=1e-3)


def test_too_few_points_or_no_change_have_no_chart():
    assert make_chart(np.arange(7.0)) is None and make_chart(np.ones(20)) is None


def test_points_beyond_3_sigma_are_as_rare_as_the_normal_distribution_says():
    """Known limits: 0.27 % of the points; 10⁶ draws give it to 2 % of itself (1 σ), bound at 4."""
    z = RNG.standard_normal(1_000_000)
    found = sum(v.rule == BEYOND for v in find_zone_violations(z)) / len(z)
    assert found == pytest.approx(FALSE_ALARMS, abs=4 * np.sqrt(FALSE_ALARMS / len(z)))


def test_limits_from_the_points_themselves_cost_little():
    """Charts of 50 points in control, limits estimated from them: near 0.27 % a point (the ranges'
    own scatter adds to it, the point's own part in the mean takes from it)."""
    charts = [make_chart(RNG.standard_normal(50)) for _ in range(2000)]
    rate = np.mean([sum(v.rule == BEYOND for v in c.violations) / 50 for c in charts])
    assert 0.6 * FALSE_ALARMS < rate < 2 * FALSE_ALARMS


def test_the_zone_rules_together_alarm_as_published():
    """Average run length in control of the four Western Electric rules: 91.75 points (Champ &
    Woodall 1987, table 1)."""
    lengths = []
    for _ in range(1500):
        z, first = RNG.standard_normal(1200), 1200
        points = [v.point for v in find_zone_violations(z)]
        lengths.append((min(points) if points else first) + 1)
    error = np.std(lengths) / np.sqrt(len(lengths))
    assert np.mean(lengths) == pytest.approx(91.75, abs=4 * error)


@pytest.mark.parametrize(
    ("z", "rule", "point"),
    [
        ([0, 0, 3.1, 0], "beyond 3 σ", 2),
        ([0, 2.1, 0.5, 2.2, 0], "2 of 3 beyond 2 σ", 3),
        ([1.1, 1.2, -0.5, 1.3, 1.4, 0], "4 of 5 beyond 1 σ", 4),
        ([-0.1] * 8, "8 on one side", 7),
    ],
)
def test_a_pattern_is_named_at_the_point_that_completes_it(z, rule, point):
    for sign in (1, -1):
        found = find_zone_violations(sign * np.array(z, float))
        assert [(v.rule, v.point) for v in found] == [(rule, point)]


def test_a_shift_is_out_of_control():
    x = RNG.standard_normal(60)
    x[50:] += 6.0
    assert make_chart(x).out_of_control
