"""identify where runs contradict each other, drift or differ, and over the beats of a split; rate
as a stage."""

import json

import numpy as np
import pytest
from diagnosis_programme import programme as free_runs
from diagnosis_programme import waves
from synthetic_waves import GYRO, NAMES, PROGRAMME, errors, programme, run_down

from hrg_cli import store
from hrg_cli.errors import HrgError
from hrg_cli.fitting.causes.evidence import find_significance
from hrg_cli.fitting.envelopes import inference
from hrg_cli.fitting.envelopes.envelope_runs import EnvelopeRun
from hrg_cli.fitting.envelopes.likelihood import fit, free_coordinates
from hrg_cli.fitting.envelopes.response import make_batch
from hrg_cli.physics.resonator import Mechanics
from hrg_cli.records import Resonator, collect
from hrg_cli.stages.demodulate import demodulate
from hrg_cli.stages.estimate import estimate
from hrg_cli.stages.identification.verdict import DISAGREES
from hrg_cli.stages.identify import identify
from hrg_cli.stages.rate import rate, summarise
from hrg_cli.stages.simulate import simulate


def details(record):
    return json.loads(record.details)


def test_a_wrong_rate_log_is_refused_and_its_run_named():
    waves = programme(std=1e-4, seed=3)
    waves[4] = waves[4].replace(rate_rad_s=np.full(len(waves[4]), 1.4), run_id="the wrong log")
    record = identify(waves)
    assert record.status == "refused" and any(
        "the wrong log" in s and "contradict" in s for s in record.status_reasons
    )
    without = identify([w for w in waves if w.run_id != "the wrong log"])
    assert without.status == "valid"


def test_two_or_three_runs_say_that_they_contradict_but_not_always_which_is_wrong():
    wrong = {"rate_rad_s": np.full(2000, 1.4), "run_id": "the wrong log"}
    rotated = [(0.1, 2.0), (0.5, -2.0), (0.9, 2.0), (0.3, 0.0)]
    waves = programme(std=1e-4, seed=3, runs=rotated)
    two = identify([waves[0].replace(**wrong), waves[1]])
    assert two.status == "refused" and any(
        "two runs contradict" in s and "third" in s for s in two.status_reasons
    )
    three = identify([waves[0].replace(**wrong), *waves[1:3]])
    assert three.status == "refused" and any(
        "contradict" in s and "the wrong log" in s for s in three.status_reasons
    )
    assert identify(waves[:2]).status == identify(waves[:3]).status == "valid"


def test_errors_hold_the_runs_disagreement():
    """Every run of a slightly different gyro: the model is wrong everywhere, the runs' scatter is
    the error."""
    rng = np.random.default_rng(5)
    squares = []
    for seed in range(10):
        waves = []
        for i, (angle, turning) in enumerate(PROGRAMME):
            other = Mechanics(
                4987.3, 0.31 * (1 + 0.01 * rng.standard_normal()), 0.012, 0.35, 0.11, 0.9, 0.55
            )
            waves.append(
                run_down(
                    angle, turning, mechanics=other, std=1e-4, window=2e-2, seed=100 * seed + i
                )
            )
        record = identify(waves)
        assert record.status != "valid"
        squares.append(errors(record)["damping_rate_1_s"] ** 2)
    assert np.mean(squares) < 3.5  # with the fit's own errors it is beyond 100


def test_a_drifting_frequency_says_what_its_number_means():
    ramp_hz = 0.02
    waves = []
    for wave in programme(std=1e-4, seed=1):
        x = wave.time_s / 4.0
        waves.append(wave.replace(phase_rad=wave.phase_rad + 2 * np.pi * ramp_hz * 4.0 * x**2 / 2))
    record = identify(waves)
    value, std, _ = record.parameters()["frequency_hz"]
    assert abs(value - (GYRO.frequency_hz + ramp_hz / 2)) < 1e-4
    assert std == pytest.approx(ramp_hz / np.sqrt(12), rel=0.05)
    assert "moves by" in details(record)["frequency_note"]
    assert all(abs(e) < 4.5 for n, e in errors(record).items() if n != "frequency_hz")


@pytest.mark.parametrize("beats", [0.1, 1.0, 10.0, 30.0])
def test_beats(beats):
    """Δf·T over its range, T = 4 s: δω = π·beats/T."""
    gyro = Mechanics(5000.0, 0.2, 0.01, 0.35, np.pi * beats / 4.0, 0.9, 0.55)
    record = identify(programme(gyro, std=1e-3, window=1e-2, seed=11))
    assert record.status == "valid" and set(record.parameters()) == set(NAMES)
    assert all(abs(e) < 4.5 for e in errors(record, gyro).values()), errors(record, gyro)


def test_rate_stage_sees_the_rate_without_the_drift():
    gyro = Mechanics(4987.3, 0.31, 0.05, 0.35, 0.3, 0.9, 0.55)
    resonator = identify(programme(gyro, std=1e-5))
    wave = run_down(
        0.3, lambda t: 0.3 * np.sin(2 * np.pi * t / 3) + 0.2, mechanics=gyro, std=1e-4, seed=11
    )
    record = rate(wave, resonator, nodes=16)
    figures = summarise(record)
    assert record.status == "valid" and len(record.time_s) == 16
    assert figures["error_rms_rad_s"] < 0.2 * figures["plain_error_rms_rad_s"]
    assert np.mean(
        (record.residual_after_rad_s / record.rate_estimate_rad_s_std) ** 2
    ) < 1 + 5 * np.sqrt(2 / 16)
    unlogged = rate(wave.replace(rate_rad_s=None), resonator)
    assert unlogged.residual_after_rad_s is None and len(unlogged.time_s) == 20
    with pytest.raises(HrgError, match="no force acts"):
        rate(wave, resonator, main_phase_error_rad=0.1)
    other = identify(programme(Mechanics(4987.3, 0.31, 0.2, 0.6, 0.3, 0.2, 0.55), std=1e-5))
    assert rate(wave, other, nodes=8).status in ("suspect", "refused")


@pytest.mark.parametrize(("split", "ratio"), [(0.3, 0.95), (2.0, 1.0), (6.0, 0.5)])
def test_rate_through_circular_orbits(split, ratio):
    """A wave that starts round, or that the frequency split rounds on its way: −mθ'/K is useless,
    the reference model is not."""
    gyro = Mechanics(4987.3, 0.31, 0.05, 0.35, split, 0.9, 0.55)
    resonator = identify(programme(gyro, std=1e-5, window=4e-3))
    course = lambda t: 0.3 * np.sin(2 * np.pi * t / 3) + 0.2  # noqa: E731
    record = rate(run_down(0.3, course, mechanics=gyro, std=1e-4, seed=11, ratio=ratio), resonator)
    error = record.rate_estimate_rad_s - course(record.time_s)
    assert record.status == "valid" and np.sqrt(np.mean(error**2)) < 0.003
    assert np.mean((error / record.rate_estimate_rad_s_std) ** 2) < 4
    assert summarise(record)["plain_error_rms_rad_s"] > 0.1


def test_a_quick_rate_takes_more_nodes_or_says_they_are_too_few():
    gyro = Mechanics(4987.3, 0.31, 0.05, 0.35, 0.3, 0.9, 0.55)
    resonator = identify(programme(gyro, std=1e-5, window=4e-3))
    course = lambda t: 3 * np.sin(2 * np.pi * t / 1.5) + 1  # noqa: E731
    wave = run_down(0.3, course, mechanics=gyro, std=1e-4, seed=11)
    few = rate(wave, resonator, nodes=10)
    assert few.status != "valid" and any("nodes follow" in s for s in few.status_reasons)
    record = rate(wave, resonator)
    error = record.rate_estimate_rad_s - course(record.time_s)
    assert record.status == "valid" and len(record.time_s) > 20
    assert np.mean((error / record.rate_estimate_rad_s_std) ** 2) < 2.5


def test_frequency_split_under_a_ring_electrode_through_raw_samples():
    """The pump damps the quadrature about twice as fast as the wave; the split comes out without
    bias all the same."""
    device = {
        "frequency_hz": 1500.0,
        "time_constant_s": 2.5,
        "damping_split": 0.02,
        "damping_axis_rad": 0.2,
        "frequency_split_hz": 0.01,
        "stiffness_axis_rad": 1.1,
    }
    config = {
        "device": device,
        "readout": {"noise": 2e-4},
        "control": {"mode": "forced", "drive": "parametric", "quadrature_loop": "off"},
        "recording": {"sample_rate_hz": 10_000.0, "duration_s": 20.0},
        "environment": {"rate_rad_s": 0.6},
    }
    wave = collect(
        estimate(collect(demodulate(collect(simulate(config, seed=3)), periods_per_window=10.0)))
    )
    record = identify([wave], method="working-mode")
    value, std, _ = record.parameters()["frequency_split_rad_s"]
    assert abs(value - np.pi * 0.01) < 4 * std and std < 0.02 * value
    axis, axis_std, _ = record.parameters()["stiffness_axis_rad"]
    assert abs(axis - 1.1) < 4 * axis_std
    assert 1.7 < details(record)["quadrature_damping_1_s"]["value"] / 0.4 < 2.3


def test_a_drive_that_was_off_in_between_leaves_one_row_a_record(tmp_path):
    """Its driven stretches are the record's own: the file that is written can be read again."""
    config = {
        "device": {"frequency_hz": 1000.0, "time_constant_s": 2.5, "frequency_split_hz": 0.01},
        "readout": {"noise": 2e-4},
        "control": {"mode": "forced", "drive": "parametric", "off_s": [[2.0, 2.5]]},
        "recording": {"sample_rate_hz": 8000.0, "duration_s": 6.0},
        "environment": {"rate_rad_s": 2.0},
    }
    wave = collect(estimate(collect(demodulate(collect(simulate(config, seed=3))))))
    store.write(tmp_path / "working.h5", identify([wave], method="working-mode"))
    found = store.read(tmp_path / "working.h5", Resonator)
    assert len(found.run) == len(found.run_rows) == 1 and found.run_rows[0] > 1000


def test_a_run_begins_and_ends_without_error_where_the_envelope_moves():
    """A wave that turns 0.1 rad a window at high precision: the first and last windows err no more
    than they say; 0.8 rad is suspect."""
    config = {
        "device": {
            "frequency_hz": 500.0,
            "time_constant_s": 5.0,
            "frequency_split_hz": 0.8,
            "stiffness_axis_rad": 0.3,
        },
        "readout": {"noise": 1e-5},
        "recording": {"sample_rate_hz": 20_000.0, "duration_s": 4.0},
    }
    recording = collect(simulate(config, seed=1))
    short = collect(demodulate(recording, periods_per_window=1.0))
    long = collect(demodulate(recording, periods_per_window=10.0))
    assert short.status == "valid", short.status_reasons
    assert long.status == "valid", long.status_reasons
    for i in (0, 1, -2, -1):  # ten short windows in a row, carried to their middle by a parabola
        near = np.argsort(np.abs(short.time_s - long.time_s[i]))[:8]
        x = short.time_s[near] - long.time_s[i]
        fits = [np.polyfit(x, short.signals[near, k], 2)[-1] for k in range(4)]
        assert np.all(
            np.abs(long.signals[i] - fits)
            < 6 * np.hypot(long.signals_std[i], short.signals_std[near].mean(0) / 2)
        ), i
    slow = collect(demodulate(recording, periods_per_window=80.0))
    assert slow.status == "suspect" and any(
        "use periods_per_window" in s for s in slow.status_reasons
    )


def test_where_half_of_the_runs_disagree_none_is_blamed_and_none_is_cleared():
    """A gain mismatch in four runs: each of two "disagrees with the rest; leave it out". A rate log
    off by a thousandth in one of them looks the same."""
    mismatched = waves(free_runs(2, {"gain_mismatch": {"gain": 3e-3}}, runs=4, duration_s=1.0))
    one_log = waves(free_runs(2, runs=4, duration_s=1.0))
    one_log[2] = one_log[2].replace(rate_rad_s=1.001 * np.asarray(one_log[2].rate_rad_s))
    for measured, odd in ((mismatched, "run1, run2"), (one_log, "run2, run3")):
        record = identify(measured)
        (told,) = (s for s in record.status_reasons if "disagree" in s)
        assert record.status == "suspect" and told.startswith(f"{odd} each disagree")
        assert "which of them is wrong, or whether the model is, these runs do not tell" in told


def test_one_number_that_a_run_tells_is_no_easier_to_disagree_with_than_six():
    """χ² a direction of one direction exceeds 6 in one run of seventy: clean runs were suspect."""
    rng, t, space = (
        np.random.default_rng(8),
        np.linspace(0.0, 10.0, 41),
        free_coordinates(["damping"], np.zeros(7)),
    )
    moved = []
    for _ in range(200):
        runs = []
        for _ in range(3):
            noise = rng.standard_normal((2, 41, 2)) * 0.01
            u = np.outer(np.exp(-0.1 * t), [1, 0j]) + noise[0] + 1j * noise[1]
            runs.append(EnvelopeRun("", t, u, 0 * t + 0.01, 0 * t, None, 5e3, 2, 0.1))
        start = np.array([[1, 0j]] * 3)
        best = fit(make_batch(runs), space, np.array([0.1]), start, np.zeros((3, 1)))
        moved.append(inference.measure_run_shifts(best, 1.0)[0])
    sigma = [find_significance(one, 1)[0] for one in np.ravel(moved)]
    assert np.mean(np.max(moved, axis=1) > 6) > 0.01, "the average alone was no test"
    assert max(sigma) < DISAGREES
    assert np.mean(np.square(sigma)) == pytest.approx(1.0, abs=0.2)
