"""Many envelopes beside the same rows are asked for in one call: what a call costs does not grow
with them, and each is what it would be alone."""

from dataclasses import replace

import numpy as np
import pytest
from test_extended import programme

from hrg_cli.effects import EFFECTS
from hrg_cli.fitting.causes.slow_equation import RungeKuttaStage
from hrg_cli.fitting.causes.turned_motion import find_slope


def several(series, count=3):
    """Envelopes (count, R, n, 2) that differ in size, phase and angle."""
    random = np.random.default_rng(4)
    beside = random.standard_normal((count, *series.envelope.shape, 2)) @ [1, 1j]
    return series.envelope + 0.1 * beside


@pytest.mark.parametrize("effect", EFFECTS, ids=lambda effect: effect.name)
def test_an_effect_of_several_envelopes_is_that_of_each(effect):
    series, point = programme()
    values = {p.name: p.typical if p.fitted else p.neutral for p in effect.parameters}
    stage = RungeKuttaStage(series, replace(point, active=((effect, values),)))
    u = several(series)
    for asked in (stage.compute_source, stage.read_out):
        at_once = np.broadcast_to(asked(u), u.shape)
        np.testing.assert_allclose(at_once, [asked(one) for one in u], rtol=1e-12, atol=1e-15)


def test_slopes_take_one_call_of_the_right_hand_side():
    series, point = programme()
    stage, asked = RungeKuttaStage(series, point), []

    def source(u):
        asked.append(u.shape)
        return stage.compute_source(u)

    find_slope(source, series.envelope)
    assert asked == [(8, *series.envelope.shape)]


def test_a_force_that_bends_is_asked_for_once():
    series, point = programme()
    stage = RungeKuttaStage(series, point)
    effect, values = next(pair for pair in point.active if pair[0].nonlinear_force)
    asked = []

    def slow(p, u, state):
        asked.append(u.shape)
        return effect.slow(p, u, state)

    counted = type(effect)(**{**vars(effect), "slow": slow})
    stage.compute_force(counted, values, series.envelope, stage.make_state(series.envelope))
    assert asked == [(3, *series.envelope.shape)]
