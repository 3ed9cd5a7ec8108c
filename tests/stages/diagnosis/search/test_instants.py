"""What happens at one instant beside a slow misfit that no cause explains: named with its size where
it stands out of it, and nothing where there is none."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_waves import as_wave, envelope

from hrg_cli.effects import EFFECTS
from hrg_cli.fitting.causes import extended_fit
from hrg_cli.physics.resonator import Mechanics
from hrg_cli.stages.diagnosis.base.base_priors import choose_freedom
from hrg_cli.stages.diagnosis.base.data import prepare
from hrg_cli.stages.diagnosis.fits.scoring import is_gross
from hrg_cli.stages.diagnosis.fits.variants import list_variants
from hrg_cli.stages.diagnosis.search.inquiry import Inquiry
from hrg_cli.stages.diagnosis.search.instants import take_strikes
from hrg_cli.stages.diagnosis.search.remainder import search_rest
from hrg_cli.stages.diagnosis.search.search_case import Case
from hrg_cli.stages.diagnosis.search.selection import Search

PENDULUM = Mechanics(0.3563, 3e-4, 4e-5, 0.4, 6e-4, 0.7, 1.0, 1)
RATE_RAD_S, LENGTH_S, ROWS, NOISE = -5e-5, 1450.0, 103, 3e-4
AT_S = 0.57 * LENGTH_S


def measured(change, seed=0, scale=1.0):
    """A wave whose amplitude and phase wander slowly by a per cent, beside what `change` (t, u)
    makes of it; times divided by `scale`."""
    random = np.random.default_rng(seed)
    # each row is the mean of finer instants, as a window is
    fine = (np.arange(20 * ROWS) + 0.5) * LENGTH_S / (20 * ROWS)
    u = envelope(PENDULUM, random.uniform(0, 3), RATE_RAD_S, fine, ratio=-0.02)
    for turns, size in zip((0.6, 1.4, 2.3), 0.01 * random.standard_normal((3, 2)), strict=True):
        course = np.sin(2 * np.pi * (turns * fine / LENGTH_S + random.uniform()))
        u = u * np.exp((size[0] + 1j * size[1]) * course)[:, None]
    u, t = (v.reshape(ROWS, 20, -1).mean(axis=1) for v in (change(fine, u), fine))
    gyro = replace(PENDULUM, frequency_hz=PENDULUM.frequency_hz * scale)
    rate = np.full(ROWS, RATE_RAD_S * scale)
    return as_wave(u, t[:, 0] / scale, NOISE, gyro, random, rate=rate)


def named(wave, sampling_step_s=None):
    """The causes at an instant beside the base model's misfit."""
    series, point, _ = prepare([wave], None, 40)
    base = extended_fit.fit(series, point, choose_freedom(series, point, None))
    assert is_gross(base), "a slow misfit was expected"
    candidates = list_variants([e for e in EFFECTS if e.seen_in == "dynamics"], base)
    inquiry = Inquiry(tuple(candidates), 5, sampling_step_s=sampling_step_s)
    left_over = search_rest(base, inquiry.noise)
    case = Case(inquiry, Search(base, base, (), (), ()), left_over)
    return take_strikes(case).search.found


def gain_step(c, s):
    return lambda t, u: u * (1 + np.array([c, s]) * (t > AT_S)[:, None])


@pytest.mark.parametrize(("c", "s"), [(0.01, 0.01), (0.0, -0.008)])
@pytest.mark.parametrize("scale", [1.0, 1e-3])
def test_a_step_of_the_gain_is_named_with_its_size_in_any_unit_of_time(c, s, scale):
    (found,) = named(measured(gain_step(c, s), scale=scale))
    group = [found.variant.effect.name, *found.rivals]
    assert group[0] == "gain_step" and len(group) <= 3
    assert abs(found.variant.values["time_s"] * scale - AT_S) < LENGTH_S / ROWS
    for name, true in (("c_gain", c), ("s_gain", s)):
        size, std = found.sizes[name]
        assert abs(size - true) < 4 * std < 4e-3


def test_a_knock_is_none_of_the_gain():
    """Across the wave's line, where no gain leads."""

    def knock(t, u):
        across = np.array([-u[0, 1].real, u[0, 0].real]) / np.linalg.norm(u[0].real)
        return u + 0.03j * across * (t > AT_S)[:, None]

    (found,) = named(measured(knock))
    assert "momentum_kick" in (found.variant.effect.name, *found.rivals)


def test_a_slow_misfit_alone_names_nothing():
    """One of a thousand courses may look like a jump."""
    assert not any(named(measured(lambda t, u: u, seed=seed)) for seed in range(4))


def phase_step(lost_s):
    """What follows comes so much later than its place says, as after lost samples."""
    omega = 2 * np.pi * PENDULUM.frequency_hz
    return lambda t, u: u * np.exp(1j * omega * lost_s * (t > AT_S))[:, None]


@pytest.mark.parametrize(("step_s", "is_loss"), [(None, True), (0.05, True), (0.3, False)])
def test_a_loss_where_sampling_is_even_is_of_whole_samples(step_s, is_loss):
    """0.05 s lost are one sample of 20 a second, and none of 3.3: a phase that jumps for another reason
    was named 1e-4 of a sample lost, at 5 to 15 σ."""
    (found,) = named(measured(phase_step(0.05)), step_s) or [None]
    assert (found is not None and found.variant.effect.name == "dropped_samples") == is_loss
