"""What repeats one value where noise is stated is no measurement; what is coarse, held or without
noise is none of that."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_waves import GYRO, as_wave, envelope

from hrg_cli.fitting.envelopes.frozen import CHANCE, COLUMNS, _improbable, find_frozen
from hrg_cli.fitting.samples.stretches import Stretches
from hrg_cli.physics import ellipse

STEP_S, ROWS, STD = 0.01, 240, 1e-4


def wave(seed=0, std=STD, noise=None, mechanics=GYRO, **more):
    """A run-down whose windows state `std` and hold that noise, or `noise`."""
    times = STEP_S * (0.5 + np.arange(ROWS))
    rng = np.random.default_rng(seed)
    made = as_wave(
        envelope(mechanics, 0.3, 0.0, times), times, std if noise is None else noise, mechanics, rng
    )
    fill = np.full(ROWS, std)
    stated = {f"{name}_std": fill for name in COLUMNS}
    return made.replace(signal_std=fill, **stated, **more)


def held(values, first, last):
    out = np.array(values)
    out[first:last] = out[first]
    return out


@pytest.mark.parametrize("name", COLUMNS)
@pytest.mark.parametrize("rows", ((0, ROWS), (120, ROWS), (50, 55)))
def test_a_column_that_repeats_its_value_is_named_with_its_rows(name, rows):
    sound = wave()
    stuck = sound.replace(**{name: held(getattr(sound, name), *rows)})
    found = find_frozen([wave(1), stuck])
    assert found[0] == []
    (one,) = found[1]
    assert one.what == COLUMNS[name] and one.rows == rows[1] - rows[0]
    assert one.first_s == pytest.approx(sound.time_s[rows[0]])
    assert one.value == getattr(sound, name)[rows[0]]


@pytest.mark.parametrize("block", (7, 50))
def test_a_long_run_is_looked_at_piece_by_piece(block, monkeypatch):
    """Pieces and a thinned sample find what the whole does, across their edges too."""
    sound = wave()
    flags = np.array(sound.flags)
    flags[[3, 48, 90]] = 1
    cases = [sound.replace(flags=flags)]
    for name in COLUMNS:
        stuck = {name: held(getattr(sound, name), 50, 120)}
        cases.append(sound.replace(flags=flags, **stuck))
    silent = wave().replace(quadrature_amplitude=np.zeros(ROWS), wave_angle_rad=np.zeros(ROWS))
    cases += [silent.replace(flags=flags)]
    whole = find_frozen(cases)
    monkeypatch.setattr("hrg_cli.fitting.envelopes.frozen.BLOCK", block)
    assert find_frozen(cases) == whole and len(whole[1]) == 1
    monkeypatch.setattr("hrg_cli.fitting.envelopes.frozen.SAMPLE", 50)
    thinned = [[(one.what, one.rows, one.value) for one in found] for found in find_frozen(cases)]
    assert thinned == [[(one.what, one.rows, one.value) for one in found] for found in whole]


def test_an_angle_that_turns_evenly_is_no_lattice():
    sound = wave()
    turning = sound.wave_angle_rad + 40 * STD * np.arange(ROWS)
    (one,) = find_frozen([sound.replace(wave_angle_rad=held(turning, 120, ROWS))])[0]
    assert one.what == "wave angle" and one.rows == 120


@pytest.mark.parametrize("channel", (0, 1))
@pytest.mark.parametrize("level", (0.0, 0.2 + 0.1j))
def test_a_channel_that_stands_still_is_named_before_the_columns_made_of_it(channel, level):
    times = STEP_S * (0.5 + np.arange(ROWS))
    rng = np.random.default_rng(3)
    u = envelope(GYRO, 0.3, 0.0, times) + STD * (
        rng.standard_normal((ROWS, 2)) + 1j * rng.standard_normal((ROWS, 2))
    )
    u[100:, channel] = level
    a_A, a_B, angle, phase = ellipse.find_wave(u)
    angle, phase = ellipse.unwrap(angle, phase)
    dead = wave().replace(
        main_amplitude=a_A, quadrature_amplitude=a_B, wave_angle_rad=angle, phase_rad=phase
    )
    (one,) = find_frozen([dead])[0]
    assert one.what == f"channel {'CS'[channel]}" and one.rows == ROWS - 100
    assert one.value == pytest.approx(abs(level), abs=1e-12)


@pytest.mark.parametrize(("room", "named"), ((0.5, True), (2.0, False)))
def test_a_stretch_is_named_by_its_chance_among_all_rows(room, named):
    """N·pⁿ = 1e-9 decides; p of values on a lattice, or of stretches that begin elsewhere."""
    pairs, count = 9, 1000
    p = (room * CHANCE / count) ** (1 / pairs)
    lattice = Stretches(count, pairs, 1, (10, 10 + pairs))
    assert (_improbable(lattice, 2 * np.sqrt(np.pi) * p) is not None) == named
    others = round(p * (count - pairs))
    begun = Stretches(count, pairs, 1 + others, (10, 10 + pairs))
    assert (_improbable(begun, 0.0) is not None) == named
    assert _improbable(Stretches(count, pairs, 1, (10, 10 + pairs)), 0.0) == (10, 10 + pairs)


def test_sound_waves_are_none_of_that():
    for seed in range(40):
        assert find_frozen([wave(seed)]) == [[]]


def test_coarse_values_and_values_held_by_a_logger_are_none_of_that():
    sound = wave()
    for step in (0.1 * STD, STD, 10 * STD, 100 * STD):
        coarse = {name: np.round(getattr(sound, name) / step) * step for name in COLUMNS}
        assert find_frozen([sound.replace(**coarse)]) == [[]]
    single = {name: getattr(sound, name).astype("f4").astype(float) for name in COLUMNS}
    assert find_frozen([sound.replace(**single)]) == [[]]
    for every in (2, 5):
        logged = {name: np.repeat(getattr(sound, name)[::every], every) for name in COLUMNS}
        assert find_frozen([sound.replace(**logged)]) == [[]]


def test_a_simulation_without_noise_and_a_channel_nobody_recorded_are_none_of_that():
    ideal = replace(GYRO, damping_split_1_s=0.0, frequency_split_rad_s=0.0)
    quiet = wave(noise=0.0, mechanics=ideal)
    angle = np.full(ROWS, 0.3)
    assert find_frozen([quiet.replace(wave_angle_rad=angle, phase_rad=0 * angle)]) == [[]]
    alone = wave().replace(quadrature_amplitude=np.zeros(ROWS), wave_angle_rad=np.zeros(ROWS))
    assert find_frozen([alone, alone]) == [[], []]
    assert [f.what for f in find_frozen([wave(), alone])[1]] == ["channel S"]
