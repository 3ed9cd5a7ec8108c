"""Increments of block averages: their noise, their equation, reading by pieces."""

from dataclasses import replace

import numpy as np
import pytest
from forced_runs import Truth, forced_run, wave_of

from hrg_cli.errors import HrgError
from hrg_cli.fitting.noise.increment_noise import (
    AngleNoise,
    build_covariance_bands,
    estimate_noise,
    whiten,
)
from hrg_cli.fitting.tables import increments
from hrg_cli.fitting.tables.increments import build_path


def noisy(seed, white, walk, n=3000, dt=0.01):
    draw = np.random.default_rng(seed)
    angle = np.cumsum(draw.normal(size=n) * np.sqrt(walk * dt)) + draw.normal(size=n) * white
    return wave_of(np.arange(n) * dt, angle / 2, np.full(n, 20.0), np.zeros(n), white / 2, "r")


@pytest.mark.parametrize("speed", [0.0, 1e-320, 1e-12])
def test_a_wave_that_all_but_stands_still_has_the_fewest_blocks(speed):
    time = np.arange(3000) * 0.01
    wave = wave_of(time, speed * time, np.full(3000, 20.0), np.zeros(3000), 1e-5, "r")
    assert len(build_path(wave, harmonics=1).turn) == increments.FEWEST_BLOCKS - 1


def test_covariance_of_increments_is_that_of_simulated_noise():
    """White noise and random walk of mθ, averaged to blocks of 25 rows: variance and neighbours'
    covariance of the increments."""
    white, walk = 2e-5, 1e-7
    products = np.zeros(3)
    for seed in range(40):
        path = build_path(noisy(seed, white, walk), harmonics=1, per_block=25)
        d = path.turn
        products += [np.mean(d * d), np.mean(d[1:] * d[:-1]), np.mean(d[2:] * d[:-2])]
    bands = build_covariance_bands(path, AngleNoise(white**2 / 25, walk))
    assert products[0] / 40 == pytest.approx(bands[0].mean(), rel=0.06)
    assert products[1] / 40 == pytest.approx(bands[1, :-1].mean(), rel=0.2)
    assert abs(products[2] / 40) < 0.03 * bands[0].mean()


def test_whitening_whitens():
    path = build_path(noisy(0, 1e-5, 1e-9), harmonics=1, per_block=30)
    bands = build_covariance_bands(path, AngleNoise(1e-10, 1e-9))
    V = np.diag(bands[0]) + np.diag(bands[1, :-1], 1) + np.diag(bands[1, :-1], -1)
    white, determinant = whiten(bands, np.eye(len(path)))
    assert white @ V @ white.T == pytest.approx(np.eye(len(path)), abs=1e-8)
    assert determinant == pytest.approx(np.linalg.slogdet(V)[1])


def test_noise_levels_are_recovered():
    found = [
        estimate_noise(p, p.turn)
        for p in (build_path(noisy(s, 3e-5, 1e-8), harmonics=1, per_block=5) for s in range(12))
    ]
    assert np.mean([f.white for f in found]) == pytest.approx((3e-5) ** 2 / 5, rel=0.15)
    assert np.mean([f.walk for f in found]) == pytest.approx(1e-8, rel=0.15)


def test_white_noise_that_a_walk_hides_is_what_the_windows_state():
    """A walk of 15 σ a block leaves nothing to tell the white part by: then it is the stated one,
    and the walk is still found."""
    for seed in range(6):
        path = build_path(noisy(seed, 1e-6, 1e-8), harmonics=1, per_block=5)
        stated = path.mode_number**2 * float(np.mean(path.angle_variance))
        found = estimate_noise(path, path.turn)
        assert found.white == pytest.approx(stated, rel=1e-9)
        assert found.walk == pytest.approx(1e-8, rel=0.2)
    # and what is more than stated and can be told still is
    path = build_path(noisy(0, 3e-5, 1e-8), harmonics=1, per_block=5)
    louder = replace(path, angle_variance=path.angle_variance / 9)
    assert estimate_noise(louder, path.turn).white == pytest.approx((3e-5) ** 2 / 5, rel=0.3)


def test_a_walk_that_is_not_there_is_seldom_found():
    """Twice the rise of ln L must exceed a gain of 6: by chance (half of χ² with one degree of
    freedom) 0.7 % of runs without a walk show one."""
    draw = np.random.default_rng(5)
    path = build_path(noisy(0, 3e-5, 0.0), harmonics=1, per_block=25)
    found = 0
    for _ in range(120):
        angle = draw.normal(size=len(path) + 1) * 1e-5
        found += estimate_noise(path, np.diff(angle)).walk > 0
    assert found <= 5  # of 120 by chance: 2 in 1000 times more


def test_the_variance_of_a_block_is_that_of_a_mean():
    """n rows of σ_i: Σσ_i²/n², what the block means of drawn angles scatter by."""
    draw, n = np.random.default_rng(6), 25
    std = 1e-5 * draw.uniform(0.5, 2, 3000)
    time = np.arange(3000) * 0.01
    zero = np.zeros(3000)
    waves = [
        wave_of(time, draw.normal(size=3000) * std, zero + 20.0, zero, 1e-5, "r").replace(
            wave_angle_rad_std=std
        )
        for _ in range(40)
    ]
    paths = [build_path(w, harmonics=1, per_block=n) for w in waves]
    assert paths[0].angle_variance == pytest.approx((std**2).reshape(-1, n).mean(1) / n)
    seen = np.var([p.angle_rad for p in paths], axis=0)
    assert np.mean(seen / paths[0].angle_variance) == pytest.approx(1 - 1 / 40, abs=0.08)


def test_the_phases_rate_is_taken_against_the_reference():
    """dφ/dt = 2π(f − f_ref): a wave 3 Hz above the reference turns its phase by 6π rad/s."""
    wave = noisy(0, 1e-5, 0.0)
    f = np.full(len(wave), wave.reference_frequency_hz + 3.0)
    path = build_path(wave.replace(frequency_hz=f), harmonics=1, per_block=25)
    assert path.phase_rate_rad_s == pytest.approx(6 * np.pi)


def test_reading_by_pieces_changes_nothing(monkeypatch):
    wave = forced_run(Truth(0), lambda t: 20 + t / 10, 0.4, 20, 0)
    whole = build_path(wave, harmonics=2)
    monkeypatch.setattr(increments, "ROWS_AT_ONCE", 64)
    pieces = build_path(wave, harmonics=2)
    for name in ("time_s", "angle_rad", "rate_integral_rad", "temperature_degc", "width_s"):
        assert getattr(pieces, name) == pytest.approx(getattr(whole, name), abs=1e-12)


def test_equation_between_blocks_holds_without_noise():
    """Fast rotation, coarse blocks: the sinc² of the basis keeps the equation to 1e-3 of the
    drift."""
    truth = Truth(3, curved=False)
    wave = forced_run(truth, 20.0, 0.8, 20, 0, dt=0.005, noise=0.0)
    path = build_path(wave, harmonics=2, per_block=40)
    predicted = (
        path.build_angle_basis(2) @ truth.d[0] * path.interval_s
        - path.build_angle_basis(2) @ truth.k[0] * path.rotation
    )
    constant = -truth.k[0, 0] * path.rotation
    assert np.abs(path.turn - predicted).max() < 5e-3 * np.abs(path.turn - constant).max()


@pytest.mark.parametrize("per_block", [1, 2])
def test_windows_that_are_long_beside_the_waves_turn_lend_no_drift(per_block):
    """A window's angle is that of its middle: cos 2mθ turns by 0.3 rad a window here, and a blur
    taken for one that is not there makes the drift up to 1.6 % too large."""
    truth = Truth(2, drift=2e-4, scale_ripple=0.0)
    rate, dt = 2.0, 0.14
    wave = forced_run(truth, 20.0, rate, 400.0, 1, dt=dt, noise=0.0, steps=40)
    path = build_path(wave, harmonics=2, per_block=per_block)
    basis = path.build_angle_basis(2) * path.interval_s[:, None]
    left = path.turn + 0.55 * path.rotation
    found = np.linalg.lstsq(basis, left, rcond=None)[0]
    assert np.abs(found[1:] - truth.d[0, 1:]).max() < 1e-3 * np.abs(truth.d[0, 1:]).max()


def test_flagged_rows_are_left_out_and_gaps_bridged():
    wave = forced_run(Truth(0), 20.0, 0.4, 20, 0)
    bad = np.zeros(len(wave), "u1")
    bad[300:420] = 2
    angle = wave.wave_angle_rad.copy()
    angle[300:420] = np.nan
    path = build_path(wave.replace(flags=bad, wave_angle_rad=angle), harmonics=2, per_block=10)
    assert np.isfinite(path.turn).all()
    whole = build_path(wave, harmonics=2, per_block=10)
    assert path.rotation.sum() == pytest.approx(whole.rotation.sum())
    assert path.interval_s.max() > 10 * np.median(path.interval_s)


def test_unusable_runs_are_named():
    wave = forced_run(Truth(0), 20.0, 0.4, 4, 0, run_id="night-3")
    with pytest.raises(HrgError, match=r"night-3.*no rate log"):
        build_path(wave.replace(rate_rad_s=None), harmonics=1)
    with pytest.raises(HrgError, match=r"night-3.*stands or goes back"):
        build_path(wave.replace(time_s=wave.time_s[::-1].copy()), harmonics=1)
    with pytest.raises(HrgError, match=r"night-3.*fewer than two good"):
        build_path(wave.replace(flags=np.ones(len(wave), "u1")), harmonics=1)


def test_a_swinging_table_is_turned_along_its_course(monkeypatch):
    """Rates logged at the windows' middles, 54 of them a period: a trapezium loses x²/12 of what
    swings, 1.1e-3 of it, and tables of right runs were suspect; read by pieces it is the same."""
    n, size, period = 700, 0.4, 54
    t = np.arange(n) * 0.02
    omega = 2 * np.pi / (period * 0.02)
    wave = wave_of(t, 0 * t, np.full(n, 20.0), 1 + size * np.sin(omega * t), 1e-6, "r")
    path = build_path(wave, harmonics=1, per_block=1)
    turned = path.time_s + size / omega * (1 - np.cos(omega * path.time_s))
    assert np.abs(path.rate_integral_rad - turned).max() < 1e-5 * size / omega
    monkeypatch.setattr(increments, "ROWS_AT_ONCE", 100)
    pieces = build_path(wave, harmonics=1, per_block=1)
    assert np.allclose(pieces.rate_integral_rad, path.rate_integral_rad, rtol=0, atol=1e-12)
