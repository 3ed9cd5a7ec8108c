"""A step of a fit: in which order parts of it and dampings are tried."""

from types import SimpleNamespace

import numpy as np
import pytest
from test_extended import programme

from hrg_cli.fitting.causes import coordinate_priors, descent, extended_fit


def tried_in_a_valley(monkeypatch, led_by, falls=0.3):
    """The steps tried where only that damping lowers the cost, and what is taken."""
    tried = []

    def follow(here, freedom, step):
        tried.append(float(step[0]))
        return None, 0.5 if step[0] == -falls else 2.0

    monkeypatch.setattr(descent, "_follow", follow)
    valley = SimpleNamespace(step=np.ones(1), damp=lambda damping: np.array([-damping]))
    return tried, descent.descend(valley, None, 1.0, 1e-6, led_by)


@pytest.mark.parametrize("led_by", [0.0, 0.3])
def test_a_valley_that_was_entered_damped_goes_on_so(monkeypatch, led_by):
    tried, made = tried_in_a_valley(monkeypatch, led_by)
    assert (made.value, made.whole, made.damping) == (0.5, False, 0.3)
    if led_by:
        assert tried == [1.0, -0.3]
    else:
        assert tried == [1.0, *descent.PARTS, -0.03, -0.1, -0.3]


@pytest.mark.parametrize("led_by", [0.0, 0.3])
def test_where_nothing_falls_everything_was_tried_once(monkeypatch, led_by):
    tried, made = tried_in_a_valley(monkeypatch, led_by, falls=np.nan)
    assert sorted(tried) == sorted([1.0, *descent.PARTS, *(-one for one in descent.DAMPED)])
    assert (made.value, made.damping) == (2.0, descent.DAMPED[-1])


def test_a_fit_that_began_too_far_off_is_given_up_early(monkeypatch):
    series, point = programme()
    free = coordinate_priors.CoordinatePriors(point.p, np.zeros(7))
    steps = []

    def level(here, freedom, value, settled, damping):
        steps.append(value)
        return descent.Descent(here.flow.prediction, value * 0.9, False, 0.0)

    monkeypatch.setattr(extended_fit, "descend", level)
    for worst, count in ((np.inf, extended_fit.MOST_STEPS), (1e-3, extended_fit.EARLY_STEPS)):
        steps.clear()
        found = extended_fit.fit(series, point, free, worst=worst)
        assert (len(steps), found.converged) == (count, False)
