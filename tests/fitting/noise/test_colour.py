"""The colour of a wave's noise: recovered from draws, and silent on white ones."""

import numpy as np

from hrg_cli.fitting.noise import colour

ROWS, STEP_S, STD, WALK = 120, 83.0, 1e-4, 2e-8
T = STEP_S * np.arange(ROWS)
FAULT = 5e-3 * (T / T[-1]) ** 2 - 2e-2 * (T / T[-1]) ** 4
"""What a wrong model leaves: smooth, far above the noise, and not noise."""


def drawn(random, q, tau=0.0):
    walk = (
        np.linalg.cholesky(colour.compute_wander(T, q, tau) + 1e-22 * np.eye(ROWS))
        @ random.normal(size=ROWS)
        if q
        else 0.0
    )
    return FAULT + STD * random.normal(size=ROWS) + walk


def test_white_noise_beside_a_misfit_is_white():
    random = np.random.default_rng(1)
    found = [colour.estimate(T, drawn(random, 0.0), np.full(ROWS, STD)) for _ in range(6)]
    assert max(n.clear for n in found) < colour.CLEAR and all(n.wander_1_s == 0 for n in found)
    assert abs(np.mean([n.white**2 for n in found]) - 1) < 4 * np.sqrt(
        2 / (6 * (ROWS - colour.SMOOTH))
    )


def test_a_random_walk_is_recovered():
    random = np.random.default_rng(2)
    found = [colour.estimate(T, drawn(random, WALK), np.full(ROWS, STD)) for _ in range(6)]
    assert min(n.clear for n in found) > colour.CLEAR
    assert (
        0.6
        < np.exp(
            np.mean([np.log(n.compute_std_after(3600.0) / np.sqrt(WALK * 3600)) for n in found])
        )
        < 1.6
    )


def test_the_component_that_wanders_is_named():
    """One component wanders, the others are white; the envelope turns and shrinks, so that the
    frame is the wave's own."""
    random = np.random.default_rng(3)
    size, angle, phase = 0.8 * np.exp(-T / 2e4), 1e-4 * T, 3e-4 * T
    e = np.exp(1j * phase)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    across = np.exp(1j * phase)[:, None] * np.stack([-np.sin(angle), np.cos(angle)], axis=-1)
    weight = np.full(ROWS, 1e4)
    a, p, q, r = (random.normal(size=ROWS) / weight for _ in range(4))
    p = p + size * np.linalg.cholesky(
        colour.compute_wander(T, WALK, 0.0) + 1e-22 * np.eye(ROWS)
    ) @ random.normal(size=ROWS)
    u = (a + 1j * p)[:, None] * e + (q + 1j * r)[:, None] * across
    residual = np.concatenate([u.real, u.imag], axis=-1)[None] * weight[None, :, None]
    envelope = (size[:, None] * e)[None]
    found = colour.estimate_noises(T[None], weight[None], envelope, residual)
    assert [n.wander_1_s > 0 for n in found] == [False, True, False, False]
    assert (
        colour.estimate_noises(T[None], weight[None], envelope, random.normal(size=(1, ROWS, 4)))
        == ()
    )
